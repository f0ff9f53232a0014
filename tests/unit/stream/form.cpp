#include "form.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <numeric>
#include <set>
#include <vector>

#include "fusion/mesh/position_index.hpp"
#include "server/stream/lattice.hpp"

namespace spectra::stream::testing {
namespace {

using base::Vec3f;
using Place = std::array<double, 3>;

Place place_of(const base::Vec3f& p) {
  return {double{p.x}, double{p.y}, double{p.z}};
}

double squared(const Place& a, const Place& b) {
  double sum = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) sum += (a[axis] - b[axis]) * (a[axis] - b[axis]);
  return sum;
}

/// Finds the nearest of some places.
class NearestPlaces {
 public:
  explicit NearestPlaces(const std::vector<Place>& places)
      : places_(places), order_(places.size()), axis_(places.size()) {
    std::iota(order_.begin(), order_.end(), 0u);
    if (!order_.empty()) build(0, order_.size());
  }

  /// The nearest `count`, nearest first.
  std::vector<std::uint32_t> nearest(const Place& p, std::size_t count) const {
    std::vector<std::pair<double, std::uint32_t>> found;
    search(p, count, 0, order_.size(), found);
    std::sort_heap(found.begin(), found.end());
    std::vector<std::uint32_t> result;
    for (const auto& [distance, v] : found) result.push_back(v);
    return result;
  }

 private:
  void build(std::size_t begin, std::size_t end) {
    if (end - begin < 2) return;
    Place low = places_[order_[begin]], high = low;
    for (std::size_t i = begin; i < end; ++i) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        low[axis] = std::min(low[axis], places_[order_[i]][axis]);
        high[axis] = std::max(high[axis], places_[order_[i]][axis]);
      }
    }
    std::size_t axis = 0;
    for (std::size_t other = 1; other < 3; ++other) {
      if (high[other] - low[other] > high[axis] - low[axis]) axis = other;
    }
    const std::size_t middle = begin + (end - begin) / 2;
    const auto at = [&](std::size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(at(begin), at(middle), at(end),
                     [&](std::uint32_t a, std::uint32_t b) { return places_[a][axis] < places_[b][axis]; });
    axis_[middle] = axis;
    build(begin, middle);
    build(middle + 1, end);
  }

  void search(const Place& p, std::size_t count, std::size_t begin, std::size_t end,
              std::vector<std::pair<double, std::uint32_t>>& found) const {
    if (begin >= end) return;
    const std::size_t middle = begin + (end - begin) / 2;
    const std::uint32_t v = order_[middle];
    found.emplace_back(squared(p, places_[v]), v);
    std::push_heap(found.begin(), found.end());
    if (found.size() > count) {
      std::pop_heap(found.begin(), found.end());
      found.pop_back();
    }
    if (end - begin == 1) return;
    const std::size_t axis = axis_[middle];
    const double beyond = p[axis] - places_[v][axis];
    const auto below = [&] { search(p, count, begin, middle, found); };
    const auto above = [&] { search(p, count, middle + 1, end, found); };
    beyond < 0 ? below() : above();
    if (found.size() < count || beyond * beyond <= found.front().first) beyond < 0 ? above() : below();
  }

  const std::vector<Place>& places_;
  std::vector<std::uint32_t> order_;
  std::vector<std::size_t> axis_;
};

struct Loss {
  double side_change = 0;
  bool is_merged = false;
};

/// What became of some vertices.
Loss loss_of(const std::vector<std::uint32_t>& vertices, const std::vector<Place>& before,
             const std::vector<Place>& after, double thin) {
  Loss loss;
  std::array<double, 3> side{}, rounded_side{}, far{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    constexpr double kFar = std::numeric_limits<double>::infinity();
    double low = kFar, high = -kFar, rounded_low = kFar, rounded_high = -kFar;
    for (const std::uint32_t v : vertices) {
      low = std::min(low, before[v][axis]);
      high = std::max(high, before[v][axis]);
      rounded_low = std::min(rounded_low, after[v][axis]);
      rounded_high = std::max(rounded_high, after[v][axis]);
    }
    side[axis] = high - low;
    rounded_side[axis] = rounded_high - rounded_low;
    far[axis] = std::max(std::abs(low), std::abs(high));
  }
  std::array<double, 3> sorted = side;
  std::sort(sorted.begin(), sorted.end());
  const auto rounding = [](double at) { return at > 0 ? std::ldexp(8, std::ilogb(at) - 23) : 0; };
  const double any_rounding = rounding(std::max({far[0], far[1], far[2]}));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const bool is_thin = side[axis] < sorted[1] * thin;
    const bool is_flat = side[axis] < sorted[1] * 0x1p-20 || side[axis] <= any_rounding;
    if (side[axis] == 0 ? rounded_side[axis] == 0 : (is_thin && is_flat) || side[axis] <= rounding(far[axis])) continue;
    loss.side_change = std::max(loss.side_change, std::abs(rounded_side[axis] - side[axis]) / side[axis]);
  }
  std::set<Place> distinct;
  for (const std::uint32_t v : vertices) distinct.insert(after[v]);
  loss.is_merged = 5 * distinct.size() < 4 * vertices.size();
  return loss;
}

}  // namespace

FormReport form_of(const map::SceneSnapshot& scene, std::size_t seed_count) {
  FormReport report;
  mesh::PositionIndex index(static_cast<std::size_t>(scene.vertex_count()));
  std::vector<Place> before, after;
  std::vector<std::uint32_t> parent;
  const auto piece_of = [&](std::uint32_t v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  std::set<std::uint32_t> torn;
  // The form is that of the leaves. Coarser tiles are drawn beside them, where they must not be torn off, but not in their place: what
  // they leave out is told by their error. The first one is drawn alone.
  std::vector<std::shared_ptr<const map::Tile>> tiles;
  for (const bool is_leaf : {true, false}) {
    for (const auto& tile : scene.tiles()) {
      const bool is_alone = tile == scene.tiles().front() && scene.tiles().size() > 1;
      if (!is_alone && (tile->child_mask == 0) == is_leaf) tiles.push_back(tile);
    }
  }
  for (const auto& tile : tiles) {
    std::vector<bool> is_drawn(tile->positions.size(), tile->triangles.empty());
    for (const auto& triangle : tile->triangles) {
      for (const std::uint32_t v : triangle) is_drawn[v] = true;
    }
    const TileLattice lattice = tile_lattice(*tile, scene.suggested_position_step_m()).value();
    std::vector<std::uint32_t> number(tile->positions.size());
    for (std::size_t v = 0; v < number.size(); ++v) {
      if (!is_drawn[v]) continue;
      Place decoded{};
      for (std::size_t axis = 0; axis < 3; ++axis)
        decoded[axis] = double{lattice.origin_m[axis] + static_cast<float>(lattice.points[v][axis]) * lattice.step_m};
      number[v] = index.find_or_insert(tile->positions[v]);
      if (number[v] == before.size()) {
        before.push_back(place_of(tile->positions[v]));
        after.push_back(decoded);
        parent.push_back(number[v]);
      } else if (after[number[v]] != decoded) {
        torn.insert(number[v]);
      }
    }
    if (tile->child_mask != 0) continue;
    for (const auto& t : tile->triangles) {
      for (const std::size_t corner : {1u, 2u}) parent[piece_of(number[t[corner]])] = piece_of(number[t[0]]);
    }
  }
  report.torn_count = torn.size();

  std::map<std::uint32_t, std::vector<std::uint32_t>> pieces;
  if (!scene.is_point_cloud()) {
    for (std::uint32_t v = 0; v < before.size(); ++v) pieces[piece_of(v)].push_back(v);
  }
  for (const auto& [root, vertices] : pieces) {
    const Loss loss = loss_of(vertices, before, after, 0x1p-15);
    ++report.piece_count;
    if (loss.side_change > 0.1) ++report.flattened_piece_count;
    if (loss.is_merged) ++report.merged_piece_count;
  }

  const base::Bounds& box = scene.bounds();
  const double smallest_radius = std::sqrt(squared(place_of(box.min), place_of(box.max))) / 20'000;
  const NearestPlaces places(before);
  const std::size_t stride = std::max<std::size_t>(1, before.size() / std::max<std::size_t>(1, seed_count));
  for (std::size_t seed = 0; seed < before.size(); seed += stride) {
    for (const std::size_t count : {50u, 60u, 70u, 85u, 100u, 1000u}) {
      if (before.size() < count) break;
      // All that are as near as the last.
      auto ball = places.nearest(before[seed], 2 * count);
      const double radius = squared(before[ball[count - 1]], before[seed]);
      while (squared(before[ball.back()], before[seed]) > radius) ball.pop_back();
      if (std::sqrt(squared(before[ball.back()], before[seed])) < smallest_radius) continue;
      const Loss loss = loss_of(ball, before, after, 0x1p-12);
      ++report.patch_count;
      report.worst_side_change = std::max(report.worst_side_change, loss.side_change);
      if (loss.side_change > 0.1) ++report.flattened_patch_count;
      if (loss.is_merged) ++report.merged_patch_count;
    }
  }
  return report;
}

}  // namespace spectra::stream::testing
