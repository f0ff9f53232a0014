#include "server/map/living_map.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <tuple>
#include <utility>

#include "fusion/base/box.hpp"
#include "server/map/block_core.hpp"
#include "server/map/leaf_facts.hpp"
#include "server/map/map_version.hpp"
#include "server/map/position_step.hpp"
#include "server/map/tile_place.hpp"

#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace spectra::map {
namespace {

using base::Vec3f;

/// About what share of the making is done with the leaves; and of that, when they are cut and when the steps are known.
constexpr double kLeavesShare = 0.5;
constexpr double kCutShare = 0.06;
constexpr double kStepsShare = 0.98;

/// A tile of the full mesh reaches over at most so many doublings of the extent of the first block. Of what 24 bits tell apart it
/// leaves 17 to the block, and maps of small blocks are not cut into crumbs.
constexpr int kLeafLevelsAbove = 6;

/// Automatic values follow when a fact of the temperatures has moved by this part of their span: a quantile is looked at when so
/// large a part of the map has changed. When all of it has, they follow in any case.
constexpr double kReferenceMove = 1.0 / 32;
constexpr double kReferenceLook = 1.0 / 4;

/// Building needs for moments several times what stays. Left alone, glibc raises the size from which it gives freed memory
/// back to the system as blocks of that size are freed, and keeps 64 MB a thread for good.
class FreedMemoryGoesBack {
 public:
  FreedMemoryGoesBack() {
#ifdef __GLIBC__
    mallopt(M_MMAP_THRESHOLD, 4 << 20);
    mallopt(M_TRIM_THRESHOLD, 8 << 20);
#endif
  }
  ~FreedMemoryGoesBack() {
#ifdef __GLIBC__
    malloc_trim(0);
#endif
  }
};

/// The whole of a mesh as one tile, for PositionSteps.
std::shared_ptr<Tile> tile_of(const mesh::MultispectralMesh& mesh) {
  auto tile = std::make_shared<Tile>();
  tile->owned_count = static_cast<std::uint32_t>(mesh.vertex_count());
  tile->positions.assign(mesh.positions().begin(), mesh.positions().end());
  tile->triangles = mesh.triangles();
  tile->source_vertex.resize(mesh.vertex_count());
  std::iota(tile->source_vertex.begin(), tile->source_vertex.end(), 0u);
  return tile;
}

/// The tiles of the leaves of a tree that nobody else has yet.
std::vector<std::shared_ptr<Tile>> new_leaves(const ChangedTree& tree) {
  std::vector<std::shared_ptr<Tile>> leaves;
  for (const auto& node : tree.made) {
    if (node->is_leaf()) leaves.push_back(std::const_pointer_cast<Tile>(node->tile));
  }
  return leaves;
}

base::Vec3f moved(const base::Vec3f& p, const base::Vec3d& by) {
  return {static_cast<float>(double{p.x} + by.x), static_cast<float>(double{p.y} + by.y),
          static_cast<float>(double{p.z} + by.z)};
}

/// By what positions that are relative to one origin move to be relative to another; nothing where both are the same.
std::optional<base::Vec3d> shift_to(const base::Vec3d& origin, const base::Vec3d& from) {
  if (from == origin) return std::nullopt;
  return base::Vec3d{from.x - origin.x, from.y - origin.y, from.z - origin.z};
}

void collect_shown(const std::shared_ptr<const MapNode>& node, bool is_point_cloud, bool with_coarse,
                   std::vector<std::shared_ptr<const Tile>>& tiles) {
  const bool is_shown = node->tile && (is_point_cloud || !node->tile->triangles.empty());
  // Leaves alone are the whole scene, whatever is drawn of it.
  if (node->is_leaf() ? (is_shown || !with_coarse) : (is_shown && with_coarse)) tiles.push_back(node->tile);
  for (const auto& branch : node->branches) collect_shown(branch.node, is_point_cloud, with_coarse, tiles);
}

/// NaN is the same as itself here.
template <class T>
bool has_same_bytes(std::span<const T> a, std::span<const T> b) {
  const auto bytes = std::as_bytes(a), others = std::as_bytes(b);
  return std::equal(bytes.begin(), bytes.end(), others.begin(), others.end());
}

bool has_moved(double from, double to, double span) {
  return std::abs(from - to) > kReferenceMove * span;
}

/// Whether what is automatic should be found anew.
bool differs_much(const fusion::TemperatureSummary& from, const fusion::TemperatureSummary& to) {
  if (from.has_temperature() != to.has_temperature()) return true;
  if ((from.over_range_count > 0) != (to.over_range_count > 0)) return true;
  if ((from.under_range_count > 0) != (to.under_range_count > 0)) return true;
  const double span =
      std::max({double{from.maximum} - double{from.minimum}, double{to.maximum} - double{to.minimum}, 1.0});
  return has_moved(double{from.minimum}, double{to.minimum}, span) ||
         has_moved(double{from.maximum}, double{to.maximum}, span) || has_moved(from.mean, to.mean, span) ||
         has_moved(from.sigma, to.sigma, span);
}

bool have_quantiles_moved(const fusion::Histogram& from, const fusion::Histogram& to) {
  const double span = double{to.maximum} - double{to.minimum};
  constexpr std::array kParts{0.005, 0.02, 0.1, 0.25, 0.5, 0.75, 0.9, 0.98, 0.995};
  return std::any_of(kParts.begin(), kParts.end(), [&](double part) {
    return has_moved(fusion::histogram_quantile(from, part), fusion::histogram_quantile(to, part), span);
  });
}

}  // namespace

LivingMap::LivingMap(const Options& options, const std::optional<MapConstants>& constants)
    : options_(options), constants_(constants), mark_(options.mark), remembers_(options.remembers) {
  labels_.baseline_mark = mark_.number;
}

TileSizes LivingMap::sizes() const {
  TileSizes sizes{.leaf_vertex_count = std::max(1u, options_.leaf_vertex_count)};
  sizes.changing_leaf_vertex_count = options_.settled_block.empty()
                                         ? sizes.leaf_vertex_count
                                         : std::max(1u, sizes.leaf_vertex_count / kSmallerWhereChanging);
  sizes.first_leaf_level = std::max(0, options_.first_level - kLeafLevelsAbove);
  // 20,000 of 32,000: with 32,000 vertices geometry and colours of a noisy scene would be more than a first picture should
  // cost.
  if (options_.levels == LevelsOfDetail::All) sizes.root_vertex_count = std::max(1u, sizes.leaf_vertex_count / 8 * 5);
  return sizes;
}

std::optional<base::Error> LivingMap::refusal_of(std::span<const BlockShape> put,
                                                 std::span<const std::string> removed) const {
  std::set<std::string_view> gone(removed.begin(), removed.end());
  for (const BlockShape& block : put) gone.insert(block.id);
  std::uint64_t vertex_count = 0;
  std::optional<bool> has_triangles;
  for (const auto& [id, block] : blocks_) {
    if (gone.contains(id)) continue;
    vertex_count += block->facts.vertex_count;
    has_triangles = block->facts.triangle_count > 0;
  }
  for (const BlockShape& block : put) {
    const std::string id(block.id);
    vertex_count += block.vertex_count;
    if (block.vertex_count == 0) {
      return base::Error{base::ErrorCode::Unsupported, "the block has no vertex", id};
    }
    if (vertex_count > std::numeric_limits<std::uint32_t>::max()) {
      return base::Error{base::ErrorCode::TooLarge, "the map would have more than 4294967295 vertices", id};
    }
    if (has_triangles.value_or(block.has_triangles) != block.has_triangles) {
      return base::Error{base::ErrorCode::Unsupported,
                         block.has_triangles ? "the map is made of points, and this block has triangles"
                                             : "the map is made of triangles, and this block has points alone",
                         id};
    }
    has_triangles = block.has_triangles;
  }
  return std::nullopt;
}

ReplacedVertices LivingMap::replaced_vertices(BlockNumber block) const {
  ReplacedVertices replaced;
  const double own_at = labels_.at(block).baseline_at;
  for (const auto& node : leaves_of(root_)) {
    if (!std::binary_search(node->blocks.begin(), node->blocks.end(), block)) continue;
    const Tile& leaf = *node->tile;
    const std::span<const float> celsius = baseline_of(leaf, mark_.number);
    const bool is_kept = celsius.data() != leaf.temperature_celsius.data();
    for (std::size_t v = 0; v < leaf.owned_count; ++v) {
      if (block_of(leaf, v) != block) continue;
      replaced.positions.push_back(leaf.positions[v]);
      replaced.source.push_back(leaf.source_vertex[v]);
      replaced.baseline.celsius.push_back(celsius[v]);
      replaced.baseline.at.push_back(is_kept ? leaf.baseline_at.at(v) : own_at);
    }
  }
  return replaced;
}

BlockBaseline LivingMap::handed_on(std::string_view id, const mesh::MultispectralMesh& mesh,
                                   std::optional<double> observed_at) const {
  const auto before = blocks_.find(id);
  if (before == blocks_.end()) return {};
  std::vector<base::Vec3f> placed;
  std::span<const base::Vec3f> positions = mesh.positions();
  if (const auto by = shift_to(constants_->origin, mesh.origin)) {
    for (const base::Vec3f& p : positions) placed.push_back(moved(p, *by));
    positions = placed;
  }
  return map::handed_on(replaced_vertices(before->second->number), positions, mesh.temperature_celsius(),
                        observed_at.value_or(kUnknownTime), kHandedOnSteps * double{constants_->position_step_m});
}

std::shared_ptr<const SceneSnapshot> LivingMap::mark_baseline(double marked_at, std::uint32_t revision) {
  mark_ = {.number = mark_.number + 1, .marked_at = marked_at};
  labels_.baseline_mark = mark_.number;
  for (auto& [number, label] : labels_.of_block) label.baseline_at = marked_at;
  remembers_ = true;
  return snapshot(revision);
}

std::shared_ptr<const SceneSnapshot> LivingMap::apply(MapChange change_wanted, std::uint32_t revision,
                                                      jobs::WorkerPool& pool, const base::Progress& progress) {
  base::report(progress, kTilingPhase, 0);
  std::vector<BlockPut>& put = change_wanted.put;
  if (!blocks_.empty()) remembers_ = true;
  for (BlockPut& one : put) {
    if (!one.baseline) one.baseline = handed_on(one.id, one.scene.mesh, one.observed_at);
  }
  std::erase_if(put, [this](const BlockPut& one) { return is_there_already(one); });
  std::sort(put.begin(), put.end(), [](const BlockPut& a, const BlockPut& b) { return a.id < b.id; });
  if (!constants_ && !put.empty()) {
    BlockPut first = std::move(put.front());
    put.erase(put.begin());
    put_first(std::move(first), pool, progress);
  }
  if (!put.empty() || !change_wanted.removed.empty()) change(std::move(put), change_wanted.removed, pool, progress);

  auto made = snapshot(revision);
  base::report(progress, kTilingPhase, 1);
  return made;
}

std::shared_ptr<const SceneSnapshot> LivingMap::snapshot(std::uint32_t revision) {
  auto made = snapshot_of(version(revision));
  if (made->reference_temperature() != reference_) {
    reference_ = made->reference_temperature();
    changed_vertex_count_ = looked_at_vertex_count_ = 0;
  }
  return made;
}

CoarseLevels::Options LivingMap::coarse_options() const {
  return {.sizes = sizes(), .position_step_m = constants_->position_step_m, .baseline_mark = mark_.number};
}

MapVersion LivingMap::version(std::uint32_t revision) {
  MapVersion version;
  version.revision = revision;
  version.is_live = options_.is_live;
  if (remembers_) version.baseline_mark = mark_.number;
  version.baseline_marked_at = mark_.marked_at;
  for (const auto& [number, label] : labels_.of_block) version.own_baseline_at.emplace(number, label.baseline_at);
  version.position_step_m = 0x1p-10F;
  MeshFacts& facts = version.facts;
  if (constants_) {
    facts.origin = constants_->origin;
    version.position_step_m = constants_->position_step_m;
  }
  const auto first = blocks_.find(first_id_);
  if (first != blocks_.end()) {
    facts.name = first->second->facts.name;
    facts.up = first->second->facts.up;
    facts.is_metric = first->second->facts.is_metric;
    facts.told = first->second->facts.told;
  }
  if (!options_.name.empty()) facts.name = options_.name;
  if (blocks_.size() == 1) facts.left_out = blocks_.begin()->second->facts.left_out;
  for (const auto& [id, block] : blocks_) {
    facts.vertex_count += block->facts.vertex_count;
    facts.triangle_count += block->facts.triangle_count;
    facts.has_visible = facts.has_visible || block->facts.has_visible;
    facts.has_temperature = facts.has_temperature || block->facts.has_temperature;
    facts.double_positions = facts.double_positions || block->facts.double_positions;
    if (const auto& seen = block->observed_at) {
      version.oldest_observed_at = std::min(version.oldest_observed_at.value_or(*seen), *seen);
      version.newest_observed_at = std::max(version.newest_observed_at.value_or(*seen), *seen);
    }
  }
  version.blocks = blocks_;
  version.notes = notes();
  BlockCore core = core_of(blocks_);
  version.core_bounds = core.bounds;
  if (core.note) version.notes.push_back(std::move(*core.note));
  version.leaves = leaves_of(root_);
  if (root_) {
    version.top_level = top_of(root_)->id.level;
    collect_shown(root_, facts.triangle_count == 0, options_.levels == LevelsOfDetail::All, version.tiles);
    std::sort(version.tiles.begin(), version.tiles.end(),
              [](const auto& a, const auto& b) { return is_before(a->id, b->id); });
  }
  fusion::TemperatureAccumulator accumulator;
  for (const auto& leaf : version.leaves) accumulator.merge(leaf->facts->temperature);
  version.summary = accumulator.summary();
  if (percentiles_ &&
      (percentiles_->minimum != version.summary.minimum || percentiles_->maximum != version.summary.maximum)) {
    percentiles_.reset();
  }
  if (is_reference_good(version)) version.reference = reference_;
  // The first greeting must not wait for them; later ones are counted by whoever asks, once.
  if (!reference_) count_percentiles(version);
  version.percentiles = percentiles_;
  return version;
}

void LivingMap::count_percentiles(const MapVersion& version) {
  if (percentiles_) return;
  percentiles_ = fusion::Histogram{version.summary.minimum, version.summary.maximum,
                                   std::vector<std::uint64_t>(fusion::kPercentileBins)};
  for (const auto& leaf : version.leaves) fusion::add_to_histogram(owned_temperature(*leaf->tile), *percentiles_);
}

bool LivingMap::is_reference_good(const MapVersion& version) {
  if (!reference_ || differs_much(reference_->summary, version.summary)) return false;
  const auto vertex_count = static_cast<double>(version.facts.vertex_count);
  if (static_cast<double>(changed_vertex_count_) >= vertex_count) return false;
  if (static_cast<double>(looked_at_vertex_count_) < kReferenceLook * vertex_count) return true;
  looked_at_vertex_count_ = 0;
  count_percentiles(version);
  return !have_quantiles_moved(reference_->histogram(fusion::kPercentileBins), *percentiles_);
}

std::vector<files::Note> LivingMap::notes() const {
  if (blocks_.size() == 1) return blocks_.begin()->second->notes;
  // A note of a kind, however many blocks have it.
  struct Told {
    files::Note note;
    std::size_t block_count = 0;
  };
  std::map<std::string, Told> by_id;
  for (const auto& [id, block] : blocks_) {
    for (const files::Note& note : block->notes) {
      Told& told = by_id[note.id];
      const std::uint64_t count = told.note.count + note.count;
      const bool needs_attention = told.note.needs_attention || note.needs_attention;
      told.note = note;
      told.note.message = "block " + id + ": " + note.message;
      told.note.count = count;
      told.note.needs_attention = needs_attention;
      ++told.block_count;
    }
  }
  std::vector<files::Note> notes;
  for (auto& [id, told] : by_id) {
    if (told.block_count > 1) {
      told.note.message += " (and " + std::to_string(told.block_count - 1) + " more blocks)";
    }
    notes.push_back(std::move(told.note));
  }
  return notes;
}

bool LivingMap::is_there_already(const BlockPut& put) const {
  const auto found = blocks_.find(put.id);
  if (found == blocks_.end() || found->second->observed_at != put.observed_at) return false;
  const MapBlock& block = *found->second;
  const mesh::MultispectralMesh& mesh = put.scene.mesh;
  const MeshFacts facts = facts_of(mesh);
  const auto plain = [](const MeshFacts& f) {
    return std::tuple(f.vertex_count, f.triangle_count, f.has_visible, f.has_temperature, f.double_positions, f.up,
                      f.is_metric, f.origin.x, f.origin.y, f.origin.z);
  };
  const auto is_same_note = [](const files::Note& a, const files::Note& b) { return a.message == b.message; };
  if (plain(facts) != plain(block.facts) || !std::ranges::equal(put.scene.notes, block.notes, is_same_note)) {
    return false;
  }
  const mesh::MultispectralMesh before = mesh_of_blocks(leaves_of(root_), {{block.number, BlockPlace{}}}, block.facts);
  return has_same_bytes(before.positions(), mesh.positions()) && has_same_bytes(before.visible(), mesh.visible()) &&
         has_same_bytes(before.temperature_celsius(), mesh.temperature_celsius()) &&
         before.triangles() == mesh.triangles() &&
         has_same_bytes(std::span(before.confidence.sigma_kelvin), std::span(mesh.confidence.sigma_kelvin)) &&
         has_same_bytes(std::span(before.confidence.looked_at), std::span(mesh.confidence.looked_at));
}

void LivingMap::put_first(BlockPut put, jobs::WorkerPool& pool, const base::Progress& progress) {
  const FreedMemoryGoesBack scope;
  constants_ = {.origin = put.scene.mesh.origin,
                .grid = MapGrid::around(put.scene.mesh.positions(), put.scene.core_bounds, options_.first_level)};
  std::vector<BlockPut> only;
  only.push_back(std::move(put));
  change(std::move(only), {}, pool, progress);
}

std::shared_ptr<const MapBlock> LivingMap::taken_in(BlockPut& put) {
  mesh::MultispectralMesh& mesh = put.scene.mesh;
  std::optional<base::Bounds>& core = put.scene.core_bounds;
  const base::Vec3d& origin = constants_->origin;
  if (const auto by = shift_to(origin, mesh.origin)) {
    for (base::Vec3f& p : mesh.positions()) p = moved(p, *by);
    if (core) core = base::Bounds{moved(core->min, *by), moved(core->max, *by)};
    mesh.origin = origin;
  }
  auto info = std::make_shared<MapBlock>();
  info->number = ++last_number_;
  info->facts = facts_of(mesh);
  info->core_bounds = core;
  info->observed_at = put.observed_at;
  info->notes = std::move(put.scene.notes);
  if (!blocks_.contains(first_id_)) first_id_ = put.id;
  return info;
}

void LivingMap::change(std::vector<BlockPut> put, std::span<const std::string> removed, jobs::WorkerPool& pool,
                       const base::Progress& progress) {
  std::vector<BlockNumber> gone;
  const auto remove = [&](const std::string& id) {
    const auto found = blocks_.find(id);
    if (found == blocks_.end()) return;
    gone.push_back(found->second->number);
    blocks_.erase(found);
  };
  for (const std::string& id : removed) remove(id);
  std::vector<BlockMesh> added;
  const bool is_first = constants_->position_step_m == 0;
  for (BlockPut& block : put) {
    remove(block.id);
    auto info = taken_in(block);
    BlockMesh& one = added.emplace_back();
    one.number = info->number;
    one.mesh = &block.scene.mesh;
    if (!is_first) {
      const std::vector<std::shared_ptr<Tile>> whole{tile_of(block.scene.mesh)};
      PositionSteps(whole, pool, constants_->position_step_m).apply(*whole[0]);
      one.step_halvings = std::move(whole[0]->step_halvings);
    }
    const double observed_at = block.observed_at.value_or(kUnknownTime);
    labels_.of_block[info->number] = {
        .name = block.id,
        .is_settled = block.id == options_.settled_block,
        .observed_at = observed_at,
        .baseline_at = block.was_marked ? mark_.marked_at.value_or(observed_at) : observed_at};
    one.baseline = std::move(block.baseline).value_or(BlockBaseline{});
    blocks_.emplace(block.id, std::move(info));
  }
  const double leaves_share = options_.levels == LevelsOfDetail::All ? kLeavesShare : 1;
  const auto made_share = [&](double share) { base::report(progress, kTilingPhase, leaves_share * kCutShare * share); };
  ChangedTree changed = changed_tree(root_, constants_->grid, sizes(), gone, added, labels_, pool, made_share);
  for (const BlockNumber number : gone) labels_.of_block.erase(number);
  // Memory of a large mesh is needed for the rest.
  added.clear();
  put.clear();
  if (is_first) {
    choose_steps(changed, pool, [&](double share) {
      base::report(progress, kTilingPhase, leaves_share * (kCutShare + (kStepsShare - kCutShare) * share));
    });
  }
  base::report(progress, kTilingPhase, leaves_share * kStepsShare);
  take(std::move(changed), pool, progress);
  // What comes next may lie somewhere else altogether.
  if (blocks_.empty()) constants_.reset();
}

void LivingMap::choose_steps(ChangedTree& first, jobs::WorkerPool& pool,
                             const std::function<void(double)>& found_share) {
  std::vector<std::shared_ptr<Tile>> leaves = new_leaves(first);
  std::optional<PositionSteps> steps(std::in_place, leaves, pool, std::nullopt, std::numeric_limits<double>::infinity(),
                                     found_share);
  const int first_leaf_level = sizes().first_leaf_level;
  if (const auto lost = first_leaf_level > 0 ? steps->lost_form(leaves) : std::nullopt) {
    constants_->grid = grid_for(*lost, leaves);
    first = cut_anew(first.root, constants_->grid, sizes(), labels_, pool);
    leaves = new_leaves(first);
    steps.emplace(leaves, pool, std::nullopt, std::ldexp(constants_->grid.edge_m(), -first_leaf_level));
  }
  constants_->position_step_m = steps->largest_step_m();
  pool.for_each(leaves.size(), [&](std::size_t i) { steps->apply(*leaves[i]); });
}

MapGrid LivingMap::grid_for(const LostForm& lost, std::span<const std::shared_ptr<Tile>> leaves) const {
  const double cell_m = std::ldexp(lost.largest_tile_m, -kLeafLevelsAbove);
  MapGrid all = constants_->grid.with_cells_of(cell_m, options_.first_level);
  if (all.edge_m() <= std::ldexp(cell_m, options_.first_level)) return all;
  // One tile may be all that lies beyond the cube.
  const MapGrid near = MapGrid::from(lost.bounds.min, cell_m, options_.first_level);
  const std::array<double, 3> low = near.corner_m();
  const auto is_within = [&](const base::Vec3f& p) {
    const auto along = [&](float at, double from) { return double{at} >= from && double{at} < from + near.edge_m(); };
    return along(p.x, low[0]) && along(p.y, low[1]) && along(p.z, low[2]);
  };
  std::size_t beyond_count = 0;
  for (const auto& leaf : leaves) {
    for (std::uint32_t v = 0; v < leaf->owned_count; ++v) beyond_count += is_within(leaf->positions[v]) ? 0u : 1u;
  }
  return beyond_count <= options_.leaf_vertex_count && is_within(lost.bounds.max) ? near : all;
}

void LivingMap::take(ChangedTree changed, jobs::WorkerPool& pool, const base::Progress& progress) {
  if (percentiles_) {
    // Good as long as the extremes stay; version() looks at that.
    fusion::Histogram gone = *percentiles_;
    std::fill(gone.counts.begin(), gone.counts.end(), 0);
    for (const auto& leaf : changed.dropped_leaves) {
      fusion::add_to_histogram(owned_temperature(*leaf->tile), gone);
    }
    for (std::size_t bin = 0; bin < gone.counts.size(); ++bin) percentiles_->counts[bin] -= gone.counts[bin];
    for (const auto& node : changed.made) {
      if (node->is_leaf()) fusion::add_to_histogram(owned_temperature(*node->tile), *percentiles_);
    }
  }
  for (const auto& leaf : changed.dropped_leaves) {
    changed_vertex_count_ += leaf->tile->owned_count;
    looked_at_vertex_count_ += leaf->tile->owned_count;
  }
  if (options_.levels == LevelsOfDetail::All) {
    const auto coarse_progress = [&](std::string_view phase, double share) {
      base::report(progress, phase, kLeavesShare + (1 - kLeavesShare) * share);
    };
    coarse_.change(changed, root_, coarse_options(), pool, coarse_progress);
  }
  root_ = std::move(changed.root);
}

bool LivingMap::is_behind() const {
  return coarse_.are_behind();
}

std::optional<CoarseWork> LivingMap::next_coarse() {
  if (!root_) return std::nullopt;
  return coarse_.next(root_, coarse_options());
}

std::shared_ptr<const SceneSnapshot> LivingMap::take_coarse(const CoarseWork& work, std::uint32_t revision) {
  const auto before = root_;
  if (root_) root_ = coarse_.taken(root_, work);
  return root_ == before ? nullptr : snapshot(revision);
}

}  // namespace spectra::map
