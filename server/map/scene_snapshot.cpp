#include "server/map/scene_snapshot.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <list>
#include <mutex>
#include <utility>

#include "fusion/base/box.hpp"
#include "fusion/mesh/surface.hpp"
#include "server/map/leaf_facts.hpp"
#include "server/map/living_map.hpp"
#include "server/map/map_version.hpp"

namespace spectra::map {
namespace {

using base::Vec3f;

using Leaves = std::vector<std::shared_ptr<const MapNode>>;

/// What is computed of all vertices of a scene when first asked for: histograms by number of bins, of which the last few are
/// kept, because a slider may visit thousands, and the hues. The histogram of percentiles may be there already.
class FactSource {
 public:
  FactSource(Leaves leaves, const fusion::TemperatureSummary& summary, std::optional<fusion::Histogram> percentiles)
      : leaves_(std::move(leaves)), summary_(summary), percentiles_(std::move(percentiles)) {}

  fusion::Hues hues() {
    const std::lock_guard lock(mutex_);
    if (!hues_) {
      hues_.emplace();
      for (const auto& leaf : leaves_) {
        fusion::add_to_hues(std::span(leaf->tile->visible).first(leaf->tile->owned_count), *hues_);
      }
    }
    return *hues_;
  }

  fusion::Histogram histogram(std::uint32_t bins) {
    if (percentiles_ && bins == percentiles_->counts.size()) return *percentiles_;
    const std::lock_guard lock(mutex_);
    const auto found = std::find_if(recent_.begin(), recent_.end(),
                                    [&](const fusion::Histogram& h) { return h.counts.size() == bins; });
    if (found != recent_.end()) {
      recent_.splice(recent_.begin(), recent_, found);
      return recent_.front();
    }
    recent_.push_front(counted(bins));
    if (recent_.size() > kKeptCount) recent_.pop_back();
    return recent_.front();
  }

 private:
  static constexpr std::size_t kKeptCount = 16;

  fusion::Histogram counted(std::uint32_t bins) const {
    fusion::Histogram made{summary_.minimum, summary_.maximum, std::vector<std::uint64_t>(bins)};
    for (const auto& leaf : leaves_) fusion::add_to_histogram(owned_temperature(*leaf->tile), made);
    return made;
  }

  const Leaves leaves_;
  const fusion::TemperatureSummary summary_;
  const std::optional<fusion::Histogram> percentiles_;
  std::mutex mutex_;
  std::list<fusion::Histogram> recent_;
  std::optional<fusion::Hues> hues_;
};

/// A clock that shows less counts from something else than 1970.
constexpr double kEarliestUnixTime = 1e8;

double triangle_area(base::Vec3f a, base::Vec3f b, base::Vec3f c) {
  const auto edge = [a](base::Vec3f to) {
    return std::array{double{to.x} - double{a.x}, double{to.y} - double{a.y}, double{to.z} - double{a.z}};
  };
  const auto u = edge(b);
  const auto v = edge(c);
  return std::hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]) / 2;
}

/// The surface that each vertex of a leaf stands for: a third of its triangles.
std::vector<float> vertex_areas(const Tile& leaf) {
  std::vector<float> areas(leaf.positions.size());
  for (const base::Triangle& triangle : leaf.triangles) {
    const double area =
        triangle_area(leaf.positions[triangle[0]], leaf.positions[triangle[1]], leaf.positions[triangle[2]]);
    for (const std::uint32_t v : triangle) areas[v] += static_cast<float>(area / 3);
  }
  return areas;
}

/// Which share of a scene's surface a plan highlights. The surface of each vertex is found when first asked for, and kept.
class SurfaceShare {
 public:
  SurfaceShare(std::span<const std::shared_ptr<const MapNode>> leaves, bool is_point_cloud,
               std::optional<std::uint32_t> baseline_mark)
      : leaves_(leaves), is_point_cloud_(is_point_cloud), baseline_mark_(baseline_mark) {}

  double highlighted(const fusion::FusionPlan& plan) {
    if (!is_point_cloud_) std::call_once(once_, [this] { find_areas(); });
    double marked_area = 0;
    std::uint64_t marked_count = 0;
    std::uint64_t count = 0;
    std::vector<std::uint8_t> marked;
    for (std::size_t i = 0; i < leaves_.size(); ++i) {
      const Tile& leaf = *leaves_[i]->tile;
      marked.resize(leaf.temperature_celsius.size());
      plan.mark(leaf.temperature_celsius, baseline_of(leaf, baseline_mark_), marked);
      for (std::size_t v = 0; v < leaf.owned_count; ++v) marked_count += marked[v];
      count += leaf.owned_count;
      if (total_area_ > 0) {
        for (std::size_t v = 0; v < marked.size(); ++v) marked_area += marked[v] != 0 ? double{areas_[i][v]} : 0;
      }
    }
    if (total_area_ > 0) return std::min(1.0, marked_area / total_area_);
    return count > 0 ? static_cast<double>(marked_count) / static_cast<double>(count) : 0;
  }

 private:
  void find_areas() {
    double total = 0;
    for (const auto& leaf : leaves_) {
      areas_.push_back(vertex_areas(*leaf->tile));
      for (const float area : areas_.back()) total += double{area};
    }
    // Beyond what floats hold, and without any extent, vertices are counted instead.
    if (std::isfinite(total)) total_area_ = total;
  }

  const std::span<const std::shared_ptr<const MapNode>> leaves_;
  const bool is_point_cloud_;
  const std::optional<std::uint32_t> baseline_mark_;
  std::once_flag once_;
  std::vector<std::vector<float>> areas_;  ///< By leaf.
  double total_area_ = 0;
};

class TiledSnapshot final : public SceneSnapshot {
 public:
  explicit TiledSnapshot(MapVersion version) : version_(std::move(version)) {
    BlockPlace next;
    for (const auto& [id, block] : version_.blocks) {
      places_.emplace(block->number, next);
      next.first_vertex += block->facts.vertex_count;
      next.first_triangle += block->facts.triangle_count;
    }
    std::vector<base::Vec3f> corners;
    for (const auto& leaf : version_.leaves) {
      corners.push_back(leaf->tile->bounds.min);
      corners.push_back(leaf->tile->bounds.max);
      take_extremes(*leaf);
    }
    if (!corners.empty()) bounds_ = bounds_of(corners);
    core_bounds_ = version_.core_bounds.value_or(bounds_);
    const auto temperature = std::make_shared<fusion::SceneTemperature>();
    temperature->summary = version_.summary;
    const auto source =
        std::make_shared<FactSource>(version_.leaves, version_.summary, std::move(version_.percentiles));
    temperature->histogram = [source](std::uint32_t bins) { return source->histogram(bins); };
    temperature->hues = [source] { return source->hues(); };
    temperature_ = temperature;
    if (!version_.reference) version_.reference = temperature_;
    share_ = std::make_unique<SurfaceShare>(version_.leaves, is_point_cloud(), version_.baseline_mark);
  }

  const std::string& name() const override { return version_.facts.name; }
  std::uint32_t revision() const override { return version_.revision; }
  std::uint64_t vertex_count() const override { return version_.facts.vertex_count; }
  std::uint64_t triangle_count() const override { return version_.facts.triangle_count; }
  bool is_point_cloud() const override { return version_.facts.triangle_count == 0; }
  base::Vec3d origin() const override { return version_.facts.origin; }
  const base::Bounds& bounds() const override { return bounds_; }
  const base::Bounds& core_bounds() const override { return core_bounds_; }
  base::UpAxis up() const override { return version_.facts.up; }
  bool is_metric() const override { return version_.facts.is_metric; }
  std::span<const files::Note> notes() const override { return version_.notes; }
  bool is_live() const override { return version_.is_live; }
  std::optional<std::pair<double, double>> observed() const override {
    if (!version_.oldest_observed_at) return std::nullopt;
    return std::pair(*version_.oldest_observed_at, *version_.newest_observed_at);
  }
  std::optional<std::uint32_t> baseline_mark() const override { return version_.baseline_mark; }
  std::optional<double> baseline_marked_at() const override { return version_.baseline_marked_at; }
  int level_count() const override { return tiles().empty() ? 0 : tiles().back()->id.level - version_.top_level + 1; }
  std::span<const std::shared_ptr<const Tile>> tiles() const override { return version_.tiles; }
  const fusion::SceneTemperature& temperature() const override { return *temperature_; }
  std::shared_ptr<const fusion::SceneTemperature> reference_temperature() const override { return version_.reference; }
  std::optional<Extreme> hottest() const override { return extreme(hottest_); }
  std::optional<Extreme> coldest() const override { return extreme(coldest_); }
  std::optional<Extreme> over_range() const override { return extreme(over_range_); }
  std::optional<Extreme> under_range() const override { return extreme(under_range_); }
  float suggested_position_step_m() const override { return version_.position_step_m; }
  double highlighted_share(const fusion::FusionPlan& plan) const override { return share_->highlighted(plan); }

  std::uint32_t vertex_index(const Tile& leaf, std::size_t v) const override {
    return static_cast<std::uint32_t>(places_.at(block_of(leaf, v)).first_vertex) + leaf.source_vertex[v];
  }

  std::optional<Probe> probe(base::Vec3f position) const override {
    if (!std::isfinite(position.x) || !std::isfinite(position.y) || !std::isfinite(position.z)) return {};
    std::vector<std::pair<double, const Tile*>> by_distance;
    by_distance.reserve(version_.leaves.size());
    for (const auto& leaf : version_.leaves) {
      by_distance.emplace_back(mesh::squared_distance_to_box(position, leaf->tile->bounds), leaf->tile.get());
    }
    std::sort(by_distance.begin(), by_distance.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    const Tile* best_tile = nullptr;
    std::size_t best_vertex = 0;
    double best_squared = 0;
    for (const auto& [box_squared, tile] : by_distance) {
      if (best_tile != nullptr && box_squared > best_squared) break;
      for (std::size_t v = 0; v < tile->owned_count; ++v) {
        const double squared = mesh::squared_distance(position, tile->positions[v]);
        if (best_tile == nullptr || squared < best_squared ||
            (squared == best_squared && is_rather_told(*tile, v, *best_tile, best_vertex))) {
          best_tile = tile;
          best_vertex = v;
          best_squared = squared;
        }
      }
    }
    if (best_tile == nullptr) return {};
    Probe result;
    result.vertex_index = vertex_index(*best_tile, best_vertex);
    result.position = best_tile->positions[best_vertex];
    result.visible = best_tile->visible[best_vertex];
    const float temperature = best_tile->temperature_celsius[best_vertex];
    if (!std::isnan(temperature)) result.temperature_celsius = temperature;
    result.distance_m = std::sqrt(best_squared);
    const double seen_at = best_tile->seen_at.at(best_vertex);
    if (!std::isnan(seen_at)) result.observed_at = seen_at;
    take_baseline(*best_tile, best_vertex, result);
    take_confidence(*best_tile, best_vertex, result);
    return result;
  }

  std::optional<mesh::MultispectralMesh> block_mesh(std::string_view id) const override {
    const auto block = version_.blocks.find(id);
    if (block == version_.blocks.end()) return std::nullopt;
    return mesh_of_blocks(version_.leaves, {{block->second->number, BlockPlace{}}}, block->second->facts);
  }

  mesh::MultispectralMesh whole_mesh() const override {
    return mesh_of_blocks(version_.leaves, places_, version_.facts);
  }

  std::vector<float> whole_baseline() const override {
    if (!version_.baseline_mark) return {};
    return baseline_of_blocks(version_.leaves, places_, version_.facts.vertex_count, *version_.baseline_mark);
  }

 private:
  /// A vertex that is one.
  struct Place {
    const Tile* leaf = nullptr;
    std::uint32_t vertex = 0;
  };

  /// Of two vertices at one place.
  bool is_rather_told(const Tile& tile, std::size_t v, const Tile& other, std::size_t other_v) const {
    const double at = tile.seen_at.at(v), other_at = other.seen_at.at(other_v);
    if (at != other_at && !(std::isnan(at) && std::isnan(other_at))) return later(at, other_at) == at;
    return vertex_index(tile, v) < vertex_index(other, other_v);
  }

  void take_baseline(const Tile& tile, std::size_t v, Probe& probe) const {
    const std::span<const float> baseline = baseline_of(tile, version_.baseline_mark);
    if (baseline.empty() || std::isnan(baseline[v])) return;
    probe.baseline_celsius = baseline[v];
    const bool is_kept = baseline.data() != tile.temperature_celsius.data();
    const double at = is_kept ? tile.baseline_at.at(v) : version_.own_baseline_at.at(block_of(tile, v));
    if (!std::isnan(at)) probe.baseline_at = at;
  }

  static void take_confidence(const Tile& tile, std::size_t v, Probe& probe) {
    if (tile.sigma_kelvin.empty() || std::isnan(tile.sigma_kelvin[v])) return;
    probe.sigma_kelvin = tile.sigma_kelvin[v];
    const double at = tile.looked_at.at(v);
    if (at > kEarliestUnixTime) probe.looked_at = at;
  }

  static std::optional<Extreme> extreme(const Place& place) {
    if (place.leaf == nullptr) return std::nullopt;
    return Extreme{place.leaf->positions[place.vertex], place.leaf->temperature_celsius[place.vertex]};
  }

  void take_extremes(const MapNode& node) {
    const auto take = [&](Place& best, std::optional<std::uint32_t> vertex, float sign) {
      if (!vertex) return;
      const Tile& leaf = *node.tile;
      if (best.leaf != nullptr) {
        const float t = leaf.temperature_celsius[*vertex], other = best.leaf->temperature_celsius[best.vertex];
        if (sign * t < sign * other ||
            (t == other && vertex_index(leaf, *vertex) > vertex_index(*best.leaf, best.vertex)))
          return;
      }
      best = {&leaf, *vertex};
    };
    take(hottest_, node.facts->hottest, 1.0f);
    take(coldest_, node.facts->coldest, -1.0f);
    take(over_range_, node.facts->over_range, 1.0f);
    take(under_range_, node.facts->under_range, -1.0f);
  }

  MapVersion version_;
  BlockPlaces places_;
  base::Bounds bounds_, core_bounds_;
  std::shared_ptr<const fusion::SceneTemperature> temperature_;
  std::unique_ptr<SurfaceShare> share_;
  Place hottest_, coldest_, over_range_, under_range_;
};

}  // namespace

std::shared_ptr<const SceneSnapshot> snapshot_of(MapVersion version) {
  return std::make_shared<TiledSnapshot>(std::move(version));
}

std::shared_ptr<const SceneSnapshot> SceneSnapshot::build(files::LoadedScene scene, std::uint32_t revision,
                                                          jobs::WorkerPool& pool, std::uint32_t leaf_vertex_count,
                                                          LevelsOfDetail levels, const base::Progress& progress) {
  LivingMap map({.levels = levels, .leaf_vertex_count = leaf_vertex_count});
  MapChange change;
  change.put.push_back({.id = "scene", .scene = std::move(scene), .observed_at = {}});
  return map.apply(std::move(change), revision, pool, progress);
}

bool SceneSnapshot::has_temperature_sigma() const {
  const auto all = tiles();
  return std::any_of(all.begin(), all.end(), [](const auto& tile) { return !tile->sigma_kelvin.empty(); });
}

}  // namespace spectra::map
