#include "server/sources/map_feed.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <utility>

#include "server/mapping/map_ply.hpp"
#include "server/mapping/simulated_drive.hpp"

namespace spectra::sources {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::milliseconds kPublishEvery{500};
constexpr std::chrono::milliseconds kWait{10};

}  // namespace

FrameStream stream_of(mapping::FrameFolder folder) {
  const auto owner = std::make_shared<const mapping::FrameFolder>(std::move(folder));
  FrameStream stream;
  stream.owner = owner;
  stream.calibration = &owner->calibration();
  stream.trajectory = &owner->trajectory();
  stream.frame_count = owner->rows().size();
  stream.load = [owner](std::size_t index, mapping::FaultLog& faults) { return owner->load(index, faults); };
  stream.stamp_s = [owner](std::size_t index) { return owner->rows()[index].time_s; };
  return stream;
}

FrameStream demo_drive_stream() {
  mapping::DriveOptions options;
  options.vertex_count = 160'000;
  options.depth_hz = 5;
  options.thermal_hz = 6.25;
  options.finer_than = 2;
  const auto owner = std::make_shared<const mapping::SimulatedDrive>(options);
  FrameStream stream;
  stream.owner = owner;
  stream.calibration = &owner->calibration();
  stream.trajectory = &owner->trajectory();
  stream.frame_count = owner->frame_count();
  stream.load = [owner](std::size_t index, mapping::FaultLog&) { return owner->frame(index); };
  stream.stamp_s = [owner](std::size_t index) { return owner->stamp_s(index); };
  stream.is_paced = true;
  stream.up = "y";
  return stream;
}

RobotPose robot_pose(const Eigen::Isometry3d& world_from_camera, double at_unix_s) {
  const auto vector = [](const Eigen::Vector3d& v) { return base::Vec3d{v.x(), v.y(), v.z()}; };
  return {at_unix_s, vector(world_from_camera.translation()), vector(world_from_camera.linear().col(2)),
          vector(-world_from_camera.linear().col(1)), false};
}

std::string ended_text(const std::string& why) {
  return "Mapping has ended (" + why + "): the map stays as it is; start the server anew to map on.";
}

void TrackTeller::tell(const mapping::Mapper& mapper) {
  if (!mapper.is_tracking() || mapper.tracked().size() == 0) return;
  const bool is_lost = mapper.found_pose().state != mapping::PoseState::Known;
  if (is_lost == is_lost_) return;
  is_lost_ = is_lost;
  if (is_lost) {
    spdlog::warn("tracking has lost its place: nothing is fused until what is seen fits the map again");
  } else {
    spdlog::info("tracking has found its place again");
  }
}

void run_feed(const FrameStream& frames, const FeedRun& run, mapping::Mapper& mapper, jobs::WorkerPool& pool,
              mapping::FaultLog& faults) {
  mapping::UnitPublisher publisher;
  const auto begin = Clock::now();
  auto last = begin;
  FeedMoment moment;
  RobotPose robot;
  TrackTeller teller;
  bool is_robot_known = false;
  for (std::size_t i = 0; i < frames.frame_count; ++i) {
    const auto due = begin + std::chrono::duration<double>(frames.stamp_s(i) - frames.stamp_s(0));
    do {
      if (run.is_over()) return;
      if (frames.is_paced && Clock::now() < due) std::this_thread::sleep_for(kWait);
    } while (frames.is_paced && Clock::now() < due);
    mapper.fuse(frames.load(i, faults), *frames.trajectory, faults);
    teller.tell(mapper);
    const mapping::PoseAnswer pose =
        mapper.is_tracking() ? mapper.found_pose() : frames.trajectory->at(frames.stamp_s(i));
    const bool is_last = i + 1 == frames.frame_count;
    moment.begin_unix_s = mapping::unix_begin_s(mapper.begin_s(), mapper.newest_s(), unix_now_s());
    const double at = moment.begin_unix_s + frames.stamp_s(i) - mapper.begin_s();
    if (pose.state == mapping::PoseState::Known) {
      moment.eye = pose.pose.translation();
      robot = robot_pose(pose.pose, at);
      is_robot_known = true;
    }
    robot.at = at;
    robot.is_lost = pose.state != mapping::PoseState::Known;
    if (is_robot_known) run.moved(robot, is_last);
    run.progress(static_cast<double>(i + 1) / static_cast<double>(frames.frame_count));
    if (Clock::now() - last < kPublishEvery && !is_last) continue;
    last = Clock::now();
    run.hand_over(mapper.changed_units(publisher, moment.eye, pool), moment, pool);
  }
}

MapFeed::MapFeed(FrameStream frames, const mapping::MapperSettings& settings, MapKeeper& map, RobotTrack& robot,
                 std::function<bool()> may_begin, std::function<void(const std::string&)> ended)
    : frames_(std::move(frames)),
      settings_(settings),
      hand_over_(map, frames_.up),
      robot_(robot),
      thread_([this, may_begin = std::move(may_begin), ended = std::move(ended)] {
        try {
          work(may_begin);
        } catch (const std::exception& error) {
          const std::string text = ended_text(error.what());
          spdlog::error("{}", text);
          ended(text);
        }
      }) {}

MapFeed::~MapFeed() {
  hand_over_.end();
  thread_.join();
}

void MapFeed::work(const std::function<bool()>& may_begin) {
  while (!may_begin()) {
    if (hand_over_.is_over()) return;
    std::this_thread::sleep_for(kWait);
  }
  jobs::WorkerPool pool(1);
  mapping::Mapper mapper(*frames_.calibration, settings_, pool);
  mapping::FaultLog faults;
  FeedRun run;
  run.is_over = [this] { return hand_over_.is_over(); };
  run.hand_over = std::ref(hand_over_);
  run.moved = [this](const RobotPose& pose, bool is_last) { robot_.moved(pose, is_last); };
  run_feed(frames_, run, mapper, pool, faults);
  for (const mapping::FrameFault& fault : faults.all()) {
    if (fault.count > 0) spdlog::warn("{} ({} times)", fault.what, fault.count);
  }
  if (hand_over_.refused_count() > 0) spdlog::warn("{} units were refused by the map", hand_over_.refused_count());
  spdlog::info("mapping is done: {} depth and {} thermal frames, {} blocks of voxels", mapper.figures().depth_frames,
               mapper.figures().thermal_frames, mapper.map().block_count());
}

}  // namespace spectra::sources
