#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "fusion/base/error.hpp"
#include "fusion/base/progress.hpp"
#include "server/mapping/calibration.hpp"
#include "server/mapping/depth_frame.hpp"
#include "server/mapping/depth_fusion.hpp"
#include "server/mapping/frame_folder.hpp"
#include "server/mapping/heat_fusion.hpp"
#include "server/mapping/submaps.hpp"
#include "server/mapping/surface_mesh.hpp"
#include "server/mapping/tracker.hpp"
#include "server/mapping/unit_publisher.hpp"
#include "server/mapping/voxel_map.hpp"

namespace spectra::mapping {

struct MapperSettings {
  double voxel_m = 0.01;
  bool use_colour = true;
  bool use_thermal = true;
  bool is_tracking =
      false;  ///< Poses are found from what is seen; of those that are given only that nearest to the first depth picture counts.
  std::optional<SubmapRules> submaps;  ///< Of given poses: the map is made in parts, which correct() moves.
  /// Of the blocks of voxels, of all submaps and the map that is made of them together. A map that has taken them maps nothing new, begins no submap, says so (MapFull), and
  /// goes on with what it has. Submaps that are turned may reach some more blocks than before.
  std::uint64_t most_bytes = std::numeric_limits<std::uint64_t>::max();
  HeatRules heat;
  MeshRules mesh;
  TrackerRules tracker;
};

/// What a mapper has done so far.
struct MapperFigures {
  std::size_t depth_frames = 0, colour_frames = 0, thermal_frames = 0;  ///< That were fused.
  std::size_t frozen_frames = 0;                                        ///< Thermal pictures of a closed shutter.
  double spread_kelvin = 0;          ///< Median over the thermal pictures: what they differ from what was known.
  double largest_offset_kelvin = 0;  ///< Of a thermal picture, in amount.
  std::size_t tracked_frames = 0, lost_frames = 0;  ///< Depth pictures whose pose was found, and was not.
  double tracking_residual_m = 0;  ///< Root mean square over those that were found, of what they differ from the map.
};

/// Makes a map of frames whose poses are known, or are told from the map itself. For one thread; uses a pool inside.
class Mapper {
 public:
  Mapper(const Calibration& calibration, const MapperSettings& settings, jobs::WorkerPool& pool);
  Mapper(const Mapper&) = delete;
  Mapper& operator=(const Mapper&) = delete;

  /// Kelvin to subtract from each thermal pixel, in place of the calibration's. Inconsistent when it is not of the camera's size.
  base::Result<void> set_vignetting(PictureFloat picture);

  /// Fuses what of a frame has a pose (tracking: the trajectory may be empty, then the first pose is none at all; thermal pictures wait for the
  /// depth picture after them); frames in order of their time. What cannot be fused is left out and stands in `faults`; of a frame before that had waited, in `faults_of_earlier`
  /// where there is one.
  void fuse(const Frame& frame, const Trajectory& trajectory, FaultLog& faults, FaultLog* faults_of_earlier = nullptr);

  /// Poses of the depth camera turn out to be others: submaps move, and what is fused from now on has poses of the corrected world. Of a mapper with
  /// submaps.
  CorrectionReport correct(const StampedPoses& poses);

  /// Tracking: thermal pictures that wait for the depth picture after them; with more the oldest is left out.
  static constexpr std::size_t kMostHeld = 64;

  /// The surface of everything, as one mesh. A sigma is at least kSystematic of what pictures differ from the map in the middle: the part
  /// of their errors that is in all of them does not become less with more looks. `progress` is told of kMeshingPhase.
  UnitMesh whole_mesh(const base::Progress& progress = {});
  static constexpr double kSystematic = 1;
  static constexpr std::string_view kMeshingPhase = "meshing";

  /// What has changed since the last call with this publisher; of at most about `most` units (UnitPublisher::take).
  std::vector<PublishedUnit> changed_units(UnitPublisher& publisher, const Eigen::Vector3d& eye, jobs::WorkerPool& pool,
                                           std::size_t most = UnitPublisher::kAll);

  /// Of submaps: what was made of them last, by the two above.
  const VoxelMap& map() const { return map_; }
  /// All that voxels take.
  std::size_t size_bytes() const { return map_.size_bytes() + (submaps_ ? submaps_->size_bytes() : 0); }
  std::size_t submap_count() const { return submaps_ ? submaps_->size() : 0; }
  /// Poses of the depth camera that were found by tracking.
  const Trajectory& tracked() const { return tracked_; }
  bool is_tracking() const { return tracker_.has_value(); }
  /// Of tracking: where the depth camera was last, Known while it is not lost.
  PoseAnswer found_pose() const;
  /// Poses that were found earlier are wanted no more.
  void forget_tracked_before(double time_s) { tracked_.forget_before(time_s); }
  /// How the last picture that was tracked fitted; all 0 without tracking.
  Alignment last_alignment() const { return tracker_ ? tracker_->last() : Alignment{}; }
  const MapperFigures& figures() const { return figures_; }
  /// The time of the first frame that had a pose (of tracking: the first), which seen_s counts from.
  double begin_s() const { return begin_s_.value_or(0); }
  /// The newest time of such a frame.
  double newest_s() const { return newest_s_; }

 private:
  MeshRules mesh_rules() const;
  /// What the blocks of fused() may take.
  std::uint64_t most_bytes_of_fused();
  std::string full_text(double time_s) const;
  VoxelMap& fused() { return submaps_ ? submaps_->newest() : map_; }
  /// The pose of the depth camera, if it can be used; else what is wrong stands in `faults`.
  bool find_pose(const Trajectory& trajectory, double time_s, PoseAnswer& answer, FaultLog& faults);
  void note_time(const Frame& frame);
  bool fuse_surface(const Frame& frame, const Trajectory& trajectory, FaultLog& faults);
  void fuse_prepared(const Frame& frame, const DepthLook& look, const Trajectory& trajectory, FaultLog& faults);
  void fuse_tracked(const Frame& frame, const Trajectory& trajectory, FaultLog& faults, FaultLog& faults_of_earlier);
  /// The pose of the depth camera at a moment, by tracking.
  std::optional<Eigen::Isometry3d> track(const Frame& frame, const DepthFrame& depth, const Trajectory& trajectory,
                                         FaultLog& faults);
  void fuse_heat(const Frame& frame, const Trajectory& trajectory, FaultLog& faults);

  Calibration calibration_;
  const MapperSettings settings_;
  jobs::WorkerPool& pool_;
  const RayTable rays_;
  VoxelMap map_;
  std::optional<Submaps> submaps_;
  std::optional<HeatFusion> heat_;
  std::optional<double> begin_s_;
  double newest_s_ = 0;
  std::vector<double> spreads_kelvin_;  ///< Of the thermal pictures about what was known.
  std::size_t jumps_seen_ = 0;
  bool is_doubtful_ = false;  ///< Poses have jumped, and none has been found to fit since.
  std::optional<Tracker> tracker_;
  Trajectory tracked_;
  DepthFrame depth_;                        ///< The last one.
  std::vector<Frame> held_;                 ///< Thermal pictures that wait for a pose after them, at most kMostHeld.
  Picture16 newest_thermal_;                ///< That differs from the one before.
  std::optional<double> newest_thermal_s_;  ///< When it was taken.
  double residual_squares_ = 0;
  MapperFigures figures_;
};

}  // namespace spectra::mapping
