#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "server/jobs/worker_pool.hpp"
#include "server/map/scene_snapshot.hpp"

namespace spectra::map {

/// A tile has fewer steps than that from end to end: floats tell twice as many apart, and Draco adds half a step before it rounds.
inline constexpr double kStepsOfTile = 0x1p23;

/// How often a step may be halved until it is the finest that a tile can have, which reaches so far; negative: so often it is doubled.
int halvings_of_tile(const Tile& tile, double step_m);

/// What tiles reach too far for.
struct LostForm {
  double largest_tile_m = 0;  ///< Tiles that reach no farther would have the steps that it asks for.
  base::Bounds bounds;        ///< Of all of it.
};

/// How finely the positions of a scene are rounded where: a power of two in metres for every place and axis, so that all
/// lattices are parts of one. A position alone decides its step: whatever tiles and levels hold a vertex, it is rounded to
/// the same point.
///
/// The step is about a quarter of the scene's median edge, and is halved where what is there would lose its form:
/// - four fifths of a few dozen neighbouring vertices stay apart,
/// - what they span along an axis is at least four steps (what is thinner than eight times what floats tell apart there counts as flat; and
///   of what is thinner than a 4,096th of its breadth, what floats on any axis do not tell apart, or is thinner than a millionth),
/// - four fifths of every connected piece of up to 256 vertices stay apart (larger ones by their neighbourhoods), and each side of its box is at least ten steps (the same, from a 32,768th on); pieces are connected by vertices in the same place, and what is connected by shared vertices alone
///   is one too, unless it is a triangle.
/// Neighbours get the finer of their steps. Where a ball of neighbours would still have a side off by more than a tenth, the few
/// vertices that its box stands on are rounded finer by themselves. A scene of few vertices is rounded finer everywhere, for bytes that do not count.
/// Vertices of no triangle in a scene with triangles are not drawn and have no say.
class PositionSteps {
 public:
  /// Of the full mesh; the same for any number of threads. `largest_step_m`: that of the map it becomes part of, a power of two.
  /// `largest_tile_m`: as far as leaves reach at most, where that is less than all of them together. Must not be called from a job of the pool. `found_share` is told from
  /// any thread what share is found.
  PositionSteps(std::span<const std::shared_ptr<Tile>> leaves, jobs::WorkerPool& pool,
                std::optional<float> largest_step_m = std::nullopt,
                double largest_tile_m = std::numeric_limits<double>::infinity(),
                const std::function<void(double)>& found_share = {});

  /// The coarsest step that any vertex may have; a power of two.
  float largest_step_m() const { return largest_step_m_; }

  /// What loses its form in these leaves, because some reach so far that they cannot have the steps that it asks for.
  std::optional<LostForm> lost_form(std::span<const std::shared_ptr<Tile>> leaves) const;

  /// Fills in the step_halvings of a tile whose vertices are vertices of the scene. Thread-safe for different tiles.
  void apply(Tile& tile) const;

 private:
  /// A few neighbouring vertices.
  struct Cell {
    base::Bounds bounds;
    std::uint32_t begin = 0, end = 0;  ///< In points_.
    StepHalvings own{}, halvings{};    ///< Needed here; here and in the neighbourhood. Of all its vertices.
    bool is_dense = false;             ///< Its vertices would fall together at the usual step.
    bool is_changed = false;           ///< Some of its vertices are rounded otherwise since the last round.
    bool is_crowded = false;           ///< Many of its vertices fall together at its own steps.
  };
  struct Point {
    base::Vec3f position;
    std::uint32_t source = 0;
  };
  /// Halves what is left of it: below `split` on `axis` is `below`, the rest `below + 1`; without an axis it is a cell.
  struct Node {
    std::uint8_t axis = kNoAxis;
    float split = 0;
    std::uint32_t below = 0;
  };
  struct Branch;
  class Losses;
  struct Neighbourhood;
  /// One look at all balls, at the halvings of the round before.
  struct SidesRound {
    bool is_first = true;
    std::vector<std::uint8_t> is_changed;  ///< Per point: its halvings are not those of the round before that.
    std::vector<float> radius;         ///< Per point: of the smallest ball around it (squared); since the first round.
    std::vector<StepHalvings> wanted;  ///< Per point: of the next round.
  };
  static constexpr std::uint8_t kNoAxis = 3;

  void gather(std::span<const std::shared_ptr<Tile>> leaves);
  void cut(jobs::WorkerPool& pool);
  void ask_cells(jobs::WorkerPool& pool);
  void ask_pieces(std::span<const std::shared_ptr<Tile>> leaves);
  /// Which piece a vertex is of, and which of points_ is in its place.
  struct Member {
    std::uint32_t piece = 0, point = 0;
  };
  /// Of pieces of that many places or more. `cell_of` has the cell of each of points_.
  void ask_pieces_of(std::span<const Member> members, std::size_t fewest, std::uint32_t piece_count,
                     std::span<const std::uint32_t> cell_of);
  void ask_neighbours(jobs::WorkerPool& pool);
  /// Per axis: the vertices of each exact plane across it that some cell lies in.
  using Planes = std::array<std::vector<std::vector<std::uint32_t>>, 3>;
  Planes find_planes() const;
  /// So that each plane is rounded to one: where a finer step begins, half a step would stand out of it.
  void keep_flat(const Planes& planes, std::vector<StepHalvings>& halvings) const;
  /// Of single vertices of small pieces, so that four fifths stay apart: what is apart at one step may fall together at a finer one, whose
  /// points lie between those of the coarser. Looks at those with vertices that are to be rounded otherwise, or at all.
  void keep_pieces_apart(std::vector<StepHalvings>& wanted, bool are_all_new) const;
  std::array<double, 3> rounded_at(std::uint32_t point, const StepHalvings& halvings) const;
  /// Of single vertices, so that balls of neighbours keep the sides of their boxes.
  void keep_sides(jobs::WorkerPool& pool, const std::function<void(double)>& found_share);
  void gather_around(const base::Bounds& box, double reach, Neighbourhood& around, const SidesRound& round);
  /// Those around one vertex; finds the radius of its smallest ball in the first round. Returns the largest ball's to that (both squared).
  float gather_alone(std::uint32_t seed, double first_reach, Neighbourhood& around, SidesRound& round);
  void keep_sides_in(const Cell& cell, Neighbourhood& around, SidesRound& round);
  /// Of larger balls than that around one vertex of each cell, from a radius (squared) on.
  void keep_large_balls_at(std::uint32_t seed, float radius, Neighbourhood& around, SidesRound& round);
  /// Of all balls from one of radius `smallest` to one of `largest` times that (squared) around where `near_distance` is measured from.
  void keep_balls_of(Neighbourhood& around, std::size_t near_count, float smallest, float largest,
                     std::vector<StepHalvings>& wanted);
  /// At most a fifth of the vertices of each ball fall together with others.
  void keep_apart(Neighbourhood& around, std::size_t near_count, std::vector<StepHalvings>& wanted);
  void keep_sides_of(const Neighbourhood& around, std::span<const std::uint32_t> ball,
                     std::vector<StepHalvings>& wanted);
  /// So that the ball ends at `least` to `most` beyond where it does.
  void keep_end(const Neighbourhood& around, std::span<const std::uint32_t> ball, std::size_t axis, float end,
                int direction, float least, float most, std::vector<StepHalvings>& wanted);
  /// No step is finer than a tile of half the scene can have: neighbours would differ on their border.
  void limit_to_one_tile(double largest_tile_m);
  /// Which of points_ is in a place.
  std::uint32_t point_at(const base::Vec3f& position) const;
  /// Calls `visit(cell)` for the cells that reach into a box.
  template <class Visit>
  void for_each_cell(const std::array<double, 3>& low, const std::array<double, 3>& high, Visit visit);
  /// Those that balls around the vertices of a box may reach.
  template <class Visit>
  void for_each_cell_around(const base::Bounds& box, double reach, Visit visit);
  /// Whether many of its vertices fall together.
  bool is_crowded(const Cell& cell);

  float largest_step_m_ = 0;
  std::uint8_t most_halvings_ = 0;  ///< That any vertex may have.
  bool is_limited_ = false;         ///< Some would be rounded finer by more.
  std::vector<Point> points_;
  std::vector<Node> nodes_;
  std::vector<Cell> cells_;
  std::vector<StepHalvings> halvings_;                               ///< Of each of points_.
  std::vector<std::vector<std::uint32_t>> small_pieces_;             ///< Of each the numbers of its points.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> coincident_;  ///< Vertices in the same place.
};

}  // namespace spectra::map
