#include "server/scene/tile_tree.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <set>
#include <tuple>
#include <utility>

#include "server/scene/octree_cut.hpp"
#include "server/scene/position_index.hpp"
#include "server/scene/seen_error.hpp"
#include "server/scene/surface.hpp"
#include "server/scene/thinning.hpp"

namespace spectra::server {
namespace {

using fusion::Triangle;
using fusion::Vec3f;
using protocol::TileId;

constexpr std::uint32_t kNone = Surface::kNone;

/// Of a vertex that no other tile needs.
constexpr std::uint8_t kUnshared = 255;

TileId parent_of(const TileId& id) {
  return {static_cast<std::uint8_t>(id.level - 1), id.x / 2, id.y / 2, id.z / 2};
}

TileId common_ancestor(TileId a, TileId b) {
  while (a.level > b.level) a = parent_of(a);
  while (b.level > a.level) b = parent_of(b);
  while (a != b) {
    a = parent_of(a);
    b = parent_of(b);
  }
  return a;
}

/// A tile while its parent is not made yet.
struct Node {
  std::shared_ptr<Tile> tile;
  /// Per vertex: the level of the lowest tile that holds all leaves in which the vertex lies on an open edge. Locked
  /// in the tiles below that.
  std::vector<std::uint8_t> sharing_level;
  std::vector<std::uint32_t> weight;     ///< Per vertex: how many vertices it stands for; empty: one each.
  std::vector<FullSample> samples;       ///< Of the full mesh under it.
  std::vector<std::uint32_t> merged_of;  ///< Per vertex: its place in the merged mesh of the parent.
  std::vector<Node*> children;
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
  for (const Triangle& triangle : tile.triangles) {
    for (const std::uint32_t v : triangle) is_drawn[v] = true;
  }
  return is_drawn;
}

bool is_degenerate(const Triangle& t) {
  return t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
}

/// The positions on open edges of a leaf, as its welded surface has them.
std::vector<Vec3f> open_positions(const Tile& leaf) {
  PositionIndex index(leaf.positions.size());
  std::vector<std::uint32_t> welded(leaf.positions.size());
  for (std::size_t v = 0; v < welded.size(); ++v) welded[v] = index.find_or_insert(leaf.positions[v]);
  std::vector<Triangle> triangles;
  triangles.reserve(leaf.triangles.size());
  for (const Triangle& t : leaf.triangles) {
    const Triangle triangle{welded[t[0]], welded[t[1]], welded[t[2]]};
    if (!is_degenerate(triangle)) triangles.push_back(triangle);
  }
  const std::vector<bool> is_open = Surface(index.positions(), triangles).open_vertices();
  std::vector<Vec3f> result;
  for (std::size_t v = 0; v < is_open.size(); ++v) {
    if (is_open[v]) result.push_back(index.positions()[v]);
  }
  return result;
}

/// Finds out what is shared between leaves.
void find_sharing_levels(std::vector<Node*>& leaves, WorkerPool& pool) {
  std::vector<std::vector<Vec3f>> open(leaves.size());
  pool.for_each(leaves.size(), [&](std::size_t i) { open[i] = open_positions(*leaves[i]->tile); });
  std::size_t open_count = 0;
  for (const auto& positions : open) open_count += positions.size();
  PositionIndex index(open_count);
  std::vector<TileId> holder;
  holder.reserve(open_count);
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    for (const Vec3f& position : open[i]) {
      const std::uint32_t v = index.find_or_insert(position);
      if (v == holder.size()) {
        holder.push_back(leaves[i]->tile->id);
      } else {
        holder[v] = common_ancestor(holder[v], leaves[i]->tile->id);
      }
    }
  }
  pool.for_each(leaves.size(), [&](std::size_t i) {
    const Tile& tile = *leaves[i]->tile;
    leaves[i]->sharing_level.assign(tile.positions.size(), kUnshared);
    for (std::size_t v = 0; v < tile.positions.size(); ++v) {
      const std::uint32_t shared = index.find(tile.positions[v]);
      if (shared != PositionIndex::kAbsent) leaves[i]->sharing_level[v] = holder[shared].level;
    }
  });
}

struct Merged : MergedTiles {
  std::uint32_t lowest_at = kNone, highest_at = kNone;
};

Merged merged(const std::vector<Node*>& children, const Tile& parent, bool is_point_cloud, float median_celsius) {
  std::size_t vertex_count = 0, triangle_count = 0;
  for (const Node* child : children) {
    vertex_count += child->tile->positions.size();
    triangle_count += child->tile->triangles.size();
  }
  Merged result;
  PositionIndex index(vertex_count);
  result.visible.reserve(vertex_count);
  result.temperature_celsius.reserve(vertex_count);
  result.source_vertex.reserve(vertex_count);
  result.weight.reserve(vertex_count);
  result.sharing_level.reserve(vertex_count);
  result.triangles.reserve(triangle_count);
  for (Node* child : children) {
    const Tile& tile = *child->tile;
    const std::vector<bool> is_drawn = drawn_vertices(tile, is_point_cloud);
    std::vector<std::uint32_t>& merged_of = child->merged_of;
    merged_of.assign(tile.positions.size(), kNone);
    for (std::size_t v = 0; v < tile.positions.size(); ++v) {
      if (!is_drawn[v]) continue;
      const std::uint32_t m = merged_of[v] = index.find_or_insert(tile.positions[v]);
      const float temperature = tile.temperature_celsius[v];
      if (m == result.source_vertex.size()) {
        result.visible.push_back(tile.visible[v]);
        result.temperature_celsius.push_back(temperature);
        result.source_vertex.push_back(tile.source_vertex[v]);
        result.weight.push_back(child->weight.empty() ? 1 : child->weight[v]);
        result.sharing_level.push_back(child->sharing_level[v]);
      } else {
        float& kept = result.temperature_celsius[m];
        kept = further_from(median_celsius, kept, temperature);
        result.sharing_level[m] = std::min(result.sharing_level[m], child->sharing_level[v]);
      }
      if (temperature == parent.lowest_celsius && result.lowest_at == kNone) result.lowest_at = m;
      if (temperature == parent.highest_celsius && result.highest_at == kNone) result.highest_at = m;
    }
    for (const Triangle& t : tile.triangles) {
      result.any_triangle = {merged_of[t[0]], merged_of[t[1]], merged_of[t[2]]};
      if (!is_degenerate(result.any_triangle)) result.triangles.push_back(result.any_triangle);
    }
  }
  result.positions = std::move(index).take_positions();
  return result;
}

/// Puts a temperature of the full mesh that lost its place to one further from the median onto the vertex near `k` where it
/// hides the least.
void show_extreme(Tile& tile, std::uint32_t k, float celsius, float median_celsius,
                  const std::vector<bool>& is_kept_locked) {
  std::vector<float>& shown = tile.temperature_celsius;
  if (std::isnan(celsius) || std::find(shown.begin(), shown.end(), celsius) != shown.end()) return;
  std::vector<std::uint32_t> near{k};
  for (const Triangle& t : tile.triangles) {
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
void show(Node& node, const Merged& mesh, Thinning& thinning, const std::vector<bool>& is_locked,
          float median_celsius) {
  Tile& tile = *node.tile;
  std::vector<bool> is_kept_locked;
  for (const std::uint32_t v : thinning.kept) {
    is_kept_locked.push_back(is_locked[v]);
    tile.positions.push_back(mesh.positions[v]);
    tile.source_vertex.push_back(mesh.source_vertex[v]);
    node.sharing_level.push_back(mesh.sharing_level[v]);
  }
  tile.visible = std::move(thinning.visible);
  tile.temperature_celsius = std::move(thinning.temperature_celsius);
  tile.triangles = std::move(thinning.triangles);
  node.weight = std::move(thinning.weight);
  for (const auto& [at, celsius] :
       {std::pair(mesh.lowest_at, tile.lowest_celsius), std::pair(mesh.highest_at, tile.highest_celsius)}) {
    if (at == kNone) continue;
    show_extreme(tile, thinning.kept_of_merged[at], celsius, median_celsius, is_kept_locked);
  }
}

/// What the children say of the tile above them.
void take_from_children(Node& node) {
  Tile& tile = *node.tile;
  TemperatureRange range;
  std::vector<Vec3f> corners;
  tile.temperature_error_celsius = std::numeric_limits<float>::quiet_NaN();
  for (const Node* child : node.children) {
    const Tile& below = *child->tile;
    range = range.joined({below.lowest_celsius, below.highest_celsius});
    corners.push_back(below.bounds.min);
    corners.push_back(below.bounds.max);
    tile.geometric_error_m = std::max(tile.geometric_error_m, below.geometric_error_m);
    tile.colour_error_levels = std::max(tile.colour_error_levels, below.colour_error_levels);
    tile.temperature_error_celsius = std::fmax(tile.temperature_error_celsius, below.temperature_error_celsius);
    tile.lost_detail_m = std::max(tile.lost_detail_m, below.lost_detail_m);
    tile.child_mask |=
        static_cast<std::uint8_t>(1u << ((below.id.x & 1) | (below.id.y & 1) << 1 | (below.id.z & 1) << 2));
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

/// How far the tile is from its children, and how what it shows differs from the full mesh. The samples of the children
/// become its own.
void measure(Node& node, const Merged& mesh, const Surface& fine, const Thinning& thinning,
             const TreeOptions& options) {
  Tile& tile = *node.tile;
  tile.geometric_error_m = sum_above(tile.geometric_error_m, thinning.distance_m);
  for (Node* child : node.children) {
    for (FullSample& sample : child->samples) {
      const std::uint32_t m = child->merged_of[sample.near];
      if (m == kNone) continue;
      sample.near = thinning.kept_of_merged[m];
      node.samples.push_back(sample);
    }
    child->samples = {};
    child->merged_of = {};
  }
  thin_out(node.samples);
  const Surface surface(tile.positions, tile.triangles);
  measure_seen_error(tile, surface, node.samples);
  const SeenContrast contrast{.levels = options.seen_levels, .celsius = options.span_celsius / 16};
  const double lost_m = lost_detail_m(tile, surface, mesh, fine, thinning, contrast);
  // Patches that were wrong before and those that are now may lie beside each other.
  const auto before_m = static_cast<double>(tile.lost_detail_m);
  tile.lost_detail_m = static_cast<float>(std::hypot(before_m, lost_m));
}

/// Nothing is ever drawn beside the root, so no border of it has to meet another: its positions are rounded no finer than an
/// eighth of what they are off anyway.
void round_as_alone(Tile& root, float step_m) {
  const double needed = std::log2(8 * static_cast<double>(step_m) / static_cast<double>(root.geometric_error_m));
  const auto most = static_cast<std::uint8_t>(std::clamp(std::ceil(needed), 0.0, 255.0));
  for (StepHalvings& halvings : root.step_halvings) {
    for (std::uint8_t& axis : halvings) axis = std::min(axis, most);
  }
}

/// Makes the tile of a node from its children and lets go of what only this needed.
void make_parent(Node& node, bool is_point_cloud, const TreeOptions& options) {
  Tile& tile = *node.tile;
  take_from_children(node);
  const Merged mesh = merged(node.children, tile, is_point_cloud, options.median_celsius);
  for (Node* child : node.children) {
    child->sharing_level = {};
    child->weight = {};
  }
  const std::size_t vertex_count = mesh.positions.size();
  std::vector<bool> is_locked(vertex_count);
  std::size_t locked_count = 0;
  for (std::size_t v = 0; v < vertex_count; ++v) {
    is_locked[v] = mesh.sharing_level[v] < tile.id.level;
    if (is_locked[v]) ++locked_count;
  }
  const std::size_t most = tile.id.level == 0 ? options.root_vertex_count : options.tile_vertex_count;
  const std::size_t share = std::max<std::size_t>(4, std::min<std::size_t>(most, vertex_count / 3));
  const std::size_t wanted_count = std::max(share, locked_count + share / 4);
  for (const std::uint32_t v : {mesh.lowest_at, mesh.highest_at}) {
    if (v != kNone) is_locked[v] = true;
  }
  const ThinningOptions thinning_options{.wanted_count = wanted_count, .span_celsius = options.span_celsius};
  const Surface fine(mesh.positions, mesh.triangles);
  Thinning thinning = is_point_cloud ? thinned_points(mesh, is_locked, thinning_options)
                                     : thinned_surface(mesh, fine, is_locked, thinning_options);
  show(node, mesh, thinning, is_locked, options.median_celsius);
  tile.owned_count = static_cast<std::uint32_t>(tile.positions.size());
  if (options.position_steps != nullptr) options.position_steps->apply(tile);
  measure(node, mesh, fine, thinning, options);
  if (tile.id.level == 0 && options.position_steps != nullptr) {
    round_as_alone(tile, options.position_steps->largest_step_m());
  }
}

}  // namespace

std::vector<std::shared_ptr<const Tile>> tile_tree(std::vector<std::shared_ptr<Tile>> leaves, bool is_point_cloud,
                                                   const TreeOptions& options, WorkerPool& pool,
                                                   const std::function<void(double)>& made_share) {
  std::set<TileId> wanted;
  for (const auto& leaf : leaves) {
    for (TileId id = leaf->id; id.level > 0 && wanted.insert(parent_of(id)).second;) id = parent_of(id);
  }
  std::atomic<std::size_t> made_count{0};
  std::map<TileId, Node> nodes;
  std::vector<Node*> leaf_nodes;
  int deepest = 0;
  for (std::shared_ptr<Tile>& leaf : leaves) {
    Node& node = nodes[leaf->id];
    deepest = std::max(deepest, int{leaf->id.level});
    node.tile = std::move(leaf);
    leaf_nodes.push_back(&node);
  }
  find_sharing_levels(leaf_nodes, pool);
  if (leaf_nodes.size() > 1) {
    pool.for_each(leaf_nodes.size(),
                  [&](std::size_t i) { leaf_nodes[i]->samples = leaf_samples(*leaf_nodes[i]->tile); });
  }
  for (int level = deepest; level > 0; --level) {
    std::vector<Node*> parents;
    for (auto& [id, node] : nodes) {
      if (id.level != level) continue;
      Node& parent = nodes[parent_of(id)];
      if (!parent.tile) {
        parent.tile = std::make_shared<Tile>();
        parent.tile->id = parent_of(id);
        parents.push_back(&parent);
      }
      parent.children.push_back(&node);
    }
    pool.for_each(parents.size(), [&](std::size_t i) {
      make_parent(*parents[i], is_point_cloud, options);
      if (made_share) made_share(static_cast<double>(++made_count) / static_cast<double>(wanted.size()));
    });
  }
  std::vector<std::shared_ptr<const Tile>> tiles;
  tiles.reserve(nodes.size());
  for (auto& [id, node] : nodes) tiles.push_back(std::move(node.tile));
  std::sort(tiles.begin(), tiles.end(), [](const auto& a, const auto& b) {
    return std::pair(a->id.level, morton_code(a->id.x, a->id.y, a->id.z)) <
           std::pair(b->id.level, morton_code(b->id.x, b->id.y, b->id.z));
  });
  return tiles;
}

}  // namespace spectra::server
