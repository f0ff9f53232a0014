#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <optional>
#include <vector>

#include "server/mapping/alignment.hpp"
#include "server/mapping/calibration.hpp"
#include "server/mapping/depth_frame.hpp"
#include "server/mapping/picture_file.hpp"
#include "server/mapping/seen_points.hpp"
#include "server/mapping/voxel_map.hpp"

namespace spectra::mapping {

struct TrackerRules {
  AlignmentTerms terms;
  double least_matching = 0.35;    ///< Of the points, that must lie on the surface of the map.
  double least_fit = 0.6;          ///< Of the points near a surface of the map, that must lie on it.
  double least_told = 0.002;       ///< Alignment::told; less is told by a few edges, which may be anything.
  double again_matching = 0.5;     ///< As least_matching, after it was lost.
  std::size_t again_count = 2;     ///< So many in a row have to fit before a lost camera is found again.
  std::size_t least_points = 500;  ///< With a depth, of a picture.
};

/// A moment of three cameras, whose depth picture is prepared.
struct TrackedMoment {
  double time_s = 0;  ///< When the depth picture was taken.
  const DepthFrame* depth = nullptr;
  const PictureRgb* colour = nullptr;  ///< Null: none, as in the dark.
  double colour_s = 0;                 ///< When it was taken.
  const Picture16* thermal = nullptr;  ///< The last one that is no repeated one, null: none.
  double thermal_s = 0;
};

/// Where the cameras are, told from the map that is made of what they saw before. For one thread.
class Tracker {
 public:
  /// `rays` of the depth camera; both have to outlive it.
  Tracker(const Calibration& calibration, const RayTable& rays, const TrackerRules& rules)
      : calibration_(calibration), rays_(rays), rules_(rules) {}

  /// Takes the pose of the first depth picture as it is.
  void begin(double time_s, const DepthFrame& depth, const Eigen::Isometry3d& pose);
  bool has_begun() const { return !keys_.empty(); }

  /// Finds the pose of the depth camera; moments in the order of their time. Nothing when what is seen does not fit the map anywhere near where it
  /// was expected or has been, or when it does not tell where it is seen from: nothing of that moment may be fused then.
  std::optional<Eigen::Isometry3d> find(const VoxelMap& map, const TrackedMoment& moment, jobs::WorkerPool& pool);

  bool is_lost() const { return is_lost_; }
  /// Of the last find().
  const Alignment& last() const { return last_; }

 private:
  Eigen::Isometry3d expected(double time_s) const;
  /// What the depth camera was at another moment, seen from where it is at `time_s`.
  Eigen::Isometry3d motion_since(double then_s, double time_s) const;
  bool is_good(const Alignment& found, double matching) const;
  std::vector<Eigen::Isometry3d> guesses(const VoxelMap& map, const SeenPoints& seen, double time_s,
                                         jobs::WorkerPool& pool) const;
  /// Of the moment whose depth is seen_now_m_.
  void keep(double time_s, const Eigen::Isometry3d& pose);

  const Calibration& calibration_;
  const RayTable& rays_;
  const TrackerRules rules_;
  /// counted_depth() of the picture whose pose is pose_, and of the newest.
  std::vector<float> seen_before_m_, seen_now_m_;
  std::vector<Eigen::Isometry3d> keys_;  ///< Poses that were found, some way apart, to come back to.
  Eigen::Isometry3d pose_ = Eigen::Isometry3d::Identity(), before_ = Eigen::Isometry3d::Identity();
  double time_s_ = 0, before_s_ = 0;
  bool has_speed_ = false, is_lost_ = false;
  std::size_t again_ = 0;  ///< Moments that fitted since it was lost.
  Alignment last_;
};

}  // namespace spectra::mapping
