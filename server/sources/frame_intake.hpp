#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/mapping/frame_folder.hpp"
#include "server/net/frame_receiver.hpp"
#include "server/sources/sender_clock.hpp"

namespace spectra::sources {

/// Seconds of a clock that is never set.
double steady_s();

/// What a robot has sent and is not mapped yet: checks messages, brings their stamps onto one clock, and has poses and pictures wait for whoever
/// maps. A picture waits until poses of its moment are there, but no longer than until something kPatienceS later has come, or nothing for as
/// long; pictures are taken in the order of their time. When more than kMostWaiting wait, the oldest of the sensor that has most of them is skipped,
/// and fewer are asked for. What is wrong with a message is answered, said once in the log, and counted. Not thread-safe.
class FrameIntake {
 public:
  static constexpr double kPatienceS = 0.3;
  static constexpr std::size_t kMostWaiting = 24;
  /// A stamp that is farther than this from every pose cannot be meant.
  static constexpr double kFarthestStampS = SenderClock::kFarS;

  using Done = std::function<void(net::FrameOutcome)>;
  using Answers = std::vector<std::pair<Done, net::FrameOutcome>>;
  /// Sensors in the order in which pictures of one time are taken.
  enum class Rank { Colour, Depth, Thermal };
  using Key = std::pair<double, Rank>;
  struct Waiting {
    net::IncomingFrame frame;
    Done done;
    std::uint64_t sender = 0;  ///< The how manieth.
  };
  using Picture = std::pair<Key, Waiting>;
  /// Poses of the depth camera, or what corrects those before.
  struct PoseNews {
    mapping::StampedPoses poses;
    bool is_correction = false;
    Done done;                  ///< May be none.
    net::FrameOutcome outcome;  ///< To answer with.
  };

  /// `is_tracking`: poses need not come. `has_submaps`: corrected poses may.
  FrameIntake(bool is_tracking, bool has_submaps) : is_tracking_(is_tracking), has_submaps_(has_submaps) {}

  bool has_sender() const { return has_sender_; }
  void begin_sender();
  /// Nobody is waited for any more.
  void end_sender();
  /// Adds to `answers` whom to answer what now. Others are answered when they are applied or mapped, so that credit bounds what waits.
  void take(net::IncomingFrame frame, Done done, Answers& answers);
  /// Whatever waits waits no longer, and is to be answered so.
  void give_up(const net::FrameOutcome& outcome, Answers& answers);

  /// Once there is one, it stays.
  const std::optional<mapping::Calibration>& calibration() const { return calibration_; }
  bool has_new_poses() const { return !new_poses_.empty(); }
  std::vector<PoseNews> take_new_poses() { return std::exchange(new_poses_, {}); }
  /// A picture waits no longer.
  bool is_ready() const;
  std::optional<Picture> next_picture();
  bool is_empty() const { return waiting_.empty(); }
  /// Seconds since the last message.
  double quiet_s() const;
  /// Of this sender's poses, on the clock of the map.
  std::optional<double> pose_end_s() const { return pose_end_s_; }
  /// Of all stamps, on the clock of the map.
  std::optional<double> newest_s() const { return clock_.newest_s(); }

  /// A picture took so many seconds to map.
  void note_took(double seconds);
  /// Pictures a second that are wanted, while they are too many.
  std::optional<double> wanted_rate() const;

  void note(const mapping::FaultLog& faults);
  net::BlockRefusal refused(mapping::FaultKind kind, std::string code, std::string field, const std::string& reason);
  /// What was wrong so far, and how many pictures were skipped.
  const mapping::FaultLog& faults() const { return faults_; }
  std::size_t skipped_count() const { return skipped_count_; }

 private:
  /// Nothing: it is answered later.
  std::optional<net::FrameOutcome> take_kind(net::IncomingFrame& frame, Done& done, Answers& answers);
  net::FrameOutcome take_calibration(const net::IncomingFrame& frame);
  std::optional<net::FrameOutcome> take_corrections(const net::IncomingFrame& frame, Done& done);
  std::optional<net::FrameOutcome> take_poses(const net::IncomingFrame& frame, Done& done, Answers& answers);
  std::optional<net::FrameOutcome> take_picture(net::IncomingFrame& frame, Done& done, Answers& answers);
  std::optional<net::BlockRefusal> refusal_of_picture(const protocol::FrameHead& head, double time_s);
  std::optional<net::BlockRefusal> refusal_of_stamp(SenderClock::Verdict verdict, const std::string& whose);
  /// One pose, which goes into `into` with what was waiting for it, or waits itself.
  std::optional<net::BlockRefusal> take_pose(double stamp_s, const Eigen::Isometry3d& pose, mapping::StampedPoses& into,
                                             Answers& answers);
  void add_pose(double stamp_s, const Eigen::Isometry3d& pose, mapping::StampedPoses& into);
  bool is_near_lone_pose(double stamp_s) const {
    return lone_pose_ && std::abs(stamp_s - lone_pose_->stamp_s) <= kFarthestStampS;
  }
  void believe_lone_pose(mapping::StampedPoses& into, Answers& answers);
  void leave_lone_pose_out();
  void note(mapping::FaultKind kind, const std::string& what, std::size_t count = 1);

  const bool is_tracking_, has_submaps_;
  bool has_sender_ = false;
  std::uint64_t sender_count_ = 0;
  bool is_flushing_ = false;  ///< Nobody is waited for any more.
  std::string calibration_text_;
  std::optional<mapping::Calibration> calibration_;
  std::multimap<Key, Waiting> waiting_;
  std::vector<PoseNews> new_poses_;
  SenderClock clock_;
  /// The first pose of a sender, or one far ahead of all before it: believed when something else has a stamp near to it. Of the depth camera.
  struct LonePose {
    double stamp_s = 0;
    Eigen::Isometry3d pose;
  };
  std::optional<LonePose> lone_pose_;
  std::optional<double> pose_end_s_;             ///< Of this sender, without that one.
  std::array<std::optional<double>, 3> last_s_;  ///< Of this sender's sensors, by rank.
  mapping::FaultLog faults_;
  std::size_t skipped_count_ = 0;
  double last_skip_s_ = -1e9;  ///< On a steady clock.
  double last_arrival_s_ = 0;  ///< The same, of any message.
  double picture_s_ = 0;       ///< What a picture takes, in the mean of the last ones.
};

}  // namespace spectra::sources
