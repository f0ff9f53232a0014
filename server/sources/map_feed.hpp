#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <thread>

#include "server/mapping/frame_folder.hpp"
#include "server/mapping/mapper.hpp"
#include "server/mapping/unit_publisher.hpp"
#include "server/sources/map_keeper.hpp"
#include "server/sources/robot_track.hpp"
#include "server/sources/unit_hand_over.hpp"

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

/// Hands over units, with the pool of whoever maps; what it throws ends mapping, and is told.
using HandOver =
    std::function<void(std::span<const mapping::PublishedUnit>, const FeedMoment&, jobs::WorkerPool& pool)>;

/// Maps frames and hands over, twice a second of real time and at the end, the units that have changed. Ends early when `is_over`.
struct FeedRun {
  std::function<bool()> is_over = [] { return false; };
  HandOver hand_over;
  std::function<void(double share)> progress = [](double) {};
  /// Where the robot is, with every frame; nothing new where no pose is known.
  std::function<void(const RobotPose& pose, bool is_last)> moved = [](const RobotPose&, bool) {};
};
void run_feed(const FrameStream& frames, const FeedRun& run, mapping::Mapper& mapper, jobs::WorkerPool& pool,
              mapping::FaultLog& faults);

/// The pose of a depth camera (x to the right and y down in its picture) as that of the robot.
RobotPose robot_pose(const Eigen::Isometry3d& world_from_camera, double at_unix_s);

/// What is said when mapping has ended by itself, because of an exception.
std::string ended_text(const std::string& why);

/// Says in the log when tracking loses the cameras, and when it has found them again.
class TrackTeller {
 public:
  void tell(const mapping::Mapper& mapper);

 private:
  bool is_lost_ = false;
};

/// Maps frames in a thread of its own and puts what has changed into a map. Says in the log what was wrong, and when it is done.
class MapFeed {
 public:
  /// Begins when `may_begin`, and says in `robot` where the cameras are. `ended`: as of LiveFeed::Sinks.
  MapFeed(FrameStream frames, const mapping::MapperSettings& settings, MapKeeper& map, RobotTrack& robot,
          std::function<bool()> may_begin, std::function<void(const std::string& why)> ended);
  ~MapFeed();  ///< Ends it after the frame that is being fused.
  MapFeed(const MapFeed&) = delete;
  MapFeed& operator=(const MapFeed&) = delete;

 private:
  void work(const std::function<bool()>& may_begin);

  const FrameStream frames_;
  const mapping::MapperSettings settings_;
  UnitHandOver hand_over_;
  RobotTrack& robot_;
  std::thread thread_;
};

}  // namespace spectra::sources
