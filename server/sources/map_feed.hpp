#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <thread>

#include "server/mapping/frame_folder.hpp"
#include "server/mapping/mapper.hpp"
#include "server/mapping/unit_publisher.hpp"
#include "server/sources/map_keeper.hpp"
#include "server/sources/robot_track.hpp"

namespace spectra::sources {

/// Frames in the order of their time, wherever they come from.
struct FrameStream {
  std::shared_ptr<const void> owner;  ///< Of what the functions use.
  const mapping::Calibration* calibration = nullptr;
  const mapping::Trajectory* trajectory = nullptr;
  std::size_t frame_count = 0;
  std::function<mapping::Frame(std::size_t index, mapping::FaultLog& faults)> load;
  std::function<double(std::size_t index)> stamp_s;
  bool is_paced = false;     ///< A frame comes no earlier than its stamp says.
  std::string_view up = "";  ///< "y", for example; empty: not known.
};

FrameStream stream_of(mapping::FrameFolder folder);
/// A drive through the demo office at the pace of a robot, with small pictures.
FrameStream demo_drive_stream();

/// What is known when units are handed over.
struct FeedMoment {
  Eigen::Vector3d eye = Eigen::Vector3d::Zero();  ///< Where the depth camera is.
  double begin_unix_s = 0;                        ///< When the map's first moment was.
};

/// Maps frames and hands over, twice a second of real time and at the end, the units that have changed; what `hand_over` returns false for
/// ends it. Ends early when `is_over`.
struct FeedRun {
  double voxel_m = 0.01;
  std::function<bool()> is_over = [] { return false; };
  std::function<bool(std::vector<mapping::PublishedUnit>, const FeedMoment& moment)> hand_over;
  std::function<void(double share)> progress = [](double) {};
  /// Where the robot is, with every frame; nothing new where no pose is known.
  std::function<void(const RobotPose& pose, bool is_last)> moved = [](const RobotPose&, bool) {};
};
void run_feed(const FrameStream& frames, const FeedRun& run, mapping::Mapper& mapper, jobs::WorkerPool& pool,
              mapping::FaultLog& faults);

/// The pose of a depth camera (x to the right and y down in its picture) as that of the robot.
RobotPose robot_pose(const Eigen::Isometry3d& world_from_camera, double at_unix_s);

/// Unix seconds.
double unix_now_s();

/// What a block that is a unit is asked to be read with, and when it was seen: now.
std::vector<std::pair<std::string, std::string>> unit_query(const FrameStream& frames, const Eigen::Vector3d& eye);

/// Maps frames in a thread of its own and puts what has changed into a map. Says in the log what was wrong, and when it is done.
class MapFeed {
 public:
  /// Begins when `may_begin`, and says in `robot` where the cameras are. At most kUnderWay units are on their way into the map at a time.
  MapFeed(FrameStream frames, double voxel_m, MapKeeper& map, RobotTrack& robot, std::function<bool()> may_begin);
  ~MapFeed();  ///< Ends it after the frame that is being fused.
  MapFeed(const MapFeed&) = delete;
  MapFeed& operator=(const MapFeed&) = delete;

  static constexpr std::size_t kUnderWay = 32;

 private:
  void work(const std::function<bool()>& may_begin);
  bool hand_over(std::vector<mapping::PublishedUnit> units, const FeedMoment& moment);

  const FrameStream frames_;
  const double voxel_m_;
  MapKeeper& map_;
  RobotTrack& robot_;
  /// Shared with answers that may come when this is gone.
  struct State {
    std::atomic<bool> is_over{false};
    std::atomic<std::size_t> under_way{0};
  };
  const std::shared_ptr<State> state_ = std::make_shared<State>();
  std::thread thread_;
};

}  // namespace spectra::sources
