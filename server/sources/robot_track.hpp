#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "fusion/base/vertex_types.hpp"

namespace spectra::sources {

/// Where the robot is: its depth camera, in the coordinates of the map, metres.
struct RobotPose {
  double at = 0;  ///< Unix seconds.
  base::Vec3d position;
  base::Vec3d forward{1, 0, 0};  ///< Where it looks; of length 1.
  base::Vec3d up{0, 0, 1};       ///< Up in its picture; of length 1.
  bool is_lost = false;          ///< It does not know where it is: this is where it was last.
};

/// Where the robot is and where it was, for whoever looks. The way is thinned: a point every kSpacing, and twice as far apart whenever
/// there are more than kMostPoints. Thread-safe.
class RobotTrack {
 public:
  static constexpr double kSpacingM = 0.05;
  static constexpr std::size_t kMostPoints = 400;
  static constexpr double kTellEveryS = 0.2;

  /// How much somebody has been told.
  struct Told {
    std::uint64_t moves = 0;
    std::uint32_t thinnings = 0;
    std::size_t points = 0;
  };
  struct News {
    RobotPose pose;
    std::size_t first_point = 0;  ///< Those of the way from here on are `points`.
    std::vector<base::Vec3d> points;
  };
  using Listener = std::function<void()>;

  /// Listeners are told when the last telling is kTellEveryS ago on the clock of the poses, when the robot is lost or found, and when
  /// `is_last`. A pose that is no number changes nothing.
  void moved(const RobotPose& pose, bool is_last = false);

  /// What somebody does not know yet; nothing when there is none of that. Notes that it was told.
  std::optional<News> news(Told& told) const;

  /// `listener` is called, from the thread of moved(), while the returned pointer is held; it should only post to its own thread.
  [[nodiscard]] std::shared_ptr<const Listener> subscribe(Listener listener);

  /// With those that have gone since the last subscribe().
  std::size_t listener_count() const {
    const std::lock_guard lock(mutex_);
    return listeners_.size();
  }

 private:
  bool take(const RobotPose& pose, bool is_last);

  mutable std::mutex mutex_;
  std::optional<RobotPose> pose_;
  std::uint64_t moves_ = 0;
  std::uint32_t thinnings_ = 0;
  double spacing_m_ = kSpacingM;
  std::vector<base::Vec3d> points_;
  double told_at_ = 0;
  bool is_any_told_ = false;
  std::vector<std::weak_ptr<const Listener>> listeners_;
};

}  // namespace spectra::sources
