#include "server/map/map_tree.hpp"

#include <algorithm>
#include <atomic>
#include <iterator>
#include <map>
#include <mutex>
#include <set>
#include <utility>

#include "fusion/base/box.hpp"
#include "server/map/map_elements.hpp"
#include "server/map/octant_groups.hpp"
#include "server/map/tile_place.hpp"

namespace spectra::map {
namespace {

using protocol::TileId;

/// About what part of the making of leaves is their cutting.
constexpr double kCutShare = 0.4;

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
  TreeChange(const MapGrid& grid, const TileSizes& sizes, std::span<const BlockNumber> removed,
             const BlockLabels& labels, std::function<void(double)> made_share)
      : grid_(grid),
        sizes_(sizes),
        removed_(removed.begin(), removed.end()),
        labels_(labels),
        made_share_(std::move(made_share)) {}

  ChangedTree run(const std::shared_ptr<const MapNode>& root, std::span<const BlockMesh> added,
                  jobs::WorkerPool& pool) {
    if (root && !removed_.empty()) find_touched(root, pool);
    total_before_ = total_ = root ? root->content : CellContent{};
    if (root) total_ -= removed_content(root->id);
    std::vector<std::vector<Element>> parts(added.size());
    std::vector<std::uint32_t> numbers;
    for (const BlockMesh& block : added) numbers.push_back(pieces_.add(piece_of(block)));
    pool.for_each(added.size(), [&](std::size_t i) {
      parts[i] = elements_of(pieces_[numbers[i]], numbers[i], added[i].mesh->vertex_count(), {}, labels_);
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
    return cut(root, std::move(incoming), pool);
  }

  ChangedTree run_anew(const std::shared_ptr<const MapNode>& root, jobs::WorkerPool& pool) {
    total_before_ = total_ = root->content;
    std::vector<Element> incoming;
    for (const auto& leaf : leaves_of(root)) {
      const std::vector<Element> part = elements_of_leaf(*leaf);
      incoming.insert(incoming.end(), part.begin(), part.end());
    }
    return cut(nullptr, std::move(incoming), pool);
  }

 private:
  ChangedTree cut(const std::shared_ptr<const MapNode>& root, std::vector<Element> incoming, jobs::WorkerPool& pool) {
    ChangedTree result;
    auto top = std::make_shared<MapNode>();
    result.root = top;
    cut(std::move(top), root, std::move(incoming), pool);
    result.made = std::move(made_);
    result.dropped_leaves = std::move(dropped_);
    return result;
  }

  static Piece piece_of(const BlockMesh& block) {
    return {.positions = block.mesh->positions(),
            .visible = block.mesh->visible(),
            .temperature_celsius = block.mesh->temperature_celsius(),
            .step_halvings = block.step_halvings,
            .triangles = block.mesh->triangles(),
            .source_vertex = {},
            .source_triangle = {},
            .vertex_block = {},
            .block = block.number,
            .baseline_celsius = block.baseline.celsius,
            .baseline_at = block.baseline.at,
            .baseline_times = nullptr,
            .sigma_kelvin = block.mesh->confidence.sigma_kelvin,
            .looked_at = block.mesh->confidence.looked_at,
            .looked_times = nullptr};
  }

  Piece piece_of(const Tile& tile) const {
    const bool is_kept = tile.baseline_mark == labels_.baseline_mark;
    return {.positions = tile.positions,
            .visible = tile.visible,
            .temperature_celsius = tile.temperature_celsius,
            .step_halvings = tile.step_halvings,
            .triangles = tile.triangles,
            .source_vertex = tile.source_vertex,
            .source_triangle = tile.source_triangle,
            .vertex_block = tile.vertex_block,
            .block = tile.block,
            .baseline_celsius = is_kept ? std::span<const float>(tile.baseline_celsius) : std::span<const float>(),
            .baseline_at = {},
            .baseline_times = &tile.baseline_at,
            .sigma_kelvin = tile.sigma_kelvin,
            .looked_at = {},
            .looked_times = &tile.looked_at};
  }

  bool is_removed(BlockNumber block) const { return removed_.contains(block); }

  std::vector<Element> elements_of_leaf(const MapNode& leaf) {
    const Tile& tile = *leaf.tile;
    const std::uint32_t number = pieces_.add(piece_of(tile));
    const Piece& its_piece = pieces_[number];
    std::vector<std::uint32_t> order(tile.triangles.size());
    for (std::uint32_t t = 0; t < order.size(); ++t) order[t] = t;
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      return std::pair(its_piece.block_of_triangle(a), tile.source_triangle[a]) <
             std::pair(its_piece.block_of_triangle(b), tile.source_triangle[b]);
    });
    return elements_of(its_piece, number, tile.owned_count, order, labels_);
  }

  // Before anything else: which leaves lose something, and what.

  void find_touched(const std::shared_ptr<const MapNode>& root, jobs::WorkerPool& pool) {
    std::vector<std::shared_ptr<const MapNode>> leaves;
    collect_touched(root, leaves);
    std::vector<TouchedLeaf> parts(leaves.size());
    pool.for_each(leaves.size(), [&](std::size_t i) {
      PieceCursor piece_of(pieces_);
      for (const Element& element : elements_of_leaf(*leaves[i])) {
        const bool goes = is_removed(block_of(piece_of(element), element));
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
    if (level < sizes_.first_leaf_level) return false;
    if (content.owned_count > sizes_.root_vertex_count && content == total_) return false;
    return 4 * content.owned_count <= 5 * std::uint64_t{sizes_.leaf_size(content)};
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
           jobs::WorkerPool& pool) {
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
    node.bounds = base::empty_bounds();
    node.content = {};
    for (const CellContent& octant : node.octants) node.content += octant;
    for (const auto& branch : node.branches) {
      base::include(node.bounds, branch.node->bounds.min);
      base::include(node.bounds, branch.node->bounds.max);
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
    const base::Bounds bounds = bounds_of(task.elements);
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
    const bool is_apart = node.id.level < sizes_.first_leaf_level;
    const auto leaf_size = [this, is_apart, most = sum.owned_count / 2](const CellContent& content) {
      return is_apart ? 0 : std::min<std::uint64_t>(sizes_.leaf_size(content), most);
    };
    const std::vector<OctantGroup> groups = octant_groups(contents, leaf_size, total_.triangle_count > 0);
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
      // What was all of the map and is not any more, or the other way round, is cut by another rule further down.
      const bool is_other_rule = group.count.owned_count > sizes_.root_vertex_count &&
                                 (group.count == total_) != (group.count == total_before_);
      if (same && parts[g].empty() && !is_touched(id) && !is_other_rule &&
          is_leaf(group.count, id.level) == same->is_leaf()) {
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

  void make_leaf(MapNode& node, std::vector<Element>& elements) const {
    node.content = content_of(elements);
    node.bounds = bounds_of(elements);
    auto tile = leaf_tile(node.id, elements, pieces_, labels_);
    node.blocks.assign(1, tile->block);
    if (!tile->vertex_block.empty()) {
      node.blocks = tile->vertex_block;
      std::sort(node.blocks.begin(), node.blocks.end());
      node.blocks.erase(std::unique(node.blocks.begin(), node.blocks.end()), node.blocks.end());
    }
    node.facts = leaf_facts(*tile);
    node.tile = std::move(tile);
  }

  const MapGrid& grid_;
  const TileSizes& sizes_;
  const std::set<BlockNumber> removed_;
  const BlockLabels& labels_;
  const std::function<void(double)> made_share_;
  CellContent total_;         ///< Of the whole map, in the end.
  CellContent total_before_;  ///< The same before the change.

  Pieces pieces_;
  std::mutex mutex_;  ///< Of the next.
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

ChangedTree changed_tree(const std::shared_ptr<const MapNode>& root, const MapGrid& grid, const TileSizes& sizes,
                         std::span<const BlockNumber> removed, std::span<const BlockMesh> added,
                         const BlockLabels& labels, jobs::WorkerPool& pool,
                         const std::function<void(double)>& made_share) {
  return TreeChange(grid, sizes, removed, labels, made_share).run(root, added, pool);
}

ChangedTree cut_anew(const std::shared_ptr<const MapNode>& root, const MapGrid& grid, const TileSizes& sizes,
                     const BlockLabels& labels, jobs::WorkerPool& pool) {
  return TreeChange(grid, sizes, {}, labels, {}).run_anew(root, pool);
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

}  // namespace spectra::map
