#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "fusion/base/error.hpp"
#include "fusion/base/progress.hpp"
#include "fusion/files/ply_reader.hpp"
#include "server/jobs/worker_pool.hpp"
#include "server/map/coarse_levels.hpp"
#include "server/map/map_grid.hpp"
#include "server/map/map_tree.hpp"
#include "server/map/map_version.hpp"
#include "server/map/position_step.hpp"
#include "server/map/scene_snapshot.hpp"

namespace spectra::map {

/// A block that comes in makes whole leaves anew, and coarse tiles above them: where blocks come and go, leaves are so many times smaller.
inline constexpr std::uint32_t kSmallerWhereChanging = 4;
/// Of a map that is expected to grow.
inline constexpr std::uint32_t kLiveLeafVertexCount = kLeafVertexCount / kSmallerWhereChanging;

/// How far a replaced block hands its baseline on, in position steps of the map: about two edges of its first block.
inline constexpr double kHandedOnSteps = 8;

/// A part of the map under a name of its own; one of the same name takes its place.
struct BlockPut {
  std::string id;
  files::LoadedScene scene;
  std::optional<double> observed_at;  ///< Unix seconds.
  /// What its vertices are compared with; nothing: what LivingMap::handed_on() says.
  std::optional<BlockBaseline> baseline = std::nullopt;
  bool was_marked = false;  ///< Of a map that is restored: the block was there when the baseline was marked.
};

/// A moment whose temperatures are the baseline.
struct BaselineMark {
  std::uint32_t number = 0;         ///< Rises with every mark.
  std::optional<double> marked_at;  ///< Unix seconds; nothing before the first.
};

/// What decides whether a block can be part of a map.
struct BlockShape {
  std::string_view id;
  std::uint64_t vertex_count = 0;
  bool has_triangles = false;
};

/// What becomes of a map in one step.
struct MapChange {
  std::vector<BlockPut> put;
  std::vector<std::string> removed;  ///< Names that are not there are nothing.
};

/// What stays the same as long as there is anything in a map.
struct MapConstants {
  base::Vec3d origin;  ///< What positions are relative to.
  MapGrid grid;
  float position_step_m = 0;  ///< The largest one.
};

/// A map that is made of blocks, and its versions: each is a scene of its own that does not change any more and shares with the
/// one before what is the same. At full accuracy a version depends on its blocks alone, not on the order in which they came.
/// The constants are given, or what the first block asks for; a map that is emptied takes them from its next first block. One thread at a time.
class LivingMap {
 public:
  struct Options {
    LevelsOfDetail levels = LevelsOfDetail::All;
    std::uint32_t leaf_vertex_count = kLeafVertexCount;
    /// The block that is not expected to change: where another one lies, leaves are kSmallerWhereChanging times smaller. Empty: they are the same everywhere.
    std::string settled_block = {};
    /// The level of the tile that the first block just fills: how often the map may double its extent.
    int first_level = 0;
    bool is_live = false;    ///< Begins empty, and is expected to grow.
    std::string name = {};   ///< Of the scene; empty: that of the first block.
    bool remembers = false;  ///< From the first block on; else from the first change after it.
    BaselineMark mark = {};
  };

  explicit LivingMap(const Options& options, const std::optional<MapConstants>& constants = std::nullopt);

  /// As long as there is a block.
  const std::optional<MapConstants>& constants() const { return constants_; }

  /// Why a change cannot be taken: a block of points where the map has triangles, or the other way round; a block without a vertex;
  /// more vertices in all than fit 32 bits. Error: Unsupported or TooLarge; `field` is the block's name.
  std::optional<base::Error> refusal_of(std::span<const BlockShape> put, std::span<const std::string> removed) const;

  /// What the vertices of a block that is put are compared with (see thermal_change). A block that is there hands its
  /// baseline on, over at most kHandedOnSteps of the map's position step; else each vertex is compared with itself.
  BlockBaseline handed_on(std::string_view id, const mesh::MultispectralMesh& mesh,
                          std::optional<double> observed_at) const;

  /// From now on temperatures are compared with those of now. The next version.
  std::shared_ptr<const SceneSnapshot> mark_baseline(double marked_at, std::uint32_t revision);
  const BaselineMark& baseline_mark() const { return mark_; }

  /// The next version. Positions of blocks are taken relative to the origin of the map. The blocks that are put have different
  /// names, and there is no refusal_of() them. Coarse tiles that were there before may not show yet what has changed beneath
  /// them; see next_coarse(). Must not be called from a job of the pool. `progress` is told of kTilingPhase.
  std::shared_ptr<const SceneSnapshot> apply(MapChange change, std::uint32_t revision, jobs::WorkerPool& pool,
                                             const base::Progress& progress = {});

  /// Some coarse tiles do not show yet what is beneath them.
  bool is_behind() const;
  /// The next of them, to be run and taken; nothing when the map is complete.
  std::optional<CoarseWork> next_coarse();
  /// The next version, with a tile that was made. Null when the map has changed meanwhile so that it has no place.
  std::shared_ptr<const SceneSnapshot> take_coarse(const CoarseWork& work, std::uint32_t revision);
  /// Nothing more is expected for a while: gives back the memory that is kept for the next tile.
  void rest() { coarse_.rest(); }

 private:
  std::shared_ptr<const SceneSnapshot> snapshot(std::uint32_t revision);
  MapVersion version(std::uint32_t revision);
  void count_percentiles(const MapVersion& version);
  /// Automatic values found with the reference are still what this version would ask for, nearly.
  bool is_reference_good(const MapVersion& version);
  std::vector<files::Note> notes() const;
  /// The map has that block already, the same in every vertex and triangle and of the same time: all tiles stay as they are.
  bool is_there_already(const BlockPut& put) const;
  void put_first(BlockPut put, jobs::WorkerPool& pool, const base::Progress& progress);
  void change(std::vector<BlockPut> put, std::span<const std::string> removed, jobs::WorkerPool& pool,
              const base::Progress& progress);
  /// Of a block that comes in, its positions relative to the origin of the map from then on.
  std::shared_ptr<const MapBlock> taken_in(BlockPut& put);
  ReplacedVertices replaced_vertices(BlockNumber block) const;
  /// Of the first block, and the tiles for it: where some reach too far for the steps that form asks for there, all are cut anew in smaller cells.
  void choose_steps(ChangedTree& first, jobs::WorkerPool& pool, const std::function<void(double)>& found_share);
  MapGrid grid_for(const LostForm& lost, std::span<const std::shared_ptr<Tile>> leaves) const;
  /// The tree with what has changed.
  void take(ChangedTree changed, jobs::WorkerPool& pool, const base::Progress& progress);
  TileSizes sizes() const;
  CoarseLevels::Options coarse_options() const;

  const Options options_;
  std::optional<MapConstants> constants_;
  std::string first_id_;  ///< Of the block that came first: its name and what is up in it are the scene's.
  BlocksByName blocks_;
  BlockLabels labels_;
  BlockNumber last_number_ = 0;
  BaselineMark mark_;
  bool remembers_;  ///< There is a before that what is put can be compared with.
  std::shared_ptr<const MapNode> root_;
  CoarseLevels coarse_;

  // Of the last version.
  std::optional<fusion::Histogram> percentiles_;  ///< Kept while the extremes stay; else counted when they are needed.
  std::shared_ptr<const fusion::SceneTemperature> reference_;
  std::uint64_t changed_vertex_count_ = 0;    ///< Since the reference was taken.
  std::uint64_t looked_at_vertex_count_ = 0;  ///< Changed since its quantiles were looked at.
};

}  // namespace spectra::map
