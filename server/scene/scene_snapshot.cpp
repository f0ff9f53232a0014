#include "server/scene/scene_snapshot.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <list>
#include <mutex>
#include <utility>

#include "server/scene/octree_cut.hpp"
#include "server/scene/position_step.hpp"
#include "server/scene/surface.hpp"
#include "server/scene/tile_tree.hpp"

#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace spectra::server {
namespace {

using fusion::Vec3f;

std::span<const float> owned_temperature(const Tile& tile) {
  return std::span(tile.temperature_celsius).first(tile.owned_count);
}

/// What is computed of all vertices of a scene: the histogram of percentiles at once, because a greeting must not wait for
/// it; when first asked for histograms by number of bins, of which the last few are kept, because a slider may visit
/// thousands, and the hues.
class FactSource {
 public:
  FactSource(std::vector<std::shared_ptr<const Tile>> leaves, const fusion::TemperatureSummary& summary)
      : leaves_(std::move(leaves)), summary_(summary), percentiles_(counted(fusion::kPercentileBins)) {}

  fusion::Hues hues() {
    const std::lock_guard lock(mutex_);
    if (!hues_) {
      hues_.emplace();
      for (const auto& leaf : leaves_) fusion::add_to_hues(std::span(leaf->visible).first(leaf->owned_count), *hues_);
    }
    return *hues_;
  }

  fusion::Histogram histogram(std::uint32_t bins) {
    if (bins == fusion::kPercentileBins) return percentiles_;
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
    for (const auto& leaf : leaves_) fusion::add_to_histogram(owned_temperature(*leaf), made);
    return made;
  }

  const std::vector<std::shared_ptr<const Tile>> leaves_;
  const fusion::TemperatureSummary summary_;
  const fusion::Histogram percentiles_;
  std::mutex mutex_;
  std::list<fusion::Histogram> recent_;
  std::optional<fusion::Hues> hues_;
};

double triangle_area(Vec3f a, Vec3f b, Vec3f c) {
  const auto edge = [a](Vec3f to) {
    return std::array{double{to.x} - double{a.x}, double{to.y} - double{a.y}, double{to.z} - double{a.z}};
  };
  const auto u = edge(b);
  const auto v = edge(c);
  return std::hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]) / 2;
}

/// The surface that each vertex of a leaf stands for: a third of its triangles.
std::vector<float> vertex_areas(const Tile& leaf) {
  std::vector<float> areas(leaf.positions.size());
  for (const fusion::Triangle& triangle : leaf.triangles) {
    const double area =
        triangle_area(leaf.positions[triangle[0]], leaf.positions[triangle[1]], leaf.positions[triangle[2]]);
    for (const std::uint32_t v : triangle) areas[v] += static_cast<float>(area / 3);
  }
  return areas;
}

/// Which share of a scene's surface a plan highlights. The surface of each vertex is found when first asked for, and kept.
class SurfaceShare {
 public:
  SurfaceShare(std::span<const std::shared_ptr<const Tile>> leaves, bool is_point_cloud)
      : leaves_(leaves), is_point_cloud_(is_point_cloud) {}

  double highlighted(const fusion::FusionPlan& plan) {
    if (!is_point_cloud_) std::call_once(once_, [this] { find_areas(); });
    double marked_area = 0;
    std::uint64_t marked_count = 0;
    std::uint64_t count = 0;
    std::vector<std::uint8_t> marked;
    for (std::size_t i = 0; i < leaves_.size(); ++i) {
      const Tile& leaf = *leaves_[i];
      marked.resize(leaf.temperature_celsius.size());
      plan.mark(leaf.temperature_celsius, marked);
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
      areas_.push_back(vertex_areas(*leaf));
      for (const float area : areas_.back()) total += double{area};
    }
    // Beyond what floats hold, and without any extent, vertices are counted instead.
    if (std::isfinite(total)) total_area_ = total;
  }

  const std::span<const std::shared_ptr<const Tile>> leaves_;
  const bool is_point_cloud_;
  std::once_flag once_;
  std::vector<std::vector<float>> areas_;  ///< By leaf.
  double total_area_ = 0;
};

/// What one leaf contributes to the facts of the scene.
struct LeafFacts {
  fusion::TemperatureAccumulator temperature;
  std::optional<std::uint32_t> hottest, coldest;         ///< Of the finite ones; indices into the leaf.
  std::optional<std::uint32_t> over_range, under_range;  ///< The first of the input.
};

LeafFacts leaf_facts(const Tile& leaf) {
  LeafFacts facts;
  facts.temperature.add(owned_temperature(leaf));
  const auto is_before = [&](std::uint32_t a, std::uint32_t b) {
    return leaf.source_vertex[a] < leaf.source_vertex[b];
  };
  for (std::uint32_t v = 0; v < leaf.owned_count; ++v) {
    const float t = leaf.temperature_celsius[v];
    if (std::isnan(t)) continue;
    if (std::isinf(t)) {
      std::optional<std::uint32_t>& first = t > 0 ? facts.over_range : facts.under_range;
      if (!first || is_before(v, *first)) first = v;
      continue;
    }
    const auto better = [&](std::optional<std::uint32_t>& best, bool is_beyond, bool is_equal) {
      if (is_beyond || (is_equal && is_before(v, *best))) best = v;
    };
    const float hot = facts.hottest ? leaf.temperature_celsius[*facts.hottest] : t;
    const float cold = facts.coldest ? leaf.temperature_celsius[*facts.coldest] : t;
    better(facts.hottest, !facts.hottest || t > hot, t == hot);
    better(facts.coldest, !facts.coldest || t < cold, t == cold);
  }
  return facts;
}

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

/// About what share of the making is done with the leaves; and of that, when they are cut and when the steps are known.
constexpr double kLeavesShare = 0.25;
constexpr double kCutShare = 0.6;
constexpr double kStepsShare = 0.9;

class TiledSnapshot final : public SceneSnapshot {
 public:
  TiledSnapshot(fusion::LoadedScene scene, std::uint32_t revision, WorkerPool& pool, std::uint32_t leaf_vertex_count,
                LevelsOfDetail levels, const fusion::Progress& progress)
      : name_(scene.mesh.name),
        revision_(revision),
        vertex_count_(scene.mesh.vertex_count()),
        triangle_count_(scene.mesh.triangle_count()),
        is_point_cloud_(scene.mesh.is_point_cloud()),
        origin_(scene.mesh.origin),
        has_visible_(scene.mesh.has_visible),
        has_temperature_(scene.mesh.has_temperature),
        double_positions_(scene.mesh.double_positions),
        left_out_(scene.mesh.left_out),
        up_(scene.mesh.up),
        is_metric_(scene.mesh.is_metric),
        notes_(std::move(scene.notes)) {
    std::vector<std::shared_ptr<Tile>> leaves = cut_leaves(std::move(scene.mesh), pool, leaf_vertex_count, levels);
    const double leaves_share = levels == LevelsOfDetail::All ? kLeavesShare : 1;
    fusion::report(progress, kTilingPhase, leaves_share * kCutShare);
    const PositionSteps position_steps(leaves, pool);
    fusion::report(progress, kTilingPhase, leaves_share * kStepsShare);
    position_step_m_ = position_steps.largest_step_m();
    pool.for_each(leaves.size(), [&](std::size_t i) { position_steps.apply(*leaves[i]); });
    std::vector<LeafFacts> facts(leaves.size());
    std::atomic<std::size_t> done_count{0};
    pool.for_each(leaves.size(), [&](std::size_t i) {
      facts[i] = leaf_facts(*leaves[i]);
      const double done_share = static_cast<double>(++done_count) / static_cast<double>(leaves.size());
      fusion::report(progress, kTilingPhase, leaves_share * (kStepsShare + (1 - kStepsShare) * done_share));
    });
    leaves_.assign(leaves.begin(), leaves.end());
    gather(std::move(facts));
    core_bounds_ = scene.core_bounds.value_or(bounds_);
    if (levels == LevelsOfDetail::All) {
      const auto [median_celsius, span_celsius] = temperature_spread();
      const TreeOptions options{.tile_vertex_count = leaf_vertex_count,
                                .root_vertex_count = root_vertex_count(leaf_vertex_count),
                                .median_celsius = median_celsius,
                                .span_celsius = span_celsius,
                                .position_steps = &position_steps};
      tiles_ = tile_tree(std::move(leaves), is_point_cloud_, options, pool, [&](double made_share) {
        fusion::report(progress, kTilingPhase, leaves_share + (1 - leaves_share) * made_share);
      });
    } else {
      tiles_ = leaves_;
    }
  }

  const std::string& name() const override { return name_; }
  std::uint32_t revision() const override { return revision_; }
  std::uint64_t vertex_count() const override { return vertex_count_; }
  std::uint64_t triangle_count() const override { return triangle_count_; }
  bool is_point_cloud() const override { return is_point_cloud_; }
  fusion::Vec3d origin() const override { return origin_; }
  const Bounds& bounds() const override { return bounds_; }
  const Bounds& core_bounds() const override { return core_bounds_; }
  fusion::UpAxis up() const override { return up_; }
  bool is_metric() const override { return is_metric_; }
  std::span<const fusion::Note> notes() const override { return notes_; }
  int level_count() const override { return tiles_.empty() ? 0 : tiles_.back()->id.level + 1; }
  std::span<const std::shared_ptr<const Tile>> tiles() const override { return tiles_; }
  const fusion::SceneTemperature& temperature() const override { return temperature_; }
  std::optional<Extreme> hottest() const override { return hottest_; }
  std::optional<Extreme> coldest() const override { return coldest_; }
  std::optional<Extreme> over_range() const override { return over_range_; }
  std::optional<Extreme> under_range() const override { return under_range_; }
  float suggested_position_step_m() const override { return position_step_m_; }
  double highlighted_share(const fusion::FusionPlan& plan) const override { return share_->highlighted(plan); }

  std::optional<Probe> probe(Vec3f position) const override {
    if (!std::isfinite(position.x) || !std::isfinite(position.y) || !std::isfinite(position.z)) return {};
    std::vector<std::pair<double, const Tile*>> by_distance;
    by_distance.reserve(leaves_.size());
    for (const auto& leaf : leaves_)
      by_distance.emplace_back(squared_distance_to_box(position, leaf->bounds), leaf.get());
    std::sort(by_distance.begin(), by_distance.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    const Tile* best_tile = nullptr;
    std::size_t best_vertex = 0;
    double best_squared = 0;
    for (const auto& [box_squared, tile] : by_distance) {
      if (best_tile != nullptr && box_squared > best_squared) break;
      for (std::size_t v = 0; v < tile->owned_count; ++v) {
        const double squared = squared_distance(position, tile->positions[v]);
        if (best_tile == nullptr || squared < best_squared ||
            (squared == best_squared && tile->source_vertex[v] < best_tile->source_vertex[best_vertex])) {
          best_tile = tile;
          best_vertex = v;
          best_squared = squared;
        }
      }
    }
    if (best_tile == nullptr) return {};
    Probe result;
    result.vertex_index = best_tile->source_vertex[best_vertex];
    result.position = best_tile->positions[best_vertex];
    result.visible = best_tile->visible[best_vertex];
    const float temperature = best_tile->temperature_celsius[best_vertex];
    if (!std::isnan(temperature)) result.temperature_celsius = temperature;
    result.distance_m = std::sqrt(best_squared);
    return result;
  }

  fusion::MultispectralMesh whole_mesh() const override {
    fusion::MultispectralMesh mesh;
    mesh.origin = origin_;
    mesh.has_visible = has_visible_;
    mesh.has_temperature = has_temperature_;
    mesh.double_positions = double_positions_;
    mesh.left_out = left_out_;
    mesh.name = name_;
    mesh.up = up_;
    mesh.is_metric = is_metric_;
    mesh.resize_vertices(static_cast<std::size_t>(vertex_count_));
    mesh.triangles().resize(static_cast<std::size_t>(triangle_count_));
    const std::span<Vec3f> positions = mesh.positions();
    const std::span<fusion::Rgb8> visible = mesh.visible();
    const std::span<float> temperature = mesh.temperature_celsius();
    for (const auto& leaf : leaves_) {
      for (std::size_t v = 0; v < leaf->owned_count; ++v) {
        const std::uint32_t source = leaf->source_vertex[v];
        positions[source] = leaf->positions[v];
        visible[source] = leaf->visible[v];
        temperature[source] = leaf->temperature_celsius[v];
      }
      for (std::size_t t = 0; t < leaf->triangles.size(); ++t) {
        fusion::Triangle& triangle = mesh.triangles()[leaf->source_triangle[t]];
        for (unsigned corner = 0; corner < 3; ++corner) {
          triangle[corner] = leaf->source_vertex[leaf->triangles[t][corner]];
        }
      }
    }
    return mesh;
  }

 private:
  /// The mesh is freed on return, before anything else is made of the leaves.
  static std::vector<std::shared_ptr<Tile>> cut_leaves(fusion::MultispectralMesh mesh, WorkerPool& pool,
                                                       std::uint32_t leaf_vertex_count, LevelsOfDetail levels) {
    const fusion::MultispectralMesh consumed = std::move(mesh);
    const OctreeCut cut = octree_cut(consumed, std::max(1u, leaf_vertex_count), pool,
                                     levels == LevelsOfDetail::All ? root_vertex_count(leaf_vertex_count)
                                                                   : std::numeric_limits<std::uint32_t>::max());
    std::vector<std::shared_ptr<Tile>> leaves(cut.leaves.size());
    pool.for_each(leaves.size(), [&](std::size_t i) { leaves[i] = leaf_tile(consumed, cut.leaves[i]); });
    return leaves;
  }

  /// 20,000 of 32,000: with 32,000 vertices geometry and colours of a noisy scene would be more than a first picture should
  /// cost.
  static std::uint32_t root_vertex_count(std::uint32_t leaf_vertex_count) {
    return std::max(1u, leaf_vertex_count / 8 * 5);
  }

  /// The median of all finite temperatures, the lower one of an even number, NaN without any; and between which nearly all
  /// lie, at least a degree apart: noise of a scene of one temperature is no contrast.
  std::pair<float, double> temperature_spread() const {
    std::vector<float> finite;
    finite.reserve(static_cast<std::size_t>(temperature_.summary.finite_count));
    for (const auto& leaf : leaves_) {
      for (const float t : owned_temperature(*leaf)) {
        if (std::isfinite(t)) finite.push_back(t);
      }
    }
    if (finite.empty()) return {std::numeric_limits<float>::quiet_NaN(), 1};
    const auto at = [&](double share) {
      const auto place = finite.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(finite.size() - 1));
      std::nth_element(finite.begin(), place, finite.end());
      return *place;
    };
    const double low = static_cast<double>(at(0.005)), high = static_cast<double>(at(0.995));
    return {at(0.5), std::max(high - low, 1.0)};
  }

  void gather(std::vector<LeafFacts> facts) {
    fusion::TemperatureAccumulator accumulator;
    std::uint32_t hottest_source = 0, coldest_source = 0, over_source = 0, under_source = 0;
    const auto take = [](std::optional<Extreme>& best, std::uint32_t& best_source, const Tile& leaf,
                         std::optional<std::uint32_t> vertex, float sign) {
      if (!vertex) return;
      const float t = leaf.temperature_celsius[*vertex];
      const std::uint32_t source = leaf.source_vertex[*vertex];
      if (!best || sign * t > sign * best->temperature_celsius ||
          (t == best->temperature_celsius && source < best_source)) {
        best = Extreme{leaf.positions[*vertex], t};
        best_source = source;
      }
    };
    std::vector<Vec3f> corners;
    for (std::size_t i = 0; i < leaves_.size(); ++i) {
      const Tile& leaf = *leaves_[i];
      accumulator.merge(facts[i].temperature);
      take(hottest_, hottest_source, leaf, facts[i].hottest, 1.0f);
      take(coldest_, coldest_source, leaf, facts[i].coldest, -1.0f);
      take(over_range_, over_source, leaf, facts[i].over_range, 1.0f);
      take(under_range_, under_source, leaf, facts[i].under_range, -1.0f);
      corners.push_back(leaf.bounds.min);
      corners.push_back(leaf.bounds.max);
    }
    if (!corners.empty()) bounds_ = bounds_of(corners);
    temperature_.summary = accumulator.summary();
    const auto source = std::make_shared<FactSource>(leaves_, temperature_.summary);
    temperature_.histogram = [source](std::uint32_t bins) { return source->histogram(bins); };
    temperature_.hues = [source] { return source->hues(); };
    share_ = std::make_unique<SurfaceShare>(leaves_, is_point_cloud_);
  }

  std::string name_;
  std::uint32_t revision_;
  std::uint64_t vertex_count_;
  std::uint64_t triangle_count_;
  bool is_point_cloud_;
  fusion::Vec3d origin_;
  bool has_visible_, has_temperature_, double_positions_;
  std::vector<fusion::LeftOutVertex> left_out_;
  fusion::UpAxis up_;
  bool is_metric_;
  std::vector<fusion::Note> notes_;
  Bounds bounds_, core_bounds_;
  std::vector<std::shared_ptr<const Tile>> tiles_;
  std::vector<std::shared_ptr<const Tile>> leaves_;
  fusion::SceneTemperature temperature_;
  std::unique_ptr<SurfaceShare> share_;
  std::optional<Extreme> hottest_, coldest_, over_range_, under_range_;
  float position_step_m_ = 0;
};

}  // namespace

std::shared_ptr<const SceneSnapshot> SceneSnapshot::build(fusion::LoadedScene scene, std::uint32_t revision,
                                                          WorkerPool& pool, std::uint32_t leaf_vertex_count,
                                                          LevelsOfDetail levels, const fusion::Progress& progress) {
  fusion::report(progress, kTilingPhase, 0);
  const FreedMemoryGoesBack scope;
  return std::make_shared<TiledSnapshot>(std::move(scene), revision, pool, leaf_vertex_count, levels, progress);
}

}  // namespace spectra::server
