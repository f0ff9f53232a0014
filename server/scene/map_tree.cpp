#include "server/scene/map_tree.hpp"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <deque>
#include <iterator>
#include <limits>
#include <map>
#include <mutex>
#include <set>
#include <tuple>
#include <utility>

#include "server/scene/box.hpp"
#include "server/scene/tile_place.hpp"
#include "server/scene/vertex_index_map.hpp"

namespace spectra::server {
namespace {

using fusion::Triangle;
using fusion::Vec3f;
using protocol::TileId;
using OctantContents = std::array<CellContent, 8>;

/// About what part of the making of leaves is their cutting.
constexpr double kCutShare = 0.4;

/// Where elements come from: a block that is put in, or a leaf of the version before.
struct Piece {
  std::span<const Vec3f> positions;
  std::span<const fusion::Rgb8> visible;
  std::span<const float> temperature_celsius;
  std::span<const StepHalvings> step_halvings;  ///< Empty: none are halved.
  std::span<const Triangle> triangles;
  std::span<const std::uint32_t> source_vertex;    ///< In the block; empty: the same number.
  std::span<const std::uint32_t> source_triangle;  ///< The same.
  std::span<const BlockNumber> vertex_block;       ///< Empty: all are of `block`.
  BlockNumber block = 0;

  std::uint32_t source_of_vertex(std::uint32_t v) const { return source_vertex.empty() ? v : source_vertex[v]; }
  std::uint32_t source_of_triangle(std::uint32_t t) const { return source_triangle.empty() ? t : source_triangle[t]; }
  BlockNumber block_of_vertex(std::uint32_t v) const { return vertex_block.empty() ? block : vertex_block[v]; }
  BlockNumber block_of_triangle(std::uint32_t t) const { return block_of_vertex(triangles[t][0]); }
};

/// What lies in cells: a triangle (at its centroid), or a vertex of no triangle.
struct Element {
  Vec3f place;
  std::uint32_t index = 0;  ///< In its piece, of the triangle or the vertex.
  std::uint32_t piece : 28 = 0;
  /// Bit k: corner k is the first in its block to use its vertex, which is therefore owned where this triangle is.
  /// kLoneVertex: the element is a vertex.
  std::uint32_t owned_corners : 4 = 0;

  static constexpr std::uint32_t kLoneVertex = 8;

  bool is_lone_vertex() const { return owned_corners == kLoneVertex; }
  CellContent content() const {
    // A lone vertex has one bit, too.
    return {is_lone_vertex() ? 0u : 1u, static_cast<std::uint64_t>(std::popcount(std::uint32_t{owned_corners}))};
  }
};

std::array<double, 3> coordinates(const Vec3f& v) {
  return {double{v.x}, double{v.y}, double{v.z}};
}

BlockNumber block_of(const Piece& piece, const Element& element) {
  return element.is_lone_vertex() ? piece.block_of_vertex(element.index) : piece.block_of_triangle(element.index);
}

CellContent content_of(std::span<const Element> elements) {
  CellContent sum;
  for (const Element& element : elements) sum += element.content();
  return sum;
}

Bounds bounds_of(std::span<const Element> elements) {
  Bounds bounds = empty_bounds();
  for (const Element& element : elements) include(bounds, element.place);
  return bounds;
}

Vec3f centroid(const Piece& piece, const Triangle& triangle) {
  const auto mean = [&](float Vec3f::*axis) {
    return static_cast<float>((double{piece.positions[triangle[0]].*axis} + double{piece.positions[triangle[1]].*axis} +
                               double{piece.positions[triangle[2]].*axis}) /
                              3);
  };
  return {mean(&Vec3f::x), mean(&Vec3f::y), mean(&Vec3f::z)};
}

/// The elements of a piece. `triangle_order`: its triangles in an order in which those of each block ascend; empty: as they are.
/// Vertices from `owned_count` on are owned elsewhere.
std::vector<Element> elements_of(const Piece& piece, std::uint32_t number, std::size_t owned_count,
                                 std::span<const std::uint32_t> triangle_order) {
  std::vector<Element> elements(piece.triangles.size());
  std::vector<bool> is_used(piece.positions.size());
  for (std::size_t i = 0; i < elements.size(); ++i) {
    const std::uint32_t t = triangle_order.empty() ? static_cast<std::uint32_t>(i) : triangle_order[i];
    Element& element = elements[i];
    element.place = centroid(piece, piece.triangles[t]);
    element.index = t;
    element.piece = number & 0xfffffffu;
    for (unsigned corner = 0; corner < 3; ++corner) {
      const std::uint32_t v = piece.triangles[t][corner];
      auto used = is_used[v];
      if (!used && v < owned_count) element.owned_corners |= 1u << corner;
      used = true;
    }
  }
  for (std::uint32_t v = 0; v < owned_count; ++v) {
    if (is_used[v]) continue;
    Element& element = elements.emplace_back();
    element.place = piece.positions[v];
    element.index = v;
    element.piece = number & 0xfffffffu;
    element.owned_corners = Element::kLoneVertex;
  }
  return elements;
}

/// Octants that become one child.
struct OctantGroup {
  unsigned octants = 0;  ///< Bit mask.
  CellContent count;
  unsigned heaviest = 0;  ///< Names the child.
};

int distance(const OctantGroup& a, const OctantGroup& b) {
  int smallest = 3;
  for (unsigned i = 0; i < 8; ++i) {
    for (unsigned j = 0; j < 8; ++j) {
      if ((a.octants >> i & 1) != 0 && (b.octants >> j & 1) != 0) smallest = std::min(smallest, std::popcount(i ^ j));
    }
  }
  return smallest;
}

/// Joins octants until none is small beside the leaf size.
std::vector<OctantGroup> octant_groups(const OctantContents& counts, std::uint64_t leaf_vertex_count,
                                       bool has_triangles) {
  std::vector<OctantGroup> groups;
  for (unsigned i = 0; i < 8; ++i) {
    if (!counts[i].is_empty()) groups.push_back({1u << i, counts[i], i});
  }
  const auto join = [&](std::size_t a, std::size_t b) {
    OctantGroup& into = groups[std::min(a, b)];
    const OctantGroup& from = groups[std::max(a, b)];
    if (counts[from.heaviest].owned_count > counts[into.heaviest].owned_count) into.heaviest = from.heaviest;
    into.octants |= from.octants;
    into.count += from.count;
    groups.erase(groups.begin() + static_cast<std::ptrdiff_t>(std::max(a, b)));
  };
  while (groups.size() > 1) {
    // Neighbours that fit into one leaf together, the lightest pair first.
    std::optional<std::tuple<std::uint64_t, std::size_t, std::size_t>> best;
    for (std::size_t a = 0; a < groups.size(); ++a) {
      for (std::size_t b = a + 1; b < groups.size(); ++b) {
        const std::uint64_t sum = groups[a].count.owned_count + groups[b].count.owned_count;
        if (sum > leaf_vertex_count || distance(groups[a], groups[b]) > 1) continue;
        if (!best || std::tuple(sum, a, b) < *best) best = {sum, a, b};
      }
    }
    if (best) {
      join(std::get<1>(*best), std::get<2>(*best));
      continue;
    }
    // A small one, with the nearest other.
    std::optional<std::pair<std::uint64_t, std::size_t>> smallest;
    for (std::size_t a = 0; a < groups.size(); ++a) {
      const bool is_bare = has_triangles && groups[a].count.triangle_count == 0;
      const bool is_small = 4 * groups[a].count.owned_count < leaf_vertex_count;
      if (!is_bare && !is_small) continue;
      const std::pair candidate(groups[a].count.owned_count, a);
      if (!smallest || candidate < *smallest) smallest = candidate;
    }
    if (!smallest) break;
    const std::size_t a = smallest->second;
    std::optional<std::tuple<int, std::uint64_t, std::size_t>> nearest;
    for (std::size_t b = 0; b < groups.size(); ++b) {
      if (b == a) continue;
      const std::tuple candidate(distance(groups[a], groups[b]), groups[b].count.owned_count, b);
      if (!nearest || candidate < *nearest) nearest = candidate;
    }
    join(a, std::get<2>(*nearest));
  }
  return groups;
}

/// Orders the elements of a leaf along a Morton curve through 16 x 16 x 16 cells of its box.
void sort_along_curve(std::span<Element> elements) {
  Bounds bounds = empty_bounds();
  for (const Element& element : elements) include(bounds, element.place);
  const auto low = coordinates(bounds.min), high = coordinates(bounds.max);
  std::array<double, 3> scale{};
  for (unsigned axis = 0; axis < 3; ++axis) {
    const double extent = high[axis] - low[axis];
    scale[axis] = extent > 0 ? 16 / extent : 0;
  }
  const auto cell_of = [&](const Element& element) {
    const auto p = coordinates(element.place);
    std::array<std::uint32_t, 3> cell{};
    for (unsigned axis = 0; axis < 3; ++axis) {
      const double position = (p[axis] - low[axis]) * scale[axis];
      cell[axis] = position > 0 ? static_cast<std::uint32_t>(std::min(position, 15.0)) : 0;
    }
    return static_cast<std::size_t>(morton_code(cell[0], cell[1], cell[2]));
  };
  std::vector<std::uint16_t> cells(elements.size());
  std::vector<std::uint32_t> next(4097);
  for (std::size_t i = 0; i < elements.size(); ++i) {
    const std::size_t cell = cell_of(elements[i]);
    cells[i] = static_cast<std::uint16_t>(cell);
    ++next[cell + 1];
  }
  for (std::size_t cell = 0; cell < 4096; ++cell) next[cell + 1] += next[cell];
  const std::vector<Element> unsorted(elements.begin(), elements.end());
  for (std::size_t i = 0; i < unsorted.size(); ++i) elements[next[cells[i]]++] = unsorted[i];
}

/// A cell of which the node is being made.
struct CellTask {
  std::shared_ptr<MapNode> node;
  std::shared_ptr<const MapNode> old;  ///< What the cell was before; null: all that lies in it is in `elements`.
  std::vector<Element> elements;       ///< That come in.
};

/// A leaf of which the tile is to be made.
struct LeafTask {
  std::shared_ptr<MapNode> node;
  std::vector<Element> elements;
};

/// What is left of a leaf that loses blocks, and what goes.
struct TouchedLeaf {
  std::vector<Element> kept, removed;
};

class TreeChange {
 public:
  TreeChange(const MapGrid& grid, const TileSizes& sizes, std::span<const BlockNumber> removed, const BlockNames& names,
             const std::function<void(double)>& made_share)
      : grid_(grid), sizes_(sizes), removed_(removed.begin(), removed.end()), names_(names), made_share_(made_share) {}

  ChangedTree run(const std::shared_ptr<const MapNode>& root, std::span<const BlockMesh> added, WorkerPool& pool) {
    if (root && !removed_.empty()) find_touched(root, pool);
    total_ = root ? root->content : CellContent{};
    if (root) total_ -= removed_content(root->id);
    std::vector<std::vector<Element>> parts(added.size());
    std::vector<std::uint32_t> numbers;
    for (const BlockMesh& block : added) numbers.push_back(add_piece(piece_of(block)));
    pool.for_each(added.size(), [&](std::size_t i) {
      parts[i] = elements_of(pieces_[numbers[i]], numbers[i], added[i].mesh->vertex_count(), {});
    });
    std::vector<Element> incoming;
    if (parts.size() == 1) {
      incoming = std::move(parts[0]);
    } else {
      for (const auto& part : parts) incoming.insert(incoming.end(), part.begin(), part.end());
    }
    total_ += content_of(incoming);
    ChangedTree result;
    if (total_.is_empty()) {
      if (root) drop_leaves(root);
      result.dropped_leaves = std::move(dropped_);
      return result;
    }
    if (root && incoming.empty() && removed_.empty()) {
      result.root = root;
      return result;
    }
    auto top = std::make_shared<MapNode>();
    result.root = top;
    cut(std::move(top), root, std::move(incoming), pool);
    result.made = std::move(made_);
    result.dropped_leaves = std::move(dropped_);
    return result;
  }

 private:
  static Piece piece_of(const BlockMesh& block) {
    return {.positions = block.mesh->positions(),
            .visible = block.mesh->visible(),
            .temperature_celsius = block.mesh->temperature_celsius(),
            .step_halvings = block.step_halvings,
            .triangles = block.mesh->triangles(),
            .source_vertex = {},
            .source_triangle = {},
            .vertex_block = {},
            .block = block.number};
  }

  static Piece piece_of(const Tile& tile) {
    return {.positions = tile.positions,
            .visible = tile.visible,
            .temperature_celsius = tile.temperature_celsius,
            .step_halvings = tile.step_halvings,
            .triangles = tile.triangles,
            .source_vertex = tile.source_vertex,
            .source_triangle = tile.source_triangle,
            .vertex_block = tile.vertex_block,
            .block = tile.block};
  }

  std::uint32_t add_piece(const Piece& piece) {
    const std::lock_guard lock(mutex_);
    pieces_.push_back(piece);
    return static_cast<std::uint32_t>(pieces_.size() - 1);
  }

  const Piece& piece(std::uint32_t number) const {
    const std::lock_guard lock(mutex_);
    return pieces_[number];
  }

  bool is_removed(BlockNumber block) const { return removed_.contains(block); }

  std::vector<Element> elements_of_leaf(const MapNode& leaf) {
    const Tile& tile = *leaf.tile;
    const std::uint32_t number = add_piece(piece_of(tile));
    const Piece& its_piece = piece(number);
    std::vector<std::uint32_t> order(tile.triangles.size());
    for (std::uint32_t t = 0; t < order.size(); ++t) order[t] = t;
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      return std::pair(its_piece.block_of_triangle(a), tile.source_triangle[a]) <
             std::pair(its_piece.block_of_triangle(b), tile.source_triangle[b]);
    });
    return elements_of(its_piece, number, tile.owned_count, order);
  }

  // Before anything else: which leaves lose something, and what.

  void find_touched(const std::shared_ptr<const MapNode>& root, WorkerPool& pool) {
    std::vector<std::shared_ptr<const MapNode>> leaves;
    collect_touched(root, leaves);
    std::vector<TouchedLeaf> parts(leaves.size());
    pool.for_each(leaves.size(), [&](std::size_t i) {
      for (const Element& element : elements_of_leaf(*leaves[i])) {
        const bool goes = is_removed(block_of(piece(element.piece), element));
        (goes ? parts[i].removed : parts[i].kept).push_back(element);
      }
    });
    for (std::size_t i = 0; i < leaves.size(); ++i) {
      const CellContent gone = content_of(parts[i].removed);
      for (TileId id = leaves[i]->id;; id = parent_of(id)) {
        removed_below_[id] += gone;
        if (id.level == 0) break;
      }
      touched_.emplace(leaves[i].get(), std::move(parts[i]));
    }
  }

  void collect_touched(const std::shared_ptr<const MapNode>& node,
                       std::vector<std::shared_ptr<const MapNode>>& leaves) const {
    if (!node->is_leaf()) {
      for (const auto& branch : node->branches) collect_touched(branch.node, leaves);
    } else if (std::any_of(node->blocks.begin(), node->blocks.end(),
                           [this](BlockNumber block) { return is_removed(block); })) {
      leaves.push_back(node);
    }
  }

  CellContent removed_content(const TileId& id) const {
    const auto found = removed_below_.find(id);
    return found == removed_below_.end() ? CellContent{} : found->second;
  }
  bool is_touched(const TileId& id) const { return removed_below_.contains(id); }

  bool is_leaf(const CellContent& content, int level) const {
    if (level >= kDeepestLevel) return true;
    if (content.owned_count > sizes_.root_vertex_count && content == total_) return false;
    return 4 * content.owned_count <= 5 * std::uint64_t{sizes_.leaf_vertex_count};
  }

  /// Appends what stays of all that lies beneath a node, if it lies in one of these octants of a cell; its leaves are dropped.
  void take_all(const std::shared_ptr<const MapNode>& node, const std::array<double, 3>& middle, unsigned octants,
                std::vector<Element>& to) {
    if (!node->is_leaf()) {
      for (const auto& branch : node->branches) take_all(branch.node, middle, octants, to);
      return;
    }
    const auto touched = touched_.find(node.get());
    const std::vector<Element> fresh = touched == touched_.end() ? elements_of_leaf(*node) : std::vector<Element>();
    for (const Element& element : touched == touched_.end() ? fresh : touched->second.kept) {
      if ((octants >> octant_at(middle, element.place) & 1) != 0) to.push_back(element);
    }
  }

  void drop_leaves(const std::shared_ptr<const MapNode>& node) {
    if (node->is_leaf()) {
      const std::lock_guard lock(mutex_);
      dropped_.push_back(node);
    }
    for (const auto& branch : node->branches) drop_leaves(branch.node);
  }

  /// Makes all nodes from the root down.
  void cut(std::shared_ptr<MapNode> top, const std::shared_ptr<const MapNode>& root, std::vector<Element> incoming,
           WorkerPool& pool) {
    std::vector<CellTask> tasks;
    tasks.push_back({std::move(top), root, std::move(incoming)});
    std::vector<LeafTask> leaves;
    while (!tasks.empty()) {
      std::vector<std::vector<CellTask>> next(tasks.size());
      std::vector<std::vector<LeafTask>> found(tasks.size());
      std::vector<std::vector<std::shared_ptr<MapNode>>> above(tasks.size());
      pool.for_each(tasks.size(), [&](std::size_t i) { cut_cell(tasks[i], above[i], next[i], found[i]); });
      for (auto& some : above) std::move(some.begin(), some.end(), std::back_inserter(made_));
      for (CellTask& task : tasks) made_.push_back(std::move(task.node));
      tasks.clear();
      for (auto& some : next) std::move(some.begin(), some.end(), std::back_inserter(tasks));
      for (auto& some : found) std::move(some.begin(), some.end(), std::back_inserter(leaves));
    }
    std::atomic<std::size_t> made_count{0};
    pool.for_each(leaves.size(), [&](std::size_t i) {
      make_leaf(*leaves[i].node, leaves[i].elements);
      leaves[i].elements = {};
      const double share = static_cast<double>(++made_count) / static_cast<double>(leaves.size());
      if (made_share_) made_share_(kCutShare + (1 - kCutShare) * share);
    });
    std::sort(made_.begin(), made_.end(), [](const auto& a, const auto& b) { return is_before(a->id, b->id); });
    for (auto node = made_.rbegin(); node != made_.rend(); ++node) complete(**node);
  }

  static void complete(MapNode& node) {
    if (node.is_leaf()) return;
    node.bounds = empty_bounds();
    node.content = {};
    for (const CellContent& octant : node.octants) node.content += octant;
    for (const auto& branch : node.branches) {
      include(node.bounds, branch.node->bounds.min);
      include(node.bounds, branch.node->bounds.max);
    }
  }

  void cut_cell(CellTask& task, std::vector<std::shared_ptr<MapNode>>& above, std::vector<CellTask>& next,
                std::vector<LeafTask>& leaves) {
    const TileId id = task.node->id;
    constexpr unsigned kAllOctants = 0xff;
    std::array<double, 3> middle = grid_.middle_of(id);
    const std::shared_ptr<const MapNode> old = std::exchange(task.old, nullptr);
    if (old && old->is_leaf()) {
      take_all(old, middle, kAllOctants, task.elements);
      drop_leaves(old);
    } else if (old) {
      CellContent content = old->content;
      content -= removed_content(old->id);
      content += content_of(task.elements);
      if (!is_leaf(content, id.level)) return cut_changed(task, old, middle, next);
      take_all(old, middle, kAllOctants, task.elements);
      drop_leaves(old);
    }
    const CellContent content = content_of(task.elements);
    const Bounds bounds = bounds_of(task.elements);
    while (!is_leaf(content, task.node->id.level) && octant_at(middle, bounds.min) == octant_at(middle, bounds.max)) {
      // All of it lies in one octant.
      const unsigned octant = octant_at(middle, bounds.min);
      auto child = std::make_shared<MapNode>();
      child->id = child_of(task.node->id, octant);
      middle = grid_.middle_of(child->id);
      task.node->octants[octant] = content;
      task.node->branches.push_back({1u << octant, child});
      above.push_back(std::exchange(task.node, std::move(child)));
    }
    if (is_leaf(content, task.node->id.level)) {
      leaves.push_back({task.node, std::move(task.elements)});
      return;
    }
    OctantContents contents{};
    for (const Element& element : task.elements) contents[octant_at(middle, element.place)] += element.content();
    distribute(task, contents, nullptr, middle, next);
  }

  /// A cell that was cut before and still is.
  void cut_changed(CellTask& task, const std::shared_ptr<const MapNode>& old, const std::array<double, 3>& middle,
                   std::vector<CellTask>& next) {
    OctantContents contents = old->octants;
    for (const auto& branch : old->branches) {
      if (is_touched(branch.node->id)) subtract_removed(branch.node, middle, contents);
    }
    for (const Element& element : task.elements) contents[octant_at(middle, element.place)] += element.content();
    distribute(task, contents, old, middle, next);
  }

  void subtract_removed(const std::shared_ptr<const MapNode>& node, const std::array<double, 3>& middle,
                        OctantContents& contents) const {
    if (!is_touched(node->id)) return;
    for (const auto& branch : node->branches) subtract_removed(branch.node, middle, contents);
    if (!node->is_leaf()) return;
    for (const Element& element : touched_.at(node.get()).removed) {
      contents[octant_at(middle, element.place)] -= element.content();
    }
  }

  void distribute(CellTask& task, const OctantContents& contents, const std::shared_ptr<const MapNode>& old,
                  const std::array<double, 3>& middle, std::vector<CellTask>& next) {
    MapNode& node = *task.node;
    node.octants = contents;
    CellContent sum;
    for (const CellContent& octant : contents) sum += octant;
    // Not all of them may become one again.
    const std::uint64_t most = std::min<std::uint64_t>(sizes_.leaf_vertex_count, sum.owned_count / 2);
    const std::vector<OctantGroup> groups = octant_groups(contents, most, total_.triangle_count > 0);
    std::array<std::size_t, 8> group_of{};
    for (std::size_t g = 0; g < groups.size(); ++g) {
      for (unsigned octant = 0; octant < 8; ++octant) {
        if ((groups[g].octants >> octant & 1) != 0) group_of[octant] = g;
      }
    }
    std::vector<std::vector<Element>> parts(groups.size());
    if (groups.size() == 1) {
      parts[0] = std::move(task.elements);
    } else {
      std::vector<std::size_t> counts(groups.size());
      for (const Element& element : task.elements) ++counts[group_of[octant_at(middle, element.place)]];
      for (std::size_t g = 0; g < groups.size(); ++g) parts[g].reserve(counts[g]);
      for (const Element& element : task.elements) parts[group_of[octant_at(middle, element.place)]].push_back(element);
      task.elements = {};
    }
    std::vector<bool> is_kept(old ? old->branches.size() : 0);  // In the new tree, or to be taken from by its task.
    for (std::size_t g = 0; g < groups.size(); ++g) {
      const OctantGroup& group = groups[g];
      const TileId id = child_of(node.id, group.heaviest);
      std::shared_ptr<const MapNode> same;
      unsigned same_octants = 0;
      for (std::size_t b = 0; old && b < old->branches.size(); ++b) {
        const MapNode::Branch& branch = old->branches[b];
        if (branch.node->id != id || (branch.octants & ~group.octants) != 0) continue;
        same = branch.node;
        same_octants = branch.octants;
        is_kept[b] = true;
      }
      for (std::size_t b = 0; old && b < old->branches.size(); ++b) {
        const MapNode::Branch& branch = old->branches[b];
        const unsigned taken = branch.octants & group.octants & ~same_octants;
        if (taken != 0) take_all(branch.node, middle, taken, parts[g]);
      }
      if (same && parts[g].empty() && !is_touched(id) && is_leaf(group.count, id.level) == same->is_leaf()) {
        node.branches.push_back({group.octants, same});
        continue;
      }
      auto child = std::make_shared<MapNode>();
      child->id = id;
      node.branches.push_back({group.octants, child});
      next.push_back({std::move(child), same, std::move(parts[g])});
    }
    for (std::size_t b = 0; b < is_kept.size(); ++b) {
      if (!is_kept[b]) drop_leaves(old->branches[b].node);
    }
  }

  /// In the order of names, as their blocks have them, triangles before vertices of none.
  void put_in_order(std::vector<Element>& elements) const {
    struct Key {
      const std::string* name;
      bool is_lone;
      std::uint32_t source;
      Element element;
    };
    std::vector<Key> keys;
    keys.reserve(elements.size());
    for (const Element& element : elements) {
      const Piece& its = piece(element.piece);
      const std::uint32_t source =
          element.is_lone_vertex() ? its.source_of_vertex(element.index) : its.source_of_triangle(element.index);
      keys.push_back({&names_.at(block_of(its, element)), element.is_lone_vertex(), source, element});
    }
    std::sort(keys.begin(), keys.end(), [](const Key& a, const Key& b) {
      if (a.name != b.name) return *a.name < *b.name;
      return std::pair(a.is_lone, a.source) < std::pair(b.is_lone, b.source);
    });
    for (std::size_t i = 0; i < keys.size(); ++i) elements[i] = keys[i].element;
  }

  void make_leaf(MapNode& node, std::vector<Element>& elements) const {
    const bool is_of_one_new_piece =
        std::all_of(elements.begin(), elements.end(),
                    [&](const Element& element) { return element.piece == elements.front().piece; }) &&
        (elements.empty() || piece(elements.front().piece).source_triangle.empty());
    if (!is_of_one_new_piece) put_in_order(elements);
    node.content = content_of(elements);
    node.bounds = bounds_of(elements);
    sort_along_curve(elements);
    auto tile = leaf_tile(node.id, elements);
    node.blocks.assign(1, tile->block);
    if (!tile->vertex_block.empty()) {
      node.blocks = tile->vertex_block;
      std::sort(node.blocks.begin(), node.blocks.end());
      node.blocks.erase(std::unique(node.blocks.begin(), node.blocks.end()), node.blocks.end());
    }
    node.facts = leaf_facts(*tile);
    node.tile = std::move(tile);
  }

  /// Copies a leaf out of its pieces.
  std::shared_ptr<Tile> leaf_tile(const TileId& id, std::span<const Element> elements) const {
    auto tile = std::make_shared<Tile>();
    tile->id = id;
    const CellContent content = content_of(elements);
    struct Vertex {
      const Piece* piece;
      std::uint32_t index;
    };
    std::vector<Vertex> vertices;
    vertices.reserve(content.owned_count);
    VertexIndexMap index_of(content.triangle_count == 0 ? 0 : content.owned_count + content.owned_count / 16);
    const auto key_of = [](const Piece& its, std::uint32_t v) {
      return std::uint64_t{its.block_of_vertex(v)} << 32 | its.source_of_vertex(v);
    };
    std::uint32_t last_number = 0xffffffffu;
    const Piece* last = nullptr;
    const auto piece_at = [&](const Element& element) -> const Piece& {
      if (element.piece != last_number) {
        last_number = element.piece;
        last = &piece(element.piece);
      }
      return *last;
    };
    for (const Element& element : elements) {
      if (element.is_lone_vertex()) continue;
      const Piece& its = piece_at(element);
      for (unsigned corner = 0; corner < 3; ++corner) {
        if ((element.owned_corners >> corner & 1) == 0) continue;
        const std::uint32_t v = its.triangles[element.index][corner];
        index_of.find_or_insert(key_of(its, v), static_cast<std::uint32_t>(vertices.size()));
        vertices.push_back({&its, v});
      }
    }
    const std::size_t referenced_count = vertices.size();
    for (const Element& element : elements) {
      if (element.is_lone_vertex()) vertices.push_back({&piece_at(element), element.index});
    }
    tile->owned_count = static_cast<std::uint32_t>(vertices.size());
    tile->triangles.reserve(content.triangle_count);
    tile->source_triangle.reserve(content.triangle_count);
    for (const Element& element : elements) {
      if (element.is_lone_vertex()) continue;
      const Piece& its = piece_at(element);
      Triangle triangle{};
      for (unsigned corner = 0; corner < 3; ++corner) {
        const std::uint32_t v = its.triangles[element.index][corner];
        const auto next = static_cast<std::uint32_t>(vertices.size());
        triangle[corner] = index_of.find_or_insert(key_of(its, v), next);
        if (triangle[corner] == next) vertices.push_back({&its, v});
      }
      tile->triangles.push_back(triangle);
      tile->source_triangle.push_back(its.source_of_triangle(element.index));
    }
    copy_vertices(vertices, *tile);
    tile->bounds = server::bounds_of(tile->positions);
    // The vertices that are drawn: all but the lone ones of a scene with triangles.
    const std::size_t lone_begin = content.triangle_count == 0 ? tile->owned_count : referenced_count;
    const TemperatureRange range =
        temperature_range(std::span(tile->temperature_celsius).first(lone_begin))
            .joined(temperature_range(std::span(tile->temperature_celsius).subspan(tile->owned_count)));
    tile->lowest_celsius = range.lowest_celsius;
    if (std::isnan(range.lowest_celsius)) tile->temperature_error_celsius = range.lowest_celsius;
    tile->highest_celsius = range.highest_celsius;
    return tile;
  }

  template <class Vertices>
  static void copy_vertices(const Vertices& vertices, Tile& tile) {
    const std::size_t count = vertices.size();
    tile.positions.resize(count);
    tile.visible.resize(count);
    tile.temperature_celsius.resize(count);
    tile.source_vertex.resize(count);
    bool is_any_halved = false, is_of_one_block = true;
    if (count > 0) tile.block = vertices[0].piece->block_of_vertex(vertices[0].index);
    for (std::size_t v = 0; v < count; ++v) {
      const auto& [piece, index] = vertices[v];
      tile.positions[v] = piece->positions[index];
      tile.visible[v] = piece->visible[index];
      tile.temperature_celsius[v] = piece->temperature_celsius[index];
      tile.source_vertex[v] = piece->source_of_vertex(index);
      is_any_halved = is_any_halved || (!piece->step_halvings.empty() && piece->step_halvings[index] != StepHalvings{});
      is_of_one_block = is_of_one_block && piece->block_of_vertex(index) == tile.block;
    }
    if (is_any_halved) {
      tile.step_halvings.resize(count);
      for (std::size_t v = 0; v < count; ++v) {
        const auto& [piece, index] = vertices[v];
        if (!piece->step_halvings.empty()) tile.step_halvings[v] = piece->step_halvings[index];
      }
    }
    if (!is_of_one_block) {
      tile.vertex_block.resize(count);
      for (std::size_t v = 0; v < count; ++v) {
        tile.vertex_block[v] = vertices[v].piece->block_of_vertex(vertices[v].index);
      }
    }
  }

  const MapGrid& grid_;
  const TileSizes& sizes_;
  const std::set<BlockNumber> removed_;
  const BlockNames& names_;
  const std::function<void(double)>& made_share_;
  CellContent total_;  ///< Of the whole map, in the end.

  mutable std::mutex mutex_;  ///< Of the next two.
  std::deque<Piece> pieces_;
  std::vector<std::shared_ptr<const MapNode>> dropped_;

  std::map<const MapNode*, TouchedLeaf> touched_;
  std::map<TileId, CellContent> removed_below_;  ///< Of the touched leaves and of all nodes above them.
  std::vector<std::shared_ptr<MapNode>> made_;
};

void collect_leaves(const std::shared_ptr<const MapNode>& node, std::vector<std::shared_ptr<const MapNode>>& leaves) {
  if (node->is_leaf()) leaves.push_back(node);
  for (const auto& branch : node->branches) collect_leaves(branch.node, leaves);
}

}  // namespace

CellContent& CellContent::operator+=(const CellContent& other) {
  triangle_count += other.triangle_count;
  owned_count += other.owned_count;
  return *this;
}

CellContent& CellContent::operator-=(const CellContent& other) {
  triangle_count -= other.triangle_count;
  owned_count -= other.owned_count;
  return *this;
}

ChangedTree changed_tree(const std::shared_ptr<const MapNode>& root, const MapGrid& grid, const TileSizes& sizes,
                         std::span<const BlockNumber> removed, std::span<const BlockMesh> added,
                         const BlockNames& names, WorkerPool& pool, const std::function<void(double)>& made_share) {
  return TreeChange(grid, sizes, removed, names, made_share).run(root, added, pool);
}

std::vector<std::shared_ptr<const MapNode>> leaves_of(const std::shared_ptr<const MapNode>& root) {
  std::vector<std::shared_ptr<const MapNode>> leaves;
  if (root) collect_leaves(root, leaves);
  std::sort(leaves.begin(), leaves.end(), [](const auto& a, const auto& b) { return is_before(a->id, b->id); });
  return leaves;
}

std::shared_ptr<const MapNode> top_of(const std::shared_ptr<const MapNode>& root) {
  std::shared_ptr<const MapNode> top = root;
  while (top && top->branches.size() == 1) top = top->branches.front().node;
  return top;
}

}  // namespace spectra::server
