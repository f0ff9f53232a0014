#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "fusion/base/box.hpp"
#include "fusion/mesh/disjoint_sets.hpp"
#include "server/map/position_shapes.hpp"
#include "server/map/position_step.hpp"

namespace spectra::map {

using namespace steps;

namespace {

/// The change of a side that is left to every form.
constexpr double kMostChange = 0.1;
/// A tile reaches beyond its cell with triangles of it.
constexpr double kStepsOfCell = kStepsOfTile / 2;
/// Points that fall together are told apart in pieces of so many.
constexpr std::size_t kMostCompared = 256;
constexpr int kCoarserHalvings = 12;

}  // namespace

int halvings_of_tile(const Tile& tile, double step_m) {
  base::Bounds box = base::empty_bounds();
  for (const base::Triangle& triangle : tile.triangles) {
    for (const std::uint32_t v : triangle) base::include(box, tile.positions[v]);
  }
  if (tile.triangles.empty()) {
    for (const base::Vec3f& p : tile.positions) base::include(box, p);
  }
  const double reach = longest_side(box);
  constexpr int kAnyHalvings = 2 * kMostHalvings;
  if (!(reach > 0)) return kAnyHalvings;
  // What is rounded to the usual step in it may come to lie half of one beyond it, at either end.
  return static_cast<int>(
      std::clamp(std::floor(std::log2(step_m * (kStepsOfTile - 2) / (reach + step_m))), -100.0, double{kAnyHalvings}));
}

/// Looks at forms, one after the other.
class PositionSteps::Losses {
 public:
  /// `halvings`: of each point those that the leaves leave it.
  Losses(const PositionSteps& steps, std::vector<std::array<int, 3>> halvings)
      : steps_(steps), halvings_(std::move(halvings)) {}

  bool is_less(std::uint32_t point) const {
    const StepHalvings& asked = steps_.halvings_[point];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (halvings_[point][axis] < int{asked[axis]}) return true;
      if (steps_.is_limited_ && asked[axis] == steps_.most_halvings_) return true;
    }
    return false;
  }

  /// `points` are in different places.
  void look_at(std::span<const std::uint32_t> points, double thin) {
    if (std::none_of(points.begin(), points.end(), [&](std::uint32_t p) { return is_less(p); })) return;
    base::Bounds box = base::empty_bounds();
    std::array<double, 3> low{}, high{};
    low.fill(std::numeric_limits<double>::infinity());
    high.fill(-std::numeric_limits<double>::infinity());
    std::set<std::array<double, 3>> distinct;
    for (const std::uint32_t point : points) {
      const base::Vec3f& position = steps_.points_[point].position;
      base::include(box, position);
      std::array<double, 3> rounded{};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double step = std::ldexp(double{steps_.largest_step_m_}, -halvings_[point][axis]);
        rounded[axis] = std::floor(double{coordinates(position)[axis]} / step + 0.5) * step;
        low[axis] = std::min(low[axis], rounded[axis]);
        high[axis] = std::max(high[axis], rounded[axis]);
      }
      if (points.size() <= kMostCompared) distinct.insert(rounded);
    }
    const Shape shape(box);
    double step_m = std::numeric_limits<double>::infinity();
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double side = shape.side[axis];
      if (!shape.has_thickness(axis, thin) || std::abs(high[axis] - low[axis] - side) <= kMostChange * side) continue;
      step_m = std::min(step_m, kMostChange * side);
    }
    if (points.size() <= kMostCompared && (points.size() - distinct.size()) * kVerticesToMerged > points.size()) {
      std::vector<base::Vec3f> positions;
      for (const std::uint32_t point : points) positions.push_back(steps_.points_[point].position);
      const double coarse_m = std::ldexp(double{steps_.largest_step_m_}, kCoarserHalvings);
      const int halvings = halvings_apart(positions, positions.size() / kVerticesToMerged, coarse_m);
      step_m = std::min(step_m, std::ldexp(coarse_m, -halvings));
    }
    if (!std::isfinite(step_m)) return;
    if (!lost_) lost_ = LostForm{std::numeric_limits<double>::infinity(), base::empty_bounds()};
    lost_->largest_tile_m = std::min(lost_->largest_tile_m, step_m * kStepsOfCell);
    base::include(lost_->bounds, box.min);
    base::include(lost_->bounds, box.max);
  }

  const std::optional<LostForm>& lost() const { return lost_; }

 private:
  const PositionSteps& steps_;
  std::vector<std::array<int, 3>> halvings_;
  std::optional<LostForm> lost_;
};

std::optional<LostForm> PositionSteps::lost_form(std::span<const std::shared_ptr<Tile>> leaves) const {
  if (points_.empty()) return std::nullopt;
  std::vector<int> of_leaf;
  for (const auto& leaf : leaves) of_leaf.push_back(halvings_of_tile(*leaf, double{largest_step_m_}));
  int most = 0;
  for (const StepHalvings& halvings : halvings_)
    most = std::max({most, int{halvings[0]}, int{halvings[1]}, int{halvings[2]}});
  if (!is_limited_ && *std::min_element(of_leaf.begin(), of_leaf.end()) >= most) return std::nullopt;

  // A triangle that reaches far coarsens its own tile; what its corners stand on may be right in another.
  std::vector<int> left(points_.size(), std::numeric_limits<int>::min());
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> sources;  // And the point that is there.
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    const Tile& leaf = *leaves[i];
    std::vector<std::uint32_t> point_of(leaf.positions.size());
    std::vector<bool> is_drawn(leaf.positions.size(), leaf.triangles.empty());
    for (const base::Triangle& triangle : leaf.triangles) {
      for (const std::uint32_t v : triangle) is_drawn[v] = true;
    }
    for (std::size_t v = 0; v < point_of.size(); ++v) {
      if (!is_drawn[v] || !is_finite(leaf.positions[v])) continue;
      point_of[v] = point_at(leaf.positions[v]);
      left[point_of[v]] = std::max(left[point_of[v]], of_leaf[i]);
      sources.emplace_back(leaf.source_vertex[v], point_of[v]);
    }
    for (const base::Triangle& t : leaf.triangles) {
      triangles.push_back({leaf.source_vertex[t[0]], leaf.source_vertex[t[1]], leaf.source_vertex[t[2]]});
    }
  }
  std::vector<std::array<int, 3>> halvings(points_.size());
  for (std::size_t p = 0; p < points_.size(); ++p) {
    for (std::size_t axis = 0; axis < 3; ++axis) halvings[p][axis] = std::min(int{halvings_[p][axis]}, left[p]);
  }
  Losses losses(*this, std::move(halvings));
  std::vector<std::uint32_t> form;
  for (const Cell& cell : cells_) {
    form.clear();
    for (std::uint32_t p = cell.begin; p < cell.end; ++p) form.push_back(p);
    losses.look_at(form, kThin);
  }
  if (triangles.empty()) return losses.lost();

  std::sort(sources.begin(), sources.end());
  sources.erase(std::unique(sources.begin(), sources.end()), sources.end());
  mesh::DisjointSets pieces(sources.back().first + 1);
  for (const auto& t : triangles) {
    pieces.unite(t[0], t[1]);
    pieces.unite(t[0], t[2]);
  }
  const auto look_at_pieces = [&] {
    std::map<std::uint32_t, std::vector<std::uint32_t>> of_piece;
    for (const auto& [source, point] : sources) of_piece[pieces.root(source)].push_back(point);
    for (auto& [root, points] : of_piece) {
      std::sort(points.begin(), points.end());
      points.erase(std::unique(points.begin(), points.end()), points.end());
      losses.look_at(points, kThinPiece);
    }
  };
  // What shares vertices, and what is in one place.
  look_at_pieces();
  std::vector<std::uint32_t> first_at(points_.size(), std::numeric_limits<std::uint32_t>::max());
  for (const auto& [source, point] : sources) {
    if (first_at[point] == std::numeric_limits<std::uint32_t>::max()) first_at[point] = source;
    pieces.unite(first_at[point], source);
  }
  look_at_pieces();
  return losses.lost();
}

}  // namespace spectra::map
