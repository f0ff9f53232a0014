#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "server/mapping/mapper.hpp"
#include "server/mapping/unit_publisher.hpp"
#include "server/net/frame_receiver.hpp"
#include "server/sources/frame_intake.hpp"
#include "server/sources/map_feed.hpp"
#include "server/sources/robot_track.hpp"
#include "server/sources/unit_hand_over.hpp"

namespace spectra::sources {

/// Maps the frames that a robot sends, in a thread of its own, as they come out of a FrameIntake.
class LiveFeed final : public net::FrameReceiver {
 public:
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
  using Answers = FrameIntake::Answers;
  using Key = FrameIntake::Key;

  net::BlockRefusal not_mapping() const { return {503, "not_mapping", "", *ended_, ""}; }
  void work();
  void end_mapping(const std::string& why);
  void apply_poses();
  void tell_found_pose();
  void correct(const mapping::StampedPoses& poses);
  net::FrameOutcome map_picture(const Key& key, const net::IncomingFrame& frame);

  const mapping::MapperSettings settings_;
  const Sinks sinks_;
  const std::function<bool()> may_begin_;
  const std::chrono::duration<double> publish_every_;

  mutable std::mutex mutex_;
  std::condition_variable has_work_;
  bool is_over_ = false;
  std::optional<std::string> ended_;  ///< Why nothing is mapped any more.
  FrameIntake intake_;                ///< Under the lock.

  // Of the thread.
  std::vector<FrameIntake::PoseNews> poses_in_hand_;
  std::optional<FrameIntake::Picture> picture_in_hand_;
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
