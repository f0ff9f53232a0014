#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "server/jobs/worker_pool.hpp"
#include "server/mapping/trajectory.hpp"
#include "server/mapping/voxel_map.hpp"

namespace spectra::mapping {

/// How far a submap reaches: the next one begins where the depth camera has gone or turned so far, or after so long.
struct SubmapRules {
  double metres = 3;
  double seconds = 30;
  double radians = 1.0471975511965976;
};

/// What correct() has done.
struct CorrectionReport {
  std::size_t moved = 0;  ///< Submaps that stand elsewhere now.
  /// What leads from the world of the newest submap's poses to that of the corrected ones.
  Eigen::Isometry3d newest = Eigen::Isometry3d::Identity();
};

/// A map in parts that can be moved: submaps, each with voxels of its own on the grid of the world that its poses were told in. A corrected pose of
/// a moment moves the submap of that moment as a whole. bake() makes one map of them all, by sampling voxels: no picture is looked at again.
/// Takes about twice the memory of one map, beside what the same places in several submaps take. For one thread; uses a pool inside.
class Submaps {
 public:
  /// Corrected poses are compared with told ones at most so far apart in time.
  static constexpr double kLongestGapSeconds = 0.35;

  explicit Submaps(double voxel_m, const SubmapRules& rules = {});

  /// What is seen next goes here.
  VoxelMap& newest() { return *parts_.back().map; }
  /// False: it has been moved, and what is seen waits for the step() that begins another.
  bool is_open() const { return !parts_.back().has_moved; }
  /// A depth picture is about to be fused with that pose: begins another submap where it is time and may be. False: nothing may be fused before one
  /// has begun.
  bool step(double time_s, const Eigen::Isometry3d& world_from_camera, bool may_begin = true);

  /// Moves each submap by the corrected pose nearest to the middle of its time (of a moment at which a pose was told, where there is one); one without any goes with the one before it. What would
  /// stand out of range (is_in_range) stays. Poses that are told from
  /// now on are those of the corrected world: a submap of their own begins.
  CorrectionReport correct(const StampedPoses& corrected);

  /// Brings a map of everything up to date. `all`: whatever has been noted of changes. What two submaps know of a voxel counts by its weight, of temperatures by
  /// their variance. Where one submap alone is known, and has not moved, its voxels are taken as they are.
  void bake(VoxelMap& world, bool all, jobs::WorkerPool& pool);

  std::size_t size() const { return parts_.size(); }
  /// As VoxelMap::block_bytes, of all of them.
  std::size_t block_bytes() const;
  /// The same, of blocks that bake() has not seen yet.
  std::size_t unbaked_bytes() const;
  std::size_t size_bytes() const;

 private:
  struct Part {
    std::unique_ptr<VoxelMap> map;
    StampedPoses told;  ///< With which it was made.
    Eigen::Isometry3d world_from_grid = Eigen::Isometry3d::Identity();
    bool has_moved = false;                                             ///< It has ever.
    Eigen::Isometry3d baked_from_grid = Eigen::Isometry3d::Identity();  ///< Where bake() has seen it last.
    bool had_moved = false;                                             ///< It had then.
    bool is_settled = false;                                            ///< Another had followed it then.
    std::size_t baked_bytes = 0;                                        ///< Its block_bytes() then.
  };
  void begin();

  const double voxel_m_;
  const SubmapRules rules_;
  std::vector<Part> parts_;
};

}  // namespace spectra::mapping
