#include "server/map/position_step.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <tuple>
#include <utility>

#include "fusion/base/box.hpp"
#include "fusion/mesh/surface.hpp"

namespace spectra::map {
namespace {

using base::Vec3f;

/// Half as many to so many vertices are a cell: no more than the smallest patch that is to keep its form.
constexpr std::uint32_t kCellVertexCount = 44;

/// Parts of the tree that are made independently of each other.
constexpr std::uint32_t kBranchVertexCount = 1 << 16;

/// Where coincident vertices are sought: everything in the same place is together by then.
constexpr std::uint32_t kWeldVertexCount = 512;

/// Of what a side of a box measures. Each of its two ends is off by half a step at most, so that a tenth is on the safe side:
/// for pieces, and for what is so dense that the usual step halved would not keep it apart. Of other cells, which a patch is larger
/// than, a little more: what half the vertices of a scan pay for.
constexpr double kStepOfPieceSide = 0.1;
constexpr double kStepOfCellSide = 0.4;

/// One in so many vertices of a cell may fall together with another.
constexpr std::size_t kVerticesToMerged = 5;

/// Where one in so many of a cell does, balls that reach beyond it are looked at.
constexpr std::size_t kVerticesToCrowd = 16;

/// How far the needs of a cell reach beyond it, in parts of its longest side. Those of what is much closer together than the usual
/// step reach to the next vertices; others to what the cell touches, and with one halving less to the next vertices.
constexpr double kReach = 0.2;
constexpr double kTouch = 0.05;

/// Balls around every vertex are looked at: of so many vertices, and in so many steps up to those of so much the
/// radius (squared; as many times the vertices, on a surface). What they may reach beyond the cell, in parts of its longest side; and the
/// change of a side that is left to them.
constexpr std::size_t kFewestOfBall = 50;
constexpr std::size_t kRings = 14;
constexpr float kLargestBall = 2.2F;
constexpr double kBallReach = 1;
constexpr double kSpareReach = 1.25;
constexpr double kMostSideChange = 0.0985;
constexpr int kMostRounds = 8;

/// What is thinner beside its breadth is flat.
constexpr double kFlat = 0x1p-12;

/// Pieces of more vertices are as many cells.
constexpr std::uint32_t kSmallPieceVertexCount = 64;

/// More than a tile has steps from end to end.
constexpr std::uint8_t kMostHalvings = 24;

/// A scene may be rounded finer everywhere for so many bits; by no more than a thousandth of the step.
constexpr std::size_t kNegligibleBits = 8 * 4096;
constexpr int kMostSpareHalvings = 10;

std::array<float, 3> coordinates(const base::Vec3f& v) {
  return {v.x, v.y, v.z};
}

bool is_finite(const base::Vec3f& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

/// Up to `kSampleCount` lengths of what neighbours in a leaf: edges, or in a point cloud nearest vertices.
std::vector<double> neighbour_distances(const Tile& leaf) {
  constexpr std::size_t kSampleCount = 256;
  constexpr std::size_t kPointSampleCount = 16;
  std::vector<double> distances;
  const auto keep = [&](double squared) {
    if (squared > 0 && std::isfinite(squared)) distances.push_back(std::sqrt(squared));
  };
  if (!leaf.triangles.empty()) {
    const std::size_t stride = leaf.triangles.size() / kSampleCount + 1;
    for (std::size_t t = 0; t < leaf.triangles.size(); t += stride) {
      const base::Triangle& triangle = leaf.triangles[t];
      for (unsigned corner = 0; corner < 3; ++corner) {
        keep(mesh::squared_distance(leaf.positions[triangle[corner]], leaf.positions[triangle[(corner + 1) % 3]]));
      }
    }
    return distances;
  }
  const std::size_t stride = leaf.positions.size() / kPointSampleCount + 1;
  for (std::size_t v = 0; v < leaf.positions.size(); v += stride) {
    double nearest = 0;
    for (const base::Vec3f& other : leaf.positions) {
      const double squared = mesh::squared_distance(leaf.positions[v], other);
      if (squared > 0 && (nearest == 0 || squared < nearest)) nearest = squared;
    }
    keep(nearest);
  }
  return distances;
}

/// The power of two nearest to a quarter of the median distance between neighbours.
float usual_step_m(std::span<const std::shared_ptr<Tile>> leaves, jobs::WorkerPool& pool) {
  std::vector<std::vector<double>> of_leaf(leaves.size());
  pool.for_each(leaves.size(), [&](std::size_t i) { of_leaf[i] = neighbour_distances(*leaves[i]); });
  std::vector<double> distances;
  for (const auto& some : of_leaf) distances.insert(distances.end(), some.begin(), some.end());
  if (distances.empty()) return 0x1p-10F;
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  const double exponent = std::round(std::log2(*middle / 4));
  return static_cast<float>(std::exp2(std::clamp(exponent, -90.0, 100.0)));
}

/// Vertices that count: in a scene with triangles those of a triangle.
std::vector<bool> drawn_vertices(const Tile& tile) {
  std::vector<bool> is_drawn(tile.positions.size(), tile.triangles.empty());
  for (const base::Triangle& triangle : tile.triangles) {
    for (const std::uint32_t v : triangle) is_drawn[v] = true;
  }
  return is_drawn;
}

double longest_side(const base::Bounds& box) {
  return std::max({double{box.max.x} - double{box.min.x}, double{box.max.y} - double{box.min.y},
                   double{box.max.z} - double{box.min.z}});
}

/// How often `step_m` is halved until it is `wanted_m` or less.
std::uint8_t halvings_to(double wanted_m, double step_m) {
  if (wanted_m >= step_m) return 0;
  return static_cast<std::uint8_t>(std::min(std::ceil(std::log2(step_m / wanted_m)), double{kMostHalvings}));
}

/// A box of points and how it wants to be rounded.
struct Shape {
  base::Bounds bounds;
  std::array<double, 3> side{};
  std::array<double, 3> float_spacing{};  ///< Of coordinates as far out.

  explicit Shape(const base::Bounds& box) : bounds(box) {
    const auto low = coordinates(box.min), high = coordinates(box.max);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      side[axis] = double{high[axis]} - double{low[axis]};
      const double farthest = std::max(std::abs(double{low[axis]}), std::abs(double{high[axis]}));
      float_spacing[axis] = farthest > 0 ? std::ldexp(1, std::ilogb(farthest) - 23) : 0;
    }
  }

  StepHalvings within_precision(StepHalvings halvings, double step_m) const {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (float_spacing[axis] > 0) halvings[axis] = std::min(halvings[axis], halvings_to(float_spacing[axis], step_m));
    }
    return halvings;
  }

  /// Whether what the points span there is no flatness or rounding of floats.
  bool has_side(std::size_t axis) const {
    std::array<double, 3> sorted = side;
    std::sort(sorted.begin(), sorted.end());
    return side[axis] > 8 * float_spacing[axis] && side[axis] >= kFlat * sorted[1];
  }

  /// So that no side that is one changes by more than a tenth.
  StepHalvings for_sides(double step_of_side, double step_m) const {
    StepHalvings halvings{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (has_side(axis)) halvings[axis] = halvings_to(step_of_side * side[axis], step_m);
    }
    return halvings;
  }
};

StepHalvings finer(const StepHalvings& a, const StepHalvings& b) {
  return {std::max(a[0], b[0]), std::max(a[1], b[1]), std::max(a[2], b[2])};
}

/// Never less than `to`, whoever else raises it.
void raise(std::uint8_t& value, std::uint8_t to) {
  const std::atomic_ref<std::uint8_t> shared(value);
  std::uint8_t now = shared.load(std::memory_order_relaxed);
  while (now < to && !shared.compare_exchange_weak(now, to, std::memory_order_relaxed)) {
  }
}

/// How many of these distinct positions fall together with another at steps of so much; where it is more than `enough`, any such number.
std::size_t merged_count(std::span<const base::Vec3f> positions, const std::array<double, 3>& steps_m,
                         std::size_t enough, std::vector<std::array<double, 3>>& rounded) {
  rounded.resize(positions.size());
  std::size_t merged = 0;
  for (std::size_t i = 0; i < positions.size() && merged <= enough; ++i) {
    const auto p = coordinates(positions[i]);
    for (std::size_t axis = 0; axis < 3; ++axis) rounded[i][axis] = std::floor(double{p[axis]} / steps_m[axis] + 0.5);
    const auto end = rounded.begin() + static_cast<std::ptrdiff_t>(i);
    if (std::find(rounded.begin(), end, rounded[i]) != end) ++merged;
  }
  return merged;
}

/// How often `step_m` is halved until all but `may_merge` of these distinct positions stay distinct.
std::uint8_t halvings_apart(std::span<const base::Vec3f> positions, std::size_t may_merge, double step_m) {
  std::vector<std::array<double, 3>> rounded;
  for (int halvings = 0; halvings < kMostHalvings; ++halvings) {
    const double step = std::ldexp(step_m, -halvings);
    if (merged_count(positions, {step, step, step}, may_merge, rounded) <= may_merge)
      return static_cast<std::uint8_t>(halvings);
  }
  return kMostHalvings;
}

/// Which vertices hang together.
class Pieces {
 public:
  explicit Pieces(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0u); }

  std::uint32_t of(std::uint32_t v) {
    while (parent_[v] != v) v = parent_[v] = parent_[parent_[v]];
    return v;
  }
  void join(std::uint32_t a, std::uint32_t b) {
    a = of(a);
    b = of(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::uint32_t> parent_;
};

}  // namespace

namespace {

/// Where the ends of the box of some vertices are, as they are and as they are rounded; those at the upper end negative, so that
/// every number is a least one.
struct Ends {
  static constexpr float kFar = std::numeric_limits<float>::infinity();
  std::array<float, 12> least{kFar, kFar, kFar, kFar, kFar, kFar, kFar, kFar, kFar, kFar, kFar, kFar};

  Ends() = default;
  Ends(const std::array<float, 3>& place, const std::array<float, 3>& rounded) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      least[axis] = place[axis];
      least[3 + axis] = rounded[axis];
      least[6 + axis] = -place[axis];
      least[9 + axis] = -rounded[axis];
    }
  }
  float low(std::size_t axis) const { return least[axis]; }
  float high(std::size_t axis) const { return -least[6 + axis]; }
  float rounded_low(std::size_t axis) const { return least[3 + axis]; }
  float rounded_high(std::size_t axis) const { return -least[9 + axis]; }

  bool operator==(const Ends&) const = default;

  void join(const Ends& other) {
    for (std::size_t i = 0; i < least.size(); ++i) least[i] = std::min(least[i], other.least[i]);
  }
  /// Whether a side changes by more than is left to it.
  bool are_off() const {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float side = high(axis) - low(axis), rounded_side = rounded_high(axis) - rounded_low(axis);
      if (std::abs(rounded_side - side) > static_cast<float>(kMostSideChange) * side) return true;
    }
    return false;
  }
  /// Whether those of any part between `inner` and `outer`, which holds it, may be.
  static bool may_be_off_between(const Ends& inner, const Ends& outer) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float side = inner.high(axis) - inner.low(axis), most_side = outer.high(axis) - outer.low(axis);
      const float rounded_side = inner.rounded_high(axis) - inner.rounded_low(axis);
      const float most_rounded_side = outer.rounded_high(axis) - outer.rounded_low(axis);
      constexpr auto kMost = static_cast<float>(kMostSideChange);
      if (most_rounded_side > (1 + kMost) * side || rounded_side < (1 - kMost) * most_side) return true;
    }
    return false;
  }
};

}  // namespace

/// The vertices around a cell, seen from a corner of it.
struct PositionSteps::Neighbourhood {
  std::array<float, 3> corner{};
  static constexpr std::array<float, 3> kFarthest{Ends::kFar, Ends::kFar, Ends::kFar};
  double reach = 0;                      ///< Beyond the cell, as far as they were looked for.
  std::array<float, 3> coarsest_step{};  ///< Of any of them.
  std::vector<std::uint32_t> points;
  std::vector<std::uint32_t> changed;  ///< Those of `points` that were rounded anew in the last round.
  std::vector<std::array<float, 3>> place, rounded;
  std::vector<float> xs, ys, zs;            ///< Of `place`.
  std::vector<Ends> ends;                   ///< Of each alone.
  std::vector<float> distance;              ///< To a vertex of the cell, squared.
  std::vector<std::uint8_t> is_later_twin;  ///< Another one is rounded to the same place.
  std::vector<std::uint32_t> twins;
  std::vector<std::uint32_t> near, ball;
  std::vector<float> near_distance;
  std::vector<std::uint32_t> ring;
  std::array<std::uint32_t, kRings + 2> ring_begin{};
  std::vector<std::pair<float, std::uint32_t>> in_order;  ///< Distance and number, nearest first.

  void resize(std::size_t count) {
    place.resize(count);
    rounded.resize(count);
    for (auto* axis : {&xs, &ys, &zs}) axis->resize(count);
    ends.resize(count);
    distance.resize(count);
    near.resize(count);
    ball.resize(count);
    near_distance.resize(count);
    ring.resize(count);
  }

  /// Fills in `distance`.
  void measure_from(const std::array<float, 3>& center) {
    const std::size_t count = distance.size();
    for (std::size_t n = 0; n < count; ++n) {
      const float x = xs[n] - center[0], y = ys[n] - center[1], z = zs[n] - center[2];
      distance[n] = x * x + y * y + z * z;
    }
  }

  /// Squared.
  float distance_from(const std::array<float, 3>& center, std::size_t n) const {
    const std::array<float, 3>& p = place[n];
    const float x = p[0] - center[0], y = p[1] - center[1], z = p[2] - center[2];
    return x * x + y * y + z * z;
  }

  /// Puts those within a radius (squared) into `near`; returns how many.
  std::size_t gather(float radius) {
    std::size_t kept = 0;
    for (std::size_t n = 0; n < distance.size(); ++n) {
      near[kept] = static_cast<std::uint32_t>(n);
      kept += distance[n] <= radius ? 1u : 0u;
    }
    return kept;
  }

  /// Of the first `near_count` of `near`: in which ring around a ball each is; in it is 0, and beyond the last ring the last.
  void find_rings(std::size_t near_count, float radius, float width) {
    for (std::size_t n = 0; n < near_count; ++n) near_distance[n] = distance[near[n]];
    for (std::size_t n = 0; n < near_count; ++n) {
      const float beyond = (near_distance[n] - radius) / width;
      // Where floats end it is no number.
      const float at_most = beyond < kRings ? beyond : kRings;
      const float at_least = at_most > 0 ? at_most : 0;
      const auto below = static_cast<std::int32_t>(at_least);
      const std::int32_t above = below + (static_cast<float>(below) < at_least ? 1 : 0);
      ring[n] = near_distance[n] <= radius ? 0u : static_cast<std::uint32_t>(above);
    }
  }

  /// Fills in `is_later_twin`.
  void find_twins() {
    is_later_twin.assign(points.size(), 0);
    twins.resize(points.size());
    std::iota(twins.begin(), twins.end(), 0u);
    std::sort(twins.begin(), twins.end(), [&](std::uint32_t a, std::uint32_t b) { return rounded[a] < rounded[b]; });
    for (std::size_t i = 1; i < twins.size(); ++i) is_later_twin[twins[i]] = rounded[twins[i]] == rounded[twins[i - 1]];
  }
  /// Whether a fifth of some ball of the first `near_count` of `near` may fall together.
  bool may_be_merged(std::size_t near_count) const {
    std::size_t twin_count = 0;
    for (std::size_t n = 0; n < near_count; ++n) twin_count += is_later_twin[near[n]];
    return twin_count * kVerticesToMerged > kFewestOfBall;
  }

  /// Whether no step could change a side of a ball (of a radius, squared; of the first `near_count` of `near`) by more than is left to
  /// it, nor of a larger one: each end is off by half a step at most.
  bool keeps_sides_around(float radius, std::size_t near_count) const {
    std::array<float, 3> low = kFarthest, high = kFarthest;  // The upper ends negative.
    for (std::size_t n = 0; n < near_count; ++n) {
      if (distance[near[n]] > radius) continue;
      const std::array<float, 3>& p = place[near[n]];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        low[axis] = std::min(low[axis], p[axis]);
        high[axis] = std::min(high[axis], -p[axis]);
      }
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (!((-high[axis] - low[axis]) * static_cast<float>(kMostSideChange) >= coarsest_step[axis])) return false;
    }
    return true;
  }

  /// Fills in `in_order` and `ring_begin` by ring; in no order within one.
  void sort_by_ring(std::size_t near_count) {
    ring_begin.fill(0);
    for (std::size_t n = 0; n < near_count; ++n) ++ring_begin[ring[n] + 1];
    std::partial_sum(ring_begin.begin(), ring_begin.end(), ring_begin.begin());
    in_order.resize(near_count);
    std::array<std::uint32_t, kRings + 2> next = ring_begin;
    for (std::size_t n = 0; n < near_count; ++n) in_order[next[ring[n]]++] = {near_distance[n], near[n]};
  }

  /// Of the first `near_count` of `near` (at least `count`): a radius that has `count` of them, or more where several are equally far.
  /// Bisection; several times faster here than std::nth_element.
  float radius_of(std::size_t count, std::size_t near_count) {
    float most = 0;
    for (std::size_t n = 0; n < near_count; ++n) {
      near_distance[n] = distance[near[n]];
      most = std::max(most, near_distance[n]);
    }
    if (near_count == count) return most;
    float least = 0;
    for (;;) {
      const float middle = (least + most) / 2;
      if (!(middle > least && middle < most)) return most;
      std::uint32_t within = 0;
      for (std::size_t n = 0; n < near_count; ++n) within += near_distance[n] <= middle ? 1u : 0u;
      if (within == count) return middle;
      (within < count ? least : most) = middle;
    }
  }
};

/// A part of the tree while it is made.
struct PositionSteps::Branch {
  std::uint32_t begin = 0, end = 0;
  std::uint32_t place = 0;  ///< Its first node in the whole tree.
  std::vector<Node> nodes;
  std::vector<Cell> cells;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> coincident;

  /// Splits a range of points in two along its longest side; false where all are in one place. Equal positions stay together.
  static bool split(std::span<Point> points, Node& node, std::size_t& below_count) {
    base::Bounds box{points[0].position, points[0].position};
    for (const Point& point : points) {
      const base::Vec3f& p = point.position;
      box.min = {std::min(box.min.x, p.x), std::min(box.min.y, p.y), std::min(box.min.z, p.z)};
      box.max = {std::max(box.max.x, p.x), std::max(box.max.y, p.y), std::max(box.max.z, p.z)};
    }
    const Shape shape(box);
    const auto longest = std::max_element(shape.side.begin(), shape.side.end());
    if (!(*longest > 0)) return false;
    const auto axis = static_cast<std::size_t>(longest - shape.side.begin());
    const auto at = [axis](const Point& point) { return coordinates(point.position)[axis]; };
    const auto middle = points.begin() + static_cast<std::ptrdiff_t>(points.size() / 2);
    std::nth_element(points.begin(), middle, points.end(),
                     [&](const Point& a, const Point& b) { return at(a) < at(b); });
    node.axis = static_cast<std::uint8_t>(axis);
    node.split = at(*middle);
    if (node.split == coordinates(box.min)[axis]) {
      node.split = std::numeric_limits<float>::infinity();
      for (const Point& point : points) {
        if (at(point) > coordinates(box.min)[axis]) node.split = std::min(node.split, at(point));
      }
    }
    const auto end = std::partition(points.begin(), points.end(), [&](const Point& p) { return at(p) < node.split; });
    below_count = static_cast<std::size_t>(end - points.begin());
    return true;
  }

  /// Leaves one vertex of each place at the front; returns how many.
  std::size_t weld(std::span<Point> points) {
    std::sort(points.begin(), points.end(), [](const Point& a, const Point& b) {
      return std::tuple(a.position.x, a.position.y, a.position.z, a.source) <
             std::tuple(b.position.x, b.position.y, b.position.z, b.source);
    });
    std::size_t count = 0;
    for (const Point& point : points) {
      if (count > 0 && points[count - 1].position == point.position) {
        coincident.emplace_back(points[count - 1].source, point.source);
      } else {
        points[count++] = point;
      }
    }
    return count;
  }

  void grow(std::span<Point> all, std::uint32_t at_node, std::uint32_t first, std::uint32_t last, bool is_welded) {
    std::span<Point> points = all.subspan(first, last - first);
    if (!is_welded && points.size() <= kWeldVertexCount) {
      last = first + static_cast<std::uint32_t>(weld(points));
      points = points.first(last - first);
      is_welded = true;
    }
    Node node;
    std::size_t below_count = 0;
    if ((is_welded && points.size() <= kCellVertexCount) || !split(points, node, below_count)) {
      if (!is_welded) {
        last = first + static_cast<std::uint32_t>(weld(points));
        points = points.first(last - first);
      }
      Cell cell;
      cell.begin = first;
      cell.end = last;
      cell.bounds = {points[0].position, points[0].position};
      for (const Point& point : points) {
        const base::Vec3f& p = point.position;
        base::Bounds& box = cell.bounds;
        box.min = {std::min(box.min.x, p.x), std::min(box.min.y, p.y), std::min(box.min.z, p.z)};
        box.max = {std::max(box.max.x, p.x), std::max(box.max.y, p.y), std::max(box.max.z, p.z)};
      }
      nodes[at_node].below = static_cast<std::uint32_t>(cells.size());
      cells.push_back(cell);
      return;
    }
    node.below = static_cast<std::uint32_t>(nodes.size());
    nodes[at_node] = node;
    nodes.resize(nodes.size() + 2);
    const std::uint32_t middle = first + static_cast<std::uint32_t>(below_count);
    grow(all, node.below, first, middle, is_welded);
    grow(all, node.below + 1, middle, last, is_welded);
  }
};

PositionSteps::PositionSteps(std::span<const std::shared_ptr<Tile>> leaves, jobs::WorkerPool& pool,
                             std::optional<float> largest_step_m) {
  largest_step_m_ = largest_step_m.value_or(usual_step_m(leaves, pool));
  gather(leaves);
  if (points_.empty()) return;
  if (!largest_step_m) {
    const std::size_t spare = kNegligibleBits / (3 * points_.size());
    largest_step_m_ = std::ldexp(largest_step_m_, -static_cast<int>(std::min<std::size_t>(spare, kMostSpareHalvings)));
  }
  cut(pool);
  ask_cells(pool);
  ask_pieces(leaves);
  ask_neighbours(pool);
  most_halvings_ = kMostHalvings;
  const bool has_triangles =
      std::any_of(leaves.begin(), leaves.end(), [](const auto& leaf) { return !leaf->triangles.empty(); });
  if (has_triangles) limit_to_one_tile();
  keep_sides(pool);
  coincident_ = {};
}

void PositionSteps::gather(std::span<const std::shared_ptr<Tile>> leaves) {
  std::size_t count = 0;
  for (const auto& leaf : leaves) count += leaf->owned_count;
  points_.reserve(count);
  for (const auto& leaf : leaves) {
    const std::vector<bool> is_drawn = drawn_vertices(*leaf);
    for (std::uint32_t v = 0; v < leaf->owned_count; ++v) {
      if (is_drawn[v] && is_finite(leaf->positions[v])) points_.push_back({leaf->positions[v], leaf->source_vertex[v]});
    }
  }
}

void PositionSteps::cut(jobs::WorkerPool& pool) {
  std::vector<Branch> branches;
  nodes_.resize(1);
  // The top, down to branches that are made in parallel.
  std::vector<Branch> open;
  open.push_back({0, static_cast<std::uint32_t>(points_.size()), 0, {}, {}, {}});
  while (!open.empty()) {
    Branch branch = std::move(open.back());
    open.pop_back();
    const std::span<Point> points = std::span(points_).subspan(branch.begin, branch.end - branch.begin);
    Node node;
    std::size_t below_count = 0;
    if (points.size() <= kBranchVertexCount || !Branch::split(points, node, below_count)) {
      branches.push_back(std::move(branch));
      continue;
    }
    node.below = static_cast<std::uint32_t>(nodes_.size());
    nodes_[branch.place] = node;
    nodes_.resize(nodes_.size() + 2);
    const std::uint32_t middle = branch.begin + static_cast<std::uint32_t>(below_count);
    open.push_back({branch.begin, middle, node.below, {}, {}, {}});
    open.push_back({middle, branch.end, node.below + 1, {}, {}, {}});
  }
  pool.for_each(branches.size(), [&](std::size_t i) {
    branches[i].nodes.resize(1);
    branches[i].grow(points_, 0, branches[i].begin, branches[i].end, false);
  });
  for (Branch& branch : branches) {
    const auto first_node = static_cast<std::uint32_t>(nodes_.size());
    const auto first_cell = static_cast<std::uint32_t>(cells_.size());
    // The first node has its place already.
    for (std::size_t i = 0; i < branch.nodes.size(); ++i) {
      Node node = branch.nodes[i];
      node.below += node.axis == kNoAxis ? first_cell : first_node - 1;
      if (i == 0) {
        nodes_[branch.place] = node;
      } else {
        nodes_.push_back(node);
      }
    }
    cells_.insert(cells_.end(), branch.cells.begin(), branch.cells.end());
    coincident_.insert(coincident_.end(), branch.coincident.begin(), branch.coincident.end());
  }
}

void PositionSteps::ask_cells(jobs::WorkerPool& pool) {
  constexpr std::size_t kChunk = 64;
  const auto step_m = static_cast<double>(largest_step_m_);
  pool.for_each((cells_.size() + kChunk - 1) / kChunk, [&](std::size_t chunk) {
    std::vector<base::Vec3f> positions;
    for (std::size_t c = chunk * kChunk; c < std::min(cells_.size(), (chunk + 1) * kChunk); ++c) {
      Cell& cell = cells_[c];
      positions.clear();
      for (std::uint32_t i = cell.begin; i < cell.end; ++i) positions.push_back(points_[i].position);
      const Shape shape(cell.bounds);
      const std::uint8_t apart = halvings_apart(positions, positions.size() / kVerticesToMerged, step_m);
      const double step_of_side = apart > 1 ? kStepOfPieceSide : kStepOfCellSide;
      cell.own = shape.within_precision(finer(shape.for_sides(step_of_side, step_m), {apart, apart, apart}), step_m);
      cell.is_dense = apart > 0;
    }
  });
}

void PositionSteps::ask_pieces(std::span<const std::shared_ptr<Tile>> leaves) {
  std::uint32_t source_count = 0;
  for (const Point& point : points_) source_count = std::max(source_count, point.source + 1);
  bool has_triangles = false;
  Pieces pieces(source_count);
  for (const auto& leaf : leaves) {
    has_triangles = has_triangles || !leaf->triangles.empty();
    for (const base::Triangle& t : leaf->triangles) {
      const std::uint32_t first = leaf->source_vertex[t[0]];
      pieces.join(first, leaf->source_vertex[t[1]]);
      pieces.join(first, leaf->source_vertex[t[2]]);
    }
  }
  if (!has_triangles) return;
  for (const auto& [a, b] : coincident_) pieces.join(a, b);

  constexpr auto kNone = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> number_of(source_count, kNone);
  struct Piece {
    base::Bounds bounds;
    std::uint32_t count = 0;
    StepHalvings halvings{};
    std::vector<base::Vec3f> positions;  ///< Of a small one.
  };
  std::vector<Piece> all;
  for (const Cell& cell : cells_) {
    for (std::uint32_t i = cell.begin; i < cell.end; ++i) {
      const base::Vec3f& p = points_[i].position;
      std::uint32_t& number = number_of[pieces.of(points_[i].source)];
      if (number == kNone) {
        number = static_cast<std::uint32_t>(all.size());
        all.push_back({{p, p}, 0, {}, {}});
      }
      Piece& piece = all[number];
      piece.bounds.min = {std::min(piece.bounds.min.x, p.x), std::min(piece.bounds.min.y, p.y),
                          std::min(piece.bounds.min.z, p.z)};
      piece.bounds.max = {std::max(piece.bounds.max.x, p.x), std::max(piece.bounds.max.y, p.y),
                          std::max(piece.bounds.max.z, p.z)};
      if (++piece.count <= kSmallPieceVertexCount) piece.positions.push_back(p);
    }
  }
  const auto step_m = static_cast<double>(largest_step_m_);
  bool is_any_fine = false;
  for (Piece& piece : all) {
    const Shape shape(piece.bounds);
    piece.halvings = shape.for_sides(kStepOfPieceSide, step_m);
    if (piece.count <= kSmallPieceVertexCount) {
      const std::uint8_t apart = halvings_apart(piece.positions, piece.positions.size() / kVerticesToMerged, step_m);
      piece.halvings = finer(piece.halvings, {apart, apart, apart});
    }
    piece.halvings = shape.within_precision(piece.halvings, step_m);
    is_any_fine = is_any_fine || piece.halvings != StepHalvings{};
  }
  if (!is_any_fine) return;
  for (Cell& cell : cells_) {
    for (std::uint32_t i = cell.begin; i < cell.end; ++i) {
      cell.halvings = finer(cell.halvings, all[number_of[pieces.of(points_[i].source)]].halvings);
    }
  }
}

template <class Visit>
void PositionSteps::for_each_cell(const std::array<double, 3>& low, const std::array<double, 3>& high, Visit visit) {
  std::vector<std::uint32_t> open{0};
  while (!open.empty()) {
    const Node& node = nodes_[open.back()];
    open.pop_back();
    if (node.axis == kNoAxis) {
      visit(cells_[node.below]);
      continue;
    }
    if (low[node.axis] < double{node.split}) open.push_back(node.below);
    if (high[node.axis] >= double{node.split}) open.push_back(node.below + 1);
  }
}

void PositionSteps::ask_neighbours(jobs::WorkerPool& pool) {
  constexpr std::size_t kChunk = 64;
  for (Cell& cell : cells_) cell.halvings = finer(cell.halvings, cell.own);
  pool.for_each((cells_.size() + kChunk - 1) / kChunk, [&](std::size_t chunk) {
    for (std::size_t c = chunk * kChunk; c < std::min(cells_.size(), (chunk + 1) * kChunk); ++c) {
      const Cell& cell = cells_[c];
      if (cell.own == StepHalvings{}) continue;
      const double longest = longest_side(cell.bounds);
      std::array<double, 3> low{}, high{};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        low[axis] = double{coordinates(cell.bounds.min)[axis]} - longest * kReach;
        high[axis] = double{coordinates(cell.bounds.max)[axis]} + longest * kReach;
      }
      for_each_cell(low, high, [&](Cell& other) {
        double gap = 0;  // Along the axis on which they are farthest apart.
        for (std::size_t axis = 0; axis < 3; ++axis) {
          gap = std::max({gap, double{coordinates(other.bounds.min)[axis]} - double{coordinates(cell.bounds.max)[axis]},
                          double{coordinates(cell.bounds.min)[axis]} - double{coordinates(other.bounds.max)[axis]}});
        }
        if (gap > longest * kReach) return;
        const int fewer = cell.is_dense || gap <= longest * kTouch ? 0 : 1;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          raise(other.halvings[axis], static_cast<std::uint8_t>(std::max(0, cell.own[axis] - fewer)));
        }
      });
    }
  });
}

void PositionSteps::limit_to_one_tile() {
  std::vector<base::Vec3f> corners;
  for (const Cell& cell : cells_) {
    corners.push_back(cell.bounds.min);
    corners.push_back(cell.bounds.max);
  }
  const double extent = longest_side(bounds_of(corners));
  const double most = std::floor(std::log2(static_cast<double>(largest_step_m_) * 0x1.fffffcp23 / extent));
  // A triangle to a stray vertex coarsens the tiles that have it, no others.
  if (!(most >= 1 && most < kMostHalvings)) return;
  most_halvings_ = static_cast<std::uint8_t>(most);
  for (Cell& cell : cells_) {
    for (std::uint8_t& halvings : cell.halvings) halvings = std::min(halvings, most_halvings_);
  }
}

template <class Visit>
void PositionSteps::for_each_cell_around(const Cell& cell, double reach, Visit visit) {
  std::array<double, 3> low{}, high{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    low[axis] = double{coordinates(cell.bounds.min)[axis]} - reach;
    high[axis] = double{coordinates(cell.bounds.max)[axis]} + reach;
  }
  for_each_cell(low, high, visit);
}

bool PositionSteps::is_crowded(const Cell& cell) {
  const auto step_m = static_cast<double>(largest_step_m_);
  std::array<double, 3> steps_m{};
  for (std::size_t axis = 0; axis < 3; ++axis) steps_m[axis] = std::ldexp(step_m, -cell.halvings[axis]);
  std::vector<base::Vec3f> positions;
  for (std::uint32_t i = cell.begin; i < cell.end; ++i) positions.push_back(points_[i].position);
  const std::size_t most = positions.size() / kVerticesToCrowd;
  std::vector<std::array<double, 3>> rounded;
  return merged_count(positions, steps_m, most, rounded) > most;
}

void PositionSteps::keep_sides(jobs::WorkerPool& pool) {
  constexpr std::size_t kChunk = 16;
  halvings_.resize(points_.size());
  for (const Cell& cell : cells_) {
    std::fill(halvings_.begin() + cell.begin, halvings_.begin() + cell.end, cell.halvings);
  }
  pool.for_each((cells_.size() + kChunk - 1) / kChunk, [&](std::size_t chunk) {
    for (std::size_t c = chunk * kChunk; c < std::min(cells_.size(), (chunk + 1) * kChunk); ++c) {
      cells_[c].is_crowded = is_crowded(cells_[c]);
    }
  });
  SidesRound round{.is_changed = std::vector<std::uint8_t>(points_.size(), 1),
                   .radius = std::vector<float>(points_.size()),
                   .wanted = halvings_};
  for (int i = 0; i < kMostRounds; ++i) {
    round.is_first = i == 0;
    pool.for_each((cells_.size() + kChunk - 1) / kChunk, [&](std::size_t chunk) {
      Neighbourhood around;
      for (std::size_t c = chunk * kChunk; c < std::min(cells_.size(), (chunk + 1) * kChunk); ++c) {
        keep_sides_in(cells_[c], around, round);
      }
    });
    bool is_any_changed = false;
    for (Cell& cell : cells_) {
      cell.is_changed = false;
      for (std::uint32_t p = cell.begin; p < cell.end; ++p) {
        round.is_changed[p] = halvings_[p] == round.wanted[p] ? 0 : 1;
        cell.is_changed = cell.is_changed || round.is_changed[p] != 0;
      }
      is_any_changed = is_any_changed || cell.is_changed;
    }
    halvings_ = round.wanted;
    if (!is_any_changed) break;
  }
}

void PositionSteps::gather_around(const Cell& cell, double reach, Neighbourhood& around, const SidesRound& round) {
  const auto step_m = static_cast<double>(largest_step_m_);
  around.reach = reach;
  around.corner = coordinates(cell.bounds.min);
  around.points.clear();
  around.changed.clear();
  for_each_cell_around(cell, reach, [&](const Cell& other) {
    for (std::uint32_t i = other.begin; i < other.end; ++i) {
      if (round.is_changed[i] != 0) around.changed.push_back(static_cast<std::uint32_t>(around.points.size()));
      around.points.push_back(i);
    }
  });
  const std::size_t count = around.points.size();
  around.resize(count);
  around.coarsest_step = {};
  std::array<double, kMostHalvings + 1> steps_m{};
  for (std::size_t h = 0; h < steps_m.size(); ++h) steps_m[h] = std::ldexp(step_m, -static_cast<int>(h));
  for (std::size_t n = 0; n < count; ++n) {
    const std::uint32_t point = around.points[n];
    const auto p = coordinates(points_[point].position);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double step = steps_m[halvings_[point][axis]];
      around.coarsest_step[axis] = std::max(around.coarsest_step[axis], static_cast<float>(step));
      around.place[n][axis] = static_cast<float>(double{p[axis]} - double{around.corner[axis]});
      around.rounded[n][axis] =
          static_cast<float>(std::floor(double{p[axis]} / step + 0.5) * step - double{around.corner[axis]});
    }
    around.ends[n] = Ends(around.place[n], around.rounded[n]);
    around.xs[n] = around.place[n][0];
    around.ys[n] = around.place[n][1];
    around.zs[n] = around.place[n][2];
  }
  if (cell.is_crowded) around.find_twins();
}

void PositionSteps::keep_sides_in(const Cell& cell, Neighbourhood& around, SidesRound& round) {
  double reach = longest_side(cell.bounds) * kBallReach;
  if (!round.is_first) {
    const auto largest = std::max_element(round.radius.begin() + cell.begin, round.radius.begin() + cell.end);
    if (*largest < 0) return;
    reach = std::sqrt(double{*largest} * double{kLargestBall});
    bool is_any_changed = false;
    for_each_cell_around(cell, reach, [&](const Cell& other) { is_any_changed = is_any_changed || other.is_changed; });
    if (!is_any_changed) return;
  }
  gather_around(cell, reach, around, round);
  constexpr float kSafe = -1;  // Instead of a radius: no further look is needed, as steps only get finer.
  constexpr float kEverywhere = std::numeric_limits<float>::infinity();
  float radius = kEverywhere;  // Of the smallest ball around the vertex before; all squared.
  for (std::uint32_t seed = cell.begin; seed < cell.end; ++seed) {
    std::array<float, 3> center = coordinates(points_[seed].position);
    for (std::size_t axis = 0; axis < 3; ++axis)
      center[axis] = static_cast<float>(double{center[axis]} - double{around.corner[axis]});
    if (around.points.size() < kFewestOfBall) break;
    if (!round.is_first) {
      radius = round.radius[seed];
      if (radius == kSafe) continue;
      // Where nothing has changed since it was looked at nothing else would come of it.
      const bool is_any_near = std::any_of(around.changed.begin(), around.changed.end(), [&](std::uint32_t n) {
        return around.distance_from(center, n) <= radius * kLargestBall;
      });
      if (!is_any_near) continue;
    }
    around.measure_from(center);
    if (round.is_first) {
      // Among few, if it is about as large as the one before.
      std::size_t few_count = around.gather(radius * 1.5F);
      if (few_count < kFewestOfBall) few_count = around.gather(kEverywhere);
      radius = around.radius_of(kFewestOfBall, few_count);
      const double wanted_reach = std::sqrt(double{radius} * double{kLargestBall});
      if (wanted_reach > around.reach && around.points.size() < points_.size()) {
        // It may be smaller then.
        gather_around(cell, kSpareReach * wanted_reach, around, round);
        around.measure_from(center);
        radius = around.radius_of(kFewestOfBall, around.gather(radius));
      }
      round.radius[seed] = radius;
    }
    const std::size_t near_count = around.gather(radius * kLargestBall);
    if (cell.is_crowded && around.may_be_merged(near_count)) keep_apart(around, near_count, round.wanted);
    const bool is_safe = around.keeps_sides_around(radius, near_count);
    if (is_safe && !cell.is_crowded) round.radius[seed] = kSafe;
    if (is_safe) continue;
    // What each ring between a ball and the next larger one adds to it.
    const float ring_width = radius * (kLargestBall - 1) / kRings;
    around.find_rings(near_count, radius, ring_width);
    std::array<Ends, kRings + 1> rings;
    for (std::size_t n = 0; n < near_count; ++n) rings[around.ring[n]].join(around.ends[around.near[n]]);
    Ends ball = rings[0];
    around.in_order.clear();
    Ends kept_ends;
    const auto keep_ball = [&](const Ends& ends, float ball_radius) {
      // Another vertex between the same ends asks for nothing else.
      if (ends == kept_ends) return;
      kept_ends = ends;
      std::size_t kept = 0;
      for (std::size_t n = 0; n < near_count; ++n) {
        around.ball[kept] = around.near[n];
        kept += around.near_distance[n] <= ball_radius ? 1u : 0u;
      }
      keep_sides_of(around, std::span(around.ball).first(kept), round.wanted);
    };
    if (ball.are_off()) keep_ball(ball, radius);
    for (std::uint32_t ring = 1; ring <= kRings; ++ring) {
      const Ends before = ball;
      ball.join(rings[ring]);
      if (!Ends::may_be_off_between(before, ball)) continue;
      if (around.in_order.empty()) around.sort_by_ring(near_count);
      const auto in_ring = std::span(around.in_order)
                               .subspan(around.ring_begin[ring], around.ring_begin[ring + 1] - around.ring_begin[ring]);
      std::sort(in_ring.begin(), in_ring.end());
      // Each ball that ends within it.
      Ends growing = before;
      for (std::size_t i = 0; i < in_ring.size(); ++i) {
        const auto [distance, n] = in_ring[i];
        growing.join(around.ends[n]);
        const bool is_ball = i + 1 == in_ring.size() || in_ring[i + 1].first > distance;
        if (is_ball && growing.are_off()) keep_ball(growing, distance);
      }
    }
  }
}

void PositionSteps::keep_apart(Neighbourhood& around, std::size_t near_count, std::vector<StepHalvings>& wanted) {
  around.in_order.clear();
  for (std::size_t i = 0; i < near_count; ++i)
    around.in_order.emplace_back(around.distance[around.near[i]], around.near[i]);
  std::sort(around.in_order.begin(), around.in_order.end());
  std::map<std::array<float, 3>, std::uint32_t> first_at;
  std::vector<std::uint32_t> merged;
  for (std::size_t i = 0; i < near_count; ++i) {
    const auto [distance, n] = around.in_order[i];
    const auto [first, is_new] = first_at.try_emplace(around.rounded[n], n);
    if (!is_new) {
      merged.push_back(n);
      merged.push_back(first->second);
    }
    const bool is_ball = i + 1 >= kFewestOfBall && (i + 1 == near_count || around.in_order[i + 1].first > distance);
    if (!is_ball || (i + 1 - first_at.size()) * kVerticesToMerged <= i + 1) continue;
    for (const std::uint32_t m : merged) {
      const std::uint32_t point = around.points[m];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const int finer_by_one = std::min(halvings_[point][axis] + 1, int{most_halvings_});
        raise(wanted[point][axis], static_cast<std::uint8_t>(finer_by_one));
      }
    }
  }
}

void PositionSteps::keep_sides_of(const Neighbourhood& around, std::span<const std::uint32_t> ball,
                                  std::vector<StepHalvings>& wanted) {
  constexpr auto kMost = static_cast<float>(kMostSideChange);
  Ends ends;
  for (const std::uint32_t n : ball) ends.join(around.ends[n]);
  std::array<float, 3> low{}, high{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    low[axis] = ends.low(axis);
    high[axis] = ends.high(axis);
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const float side = high[axis] - low[axis];
    const float at_low = low[axis] - ends.rounded_low(axis), at_high = ends.rounded_high(axis) - high[axis];
    if (std::abs(at_low + at_high) <= kMost * side) continue;
    const auto absolute = [&](const std::array<float, 3>& p) {
      return base::Vec3f{p[0] + around.corner[0], p[1] + around.corner[1], p[2] + around.corner[2]};
    };
    if (!Shape({absolute(low), absolute(high)}).has_side(axis)) continue;
    // One end where that is enough: the worse one.
    const float most = kMost * side;
    const bool is_low_worse = std::abs(at_low) > std::abs(at_high);
    const float other = is_low_worse ? at_high : at_low;
    const bool are_both = std::abs(other) > 0.75F * most;
    if (is_low_worse || are_both)
      keep_end(around, ball, axis, low[axis], -1, are_both ? -most / 2 : -most - other,
               are_both ? most / 2 : most - other, wanted);
    if (!is_low_worse || are_both)
      keep_end(around, ball, axis, high[axis], 1, are_both ? -most / 2 : -most - other,
               are_both ? most / 2 : most - other, wanted);
  }
}

void PositionSteps::keep_end(const Neighbourhood& around, std::span<const std::uint32_t> ball, std::size_t axis,
                             float end, int direction, float least, float most, std::vector<StepHalvings>& wanted) {
  const auto step_m = static_cast<double>(largest_step_m_);
  const auto sign = static_cast<float>(direction);
  // How far beyond the end.
  const auto beyond = [&](float there) { return sign * (there - end); };
  const bool is_lost =
      std::none_of(ball.begin(), ball.end(), [&](std::uint32_t n) { return beyond(around.rounded[n][axis]) >= least; });
  for (const std::uint32_t n : ball) {
    const bool is_end = is_lost && around.place[n][axis] == end;
    const std::uint32_t point = around.points[n];
    const double at = double{coordinates(points_[point].position)[axis]};
    int halvings = halvings_[point][axis];
    float there = around.rounded[n][axis];
    while ((beyond(there) > most || (is_end && beyond(there) < least)) && halvings < int{most_halvings_}) {
      const double step = std::ldexp(step_m, -++halvings);
      there = static_cast<float>(std::floor(at / step + 0.5) * step - double{around.corner[axis]});
    }
    raise(wanted[point][axis], static_cast<std::uint8_t>(halvings));
  }
}

StepHalvings PositionSteps::halvings_at(const base::Vec3f& position) const {
  const auto p = coordinates(position);
  const Node* node = &nodes_[0];
  while (node->axis != kNoAxis) node = &nodes_[node->below + (p[node->axis] < node->split ? 0 : 1)];
  const Cell& cell = cells_[node->below];
  std::uint32_t i = cell.begin;
  while (i + 1 < cell.end && points_[i].position != position) ++i;
  return halvings_[i];
}

void PositionSteps::apply(Tile& tile) const {
  tile.step_halvings.clear();
  if (cells_.empty() || tile.positions.empty()) return;
  const std::vector<bool> is_drawn = drawn_vertices(tile);
  std::vector<StepHalvings> halvings(tile.positions.size());
  bool is_any = false;
  for (std::size_t v = 0; v < halvings.size(); ++v) {
    if (!is_drawn[v]) continue;
    halvings[v] = halvings_at(tile.positions[v]);
    is_any = is_any || halvings[v] != StepHalvings{};
  }
  if (is_any) tile.step_halvings = std::move(halvings);
}

}  // namespace spectra::map
