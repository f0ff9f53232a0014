#include "server/scene/tile_tree.hpp"

#include <meshoptimizer.h>

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
#include "server/scene/point_groups.hpp"
#include "server/scene/position_index.hpp"
#include "server/scene/surface.hpp"

namespace spectra::server {
namespace {

using fusion::Triangle;
using fusion::Vec3f;
using protocol::TileId;

constexpr std::uint32_t kNone = Surface::kNone;

/// Of a vertex that no other tile needs.
constexpr std::uint8_t kUnshared = 255;

/// What is between the measured samples may be farther away than they are.
constexpr double kErrorMargin = 1.1;

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
  std::vector<std::uint32_t> weight;  ///< Per vertex: how many vertices it stands for; empty: one each.
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

/// The children of a tile as one piece.
struct Merged {
  std::vector<Vec3f> positions;
  std::vector<fusion::Rgb8> visible;
  std::vector<float> temperature_celsius;
  std::vector<std::uint32_t> source_vertex;
  std::vector<std::uint32_t> weight;
  std::vector<std::uint8_t> sharing_level;
  std::vector<Triangle> triangles;
  Triangle any_triangle{};  ///< For a tile of degenerate triangles alone.
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
  std::vector<std::uint32_t> merged_of;
  for (const Node* child : children) {
    const Tile& tile = *child->tile;
    const std::vector<bool> is_drawn = drawn_vertices(tile, is_point_cloud);
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

/// The triangles with each vertex replaced by what stands for it, without those that become degenerate.
std::vector<Triangle> mapped(const std::vector<Triangle>& triangles, std::span<const std::uint32_t> standing) {
  std::vector<Triangle> result;
  for (const Triangle& t : triangles) {
    const Triangle image{standing[t[0]], standing[t[1]], standing[t[2]]};
    if (!is_degenerate(image)) result.push_back(image);
  }
  return result;
}

std::vector<std::uint32_t> used_vertices(const std::vector<Triangle>& triangles, std::size_t vertex_count) {
  std::vector<bool> is_used(vertex_count);
  for (const Triangle& t : triangles) {
    for (const std::uint32_t v : t) is_used[v] = true;
  }
  std::vector<std::uint32_t> result;
  for (std::uint32_t v = 0; v < vertex_count; ++v) {
    if (is_used[v]) result.push_back(v);
  }
  return result;
}

/// Fewer triangles over the same vertices, some of which stay where they are.
std::vector<Triangle> simplified(const Merged& mesh, const std::vector<bool>& is_locked, std::size_t wanted_count) {
  const std::size_t vertex_count = mesh.positions.size();
  std::vector<Triangle> result = mesh.triangles;
  const Bounds bounds = bounds_of(mesh.positions);
  const float extent =
      std::max({bounds.max.x - bounds.min.x, bounds.max.y - bounds.min.y, bounds.max.z - bounds.min.z});
  // meshopt computes with squares of floats.
  if (std::isfinite(extent) && extent > 1e-30f && !result.empty()) {
    // A position that three vertices have stays where it is: that is how version 0.18 is told to lock a vertex. Its own
    // option would lock the edges of the scene too, and holes in a scan have many.
    const auto locked_count = static_cast<std::size_t>(std::count(is_locked.begin(), is_locked.end(), true));
    std::vector<Vec3f> positions;
    positions.reserve(vertex_count + 2 * locked_count);
    positions = mesh.positions;
    for (std::size_t v = 0; v < vertex_count; ++v) {
      if (is_locked[v]) positions.insert(positions.end(), 2, mesh.positions[v]);
    }
    // A closed surface has two triangles for each vertex; each vertex on an open edge costs one.
    const std::size_t share = result.size() * wanted_count / vertex_count;
    const std::size_t wanted_triangles = std::min(share, 2 * wanted_count - std::min(locked_count, wanted_count));
    constexpr float kAnyError = 1e6f;
    const std::size_t index_count =
        meshopt_simplify(result[0].data(), result[0].data(), 3 * result.size(), &positions[0].x, positions.size(),
                         sizeof(Vec3f), 3 * wanted_triangles, kAnyError, 0, nullptr);
    result.resize(index_count / 3);
  }
  // Loose pieces, or places where many sheets meet, may have stopped it.
  std::vector<std::uint32_t> used = used_vertices(result, vertex_count);
  if (4 * used.size() > 5 * wanted_count) {
    const std::size_t used_count = used.size();
    std::erase_if(used, [&](std::uint32_t v) { return is_locked[v]; });
    const std::size_t locked_count = used_count - used.size();
    const std::size_t group_count = wanted_count > locked_count ? wanted_count - locked_count : 1;
    result = mapped(result, group_representatives(mesh.positions, std::move(used), group_count));
  }
  if (result.empty()) result.push_back(mesh.any_triangle);
  return result;
}

/// The nearest of some points, for the few vertices that no edge connects to one.
class NearestPoint {
 public:
  NearestPoint(std::span<const Vec3f> positions, std::vector<std::uint32_t> points)
      : positions_(positions), points_(std::move(points)) {
    std::sort(points_.begin(), points_.end(), [&](std::uint32_t a, std::uint32_t b) {
      return std::pair(positions[a].x, a) < std::pair(positions[b].x, b);
    });
  }

  std::uint32_t operator()(const Vec3f& p) const {
    const auto middle = std::lower_bound(points_.begin(), points_.end(), p.x,
                                         [&](std::uint32_t v, float x) { return positions_[v].x < x; });
    std::uint32_t best = points_.front();
    double best_squared = std::numeric_limits<double>::infinity();
    const auto is_beyond = [&](std::uint32_t v) {
      const double dx = static_cast<double>(positions_[v].x) - static_cast<double>(p.x);
      if (dx * dx > best_squared) return true;
      const double squared = squared_distance(p, positions_[v]);
      if (squared < best_squared || (squared == best_squared && v < best)) {
        best_squared = squared;
        best = v;
      }
      return false;
    };
    for (auto up = middle; up != points_.end() && !is_beyond(*up); ++up) {
    }
    for (auto down = middle; down != points_.begin() && !is_beyond(*std::prev(down)); --down) {
    }
    return best;
  }

 private:
  std::span<const Vec3f> positions_;
  std::vector<std::uint32_t> points_;
};

/// What becomes of the merged vertices.
struct Thinning {
  std::vector<Triangle> triangles;            ///< Over the kept vertices.
  std::vector<std::uint32_t> kept;            ///< Merged vertices, ascending.
  std::vector<std::uint32_t> kept_of_merged;  ///< For each merged vertex an index into `kept`, near it.
  double distance_m = 0;
};

Thinning thinned_surface(const Merged& mesh, const std::vector<bool>& is_locked, std::size_t wanted_count) {
  Thinning result;
  result.triangles = simplified(mesh, is_locked, wanted_count);
  result.kept = used_vertices(result.triangles, mesh.positions.size());
  std::vector<std::uint32_t> index_of(mesh.positions.size(), kNone);
  std::vector<bool> is_kept(mesh.positions.size());
  std::vector<Vec3f> positions(result.kept.size());
  for (std::uint32_t k = 0; k < result.kept.size(); ++k) {
    index_of[result.kept[k]] = k;
    is_kept[result.kept[k]] = true;
    positions[k] = mesh.positions[result.kept[k]];
  }
  for (Triangle& t : result.triangles) t = {index_of[t[0]], index_of[t[1]], index_of[t[2]]};

  const Surface fine(mesh.positions, mesh.triangles);
  result.kept_of_merged = fine.nearest_seeds(is_kept);
  const NearestPoint nearest(mesh.positions, result.kept);
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    std::uint32_t& k = result.kept_of_merged[v];
    k = index_of[k != kNone ? k : nearest(mesh.positions[v])];
  }
  result.distance_m =
      kErrorMargin * two_sided_distance(fine, Surface(positions, result.triangles), result.kept_of_merged, result.kept);
  return result;
}

Thinning thinned_points(const Merged& cloud, std::size_t wanted_count) {
  std::vector<std::uint32_t> all(cloud.positions.size());
  std::iota(all.begin(), all.end(), 0u);
  const std::vector<std::uint32_t> standing = group_representatives(cloud.positions, all, wanted_count);
  Thinning result;
  result.kept_of_merged.resize(all.size());
  std::vector<std::uint32_t> index_of(all.size(), kNone);
  for (std::uint32_t v = 0; v < all.size(); ++v) {
    if (standing[v] != v) continue;
    index_of[v] = static_cast<std::uint32_t>(result.kept.size());
    result.kept.push_back(v);
  }
  double largest_squared = 0;
  for (std::uint32_t v = 0; v < all.size(); ++v) {
    result.kept_of_merged[v] = index_of[standing[v]];
    largest_squared = std::max(largest_squared, squared_distance(cloud.positions[v], cloud.positions[standing[v]]));
  }
  result.distance_m = std::sqrt(largest_squared);
  return result;
}

/// Where what a kept vertex stands for is shown: locked ones show themselves alone, so that a border has the same colours
/// on both sides, and hand the rest on to the nearest that is not.
std::vector<std::uint32_t> showing_vertices(const Thinning& thinning, const Merged& mesh,
                                            const std::vector<bool>& is_kept_locked) {
  std::vector<Vec3f> positions(thinning.kept.size());
  std::vector<bool> is_free(thinning.kept.size());
  for (std::size_t k = 0; k < positions.size(); ++k) {
    positions[k] = mesh.positions[thinning.kept[k]];
    is_free[k] = !is_kept_locked[k];
  }
  std::vector<std::uint32_t> result = Surface(positions, thinning.triangles).nearest_seeds(is_free);
  for (std::uint32_t k = 0; k < result.size(); ++k) {
    if (result[k] == kNone) result[k] = k;
  }
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
void show(Node& node, const Merged& mesh, const Thinning& thinning, const std::vector<bool>& is_locked,
          float median_celsius) {
  Tile& tile = *node.tile;
  const std::size_t count = thinning.kept.size();
  std::vector<bool> is_kept_locked(count);
  for (std::size_t k = 0; k < count; ++k) is_kept_locked[k] = is_locked[thinning.kept[k]];
  const std::vector<std::uint32_t> showing = showing_vertices(thinning, mesh, is_kept_locked);
  struct Colour {
    std::uint64_t r = 0, g = 0, b = 0, weight = 0;
  };
  std::vector<Colour> colours(count);
  tile.temperature_celsius.assign(count, std::numeric_limits<float>::quiet_NaN());
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    std::uint32_t k = thinning.kept_of_merged[v];
    if (thinning.kept[k] != v) k = showing[k];  // a kept vertex always counts for itself
    tile.temperature_celsius[k] =
        further_from(median_celsius, tile.temperature_celsius[k], mesh.temperature_celsius[v]);
    const std::uint64_t weight = mesh.weight[v];
    Colour& colour = colours[k];
    colour.r += weight * mesh.visible[v].r;
    colour.g += weight * mesh.visible[v].g;
    colour.b += weight * mesh.visible[v].b;
    colour.weight += weight;
  }
  tile.positions.reserve(count);
  tile.visible.reserve(count);
  tile.source_vertex.reserve(count);
  for (std::size_t k = 0; k < count; ++k) {
    const std::uint32_t v = thinning.kept[k];
    const Colour& colour = colours[k];
    const auto mean = [&](std::uint64_t sum) {
      return static_cast<std::uint8_t>((sum + colour.weight / 2) / colour.weight);
    };
    tile.positions.push_back(mesh.positions[v]);
    tile.visible.push_back({mean(colour.r), mean(colour.g), mean(colour.b)});
    tile.source_vertex.push_back(mesh.source_vertex[v]);
    node.sharing_level.push_back(mesh.sharing_level[v]);
    node.weight.push_back(static_cast<std::uint32_t>(std::min<std::uint64_t>(colour.weight, 0xffffffffu)));
  }
  tile.triangles = thinning.triangles;
  for (const auto& [at, celsius] :
       {std::pair(mesh.lowest_at, tile.lowest_celsius), std::pair(mesh.highest_at, tile.highest_celsius)}) {
    if (at == kNone) continue;
    show_extreme(tile, showing[thinning.kept_of_merged[at]], celsius, median_celsius, is_kept_locked);
  }
}

/// Makes the tile of a node from its children and lets go of what only this needed.
void make_parent(Node& node, bool is_point_cloud, const TreeOptions& options) {
  Tile& tile = *node.tile;
  TemperatureRange range;
  std::vector<Vec3f> corners;
  double children_error_m = 0;
  for (const Node* child : node.children) {
    const Tile& below = *child->tile;
    range = range.joined({below.lowest_celsius, below.highest_celsius});
    corners.push_back(below.bounds.min);
    corners.push_back(below.bounds.max);
    children_error_m = std::max(children_error_m, static_cast<double>(below.geometric_error_m));
    tile.child_mask |=
        static_cast<std::uint8_t>(1u << ((below.id.x & 1) | (below.id.y & 1) << 1 | (below.id.z & 1) << 2));
  }
  tile.lowest_celsius = range.lowest_celsius;
  tile.highest_celsius = range.highest_celsius;
  tile.bounds = bounds_of(corners);

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
  Thinning thinning =
      is_point_cloud ? thinned_points(mesh, wanted_count) : thinned_surface(mesh, is_locked, wanted_count);
  show(node, mesh, thinning, is_locked, options.median_celsius);
  tile.owned_count = static_cast<std::uint32_t>(tile.positions.size());
  if (options.position_steps != nullptr) options.position_steps->apply(tile);
  constexpr float kLargest = std::numeric_limits<float>::max();
  const double error_m = children_error_m + thinning.distance_m;
  tile.geometric_error_m =
      error_m < static_cast<double>(kLargest) ? std::nextafter(static_cast<float>(error_m), kLargest) : kLargest;
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
