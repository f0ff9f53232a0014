#include "server/sources/live_feed.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <exception>
#include <limits>

#include "server/mapping/map_ply.hpp"
#include "server/sources/frame_bodies.hpp"
#include "server/sources/map_feed.hpp"

namespace spectra::sources {
namespace {

using mapping::FaultKind;

constexpr std::chrono::milliseconds kLookEvery{50};
/// Without a word of the sender for so long, what is left is handed over with every look.
constexpr double kIdleAfterS = 0.1;
constexpr double kLostAfterS = 1;
constexpr std::size_t kManyPoses = 4096;

std::string code_of(FaultKind kind) {
  switch (kind) {
    case FaultKind::NoPose:
      return "no_pose";
    case FaultKind::JumpingPose:
      return "jumping_pose";
    case FaultKind::UnfittingPose:
      return "unfitting_pose";
    case FaultKind::LostTrack:
      return "lost_track";
    case FaultKind::WrongSize:
      return "wrong_size";
    case FaultKind::DamagedFile:
      return "damaged_picture";
    case FaultKind::MapFull:
      return "map_full";
    default:
      return "not_mapped";
  }
}

}  // namespace

LiveFeed::LiveFeed(const mapping::MapperSettings& settings, Sinks sinks, std::function<bool()> may_begin,
                   std::chrono::duration<double> publish_every)
    : settings_(settings),
      sinks_(std::move(sinks)),
      may_begin_(std::move(may_begin)),
      publish_every_(publish_every),
      intake_(settings.is_tracking, settings.submaps.has_value()),
      thread_([this] {
        try {
          work();
        } catch (const std::exception& error) {
          end_mapping(error.what());
        }
      }) {}

LiveFeed::~LiveFeed() {
  {
    const std::lock_guard lock(mutex_);
    is_over_ = true;
  }
  has_work_.notify_all();
  thread_.join();
}

void LiveFeed::end_mapping(const std::string& why) {
  const std::string text = ended_text(why);
  Answers answers;
  {
    const std::lock_guard lock(mutex_);
    ended_ = text;
    if (picture_in_hand_) answers.emplace_back(std::move(picture_in_hand_->second.done), not_mapping());
    for (FrameIntake::PoseNews& some : poses_in_hand_) answers.emplace_back(std::move(some.done), not_mapping());
    poses_in_hand_.clear();
    intake_.give_up(not_mapping(), answers);
  }
  spdlog::error("{}", text);
  for (auto& [answer, outcome] : answers) {
    if (answer) answer(std::move(outcome));
  }
  sinks_.ended(text);
}

std::optional<net::BlockRefusal> LiveFeed::begin() {
  const auto busy = [](const char* reason) { return net::BlockRefusal{503, "busy", "", reason, ""}; };
  if (!may_begin_()) return busy("the map is not open yet");
  const std::lock_guard lock(mutex_);
  if (ended_) return not_mapping();
  if (intake_.has_sender() || is_over_) return busy("another robot sends frames already");
  intake_.begin_sender();
  return std::nullopt;
}

void LiveFeed::end() {
  {
    const std::lock_guard lock(mutex_);
    intake_.end_sender();
  }
  has_work_.notify_all();
}

mapping::FaultLog LiveFeed::faults() const {
  const std::lock_guard lock(mutex_);
  return intake_.faults();
}

std::size_t LiveFeed::skipped_count() const {
  const std::lock_guard lock(mutex_);
  return intake_.skipped_count();
}

void LiveFeed::take(net::IncomingFrame frame, FrameIntake::Done done) {
  Answers answers;
  {
    const std::lock_guard lock(mutex_);
    if (ended_)
      answers.emplace_back(std::move(done), not_mapping());
    else
      intake_.take(std::move(frame), std::move(done), answers);
  }
  has_work_.notify_all();
  for (auto& [answer, outcome] : answers) answer(std::move(outcome));
}

void LiveFeed::correct(const mapping::StampedPoses& poses) {
  const mapping::CorrectionReport report = mapper_->correct(poses);
  if (report.moved == 0) return;
  spdlog::info("corrected poses have moved {} of {} submaps", report.moved, mapper_->submap_count());
  // What comes is of the corrected world; what is there is brought along, so that nothing jumps between.
  trajectory_.move(report.newest);
  has_changed_ = true;
}

void LiveFeed::apply_poses() {
  for (const FrameIntake::PoseNews& some : poses_in_hand_) {
    if (some.is_correction) {
      correct(some.poses);
    } else {
      for (const auto& [time_s, pose] : some.poses) trajectory_.add(time_s, pose);
    }
  }
  // Where an answer finds no memory those after it are answered when mapping ends.
  for (FrameIntake::PoseNews& some : poses_in_hand_) {
    if (const FrameIntake::Done done = std::exchange(some.done, nullptr)) done(std::move(some.outcome));
  }
  poses_in_hand_.clear();
}

void LiveFeed::tell_found_pose() {
  teller_.tell(*mapper_);
  if (mapper_->tracked().size() == 0) return;
  const mapping::PoseAnswer found = mapper_->found_pose();
  const double at_s = mapper_->tracked().end_s();
  if (mapper_->tracked().size() > kManyPoses) mapper_->forget_tracked_before(at_s - 2 * FrameIntake::kFarthestStampS);
  moment_.eye = found.pose.translation();
  moment_.begin_unix_s = mapping::unix_begin_s(mapper_->begin_s(), mapper_->newest_s(), unix_now_s());
  RobotPose robot = robot_pose(found.pose, moment_.begin_unix_s + at_s - mapper_->begin_s());
  robot.is_lost = found.state != mapping::PoseState::Known;
  sinks_.moved(robot, false);
}

void LiveFeed::work() {
  double last_published_s = -std::numeric_limits<double>::infinity();
  for (;;) {
    std::optional<double> pose_end_s, newest_s;
    bool is_idle = false;
    {
      std::unique_lock lock(mutex_);
      has_work_.wait_for(lock, kLookEvery, [&] { return is_over_ || intake_.is_ready() || intake_.has_new_poses(); });
      if (is_over_) return;
      if (!mapper_ && intake_.calibration()) mapper_.emplace(*intake_.calibration(), settings_, pool_);
      poses_in_hand_ = intake_.take_new_poses();
      pose_end_s = intake_.pose_end_s();
      newest_s = intake_.newest_s();
      picture_in_hand_ = intake_.next_picture();
      is_idle = intake_.is_empty() && !picture_in_hand_ && intake_.quiet_s() > kIdleAfterS;
    }
    apply_poses();
    // Of pictures that wait the oldest may be as far from the newest pose as one may come, and wait as long.
    if (pose_end_s && trajectory_.size() > kManyPoses)
      trajectory_.forget_before(*pose_end_s - 2 * FrameIntake::kFarthestStampS);
    if (mapper_ && settings_.is_tracking) tell_found_pose();
    if (mapper_ && pose_end_s && !settings_.is_tracking) {
      const mapping::PoseAnswer latest = trajectory_.at(*pose_end_s);
      moment_.eye = latest.pose.translation();
      moment_.begin_unix_s = mapping::unix_begin_s(mapper_->begin_s(), newest_s.value_or(0), unix_now_s());
      RobotPose robot = robot_pose(latest.pose, moment_.begin_unix_s + *pose_end_s - mapper_->begin_s());
      robot.is_lost = newest_s && *newest_s - *pose_end_s > kLostAfterS;
      if (latest.state != mapping::PoseState::Unknown) sinks_.moved(robot, false);
    }
    if (picture_in_hand_) {
      const double begun_s = steady_s();
      net::FrameOutcome outcome = map_picture(picture_in_hand_->first, picture_in_hand_->second.frame);
      {
        const std::lock_guard lock(mutex_);
        intake_.note_took(steady_s() - begun_s);
        if (auto* taken = std::get_if<net::FrameTaken>(&outcome)) taken->pictures_per_s = intake_.wanted_rate();
      }
      const FrameIntake::Done done = std::move(picture_in_hand_->second.done);
      picture_in_hand_.reset();
      done(std::move(outcome));
    }
    if (!mapper_) continue;
    // A map that is behind gets what it can take, the hot and the near first; mapping does not wait for it.
    const std::size_t room = sinks_.room(), waiting_units = publisher_.waiting_count();
    const bool is_due = steady_s() - last_published_s >= publish_every_.count() && (has_changed_ || waiting_units > 0);
    // While frames come, whoever makes tiles of it needs the time between.
    const bool is_left = is_idle && waiting_units > 0 && room >= UnitHandOver::kUnderWay / 2;
    if (room == 0 || !(is_due || is_left)) continue;
    last_published_s = steady_s();
    has_changed_ = false;
    sinks_.hand_over(mapper_->changed_units(publisher_, moment_.eye, pool_, room), moment_, pool_);
  }
}

net::FrameOutcome LiveFeed::map_picture(const Key& key, const net::IncomingFrame& incoming) {
  mapping::FaultLog faults, faults_of_earlier;
  // Without the lock: once there is one, it stays.
  mapping::Frame frame = frame_of(incoming, key.first, *intake_.calibration(), faults);
  if (key.second == FrameIntake::Rank::Colour) {
    colour_ = std::move(frame.colour);
    colour_s_ = key.first;
  } else {
    if (!frame.depth.empty() && !colour_.empty() && std::abs(key.first - colour_s_) <= kColourAgeS) {
      frame.colour = std::move(colour_);
      frame.colour_time_s = colour_s_;
      colour_ = {};
    }
    mapper_->fuse(frame, trajectory_, faults, &faults_of_earlier);
    has_changed_ = true;
  }
  const auto wrong = std::find_if(faults.all().begin(), faults.all().end(),
                                  [](const mapping::FrameFault& fault) { return fault.count > 0; });
  const std::lock_guard lock(mutex_);
  // They were answered when they were held.
  intake_.note(faults_of_earlier);
  if (wrong == faults.all().end()) return net::FrameTaken{};
  const auto kind = static_cast<FaultKind>(wrong - faults.all().begin());
  return intake_.refused(kind, code_of(kind), kind == FaultKind::NoPose ? "time" : "body", wrong->what);
}

}  // namespace spectra::sources
