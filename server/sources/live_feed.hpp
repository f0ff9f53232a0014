#pragma once

#include <array>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "server/mapping/frame_folder.hpp"
#include "server/mapping/mapper.hpp"
#include "server/mapping/unit_publisher.hpp"
#include "server/net/frame_receiver.hpp"
#include "server/sources/map_feed.hpp"
#include "server/sources/robot_track.hpp"
#include "server/sources/sender_clock.hpp"
#include "server/sources/unit_hand_over.hpp"

namespace spectra::sources {

/// Maps the frames that a robot sends, in a thread of its own. A picture waits until poses of its moment are there, but no longer than until
/// something kPatienceS later has come, or nothing for as long; pictures are taken in the order of their time. When more than kMostWaiting wait, the oldest of the sensor
/// that has most of them is skipped, and fewer are asked for. What is wrong with a message is answered, said once in the log, and counted.
class LiveFeed final : public net::FrameReceiver {
 public:
  static constexpr double kPatienceS = 0.3;
  static constexpr std::size_t kMostWaiting = 24;
  /// A stamp that is farther than this from every pose cannot be meant.
  static constexpr double kFarthestStampS = SenderClock::kFarS;
  /// A depth picture takes its colours from one that is at most so much older.
  static constexpr double kColourAgeS = 0.15;

  struct Sinks {
    HandOver hand_over;
    std::function<void(const RobotPose& pose, bool is_last)> moved;
    /// Units that can be handed over without waiting.
    std::function<std::size_t()> room = [] { return mapping::UnitPublisher::kAll; };
    /// Mapping has ended by itself, and why, in a sentence; from the thread that maps.
    std::function<void(const std::string& why)> ended = [](const std::string&) {};
  };

  /// While frames come, what has changed is handed over so often.
  static constexpr std::chrono::milliseconds kPublishEvery{200};

  /// Takes nobody's frames before `may_begin`.
  LiveFeed(const mapping::MapperSettings& settings, Sinks sinks, std::function<bool()> may_begin,
           std::chrono::duration<double> publish_every = kPublishEvery);
  ~LiveFeed() override;  ///< Ends it after the picture that is being fused; what waits is answered by nobody.
  LiveFeed(const LiveFeed&) = delete;
  LiveFeed& operator=(const LiveFeed&) = delete;

  std::optional<net::BlockRefusal> begin() override;
  void take(net::IncomingFrame frame, std::function<void(net::FrameOutcome)> done) override;
  void end() override;

  /// What was wrong so far, and how many pictures were skipped.
  mapping::FaultLog faults() const;
  std::size_t skipped_count() const;

 private:
  using Done = std::function<void(net::FrameOutcome)>;
  /// Sensors in the order in which pictures of one time are taken.
  enum class Rank { Colour, Depth, Thermal };
  struct Waiting {
    net::IncomingFrame frame;
    Done done;
  };
  using Key = std::pair<double, Rank>;
  using Answers = std::vector<std::pair<Done, net::FrameOutcome>>;

  // Under the lock.
  net::FrameOutcome take_calibration(const net::IncomingFrame& frame);
  /// Nothing: it is answered when it is applied or mapped, so that credit bounds what waits.
  std::optional<net::FrameOutcome> take_kind(net::IncomingFrame& frame, Done& done, Answers& answers);
  std::optional<net::FrameOutcome> take_corrections(const net::IncomingFrame& frame, Done& done);
  std::optional<net::FrameOutcome> take_poses(const net::IncomingFrame& frame, Done& done);
  std::optional<net::FrameOutcome> take_picture(net::IncomingFrame& frame, Done& done, Answers& answers);
  std::optional<net::BlockRefusal> refusal_of_picture(const protocol::FrameHead& head, double time_s);
  std::optional<net::BlockRefusal> refusal_of_stamp(SenderClock::Verdict verdict, const std::string& whose);
  /// One pose, which goes into `into` with what was waiting for it, or waits itself.
  std::optional<net::BlockRefusal> take_pose(double stamp_s, const Eigen::Isometry3d& pose,
                                             mapping::StampedPoses& into);
  void add_pose(double stamp_s, const Eigen::Isometry3d& pose, mapping::StampedPoses& into);
  bool is_near_lone_pose(double stamp_s) const {
    return lone_pose_ && std::abs(stamp_s - lone_pose_->stamp_s) <= kFarthestStampS;
  }
  void believe_lone_pose(mapping::StampedPoses& into);
  void leave_lone_pose_out();
  net::BlockRefusal not_mapping() const { return {503, "not_mapping", "", *ended_, ""}; }
  net::BlockRefusal refused(mapping::FaultKind kind, std::string code, std::string field, const std::string& reason);
  void note(mapping::FaultKind kind, const std::string& what, std::size_t count = 1);
  bool is_ready() const;
  std::optional<double> wanted_rate() const;

  void work();
  void end_mapping(const std::string& why);
  void apply_poses();
  void tell_found_pose();
  void correct(const mapping::StampedPoses& poses);
  net::FrameOutcome map_picture(const Key& key, const net::IncomingFrame& frame);
  mapping::Frame decoded(const Key& key, const net::IncomingFrame& frame, mapping::FaultLog& faults);

  const mapping::MapperSettings settings_;
  const Sinks sinks_;
  const std::function<bool()> may_begin_;
  const std::chrono::duration<double> publish_every_;

  mutable std::mutex mutex_;
  std::condition_variable has_work_;
  bool is_over_ = false;
  std::optional<std::string> ended_;  ///< Why nothing is mapped any more.
  bool has_sender_ = false;
  bool is_flushing_ = false;  ///< Nobody is waited for any more.
  std::string calibration_text_;
  std::optional<mapping::Calibration> calibration_;
  std::multimap<Key, Waiting> waiting_;
  /// Poses, or what corrects those before.
  struct PoseNews {
    mapping::StampedPoses poses;
    bool is_correction = false;
    Done done;                  ///< May be none.
    net::FrameOutcome outcome;  ///< To answer with.
  };
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

  // Of the thread.
  std::vector<PoseNews> poses_in_hand_;
  std::optional<std::pair<Key, Waiting>> picture_in_hand_;
  jobs::WorkerPool pool_{1};
  std::optional<mapping::Mapper> mapper_;
  mapping::Trajectory trajectory_;
  mapping::UnitPublisher publisher_;
  mapping::PictureRgb colour_;
  double colour_s_ = 0;
  FeedMoment moment_;
  bool has_changed_ = false;
  TrackTeller teller_;
  std::thread thread_;
};

}  // namespace spectra::sources
