#include "server/map/coarse_levels.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "fusion/mesh/surface.hpp"
#include "server/map/leaf_facts.hpp"
#include "server/map/tile_place.hpp"

namespace spectra::map {
namespace {

using base::Vec3f;
using protocol::TileId;

/// The median of all finite temperatures, the lower one of an even number, NaN without any; and between which nearly all
/// lie, at least a degree apart: noise of a scene of one temperature is no contrast.
std::pair<float, double> temperature_spread(std::span<const std::shared_ptr<const MapNode>> leaves) {
  std::vector<float> finite;
  for (const auto& leaf : leaves) {
    for (const float t : owned_temperature(*leaf->tile)) {
      if (std::isfinite(t)) finite.push_back(t);
    }
  }
  if (finite.empty()) return {std::numeric_limits<float>::quiet_NaN(), 1};
  const auto at = [&](double share) {
    const auto place = finite.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(finite.size() - 1));
    std::nth_element(finite.begin(), place, finite.end());
    return *place;
  };
  const double low = double{at(0.005)}, high = double{at(0.995)};
  return {at(0.5), std::max(high - low, 1.0)};
}

void collect_inner(const std::shared_ptr<const MapNode>& node, std::set<TileId>& ids) {
  if (node->is_leaf()) return;
  ids.insert(node->id);
  for (const auto& branch : node->branches) collect_inner(branch.node, ids);
}

/// The node of a cell; null when there is none.
std::shared_ptr<const MapNode> node_at(std::shared_ptr<const MapNode> node, const TileId& id) {
  while (node && node->id != id) {
    const auto leads_there = [&](const MapNode::Branch& branch) {
      return branch.node->id.level <= id.level && common_ancestor(branch.node->id, id) == branch.node->id;
    };
    const auto branch = std::find_if(node->branches.begin(), node->branches.end(), leads_there);
    node = branch == node->branches.end() ? nullptr : branch->node;
  }
  return node;
}

/// A tree with another node in the place of its cell.
std::shared_ptr<const MapNode> with_node(const std::shared_ptr<const MapNode>& root,
                                         const std::shared_ptr<const MapNode>& node) {
  if (root->id == node->id) return node;
  auto copy = std::make_shared<MapNode>(*root);
  for (MapNode::Branch& branch : copy->branches) {
    if (common_ancestor(branch.node->id, node->id) == branch.node->id) branch.node = with_node(branch.node, node);
  }
  return copy;
}

bool have_same_branches(const MapNode& a, const MapNode& b) {
  return std::equal(a.branches.begin(), a.branches.end(), b.branches.begin(), b.branches.end(),
                    [](const MapNode::Branch& one, const MapNode::Branch& other) {
                      return one.octants == other.octants && one.node->id == other.node->id;
                    });
}

double diagonal(const base::Bounds& bounds) {
  return std::sqrt(mesh::squared_distance(bounds.min, bounds.max));
}

std::uint8_t child_mask_of(const MapNode& node) {
  std::uint8_t mask = 0;
  for (const MapNode::Branch& branch : node.branches) {
    mask |= static_cast<std::uint8_t>(1u << octant_of(branch.node->id));
  }
  return mask;
}

void take_tile(MapNode& node, const MapNode& from) {
  node.tile = from.tile;
  node.weight = from.weight;
  node.samples = from.samples;
  node.is_top = from.is_top;
}

/// Of a tile that says nothing of its colours.
constexpr float kAnyLevel = 255;

/// Of two temperatures beneath a node or of a tile; NaN where there is none.
float largest_difference_celsius(const std::shared_ptr<const MapNode>& node, const Tile& tile) {
  TemperatureRange range{tile.lowest_celsius, tile.highest_celsius};
  for (const auto& leaf : leaves_of(node)) {
    range = range.joined({leaf->tile->lowest_celsius, leaf->tile->highest_celsius});
  }
  if (std::isnan(range.lowest_celsius)) return range.lowest_celsius;
  constexpr float kMost = 1e30F;  // Where one is beyond the sensor's range.
  const float difference = range.highest_celsius - range.lowest_celsius;
  return std::isfinite(difference) ? difference : kMost;
}

/// What was seen of a cell before stays until its tile is made.
void take_tile_of_before(const std::shared_ptr<MapNode>& node, const MapNode& before) {
  take_tile(*node, before);
  const std::uint8_t mask = child_mask_of(*node);
  const bool was_full = before.is_leaf() || before.tile->colour_error_levels >= kAnyLevel;
  if (before.tile->child_mask == mask && !was_full) return;
  const auto tile = std::make_shared<Tile>(*before.tile);
  tile->child_mask = mask;
  if (was_full) {
    // It was the full mesh and is not any more: nobody who looks from near should stay with it, and anything may be beside what it shows.
    tile->geometric_error_m = static_cast<float>(std::max(diagonal(node->bounds), diagonal(tile->bounds)));
    tile->colour_error_levels = kAnyLevel;
    tile->temperature_error_celsius = largest_difference_celsius(node, *tile);
  }
  node->tile = tile;
}

}  // namespace

CoarseWork::CoarseWork(std::shared_ptr<const MapNode> from, bool is_top, std::shared_ptr<const BorderIndex> borders,
                       const CoarseOptions& options, std::shared_ptr<mesh::SimplifyMemory> memory)
    : from_(std::move(from)),
      is_top_(is_top),
      borders_(std::move(borders)),
      options_(options),
      memory_(std::move(memory)) {}

void CoarseWork::run() {
  made_ = std::make_shared<MapNode>(*from_);
  make_coarse_tile(*made_, is_top_, *borders_, options_, *memory_);
}

CoarseOptions CoarseLevels::coarse_options(const MapNode& root, const Options& options) const {
  return {.tile_vertex_count = options.sizes.leaf_vertex_count,
          .top_vertex_count = options.sizes.root_vertex_count,
          .median_celsius = median_celsius_,
          .span_celsius = span_celsius_,
          .is_point_cloud = root.content.triangle_count == 0,
          .position_step_m = options.position_step_m,
          .baseline_mark = options.baseline_mark};
}

std::set<TileId> CoarseLevels::update_borders(const ChangedTree& changed, jobs::WorkerPool& pool) {
  std::vector<MapNode*> leaves;
  for (const auto& node : changed.made) {
    if (node->is_leaf()) leaves.push_back(node.get());
  }
  pool.for_each(leaves.size(), [&](std::size_t i) { leaves[i]->open_positions = open_positions(*leaves[i]->tile); });
  std::vector<std::vector<std::uint8_t>> before(leaves.size());
  for (std::size_t i = 0; i < leaves.size(); ++i) before[i] = borders_->sharing_levels(leaves[i]->open_positions);
  {
    BorderIndex::Change change(*borders_);
    for (const auto& leaf : changed.dropped_leaves) change.remove(leaf->id, leaf->open_positions);
    for (const MapNode* leaf : leaves) change.add(leaf->id, leaf->open_positions);
  }
  // Vertices of others that may not move any more, because something has come to their other side.
  std::set<TileId> locked_anew;
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    const std::vector<std::uint8_t> now = borders_->sharing_levels(leaves[i]->open_positions);
    for (std::size_t p = 0; p < now.size(); ++p) {
      if (now[p] >= before[i][p]) continue;
      borders_->for_each_holder(leaves[i]->open_positions[p], [&](TileId holder) {
        while (holder.level > now[p]) locked_anew.insert(holder = parent_of(holder));
      });
    }
  }
  return locked_anew;
}

bool CoarseLevels::has_new_spread(const std::shared_ptr<const MapNode>& root) {
  const std::uint64_t count = root->content.owned_count;
  if (count < 2 * spread_vertex_count_ && !std::isnan(median_celsius_)) return false;
  const auto [median, span] = temperature_spread(leaves_of(root));
  spread_vertex_count_ = count;
  const bool is_new = std::isnan(median) != std::isnan(median_celsius_) ||
                      std::abs(double{median} - double{median_celsius_}) > span / 16 ||
                      std::abs(span - span_celsius_) > span / 4;
  if (is_new) {
    median_celsius_ = median;
    span_celsius_ = span;
  }
  return is_new;
}

void CoarseLevels::change(ChangedTree& changed, const std::shared_ptr<const MapNode>& before, const Options& options,
                          jobs::WorkerPool& pool, const base::Progress& progress) {
  std::set<TileId> wanted = update_borders(changed, pool);
  const std::shared_ptr<const MapNode>& root = changed.root;
  if (!root) {
    outdated_.clear();
    round_.clear();
    median_celsius_ = std::numeric_limits<float>::quiet_NaN();
    return;
  }
  if (has_new_spread(root)) collect_inner(root, wanted);
  const std::shared_ptr<const MapNode> old_top = top_of(before), top = top_of(root);
  if (!top->is_top) wanted.insert(top->id);
  // Above the top there are no tiles.
  for (const MapNode* node = root.get(); node != top.get(); node = node->branches.front().node.get()) {
    if (node->tile) wanted.insert(node->id);
  }
  if (old_top && old_top->id != top->id) wanted.insert(old_top->id);

  std::map<TileId, std::shared_ptr<MapNode>> open;  // Those that may be changed.
  for (const auto& node : changed.made) open.emplace(node->id, node);
  std::set<TileId> path;
  for (TileId id : wanted) {
    while (path.insert(id).second && id.level > 0) id = parent_of(id);
  }
  for (const TileId& id : path) {  // Coarse before fine.
    if (open.contains(id) || id.level == 0) continue;
    const auto parent = open.find(parent_of(id));
    if (parent == open.end()) continue;
    for (MapNode::Branch& branch : parent->second->branches) {
      if (branch.node->id != id) continue;
      const auto copy = std::make_shared<MapNode>(*branch.node);
      branch.node = copy;
      open.emplace(id, copy);
    }
  }
  std::vector<std::vector<MapNode*>> by_level(kDeepestLevel + 1);
  std::size_t count = 0;
  for (const auto& [id, node] : open) {
    if (node->is_leaf()) continue;
    if (id.level < top->id.level) {
      node->tile = nullptr;
      node->weight = {};
      node->samples = {};
      continue;
    }
    const std::shared_ptr<const MapNode> old = node_at(before, id);
    if (old && old->tile) {
      take_tile_of_before(node, *old);
      outdated_.insert(id);
      continue;
    }
    by_level[id.level].push_back(node.get());
    ++count;
  }
  const CoarseOptions coarse = coarse_options(*root, options);
  std::atomic<std::size_t> made_count{0};
  for (auto level = by_level.rbegin(); level != by_level.rend(); ++level) {
    pool.for_each(level->size(), [&](std::size_t i) {
      MapNode& node = *(*level)[i];
      make_coarse_tile(node, node.id == top->id, *borders_, coarse, *memory_);
      base::report(progress, kTilingPhase, static_cast<double>(++made_count) / static_cast<double>(count));
    });
    for (const MapNode* node : *level) {
      const bool is_outdated = std::any_of(node->branches.begin(), node->branches.end(), [&](const auto& branch) {
        return outdated_.contains(branch.node->id) && !branch.node->is_leaf();
      });
      if (is_outdated) outdated_.insert(node->id);
    }
  }
  if (outdated_.empty()) memory_->clear();
}

std::optional<CoarseWork> CoarseLevels::next(const std::shared_ptr<const MapNode>& root, const Options& options) {
  const std::shared_ptr<const MapNode> top = top_of(root);
  while (!outdated_.empty()) {
    if (round_.empty()) round_ = outdated_;
    const TileId id = *round_.rbegin();
    round_.erase(id);
    auto node = node_at(root, id);
    if (node && !node->is_leaf() && id.level >= top->id.level) {
      return CoarseWork(node, node == top, borders_, coarse_options(*root, options), memory_);
    }
    outdated_.erase(id);
  }
  round_.clear();
  return std::nullopt;
}

std::shared_ptr<const MapNode> CoarseLevels::taken(const std::shared_ptr<const MapNode>& root, const CoarseWork& work) {
  const TileId id = work.from()->id;
  const auto node = node_at(root, id);
  if (!node || !have_same_branches(*node, work.made()) || id.level < top_of(root)->id.level) return root;
  // What has changed meanwhile is shown in the next round.
  if (node == work.from()) outdated_.erase(id);
  if (id.level > top_of(root)->id.level) outdated_.insert(parent_of(id));
  const auto copy = std::make_shared<MapNode>(*node);
  take_tile(*copy, work.made());
  return with_node(root, copy);
}

}  // namespace spectra::map
