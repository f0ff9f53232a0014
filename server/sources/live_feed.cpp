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
using protocol::FrameSensor;
using protocol::FramesKind;

constexpr std::chrono::milliseconds kLookEvery{50};
/// Without a word of the sender for so long, what is left is handed over with every look.
constexpr double kIdleAfterS = 0.1;
/// After a picture was skipped fewer are asked for as long.
constexpr double kOverloadS = 2;
/// Of what it could do that is asked for, so that it catches up.
constexpr double kAskedShare = 0.9;
constexpr double kLostAfterS = 1;
constexpr std::size_t kManyPoses = 4096;

double steady_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::string name_of(FrameSensor sensor) {
  return sensor == FrameSensor::Depth ? "depth" : sensor == FrameSensor::Color ? "color" : "thermal";
}

std::string picture_name(FrameSensor sensor) {
  return "a " + name_of(sensor) + " picture";
}

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

Eigen::Isometry3d depth_pose(const mapping::Calibration& calibration, const Eigen::Isometry3d& pose) {
  return (calibration.is_world_to_camera ? pose.inverse() : pose) * calibration.depth_from_pose.inverse();
}

}  // namespace

LiveFeed::LiveFeed(const mapping::MapperSettings& settings, Sinks sinks, std::function<bool()> may_begin,
                   std::chrono::duration<double> publish_every)
    : settings_(settings),
      sinks_(std::move(sinks)),
      may_begin_(std::move(may_begin)),
      publish_every_(publish_every),
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
    const auto answer = [&](Done& done) { answers.emplace_back(std::move(done), not_mapping()); };
    if (picture_in_hand_) answer(picture_in_hand_->second.done);
    for (auto* news : {&poses_in_hand_, &new_poses_}) {
      for (PoseNews& some : *news) answer(some.done);
      news->clear();
    }
    for (auto& [key, item] : waiting_) answer(item.done);
    waiting_.clear();
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
  if (has_sender_ || is_over_) return busy("another robot sends frames already");
  has_sender_ = true;
  is_flushing_ = false;
  clock_.begin_sender();
  leave_lone_pose_out();
  pose_end_s_.reset();
  last_s_ = {};
  return std::nullopt;
}

void LiveFeed::end() {
  {
    const std::lock_guard lock(mutex_);
    has_sender_ = false;
    is_flushing_ = true;
    leave_lone_pose_out();
    for (const mapping::FrameFault& fault : faults_.all()) {
      if (fault.count > 1) spdlog::warn("{} ({} times so far)", fault.what, fault.count);
    }
    if (skipped_count_ > 0) spdlog::warn("{} pictures were skipped so far: there was no time for them", skipped_count_);
  }
  has_work_.notify_all();
}

mapping::FaultLog LiveFeed::faults() const {
  const std::lock_guard lock(mutex_);
  return faults_;
}

std::size_t LiveFeed::skipped_count() const {
  const std::lock_guard lock(mutex_);
  return skipped_count_;
}

void LiveFeed::note(FaultKind kind, const std::string& what, std::size_t count) {
  if (faults_.of(kind).count == 0) spdlog::warn("{}; said once", what);
  faults_.add(kind, what, count);
}

net::BlockRefusal LiveFeed::refused(FaultKind kind, std::string code, std::string field, const std::string& reason) {
  note(kind, reason);
  return {400, std::move(code), std::move(field), reason, ""};
}

std::optional<net::BlockRefusal> LiveFeed::refusal_of_stamp(SenderClock::Verdict verdict, const std::string& whose) {
  switch (verdict) {
    case SenderClock::Verdict::NotInSeconds:
      return refused(FaultKind::FarStamp, "far_stamp", "time",
                     "the stamp of " + whose + " is no number of seconds less than 1e11");
    case SenderClock::Verdict::Ahead:
      return refused(
          FaultKind::FarStamp, "far_stamp", "time",
          "the stamp of " + whose + " is more than 10 s ahead of all before it; the third such in a row is taken");
    case SenderClock::Verdict::BegunAnew:
      note(FaultKind::ClockBegunAnew,
           "stamps are far behind those before them: the clock of whoever sends frames is taken to begin anew");
      pose_end_s_.reset();
      last_s_ = {};
      break;
    case SenderClock::Verdict::Taken:
      break;
  }
  return std::nullopt;
}

net::FrameOutcome LiveFeed::take_calibration(const net::IncomingFrame& frame) {
  const std::string text = frame.message.substr(frame.body_begin);
  if (calibration_ && text == calibration_text_) return net::FrameTaken{};
  if (calibration_) {
    return refused(FaultKind::NoCalibration, "other_calibration", "body",
                   "the calibration is another than that of the map, which stays; start the server anew for it");
  }
  auto read = mapping::calibration_from_text(text, "the calibration");
  if (!read) return refused(FaultKind::NoCalibration, "bad_calibration", "body", read.error().message);
  calibration_ = std::move(read).value();
  calibration_text_ = text;
  return net::FrameTaken{};
}

void LiveFeed::add_pose(double stamp_s, const Eigen::Isometry3d& pose, mapping::StampedPoses& into) {
  pose_end_s_ = clock_.on_own_clock(stamp_s);
  clock_.accept(stamp_s, steady_s());
  into.emplace_back(*pose_end_s_, pose);
}

void LiveFeed::believe_lone_pose(mapping::StampedPoses& into) {
  const LonePose lone = *std::exchange(lone_pose_, std::nullopt);
  if (!pose_end_s_ && !clock_.has_said_near(lone.stamp_s)) {
    // Poses tell the time, not pictures that came before the first of them.
    clock_.forget_sender();
    last_s_ = {};
  }
  add_pose(lone.stamp_s, lone.pose, into);
}

void LiveFeed::leave_lone_pose_out() {
  if (!lone_pose_) return;
  lone_pose_.reset();
  note(FaultKind::FarStamp, "a pose is left out: nothing else has a stamp within 10 s of it");
}

std::optional<net::BlockRefusal> LiveFeed::take_pose(double stamp_s, const Eigen::Isometry3d& pose,
                                                     mapping::StampedPoses& into) {
  const bool is_first = !pose_end_s_;
  const SenderClock::Verdict verdict = clock_.look(stamp_s, steady_s());
  const bool is_ahead = verdict == SenderClock::Verdict::Ahead;
  if (!is_ahead) {
    if (auto refusal = refusal_of_stamp(verdict, "a pose")) return refusal;
  }
  if (is_ahead || (is_first && !clock_.has_said_near(stamp_s))) {
    // Stills are minutes apart, and some stamps cannot be meant.
    if (!is_near_lone_pose(stamp_s)) {
      leave_lone_pose_out();
      lone_pose_ = LonePose{stamp_s, pose};
      return std::nullopt;
    }
    believe_lone_pose(into);
  }
  if (pose_end_s_ && !(clock_.on_own_clock(stamp_s) > *pose_end_s_)) {
    return refused(FaultKind::BackwardPose, "backward_pose", "poses", "a pose is not later than the one before");
  }
  leave_lone_pose_out();
  add_pose(stamp_s, pose, into);
  return std::nullopt;
}

std::optional<net::FrameOutcome> LiveFeed::take_poses(const net::IncomingFrame& frame, Done& done) {
  if (!calibration_) {
    return refused(FaultKind::NoCalibration, "no_calibration", "", "poses have come before the calibration");
  }
  std::optional<net::BlockRefusal> refusal;
  PoseNews news;
  for (const auto& values : frame.head.poses) {
    const auto pose = mapping::pose_of(values);
    if (!pose) {
      refusal =
          refused(FaultKind::UnreadablePose, "bad_pose", "poses",
                  "a pose is not eight finite numbers with a rotation in the last four, less than 1,000 km from 0");
      continue;
    }
    if (auto wrong = take_pose(values[0], depth_pose(*calibration_, *pose), news.poses)) refusal = std::move(wrong);
  }
  if (refusal) news.outcome = *refusal;
  news.done = std::move(done);
  new_poses_.push_back(std::move(news));
  return std::nullopt;
}

std::optional<net::FrameOutcome> LiveFeed::take_corrections(const net::IncomingFrame& frame, Done& done) {
  if (!settings_.submaps) {
    return refused(FaultKind::UnreadablePose, "no_submaps", "kind",
                   "this map is made in one piece, which does not move; start the server with --submaps");
  }
  if (!calibration_) {
    return refused(FaultKind::NoCalibration, "no_calibration", "", "poses have come before the calibration");
  }
  PoseNews news;
  news.is_correction = true;
  for (const auto& values : frame.head.poses) {
    const auto pose = mapping::pose_of(values);
    // Half a correction would tear the map.
    if (!pose) {
      return refused(
          FaultKind::UnreadablePose, "bad_pose", "poses",
          "a corrected pose is not eight finite numbers with a rotation in the last four, less than 1,000 km from "
          "0; none was taken");
    }
    // They speak of what was, and say nothing of the clock of what comes.
    news.poses.emplace_back(clock_.moment_of(values[0]), depth_pose(*calibration_, *pose));
  }
  news.done = std::move(done);
  new_poses_.push_back(std::move(news));
  return std::nullopt;
}

std::optional<net::BlockRefusal> LiveFeed::refusal_of_picture(const protocol::FrameHead& head, double time_s) {
  const std::string name = picture_name(*head.sensor);
  if (!calibration_) {
    return refused(FaultKind::NoCalibration, "no_calibration", "", name + " has come before the calibration");
  }
  const bool has_camera =
      *head.sensor == FrameSensor::Depth ||
      (*head.sensor == FrameSensor::Color ? calibration_->colour.has_value() : calibration_->thermal.has_value());
  if (!has_camera) {
    return refused(FaultKind::NoCalibration, "no_calibration", "sensor",
                   "the calibration has no " + name_of(*head.sensor) + " camera");
  }
  if (!settings_.is_tracking && pose_end_s_ && std::abs(time_s - *pose_end_s_) > kFarthestStampS) {
    return refused(FaultKind::NoPose, "no_pose", "time", name + " has a stamp more than 10 s from the newest pose");
  }
  return std::nullopt;
}

std::optional<net::FrameOutcome> LiveFeed::take_picture(net::IncomingFrame& frame, Done& done, Answers& answers) {
  const protocol::FrameHead& head = frame.head;
  const std::string name = picture_name(*head.sensor);
  if (is_near_lone_pose(*head.time)) {
    // Both are believed.
    PoseNews news;
    believe_lone_pose(news.poses);
    new_poses_.push_back(std::move(news));
  }
  // Poses tell the time where there are any.
  if (settings_.is_tracking || !pose_end_s_) {
    if (auto refusal = refusal_of_stamp(clock_.look(*head.time, steady_s()), name)) return std::move(*refusal);
  }
  const double time_s = clock_.on_own_clock(*head.time);
  if (auto refusal = refusal_of_picture(head, time_s)) return std::move(*refusal);
  const Rank rank = *head.sensor == FrameSensor::Color   ? Rank::Colour
                    : *head.sensor == FrameSensor::Depth ? Rank::Depth
                                                         : Rank::Thermal;
  auto& last_s = last_s_[static_cast<std::size_t>(rank)];
  if (last_s && !(time_s > *last_s)) {
    return refused(FaultKind::BackwardClock, "backward_clock", "time", name + " is not later than the one before");
  }
  last_s = time_s;
  clock_.accept(*head.time, steady_s());
  if (settings_.is_tracking && lone_pose_ && !pose_end_s_) {
    // Where the map begins, whenever that was.
    new_poses_.push_back(
        {.poses = {{time_s, std::exchange(lone_pose_, std::nullopt)->pose}}, .done = {}, .outcome = {}});
  }
  waiting_.emplace(Key{time_s, rank}, Waiting{std::move(frame), std::move(done)});
  if (waiting_.size() <= kMostWaiting) return std::nullopt;
  // The picture itself is not lost among those of another sensor: the one that sends most gives way.
  std::array<std::size_t, 3> counts{};
  for (const auto& [key, item] : waiting_) ++counts[static_cast<std::size_t>(key.second)];
  const auto most = std::max_element(counts.begin(), counts.end()) - counts.begin();
  const auto oldest = std::find_if(waiting_.begin(), waiting_.end(), [&](const auto& entry) {
    return static_cast<std::ptrdiff_t>(entry.first.second) == most;
  });
  if (skipped_count_ == 0) spdlog::warn("pictures come faster than they can be mapped: some are skipped; said once");
  ++skipped_count_;
  last_skip_s_ = steady_s();
  answers.emplace_back(std::move(oldest->second.done), net::FrameTaken{true, wanted_rate()});
  waiting_.erase(oldest);
  return std::nullopt;
}

std::optional<double> LiveFeed::wanted_rate() const {
  if (picture_s_ <= 0 || steady_s() - last_skip_s_ > kOverloadS) return std::nullopt;
  return kAskedShare / picture_s_;
}

std::optional<net::FrameOutcome> LiveFeed::take_kind(net::IncomingFrame& frame, Done& done, Answers& answers) {
  if (ended_) return not_mapping();
  switch (frame.head.kind) {
    case FramesKind::Calibration:
      return take_calibration(frame);
    case FramesKind::Poses:
      return take_poses(frame, done);
    case FramesKind::CorrectedPoses:
      return take_corrections(frame, done);
    case FramesKind::Picture:
      return take_picture(frame, done, answers);
    case FramesKind::End:
      is_flushing_ = true;
      break;
  }
  return net::FrameTaken{};
}

void LiveFeed::take(net::IncomingFrame frame, Done done) {
  Answers answers;
  {
    const std::lock_guard lock(mutex_);
    last_arrival_s_ = steady_s();
    auto outcome = take_kind(frame, done, answers);
    if (outcome) answers.emplace_back(std::move(done), std::move(*outcome));
  }
  has_work_.notify_all();
  for (auto& [answer, outcome] : answers) answer(std::move(outcome));
}

bool LiveFeed::is_ready() const {
  if (waiting_.empty()) return false;
  const bool is_quiet = steady_s() - last_arrival_s_ > kPatienceS;
  if (is_flushing_ || is_quiet || waiting_.size() >= kMostWaiting) return true;
  const auto& [time_s, rank] = waiting_.begin()->first;
  const double delay_s = rank == Rank::Depth                              ? calibration_->depth.delay_s
                         : rank == Rank::Colour && calibration_->colour   ? calibration_->colour->delay_s
                         : rank == Rank::Thermal && calibration_->thermal ? calibration_->thermal->delay_s
                                                                          : 0;
  return (!settings_.is_tracking && pose_end_s_ && *pose_end_s_ >= time_s + delay_s) ||
         (clock_.newest_s() && *clock_.newest_s() - time_s > kPatienceS);
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
  for (const PoseNews& some : poses_in_hand_) {
    if (some.is_correction) {
      correct(some.poses);
    } else {
      for (const auto& [time_s, pose] : some.poses) trajectory_.add(time_s, pose);
    }
  }
  std::vector<PoseNews> applied;
  applied.swap(poses_in_hand_);
  for (PoseNews& some : applied) {
    if (some.done) some.done(std::move(some.outcome));
  }
}

void LiveFeed::tell_found_pose() {
  teller_.tell(*mapper_);
  if (mapper_->tracked().size() == 0) return;
  const mapping::PoseAnswer found = mapper_->found_pose();
  const double at_s = mapper_->tracked().end_s();
  if (mapper_->tracked().size() > kManyPoses) mapper_->forget_tracked_before(at_s - 2 * kFarthestStampS);
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
      has_work_.wait_for(lock, kLookEvery, [&] { return is_over_ || is_ready() || !new_poses_.empty(); });
      if (is_over_) return;
      if (!mapper_ && calibration_) {
        mapper_.emplace(*calibration_, settings_, pool_);
      }
      poses_in_hand_.swap(new_poses_);
      pose_end_s = pose_end_s_;
      newest_s = clock_.newest_s();
      if (is_ready()) {
        picture_in_hand_.emplace(waiting_.begin()->first, std::move(waiting_.begin()->second));
        waiting_.erase(waiting_.begin());
      } else if (waiting_.empty() && has_sender_) {
        is_flushing_ = false;
      }
      is_idle = waiting_.empty() && !picture_in_hand_ && steady_s() - last_arrival_s_ > kIdleAfterS;
    }
    apply_poses();
    // Of pictures that wait the oldest may be as far from the newest pose as one may come, and wait as long.
    if (pose_end_s && trajectory_.size() > kManyPoses) trajectory_.forget_before(*pose_end_s - 2 * kFarthestStampS);
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
        const double took_s = steady_s() - begun_s;
        picture_s_ = picture_s_ > 0 ? 0.9 * picture_s_ + 0.1 * took_s : took_s;
        if (auto* taken = std::get_if<net::FrameTaken>(&outcome)) taken->pictures_per_s = wanted_rate();
      }
      const Done done = std::move(picture_in_hand_->second.done);
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

mapping::Frame LiveFeed::decoded(const Key& key, const net::IncomingFrame& frame, mapping::FaultLog& faults) {
  const auto& [time_s, rank] = key;
  const std::string name = picture_name(*frame.head.sensor);
  mapping::Frame result;
  result.time_s = time_s;
  const auto take = [&](auto read, const mapping::CameraModel& camera, auto& into) {
    if (!read) {
      faults.add(FaultKind::DamagedFile, read.error().message);
    } else if (read.value().width != camera.width || read.value().height != camera.height) {
      faults.add(FaultKind::WrongSize, name + " has " + std::to_string(read.value().width) + " x " +
                                           std::to_string(read.value().height) + " pixels, and its camera has " +
                                           std::to_string(camera.width) + " x " + std::to_string(camera.height));
    } else {
      into = std::move(read).value();
    }
  };
  if (rank == Rank::Depth) take(picture16_of(frame, name), calibration_->depth.camera, result.depth);
  if (rank == Rank::Thermal) take(picture16_of(frame, name), calibration_->thermal->camera, result.thermal);
  if (rank == Rank::Colour) take(colour_picture_of(frame, name), calibration_->colour->camera, result.colour);
  return result;
}

net::FrameOutcome LiveFeed::map_picture(const Key& key, const net::IncomingFrame& incoming) {
  mapping::FaultLog faults, faults_of_earlier;
  mapping::Frame frame = decoded(key, incoming, faults);
  if (key.second == Rank::Colour) {
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
  for (std::size_t i = 0; i < mapping::kFaultKinds; ++i) {
    const mapping::FrameFault& fault = faults_of_earlier.all()[i];
    if (fault.count > 0) note(static_cast<FaultKind>(i), fault.what, fault.count);
  }
  if (wrong == faults.all().end()) return net::FrameTaken{};
  const auto kind = static_cast<FaultKind>(wrong - faults.all().begin());
  return refused(kind, code_of(kind), kind == FaultKind::NoPose ? "time" : "body", wrong->what);
}

}  // namespace spectra::sources
