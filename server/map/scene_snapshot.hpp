#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "fusion/base/bounds.hpp"
#include "fusion/base/progress.hpp"
#include "fusion/base/vertex_types.hpp"
#include "fusion/files/ply_reader.hpp"
#include "fusion/fusion_plan.hpp"
#include "fusion/mesh/multispectral_mesh.hpp"
#include "fusion/statistics/temperature_statistics.hpp"
#include "protocol/tile_frame.hpp"
#include "server/jobs/worker_pool.hpp"
#include "server/map/vertex_times.hpp"

namespace spectra::map {

/// How many times the position step is halved for a vertex, along each axis.
using StepHalvings = std::array<std::uint8_t, 3>;

/// One node of the tile tree: flat arrays of its vertices. Owned vertices come first: every vertex of the scene is owned
/// by exactly one leaf, copies on a border follow. Vertices of no triangle are owned too, but not part of the geometry.
/// Every tile of a scene with triangles has at least one.
struct Tile {
  protocol::TileId id;
  std::uint8_t child_mask = 0;
  float geometric_error_m = 0;  ///< Against the full mesh; 0 at leaves.
  /// Largest difference of a channel from the full mesh, 95th percentile of the worst part of the tile; 0 at leaves.
  float colour_error_levels = 0;
  float temperature_error_celsius = 0;  ///< The same of the temperature; NaN = none has one.
  float lost_detail_m = 0;              ///< Size of the largest detail that is seen wrong; 0 at leaves.
  base::Bounds bounds;
  /// Of the geometry under this tile in the full mesh; NaN = no temperature, infinite = beyond the sensor's range.
  float lowest_celsius = 0;
  float highest_celsius = 0;
  std::uint32_t owned_count = 0;
  std::vector<base::Vec3f> positions;
  std::vector<base::Rgb8> visible;
  std::vector<float> temperature_celsius;
  std::uint32_t block = 0;                   ///< The block of the map that it is of, or its first vertex.
  std::vector<std::uint32_t> vertex_block;   ///< Per vertex; empty: all are of `block`.
  std::vector<std::uint32_t> source_vertex;  ///< Index in its block, per vertex.
  std::vector<StepHalvings> step_halvings;   ///< Per vertex; empty: none are halved.
  VertexTimes seen_at;  ///< When each vertex was seen; of a coarse tile the newest of what it stands for.
  /// What each vertex is compared with, degC (NaN: nothing), as long as the newest mark of the map is `baseline_mark`; empty, or when
  /// it is another: with its own temperature.
  std::vector<float> baseline_celsius;
  VertexTimes baseline_at;  ///< Of a leaf: the times they are of.
  std::uint32_t baseline_mark = 0;
  /// How sure each temperature is, kelvin (NaN: not known), and when the thermal camera last looked there, on the source's clock; empty:
  /// not known of any.
  std::vector<float> sigma_kelvin;
  VertexTimes looked_at;
  std::vector<base::Triangle> triangles;       ///< Indices into this tile; empty for a point cloud.
  std::vector<std::uint32_t> source_triangle;  ///< Index in its block, per triangle (leaves).
};

/// The vertex nearest to a place, at full accuracy.
struct Probe {
  std::uint32_t vertex_index = 0;            ///< In the input's order.
  base::Vec3f position;                      ///< Metres relative to the scene origin.
  std::optional<float> temperature_celsius;  ///< Infinite where the sensor was beyond its range.
  base::Rgb8 visible;
  double distance_m = 0;
  std::optional<double> observed_at;  ///< Unix seconds.
  /// What the temperature is compared with, and the time that is of: later than that it was another, or has not been looked at.
  std::optional<float> baseline_celsius;
  std::optional<double> baseline_at;
  std::optional<float> sigma_kelvin;  ///< Standard deviation of the temperature.
  std::optional<double> looked_at;    ///< When the thermal camera last looked there, Unix seconds.
};

/// Where it is hottest or coldest.
struct Extreme {
  base::Vec3f position;
  float temperature_celsius = 0;
};

/// About how many vertices a leaf has unless said otherwise.
inline constexpr std::uint32_t kLeafVertexCount = 32'000;

/// What a snapshot tells of its making.
inline constexpr std::string_view kTilingPhase = "tiling";

/// Which tiles a snapshot has.
enum class LevelsOfDetail {
  LeavesOnly,  ///< The full mesh alone.
  All,         ///< Coarser tiles above it too, up to the root.
};

/// An immutable scene, cut into tiles; shared by pointer, readers never lock. The histogram is computed once for each number
/// of bins, when first asked for (thread-safe).
class SceneSnapshot {
 public:
  /// Cuts the mesh into octree leaves of about `leaf_vertex_count` vertices (small ones merged with a neighbour).
  /// Consumes the mesh so that peak memory stays low. `revision` rises with every snapshot of a store. The same tiles
  /// for any number of threads. Must not be called from a job of the pool. `progress` is told of kTilingPhase.
  static std::shared_ptr<const SceneSnapshot> build(files::LoadedScene scene, std::uint32_t revision,
                                                    jobs::WorkerPool& pool,
                                                    std::uint32_t leaf_vertex_count = kLeafVertexCount,
                                                    LevelsOfDetail levels = LevelsOfDetail::LeavesOnly,
                                                    const base::Progress& progress = {});
  /// The same for a mesh of which nothing has to be said.
  static std::shared_ptr<const SceneSnapshot> build(mesh::MultispectralMesh mesh, std::uint32_t revision,
                                                    jobs::WorkerPool& pool,
                                                    std::uint32_t leaf_vertex_count = kLeafVertexCount,
                                                    LevelsOfDetail levels = LevelsOfDetail::LeavesOnly) {
    return build(files::LoadedScene{std::move(mesh), {}, {}}, revision, pool, leaf_vertex_count, levels);
  }
  virtual ~SceneSnapshot() = default;

  virtual const std::string& name() const = 0;
  virtual std::uint32_t revision() const = 0;
  virtual std::uint64_t vertex_count() const = 0;
  virtual std::uint64_t triangle_count() const = 0;
  virtual bool is_point_cloud() const = 0;
  virtual base::Vec3d origin() const = 0;
  virtual const base::Bounds& bounds() const = 0;
  /// Of all that is worth a look: bounds() without the few vertices that lie far from everything else.
  virtual const base::Bounds& core_bounds() const = 0;
  virtual base::UpAxis up() const = 0;
  /// Somebody has said that positions are in metres; otherwise they are taken for it.
  virtual bool is_metric() const = 0;
  /// What was noticed while the scene was read.
  virtual std::span<const files::Note> notes() const = 0;
  /// A version of a map that began empty and is expected to grow.
  virtual bool is_live() const { return false; }
  /// When the oldest and the newest part was seen, Unix seconds; of the parts of which that is known.
  virtual std::optional<std::pair<double, double>> observed() const { return std::nullopt; }
  /// Which mark its temperatures are compared with, 0 before the first; nothing in a scene that does not remember, as a file.
  virtual std::optional<std::uint32_t> baseline_mark() const { return std::nullopt; }
  /// When that was set, Unix seconds.
  virtual std::optional<double> baseline_marked_at() const { return std::nullopt; }
  virtual int level_count() const = 0;
  /// All tiles, coarse before fine.
  virtual std::span<const std::shared_ptr<const Tile>> tiles() const = 0;
  /// Of some vertices it is known how sure their temperature is.
  bool has_temperature_sigma() const;
  /// Summary and histogram. A copy stays valid without the snapshot.
  virtual const fusion::SceneTemperature& temperature() const = 0;
  /// The same, for FusionPlan::prepare, of this or an earlier version of a map that grows: automatic values do not follow every
  /// block, so that what has not changed keeps its colours. Another object means other values.
  virtual std::shared_ptr<const fusion::SceneTemperature> reference_temperature() const = 0;
  /// Which vertex of whole_mesh() a vertex of a leaf is.
  virtual std::uint32_t vertex_index(const Tile& leaf, std::size_t vertex) const = 0;
  /// Of several equally near vertices the one that was seen last, and of those the first of the input; nothing in an empty scene
  /// or at a position that is not finite.
  virtual std::optional<Probe> probe(base::Vec3f position) const = 0;
  /// Of the finite temperatures; of several the first of the input; nothing without thermal data.
  virtual std::optional<Extreme> hottest() const = 0;
  virtual std::optional<Extreme> coldest() const = 0;
  /// The first vertex of the input that is hotter or colder than the sensor could tell; its temperature is infinite.
  virtual std::optional<Extreme> over_range() const = 0;
  virtual std::optional<Extreme> under_range() const = 0;
  /// The largest position step (metres) of the scene, a power of two: about a quarter of the median edge length (of a point
  /// cloud: of the distance to the nearest neighbour). Where the scene holds finer form its tiles say how often it is halved;
  /// see PositionSteps. Positive and finite whatever the scene.
  virtual float suggested_position_step_m() const = 0;
  /// Which share of the surface, 0 to 1, a plan made for this scene highlights; of a point cloud, or of a mesh without any
  /// area, which share of the vertices. Thread-safe.
  virtual double highlighted_share(const fusion::FusionPlan& plan) const = 0;
  /// A block as it was put, its positions relative to the origin; nothing when there is none of that name.
  virtual std::optional<mesh::MultispectralMesh> block_mesh(std::string_view id) const = 0;
  /// The scene as it was read, vertices and triangles in the input's order; for exports. Costs a full copy.
  virtual mesh::MultispectralMesh whole_mesh() const = 0;
  /// What the vertices of whole_mesh() are compared with; empty where baseline_mark() is nothing.
  virtual std::vector<float> whole_baseline() const { return {}; }
};

/// What the vertices of a tile are compared with in a scene with that baseline_mark(); empty: nothing.
inline std::span<const float> baseline_of(const Tile& tile, std::optional<std::uint32_t> mark) {
  if (!mark) return {};
  const bool is_kept = !tile.baseline_celsius.empty() && tile.baseline_mark == *mark;
  return is_kept ? std::span<const float>(tile.baseline_celsius) : std::span<const float>(tile.temperature_celsius);
}

}  // namespace spectra::map
