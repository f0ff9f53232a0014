#include "server/sources/frame_intake.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "server/sources/frame_bodies.hpp"

namespace spectra::sources {
namespace {

using mapping::FaultKind;
using protocol::FrameSensor;
using protocol::FramesKind;

/// After a picture was skipped fewer are asked for as long.
constexpr double kOverloadS = 2;
/// Of what it could do that is asked for, so that it catches up.
constexpr double kAskedShare = 0.9;

Eigen::Isometry3d depth_pose(const mapping::Calibration& calibration, const Eigen::Isometry3d& pose) {
  return (calibration.is_world_to_camera ? pose.inverse() : pose) * calibration.depth_from_pose.inverse();
}

}  // namespace

double steady_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

void FrameIntake::begin_sender() {
  has_sender_ = true;
  ++sender_count_;
  is_flushing_ = false;
  clock_.begin_sender();
  pose_end_s_.reset();
  last_s_ = {};
}

void FrameIntake::end_sender() {
  has_sender_ = false;
  is_flushing_ = true;
  leave_lone_pose_out();
  for (const mapping::FrameFault& fault : faults_.all()) {
    if (fault.count > 1) spdlog::warn("{} ({} times so far)", fault.what, fault.count);
  }
  if (skipped_count_ > 0) spdlog::warn("{} pictures were skipped so far: there was no time for them", skipped_count_);
}

void FrameIntake::note(FaultKind kind, const std::string& what, std::size_t count) {
  if (faults_.of(kind).count == 0) spdlog::warn("{}; said once", what);
  faults_.add(kind, what, count);
}

void FrameIntake::note(const mapping::FaultLog& faults) {
  for (std::size_t i = 0; i < mapping::kFaultKinds; ++i) {
    const mapping::FrameFault& fault = faults.all()[i];
    if (fault.count > 0) note(static_cast<FaultKind>(i), fault.what, fault.count);
  }
}

net::BlockRefusal FrameIntake::refused(FaultKind kind, std::string code, std::string field, const std::string& reason) {
  note(kind, reason);
  return {400, std::move(code), std::move(field), reason, ""};
}

std::optional<net::BlockRefusal> FrameIntake::refusal_of_stamp(SenderClock::Verdict verdict, const std::string& whose) {
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

net::FrameOutcome FrameIntake::take_calibration(const net::IncomingFrame& frame) {
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

void FrameIntake::add_pose(double stamp_s, const Eigen::Isometry3d& pose, mapping::StampedPoses& into) {
  pose_end_s_ = clock_.on_own_clock(stamp_s);
  clock_.accept(stamp_s, steady_s());
  into.emplace_back(*pose_end_s_, pose);
}

void FrameIntake::believe_lone_pose(mapping::StampedPoses& into, Answers& answers) {
  const LonePose lone = *std::exchange(lone_pose_, std::nullopt);
  if (!pose_end_s_ && !clock_.has_said_near(lone.stamp_s)) {
    // Poses tell the time, not pictures that came before the first of them: on this clock those are of another moment than they say.
    clock_.forget_sender();
    last_s_ = {};
    for (auto at = waiting_.begin(); at != waiting_.end();) {
      if (at->second.sender != sender_count_) {
        ++at;
        continue;
      }
      answers.emplace_back(std::move(at->second.done),
                           refused(FaultKind::NoPose, "no_pose", "time",
                                   picture_name(*at->second.frame.head.sensor) +
                                       " that came before the first pose has a stamp more than 10 s from it"));
      at = waiting_.erase(at);
    }
  }
  add_pose(lone.stamp_s, lone.pose, into);
}

void FrameIntake::leave_lone_pose_out() {
  if (!lone_pose_) return;
  lone_pose_.reset();
  note(FaultKind::FarStamp, "a pose is left out: nothing else has a stamp within 10 s of it");
}

std::optional<net::BlockRefusal> FrameIntake::take_pose(double stamp_s, const Eigen::Isometry3d& pose,
                                                        mapping::StampedPoses& into, Answers& answers) {
  const bool is_first = !pose_end_s_;
  const SenderClock::Verdict verdict = clock_.look(stamp_s, steady_s());
  const bool is_ahead = verdict == SenderClock::Verdict::Ahead && !is_tracking_;
  if (!is_ahead) {
    if (auto refusal = refusal_of_stamp(verdict, "a pose")) return refusal;
  }
  // Tracking goes by the pictures as soon as there are any.
  const bool is_lone = is_ahead || (is_first && !clock_.has_said_near(stamp_s));
  if (is_lone && !(is_tracking_ && clock_.has_said_any())) {
    // Stills are minutes apart, and some stamps cannot be meant.
    if (!is_near_lone_pose(stamp_s)) {
      leave_lone_pose_out();
      lone_pose_ = LonePose{stamp_s, pose};
      return std::nullopt;
    }
    believe_lone_pose(into, answers);
  }
  if (pose_end_s_ && !(clock_.on_own_clock(stamp_s) > *pose_end_s_)) {
    return refused(FaultKind::BackwardPose, "backward_pose", "poses", "a pose is not later than the one before");
  }
  leave_lone_pose_out();
  add_pose(stamp_s, pose, into);
  return std::nullopt;
}

std::optional<net::FrameOutcome> FrameIntake::take_poses(const net::IncomingFrame& frame, Done& done,
                                                         Answers& answers) {
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
    if (auto wrong = take_pose(values[0], depth_pose(*calibration_, *pose), news.poses, answers))
      refusal = std::move(wrong);
  }
  if (refusal) news.outcome = *refusal;
  news.done = std::move(done);
  new_poses_.push_back(std::move(news));
  return std::nullopt;
}

std::optional<net::FrameOutcome> FrameIntake::take_corrections(const net::IncomingFrame& frame, Done& done) {
  if (!has_submaps_) {
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

std::optional<net::BlockRefusal> FrameIntake::refusal_of_picture(const protocol::FrameHead& head, double time_s) {
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
  if (!is_tracking_ && pose_end_s_ && std::abs(time_s - *pose_end_s_) > kFarthestStampS) {
    return refused(FaultKind::NoPose, "no_pose", "time", name + " has a stamp more than 10 s from the newest pose");
  }
  return std::nullopt;
}

std::optional<net::FrameOutcome> FrameIntake::take_picture(net::IncomingFrame& frame, Done& done, Answers& answers) {
  const protocol::FrameHead& head = frame.head;
  const std::string name = picture_name(*head.sensor);
  if (is_near_lone_pose(*head.time)) {
    // Both are believed.
    PoseNews news;
    believe_lone_pose(news.poses, answers);
    new_poses_.push_back(std::move(news));
  }
  // Poses tell the time where there are any.
  if (is_tracking_ || !pose_end_s_) {
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
  if (is_tracking_ && lone_pose_ && !pose_end_s_) {
    // Where the map begins, whenever that was.
    new_poses_.push_back(
        {.poses = {{time_s, std::exchange(lone_pose_, std::nullopt)->pose}}, .done = {}, .outcome = {}});
  }
  waiting_.emplace(Key{time_s, rank}, Waiting{std::move(frame), std::move(done), sender_count_});
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

std::optional<double> FrameIntake::wanted_rate() const {
  if (picture_s_ <= 0 || steady_s() - last_skip_s_ > kOverloadS) return std::nullopt;
  return kAskedShare / picture_s_;
}

std::optional<net::FrameOutcome> FrameIntake::take_kind(net::IncomingFrame& frame, Done& done, Answers& answers) {
  switch (frame.head.kind) {
    case FramesKind::Calibration:
      return take_calibration(frame);
    case FramesKind::Poses:
      return take_poses(frame, done, answers);
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

void FrameIntake::take(net::IncomingFrame frame, Done done, Answers& answers) {
  last_arrival_s_ = steady_s();
  if (auto outcome = take_kind(frame, done, answers)) answers.emplace_back(std::move(done), std::move(*outcome));
}

void FrameIntake::give_up(const net::FrameOutcome& outcome, Answers& answers) {
  for (PoseNews& some : new_poses_) answers.emplace_back(std::move(some.done), outcome);
  for (auto& [key, item] : waiting_) answers.emplace_back(std::move(item.done), outcome);
  new_poses_.clear();
  waiting_.clear();
}

double FrameIntake::quiet_s() const {
  return steady_s() - last_arrival_s_;
}

bool FrameIntake::is_ready() const {
  if (waiting_.empty()) return false;
  const bool is_quiet = quiet_s() > kPatienceS;
  if (is_flushing_ || is_quiet || waiting_.size() >= kMostWaiting) return true;
  const auto& [time_s, rank] = waiting_.begin()->first;
  const double delay_s = rank == Rank::Depth                              ? calibration_->depth.delay_s
                         : rank == Rank::Colour && calibration_->colour   ? calibration_->colour->delay_s
                         : rank == Rank::Thermal && calibration_->thermal ? calibration_->thermal->delay_s
                                                                          : 0;
  return (!is_tracking_ && pose_end_s_ && *pose_end_s_ >= time_s + delay_s) ||
         (clock_.newest_s() && *clock_.newest_s() - time_s > kPatienceS);
}

std::optional<FrameIntake::Picture> FrameIntake::next_picture() {
  if (!is_ready()) {
    if (waiting_.empty() && has_sender_) is_flushing_ = false;
    return std::nullopt;
  }
  Picture next{waiting_.begin()->first, std::move(waiting_.begin()->second)};
  waiting_.erase(waiting_.begin());
  return next;
}

void FrameIntake::note_took(double seconds) {
  picture_s_ = picture_s_ > 0 ? 0.9 * picture_s_ + 0.1 * seconds : seconds;
}

}  // namespace spectra::sources
