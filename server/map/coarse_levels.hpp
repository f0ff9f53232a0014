#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <set>

#include "fusion/base/progress.hpp"
#include "server/jobs/worker_pool.hpp"
#include "server/map/border_index.hpp"
#include "server/map/coarse_tile.hpp"
#include "server/map/map_tree.hpp"

namespace spectra::map {

/// A coarse tile that is to be made anew. Holds all that this needs.
class CoarseWork {
 public:
  CoarseWork(std::shared_ptr<const MapNode> from, bool is_top, std::shared_ptr<const BorderIndex> borders,
             const CoarseOptions& options, std::shared_ptr<mesh::SimplifyMemory> memory);

  /// Makes the tile; from any thread, while the map goes on.
  void run();

  const std::shared_ptr<const MapNode>& from() const { return from_; }
  /// The same cell with its new tile, after run().
  const MapNode& made() const { return *made_; }

 private:
  std::shared_ptr<const MapNode> from_;
  std::shared_ptr<MapNode> made_;
  bool is_top_;
  std::shared_ptr<const BorderIndex> borders_;
  CoarseOptions options_;
  std::shared_ptr<mesh::SimplifyMemory> memory_;
};

/// Keeps the tiles above the leaves of a map that changes. Right after a change a coarse tile may still be the one of before: what has
/// changed beneath it is seen when its CoarseWork is done and taken. One thread at a time.
class CoarseLevels {
 public:
  /// The facts of which map the tiles are made.
  struct Options {
    TileSizes sizes;
    float position_step_m = 0;
    std::uint32_t baseline_mark = 0;
  };

  /// Gives the nodes that have been made their coarse tiles: those of before where there are some, new ones where not. `before` is the tree before.
  void change(ChangedTree& changed, const std::shared_ptr<const MapNode>& before, const Options& options,
              jobs::WorkerPool& pool, const base::Progress& progress);

  /// Some tiles do not show yet what is beneath them.
  bool are_behind() const { return !outdated_.empty(); }
  /// The next tile to be made, in rounds from fine to coarse; nothing when all show what is beneath them.
  std::optional<CoarseWork> next(const std::shared_ptr<const MapNode>& root, const Options& options);
  /// The tree with the tile that was made; the same tree when that cell is not what it was any more.
  std::shared_ptr<const MapNode> taken(const std::shared_ptr<const MapNode>& root, const CoarseWork& work);
  /// Gives back the memory that is kept for the next tile.
  void rest() { memory_->clear(); }

 private:
  std::set<protocol::TileId> update_borders(const ChangedTree& changed, jobs::WorkerPool& pool);
  bool has_new_spread(const std::shared_ptr<const MapNode>& root);
  CoarseOptions coarse_options(const MapNode& root, const Options& options) const;

  const std::shared_ptr<BorderIndex> borders_ = std::make_shared<BorderIndex>();
  const std::shared_ptr<mesh::SimplifyMemory> memory_ = std::make_shared<mesh::SimplifyMemory>();
  float median_celsius_ = std::numeric_limits<float>::quiet_NaN();
  double span_celsius_ = 1;
  std::uint64_t spread_vertex_count_ = 0;  ///< So many vertices the map had when the last two were found.
  std::set<protocol::TileId> outdated_;    ///< Cells whose tiles are not made of what is beneath them now.
  std::set<protocol::TileId> round_;       ///< Those of them that are still to be made in this round.
};

}  // namespace spectra::map
