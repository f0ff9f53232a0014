#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "fusion/base/error.hpp"

namespace spectra::mapping {

/// What is known of where the cameras were at a moment.
enum class PoseState {
  Known,
  Unknown,  ///< Before the first pose, after the last, or in a gap of more than 100 ms.
  Jumping,  ///< The poses around it would need an impossible motion.
};

struct PoseAnswer {
  PoseState state = PoseState::Unknown;
  std::size_t jumps_before =
      0;  ///< Impossible motions between poses at most 100 ms apart, from the beginning up to here.
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  Eigen::Vector3d linear_m_per_s = Eigen::Vector3d::Zero();  ///< In the world.
  Eigen::Vector3d angular_rad_per_s =
      Eigen::Vector3d::Zero();  ///< In the world; both 0 where neighbours are too far away in time.
};

/// A place farther from 0 is not mapped: in voxels of 1 mm, the smallest, it still counts in 32 bits with what a camera sees from there, wherever it
/// is turned to.
inline constexpr double kFarthestPoseM = 1e6;
/// False of what is no number, too.
inline bool is_in_range(const Eigen::Isometry3d& pose) {
  return pose.translation().norm() < kFarthestPoseM;
}

/// The pose of eight numbers: a stamp, tx ty tz, qx qy qz qw. Nothing where they are not as many, or not finite, where the last four are no rotation
/// (to 5 %), or where it is too far away (is_in_range).
std::optional<Eigen::Isometry3d> pose_of(std::span<const double> values);

/// The rotation by slerp, the translation linearly; share 0 is the first.
Eigen::Isometry3d pose_between(const Eigen::Isometry3d& first, const Eigen::Isometry3d& second, double share);

/// Poses by their time.
using StampedPoses = std::vector<std::pair<double, Eigen::Isometry3d>>;

/// Lines that were left out of a trajectory, by reason.
struct TrajectoryNotes {
  std::size_t unreadable = 0;  ///< Not eight finite numbers, or no rotation, or farther away than is_in_range().
  std::size_t backwards = 0;   ///< Not later than the line before.
};

/// Poses in the order of their time.
class Trajectory {
 public:
  static constexpr double kMaxGapSeconds = 0.1;
  static constexpr double kMaxMetresPerSecond = 5;
  static constexpr double kMaxRadiansPerSecond = 12;

  /// Lines of `timestamp tx ty tz qx qy qz qw`, as the RGB-D benchmark of TUM has them (Sturm et al., IROS 2012); # begins a comment.
  /// What is no pose is left out and counted. Fails when nothing is left.
  static base::Result<Trajectory> read(const std::filesystem::path& file);
  static Trajectory from_text(const std::string& text);

  void add(double time_s, const Eigen::Isometry3d& pose);
  /// Poses of another camera, or from the world to it, become those of the camera that `camera_from_own` leads to.
  void change_to(bool is_world_to_camera, const Eigen::Isometry3d& camera_from_own);

  /// All of them are somewhere else in the world.
  void move(const Eigen::Isometry3d& by);

  /// The pose at a moment: the rotation by slerp, the translation linearly, between neighbours at most 100 ms apart; or that of a
  /// pose of exactly this moment, within a microsecond.
  PoseAnswer at(double time_s) const;

  /// The pose of the moment nearest to one. Of a trajectory with any.
  const Eigen::Isometry3d& nearest(double time_s) const;

  /// Takes out what is earlier; the last one before stays, so that what is between can be told.
  void forget_before(double time_s);

  /// The lines that read() reads, after a line that says what they are.
  std::string to_text() const;

  StampedPoses stamped() const;
  std::size_t size() const { return times_.size(); }
  double begin_s() const { return times_.front(); }
  double end_s() const { return times_.back(); }
  const TrajectoryNotes& notes() const { return notes_; }

 private:
  bool is_near(std::size_t first) const;  ///< Pose `first` and the next are at most the gap apart.
  bool is_jump(std::size_t first) const;
  void set_speed(std::size_t first, std::size_t last, PoseAnswer& answer) const;

  std::vector<double> times_;
  std::vector<Eigen::Isometry3d> poses_;
  std::vector<std::size_t> jumps_;  ///< Up to each pose.
  TrajectoryNotes notes_;
};

}  // namespace spectra::mapping
