#include "server/map/coarse_tile.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>
#include <utility>

#include "fusion/base/box.hpp"
#include "fusion/mesh/position_index.hpp"
#include "fusion/mesh/surface.hpp"
#include "server/map/position_step.hpp"
#include "server/map/seen_error.hpp"
#include "server/map/thinning.hpp"
#include "server/map/tile_place.hpp"

namespace spectra::map {
namespace {

using base::Triangle;
using base::Vec3f;
using protocol::TileId;

constexpr std::uint32_t kNone = mesh::Surface::kNone;

/// A child of the tile that is being made.
struct Child {
  const MapNode& node;
  std::vector<std::uint32_t> merged_of;  ///< Per vertex: its place in the merged mesh.
};

/// How far a temperature that is not missing stands out; what is over or under range stands out most, whatever the median.
double distance_from(float median_celsius, float celsius) {
  if (std::isinf(celsius)) return std::numeric_limits<double>::infinity();
  return std::fabs(static_cast<double>(celsius) - static_cast<double>(median_celsius));
}

/// Of two temperatures the one that is farther from the median; a missing one never; the higher of equals.
float further_from(float median_celsius, float a, float b) {
  if (std::isnan(a)) return b;
  if (std::isnan(b)) return a;
  const double from_a = distance_from(median_celsius, a);
  const double from_b = distance_from(median_celsius, b);
  if (from_a == from_b) return std::max(a, b);
  return from_a > from_b ? a : b;
}

/// Which vertices of a tile are drawn.
std::vector<bool> drawn_vertices(const Tile& tile, bool is_point_cloud) {
  std::vector<bool> is_drawn(tile.positions.size(), is_point_cloud);
  for (const base::Triangle& triangle : tile.triangles) {
    for (const std::uint32_t v : triangle) is_drawn[v] = true;
  }
  return is_drawn;
}

bool is_degenerate(const base::Triangle& t) {
  return t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
}

struct Merged : MergedTiles {
  std::uint32_t lowest_at = kNone, highest_at = kNone;
};

StepHalvings finer(const StepHalvings& a, const StepHalvings& b) {
  return {std::max(a[0], b[0]), std::max(a[1], b[1]), std::max(a[2], b[2])};
}

Merged merged(std::vector<Child>& children, const Tile& parent, const BorderIndex& borders,
              const CoarseOptions& options) {
  std::size_t vertex_count = 0, triangle_count = 0;
  for (const Child& child : children) {
    vertex_count += child.node.tile->positions.size();
    triangle_count += child.node.tile->triangles.size();
  }
  Merged result;
  mesh::PositionIndex index(vertex_count);
  result.visible.reserve(vertex_count);
  result.temperature_celsius.reserve(vertex_count);
  result.source_vertex.reserve(vertex_count);
  result.weight.reserve(vertex_count);
  result.step_halvings.reserve(vertex_count);
  result.triangles.reserve(triangle_count);
  for (Child& child : children) {
    const Tile& tile = *child.node.tile;
    const std::vector<bool> is_drawn = drawn_vertices(tile, options.is_point_cloud);
    std::vector<std::uint32_t>& merged_of = child.merged_of;
    merged_of.assign(tile.positions.size(), kNone);
    for (std::size_t v = 0; v < tile.positions.size(); ++v) {
      if (!is_drawn[v]) continue;
      const std::uint32_t m = merged_of[v] = index.find_or_insert(tile.positions[v]);
      const float temperature = tile.temperature_celsius[v];
      const StepHalvings halvings = tile.step_halvings.empty() ? StepHalvings{} : tile.step_halvings[v];
      if (m == result.source_vertex.size()) {
        result.visible.push_back(tile.visible[v]);
        result.temperature_celsius.push_back(temperature);
        result.source_vertex.push_back(tile.source_vertex[v]);
        result.weight.push_back(child.node.weight.empty() ? 1 : child.node.weight[v]);
        result.step_halvings.push_back(halvings);
      } else {
        float& kept = result.temperature_celsius[m];
        kept = further_from(options.median_celsius, kept, temperature);
        result.step_halvings[m] = finer(result.step_halvings[m], halvings);
      }
      if (temperature == parent.lowest_celsius && result.lowest_at == kNone) result.lowest_at = m;
      if (temperature == parent.highest_celsius && result.highest_at == kNone) result.highest_at = m;
    }
    for (const base::Triangle& t : tile.triangles) {
      result.any_triangle = {merged_of[t[0]], merged_of[t[1]], merged_of[t[2]]};
      if (!is_degenerate(result.any_triangle)) result.triangles.push_back(result.any_triangle);
    }
  }
  result.positions = std::move(index).take_positions();
  result.sharing_level = borders.sharing_levels(result.positions);
  return result;
}

/// Puts a temperature of the full mesh that lost its place to one further from the median onto the vertex near `k` where it
/// hides the least.
void show_extreme(Tile& tile, std::uint32_t k, float celsius, float median_celsius,
                  const std::vector<bool>& is_kept_locked) {
  std::vector<float>& shown = tile.temperature_celsius;
  if (std::isnan(celsius) || std::find(shown.begin(), shown.end(), celsius) != shown.end()) return;
  std::vector<std::uint32_t> near{k};
  for (const base::Triangle& t : tile.triangles) {
    if (t[0] == k || t[1] == k || t[2] == k) near.insert(near.end(), t.begin(), t.end());
  }
  // The other extreme is never given up for this one; a locked vertex only where there is no other.
  const auto cost = [&](std::uint32_t v) {
    const float t = shown[v];
    const bool is_other = t == tile.lowest_celsius || t == tile.highest_celsius;
    const double deviation = std::isnan(t) ? -1 : distance_from(median_celsius, t);
    return std::tuple(is_other, is_kept_locked[v], deviation, v);
  };
  const auto is_cheaper = [&](std::uint32_t a, std::uint32_t b) { return cost(a) < cost(b); };
  std::uint32_t chosen = *std::min_element(near.begin(), near.end(), is_cheaper);
  if (std::get<0>(cost(chosen))) {
    near.resize(shown.size());
    std::iota(near.begin(), near.end(), 0u);
    chosen = *std::min_element(near.begin(), near.end(), is_cheaper);
  }
  // A tile of one vertex has no room for both.
  if (!std::get<0>(cost(chosen))) shown[chosen] = celsius;
}

/// Fills the kept vertices with what they show.
void show(Tile& tile, const Merged& mesh, Thinning& thinning, const std::vector<bool>& is_locked,
          float median_celsius) {
  std::vector<bool> is_kept_locked;
  bool is_any_halved = false;
  for (const std::uint32_t v : thinning.kept) {
    is_kept_locked.push_back(is_locked[v]);
    tile.positions.push_back(mesh.positions[v]);
    tile.source_vertex.push_back(mesh.source_vertex[v]);
    is_any_halved = is_any_halved || mesh.step_halvings[v] != StepHalvings{};
  }
  if (is_any_halved) {
    for (const std::uint32_t v : thinning.kept) tile.step_halvings.push_back(mesh.step_halvings[v]);
  }
  tile.visible = std::move(thinning.visible);
  tile.temperature_celsius = std::move(thinning.temperature_celsius);
  tile.triangles = std::move(thinning.triangles);
  for (const auto& [at, celsius] :
       {std::pair(mesh.lowest_at, tile.lowest_celsius), std::pair(mesh.highest_at, tile.highest_celsius)}) {
    if (at == kNone) continue;
    show_extreme(tile, thinning.kept_of_merged[at], celsius, median_celsius, is_kept_locked);
  }
}

/// What was seen of the regions of kept vertices. `place_of(child, v)` is the kept vertex that stands for one of a child, or kNone.
template <class PlaceOf>
void take_times(Tile& tile, const std::vector<Child>& children, const PlaceOf& place_of) {
  const VertexTimes& first = children.front().node.tile->seen_at;
  const bool is_one = std::all_of(children.begin(), children.end(), [&](const Child& child) {
    const VertexTimes& times = child.node.tile->seen_at;
    return times.of_vertex.empty() && times.distinct == first.distinct;
  });
  if (is_one) {
    tile.seen_at = first;
    return;
  }
  std::vector<double> newest(tile.positions.size(), kUnknownTime);
  for (const Child& child : children) {
    for (std::size_t v = 0; v < child.merged_of.size(); ++v) {
      const std::uint32_t k = place_of(child, v);
      if (k != kNone) newest[k] = later(newest[k], child.node.tile->seen_at.at(v));
    }
  }
  tile.seen_at = VertexTimes::of(newest);
}

/// How sure the temperatures are of the vertices that are kept: as the same vertex of a child.
template <class PlaceOf>
void take_confidence(Tile& tile, const std::vector<Child>& children, const Thinning& thinning,
                     const PlaceOf& place_of) {
  const auto is_empty = [](const Child& child) { return child.node.tile->sigma_kelvin.empty(); };
  if (std::all_of(children.begin(), children.end(), is_empty)) return;
  tile.sigma_kelvin.assign(tile.positions.size(), std::numeric_limits<float>::quiet_NaN());
  for (const Child& child : children) {
    const Tile& below = *child.node.tile;
    if (below.sigma_kelvin.empty()) continue;
    for (std::size_t v = 0; v < child.merged_of.size(); ++v) {
      const std::uint32_t k = place_of(child, v);
      if (k == kNone || std::isnan(tile.temperature_celsius[k])) continue;
      float& sigma = tile.sigma_kelvin[k];
      // A vertex that stays knows best; where it knows nothing, whoever of its region does.
      const bool is_kept_itself = thinning.kept[k] == child.merged_of[v];
      if (!std::isnan(below.sigma_kelvin[v]) && (is_kept_itself || std::isnan(sigma))) sigma = below.sigma_kelvin[v];
    }
  }
}

/// The same of what has changed.
template <class PlaceOf>
void take_baseline(Tile& tile, const std::vector<Child>& children, const CoarseOptions& options,
                   const PlaceOf& place_of) {
  const auto is_kept = [&](const Child& child) {
    return !child.node.tile->baseline_celsius.empty() && child.node.tile->baseline_mark == options.baseline_mark;
  };
  if (std::none_of(children.begin(), children.end(), is_kept)) return;
  struct Region {
    double sum = 0, weight = 0;
    float outlier = std::numeric_limits<float>::quiet_NaN();  ///< The change that differs most from the mean.
    float outlier_baseline = std::numeric_limits<float>::quiet_NaN();
    double mean() const { return weight > 0 ? sum / weight : 0; }
  };
  std::vector<Region> regions(tile.positions.size());
  /// visit(region, temperature, baseline, weight) for what is known of the full mesh, or of its coarser copies.
  const auto for_each_change = [&](const auto& visit) {
    for (const Child& child : children) {
      const Tile& below = *child.node.tile;
      const std::span<const float> baseline = baseline_of(below, options.baseline_mark);
      for (std::size_t v = 0; v < child.merged_of.size(); ++v) {
        const std::uint32_t k = place_of(child, v);
        const float celsius = below.temperature_celsius[v];
        if (k == kNone || std::isnan(celsius) || std::isnan(baseline[v])) continue;
        visit(regions[k], celsius, baseline[v],
              child.node.weight.empty() ? 1.0 : static_cast<double>(child.node.weight[v]));
      }
    }
  };
  for_each_change([](Region& region, float celsius, float baseline, double weight) {
    const double change = double{celsius} - double{baseline};
    if (!std::isfinite(change)) return;
    region.sum += change * weight;
    region.weight += weight;
  });
  for_each_change([](Region& region, float celsius, float baseline, double) {
    const float change = celsius - baseline;
    if (std::isnan(change)) return;
    const auto apart = [&](float of) { return std::fabs(double{of} - region.mean()); };
    if (!std::isnan(region.outlier) && apart(change) <= apart(region.outlier)) return;
    region.outlier = change;
    region.outlier_baseline = baseline;
  });
  tile.baseline_mark = options.baseline_mark;
  for (std::size_t k = 0; k < regions.size(); ++k) {
    const Region& region = regions[k];
    const float celsius = tile.temperature_celsius[k];
    const bool stands_out = std::fabs(double{region.outlier} - region.mean()) >= options.span_celsius / 16;
    const double change = stands_out ? double{region.outlier} : region.mean();
    float baseline = static_cast<float>(double{celsius} - change);
    if (std::isnan(region.outlier)) baseline = region.outlier;
    if (std::isinf(celsius)) baseline = region.outlier_baseline;
    tile.baseline_celsius.push_back(baseline);
  }
}

/// What the children say of the tile above them.
void take_from_children(Tile& tile, const std::vector<Child>& children) {
  TemperatureRange range;
  std::vector<base::Vec3f> corners;
  tile.temperature_error_celsius = std::numeric_limits<float>::quiet_NaN();
  for (const Child& child : children) {
    const Tile& below = *child.node.tile;
    range = range.joined({below.lowest_celsius, below.highest_celsius});
    corners.push_back(below.bounds.min);
    corners.push_back(below.bounds.max);
    tile.geometric_error_m = std::max(tile.geometric_error_m, below.geometric_error_m);
    tile.colour_error_levels = std::max(tile.colour_error_levels, below.colour_error_levels);
    tile.temperature_error_celsius = std::fmax(tile.temperature_error_celsius, below.temperature_error_celsius);
    tile.lost_detail_m = std::max(tile.lost_detail_m, below.lost_detail_m);
    tile.child_mask |= static_cast<std::uint8_t>(1u << octant_of(below.id));
  }
  tile.lowest_celsius = range.lowest_celsius;
  tile.highest_celsius = range.highest_celsius;
  tile.bounds = bounds_of(corners);
}

/// A float not below the sum.
float sum_above(float a, double b) {
  constexpr float kLargest = std::numeric_limits<float>::max();
  const double sum = static_cast<double>(a) + b;
  return sum < static_cast<double>(kLargest) ? std::nextafter(static_cast<float>(sum), kLargest) : kLargest;
}

/// How far vertices are moved because the tile reaches too far for the steps that they ask for; 0 where it does not.
double rounding_of_reach_m(const Tile& tile, float step_m) {
  int asked = 0;
  for (const StepHalvings& halvings : tile.step_halvings) {
    for (const std::uint8_t axis : halvings) asked = std::max(asked, int{axis});
  }
  const int halvings = halvings_of_tile(tile, double{step_m});
  return halvings < asked ? std::sqrt(0.75) * std::ldexp(double{step_m}, -halvings) : 0;
}

/// How far the tile is from its children, and how what it shows differs from the full mesh. Returns samples of that.
std::vector<FullSample> measure(Tile& tile, const std::vector<Child>& children, const Merged& mesh,
                                const mesh::Surface& fine, const Thinning& thinning, const CoarseOptions& options) {
  tile.geometric_error_m = sum_above(tile.geometric_error_m, thinning.distance_m);
  if (const double rounding_m = rounding_of_reach_m(tile, options.position_step_m); rounding_m > 0) {
    tile.geometric_error_m = sum_above(tile.geometric_error_m, rounding_m);
  }
  std::vector<FullSample> samples;
  for (const Child& child : children) {
    const bool is_leaf = child.node.is_leaf();
    const std::vector<FullSample> of_leaf = is_leaf ? leaf_samples(*child.node.tile) : std::vector<FullSample>();
    for (FullSample sample : is_leaf ? of_leaf : child.node.samples) {
      const std::uint32_t m = child.merged_of[sample.near];
      if (m == kNone) continue;
      sample.near = thinning.kept_of_merged[m];
      samples.push_back(sample);
    }
  }
  thin_out(samples);
  const mesh::Surface surface(tile.positions, tile.triangles);
  measure_seen_error(tile, surface, samples);
  const SeenContrast contrast{.levels = options.seen_levels, .celsius = options.span_celsius / 16};
  const double lost_m = lost_detail_m(tile, surface, mesh, fine, thinning, contrast);
  // Patches that were wrong before and those that are now may lie beside each other.
  const auto before_m = static_cast<double>(tile.lost_detail_m);
  tile.lost_detail_m = static_cast<float>(std::hypot(before_m, lost_m));
  return samples;
}

/// Nothing is ever drawn beside the top, so no border of it has to meet another: its positions are rounded no finer than an
/// eighth of what they are off anyway.
void round_as_alone(Tile& top, float step_m) {
  const double needed = std::log2(8 * static_cast<double>(step_m) / static_cast<double>(top.geometric_error_m));
  const auto most = static_cast<std::uint8_t>(std::clamp(std::ceil(needed), 0.0, 255.0));
  for (StepHalvings& halvings : top.step_halvings) {
    for (std::uint8_t& axis : halvings) axis = std::min(axis, most);
  }
}

}  // namespace

/// The positions on open edges of a leaf, as its welded surface has them.
std::vector<base::Vec3f> open_positions(const Tile& leaf) {
  mesh::PositionIndex index(leaf.positions.size());
  std::vector<std::uint32_t> welded(leaf.positions.size());
  for (std::size_t v = 0; v < welded.size(); ++v) welded[v] = index.find_or_insert(leaf.positions[v]);
  std::vector<base::Triangle> triangles;
  triangles.reserve(leaf.triangles.size());
  for (const base::Triangle& t : leaf.triangles) {
    const base::Triangle triangle{welded[t[0]], welded[t[1]], welded[t[2]]};
    if (!is_degenerate(triangle)) triangles.push_back(triangle);
  }
  const std::vector<bool> is_open = mesh::Surface(index.positions(), triangles).open_vertices();
  std::vector<base::Vec3f> result;
  for (std::size_t v = 0; v < is_open.size(); ++v) {
    if (is_open[v]) result.push_back(index.positions()[v]);
  }
  return result;
}

void make_coarse_tile(MapNode& node, bool is_top, const BorderIndex& borders, const CoarseOptions& options,
                      mesh::SimplifyMemory& memory) {
  std::vector<Child> children;
  for (const MapNode::Branch& branch : node.branches) {
    const auto& below = branch.node->tile;
    // In a map with triangles vertices of none are not drawn.
    if (below && (options.is_point_cloud || !below->triangles.empty())) children.push_back({*branch.node, {}});
  }
  auto tile = std::make_shared<Tile>();
  tile->id = node.id;
  take_from_children(*tile, children);
  const Merged mesh = merged(children, *tile, borders, options);
  const std::size_t vertex_count = mesh.positions.size();
  std::vector<bool> is_locked(vertex_count);
  std::size_t locked_count = 0;
  for (std::size_t v = 0; v < vertex_count; ++v) {
    is_locked[v] = mesh.sharing_level[v] < tile->id.level;
    if (is_locked[v]) ++locked_count;
  }
  const std::size_t most = is_top ? options.top_vertex_count : options.tile_vertex_count;
  const std::size_t share = std::max<std::size_t>(4, std::min<std::size_t>(most, vertex_count / 3));
  const std::size_t wanted_count = std::max(share, locked_count + share / 4);
  for (const std::uint32_t v : {mesh.lowest_at, mesh.highest_at}) {
    if (v != kNone) is_locked[v] = true;
  }
  const ThinningOptions thinning_options{.wanted_count = wanted_count, .span_celsius = options.span_celsius};
  const mesh::Surface fine(mesh.positions, mesh.triangles);
  Thinning thinning = options.is_point_cloud ? thinned_points(mesh, is_locked, thinning_options)
                                             : thinned_surface(mesh, fine, is_locked, thinning_options, memory);
  show(*tile, mesh, thinning, is_locked, options.median_celsius);
  const auto place_of = [&](const Child& child, std::size_t v) {
    const std::uint32_t m = child.merged_of[v];
    return m == kNone ? kNone : thinning.kept_of_merged[m];
  };
  if (!children.empty()) take_times(*tile, children, place_of);
  take_baseline(*tile, children, options, place_of);
  take_confidence(*tile, children, thinning, place_of);
  tile->owned_count = static_cast<std::uint32_t>(tile->positions.size());
  node.samples = measure(*tile, children, mesh, fine, thinning, options);
  node.weight = std::move(thinning.weight);
  node.is_top = is_top;
  if (is_top) round_as_alone(*tile, options.position_step_m);
  node.tile = std::move(tile);
}

}  // namespace spectra::map
