#include "server/sources/live_feed.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <future>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace spectra::sources {
namespace {

using namespace std::chrono_literals;
using protocol::FrameEncoding;
using protocol::FrameHead;
using protocol::FrameSensor;
using protocol::FramesKind;

constexpr int kWidth = 80, kHeight = 60;
const std::string kCamera = R"("width":80,"height":60,"fx":70,"fy":70,"cx":39.5,"cy":29.5)";

class LiveFeedTest : public ::testing::Test {
 protected:
  using Answer = std::future<net::FrameOutcome>;

  Answer send(FrameHead head, const std::string& body = "") {
    head.sequence = 1;
    auto promise = std::make_shared<std::promise<net::FrameOutcome>>();
    Answer answer = promise->get_future();
    own_->take({std::move(head), "head" + body, 4},
               [promise](net::FrameOutcome outcome) { promise->set_value(std::move(outcome)); });
    return answer;
  }
  Answer calibrate(const std::string& more = "") {
    FrameHead head;
    head.kind = FramesKind::Calibration;
    return send(head, "{\"depth\":{" + kCamera + more + "}}");
  }
  Answer pose(double time_s, double x = 0) {
    FrameHead head;
    head.kind = FramesKind::Poses;
    head.poses = {std::vector<double>{time_s, x, 0, 0, 0, 0, 0, 1}};
    return send(head);
  }
  Answer depth(double time_s) { return picture(FrameSensor::Depth, time_s); }
  /// A depth picture, or a thermal one of -258 degC.
  Answer picture(FrameSensor sensor, double time_s) {
    FrameHead head;
    head.kind = FramesKind::Picture;
    head.sensor = sensor;
    head.encoding = FrameEncoding::Raw16;
    head.width = kWidth;
    head.height = kHeight;
    head.time = time_s;
    std::string body;
    for (int i = 0; i < kWidth * kHeight; ++i) body += "\xdc\x05";  // 1500 mm
    return send(head, body);
  }
  Answer end_of_frames() {
    FrameHead head;
    head.kind = FramesKind::End;
    return send(head);
  }
  static std::string code_of(Answer answer) {
    if (answer.wait_for(10s) != std::future_status::ready) return "no answer";
    const net::FrameOutcome outcome = answer.get();
    const auto* refusal = std::get_if<net::BlockRefusal>(&outcome);
    if (refusal != nullptr) return refusal->code;
    return std::get<net::FrameTaken>(outcome).is_skipped ? "skipped" : "taken";
  }

  std::mutex mutex_;
  std::vector<RobotPose> poses_;
  std::size_t unit_count_ = 0;
  std::atomic<std::size_t> room_ = mapping::UnitPublisher::kAll;
  std::promise<std::string> ended_;
  static mapping::MapperSettings settings() {
    mapping::MapperSettings settings;
    settings.voxel_m = 0.02;
    return settings;
  }
  LiveFeed::Sinks sinks() {
    LiveFeed::Sinks sinks;
    sinks.hand_over = [this](auto units, const auto&, auto&) {
      const std::lock_guard lock(mutex_);
      unit_count_ += units.size();
    };
    sinks.room = [this] { return room_.load(); };
    sinks.ended = [this](const std::string& why) { ended_.set_value(why); };
    sinks.moved = [this](const RobotPose& pose, bool) {
      const std::lock_guard lock(mutex_);
      poses_.push_back(pose);
    };
    return sinks;
  }
  std::unique_ptr<LiveFeed> feed_of(const mapping::MapperSettings& settings) {
    return std::make_unique<LiveFeed>(settings, sinks(), [] { return true; });
  }
  /// What begin() says.
  std::string begun() {
    const auto refusal = own_->begin();
    return refusal ? std::to_string(refusal->status) + " " + refusal->code : "begun";
  }
  std::size_t units_within(std::chrono::milliseconds patience) {
    for (const auto end = std::chrono::steady_clock::now() + patience; std::chrono::steady_clock::now() < end;
         std::this_thread::sleep_for(10ms)) {
      const std::lock_guard lock(mutex_);
      if (unit_count_ > 0) break;
    }
    const std::lock_guard lock(mutex_);
    return std::exchange(unit_count_, 0);
  }
  void expect_robot_is_here_now() {
    bool is_here = false;
    for (int i = 0; i < 250 && !is_here; ++i) {
      if (i > 0) std::this_thread::sleep_for(20ms);
      const std::lock_guard lock(mutex_);
      is_here = !poses_.empty() && !poses_.back().is_lost && std::abs(poses_.back().at - unix_now_s()) < 60;
    }
    const std::lock_guard lock(mutex_);
    ASSERT_FALSE(poses_.empty());
    EXPECT_TRUE(is_here) << std::fixed << poses_.back().at << (poses_.back().is_lost ? " lost" : "");
    EXPECT_NEAR(poses_.back().position.x, 0, 0.1);
  }
  /// A feed that makes the map in parts, with a sender.
  void begin_in_parts() {
    mapping::MapperSettings in_parts = settings();
    in_parts.submaps.emplace();
    own_ = feed_of(in_parts);
    EXPECT_EQ(begun(), "begun");
    EXPECT_EQ(code_of(calibrate()), "taken");
  }
  void map_a_picture() {
    for (int i = 0; i < 4; ++i) EXPECT_EQ(code_of(pose(0.05 * i)), "taken");
    EXPECT_EQ(code_of(depth(0.05)), "taken");
    EXPECT_GT(units_within(5s), 0U);
  }
  std::unique_ptr<LiveFeed> own_ = feed_of(settings());  ///< Last, since it calls back until it is gone.
};

TEST_F(LiveFeedTest, TakesOneSenderAtATime) {
  EXPECT_EQ(begun(), "begun");
  EXPECT_EQ(begun(), "503 busy");
  own_->end();
  EXPECT_EQ(begun(), "begun");
}

TEST_F(LiveFeedTest, WaitsForThePoseOfAPictureAndMapsInTheOrderOfTime) {
  ASSERT_EQ(begun(), "begun");
  EXPECT_EQ(code_of(calibrate()), "taken");
  EXPECT_EQ(code_of(pose(10)), "taken");
  Answer early = depth(10.05);
  EXPECT_EQ(early.wait_for(150ms), std::future_status::timeout) << "no pose of its moment is there yet";
  EXPECT_EQ(code_of(pose(10.1)), "taken");
  EXPECT_EQ(code_of(std::move(early)), "taken");
  for (int i = 2; i < 6; ++i) {
    code_of(pose(10 + 0.1 * i));
    EXPECT_EQ(code_of(depth(10 + 0.1 * i)), "taken");
  }
  for (int i = 0; i < 100; ++i) {
    {
      const std::lock_guard lock(mutex_);
      if (unit_count_ > 0 && poses_.size() > 1) break;
    }
    std::this_thread::sleep_for(20ms);
  }
  const std::lock_guard lock(mutex_);
  EXPECT_GT(unit_count_, 0U);
  EXPECT_EQ(poses_.back().forward.z, 1) << "the camera looks along its z";
}

TEST_F(LiveFeedTest, WaitsForNoPoseLongerThanItsPatience) {
  ASSERT_EQ(begun(), "begun");
  code_of(calibrate());
  EXPECT_EQ(code_of(depth(5)), "no_pose") << "when nothing else comes";
  Answer waiting = depth(6);
  Answer later = depth(6.5);
  EXPECT_EQ(code_of(std::move(waiting)), "no_pose");
  EXPECT_EQ(code_of(end_of_frames()), "taken");
  EXPECT_EQ(code_of(std::move(later)), "no_pose");
  EXPECT_EQ(own_->faults().of(mapping::FaultKind::NoPose).count, 3U);
}

TEST_F(LiveFeedTest, SkipsTheOldestWhenTooManyWait) {
  ASSERT_EQ(begun(), "begun");
  code_of(calibrate());
  code_of(pose(100));
  std::vector<Answer> answers;
  {
    // Who maps waits for this, with at most one of them.
    const std::lock_guard lock(mutex_);
    for (int i = 1; i <= 40; ++i) answers.push_back(depth(100 + 0.001 * i));
  }
  std::size_t skipped = 0;
  for (Answer& answer : answers) skipped += code_of(std::move(answer)) == "skipped" ? std::size_t{1} : 0;
  EXPECT_EQ(skipped, own_->skipped_count());
  EXPECT_GE(skipped, 39 - FrameIntake::kMostWaiting);
  EXPECT_LE(skipped, 40 - FrameIntake::kMostWaiting);
}

TEST_F(LiveFeedTest, GoesOnWithAClockThatIsBehindAndKeepsItsCalibration) {
  ASSERT_EQ(begun(), "begun");
  code_of(calibrate());
  code_of(pose(100));
  EXPECT_EQ(code_of(depth(100)), "taken");
  EXPECT_EQ(code_of(depth(99)), "backward_clock");
  EXPECT_EQ(code_of(pose(99)), "backward_pose");
  EXPECT_EQ(code_of(depth(200)), "no_pose") << "a stamp from nowhere does not stop the clock";
  code_of(pose(100.1));
  EXPECT_EQ(code_of(depth(100.1)), "taken");
  own_->end();
  ASSERT_EQ(begun(), "begun");
  EXPECT_EQ(code_of(calibrate(R"(,"delay_s":0.5)")), "other_calibration");
  EXPECT_EQ(code_of(calibrate()), "taken");
  code_of(pose(1));
  EXPECT_EQ(code_of(depth(1)), "taken");
}

TEST_F(LiveFeedTest, TracksWithoutPosesAndSaysThatItIsLost) {
  mapping::MapperSettings tracking = settings();
  tracking.is_tracking = true;
  own_ = feed_of(tracking);
  EXPECT_EQ(begun(), "begun");
  EXPECT_EQ(code_of(calibrate()), "taken");
  Answer first = depth(0), second = depth(0.1);
  EXPECT_EQ(code_of(end_of_frames()), "taken");
  EXPECT_EQ(code_of(std::move(first)), "taken") << "the first picture is where the map begins";
  // A bare wall does not tell where along it one is.
  EXPECT_EQ(code_of(std::move(second)), "lost_track");
  EXPECT_GT(units_within(5s), 0U) << "of the first picture";
  for (int i = 0; i < 100; ++i) {
    {
      const std::lock_guard lock(mutex_);
      if (!poses_.empty() && poses_.back().is_lost) break;
    }
    std::this_thread::sleep_for(20ms);
  }
  const std::lock_guard lock(mutex_);
  ASSERT_FALSE(poses_.empty());
  EXPECT_TRUE(poses_.back().is_lost);
}

TEST_F(LiveFeedTest, APictureIsNotAnsweredForThoseThatWereHeldBeforeIt) {
  mapping::MapperSettings tracking = settings();
  tracking.is_tracking = true;
  own_ = feed_of(tracking);
  EXPECT_EQ(begun(), "begun");
  const std::string beside = R"("from_depth":[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]])";
  EXPECT_EQ(code_of(calibrate(R"(},"thermal":{)" + kCamera + "," + beside)), "taken");
  const std::size_t left_out = 5;
  std::vector<Answer> answers;
  for (std::size_t i = 0; i < mapping::Mapper::kMostHeld + left_out; ++i) {
    answers.push_back(picture(FrameSensor::Thermal, 0.001 * static_cast<double>(i)));
    if (answers.size() < FrameIntake::kMostWaiting / 2 && i + 1 < mapping::Mapper::kMostHeld + left_out) continue;
    EXPECT_EQ(code_of(end_of_frames()), "taken");
    for (Answer& answer : answers) EXPECT_EQ(code_of(std::move(answer)), "taken");
    answers.clear();
  }
  EXPECT_EQ(own_->faults().of(mapping::FaultKind::NoPose).count, left_out) << "but said and counted";
  Answer first = depth(2);
  EXPECT_EQ(code_of(end_of_frames()), "taken");
  EXPECT_EQ(code_of(std::move(first)), "taken") << "none of those has a pose any more";
  EXPECT_EQ(own_->faults().of(mapping::FaultKind::NoPose).count, left_out + mapping::Mapper::kMostHeld);
}

TEST_F(LiveFeedTest, TracksOnAfterTheOnlyPose) {
  mapping::MapperSettings tracking = settings();
  tracking.is_tracking = true;
  own_ = feed_of(tracking);
  EXPECT_EQ(begun(), "begun");
  EXPECT_EQ(code_of(calibrate()), "taken");
  EXPECT_EQ(code_of(pose(0, 2)), "taken");
  // Not of the moment of that pose.
  EXPECT_EQ(code_of(depth(0.04)), "taken");
  EXPECT_EQ(code_of(depth(5)), "lost_track") << "a bare wall";
  EXPECT_EQ(code_of(depth(10.5)), "lost_track") << "of later poses nothing is wanted";
  const std::lock_guard lock(mutex_);
  ASSERT_FALSE(poses_.empty());
  EXPECT_NEAR(poses_.back().position.x, 2, 0.01);
}

TEST_F(LiveFeedTest, RefusesPosesThatCannotBeMeant) {
  begin_in_parts();
  EXPECT_EQ(code_of(pose(0, 1e308)), "bad_pose");
  EXPECT_EQ(code_of(pose(0.01, 1e6)), "bad_pose");
  for (int i = 0; i < 4; ++i) EXPECT_EQ(code_of(pose(0.05 * i)), "taken");
  EXPECT_EQ(code_of(depth(0.05)), "taken");
  FrameHead corrected;
  corrected.kind = FramesKind::CorrectedPoses;
  for (const double far : {1e8, 1e308}) {
    corrected.poses = {{0.05, 0, far, 0, 0, 0, 0, 1}};
    EXPECT_EQ(code_of(send(corrected)), "bad_pose") << far;
  }
  EXPECT_EQ(code_of(depth(0.1)), "taken") << "mapping goes on";
}

TEST_F(LiveFeedTest, CorrectionsOfBeforeTheLinkBrokeSpeakOfThatTime) {
  begin_in_parts();
  map_a_picture();
  own_->end();
  EXPECT_EQ(begun(), "begun");
  FrameHead corrected;
  corrected.kind = FramesKind::CorrectedPoses;
  corrected.poses = {{0.05, 1, 0, 0, 0, 0, 0, 1}};
  EXPECT_EQ(code_of(send(corrected)), "taken");
  EXPECT_GT(units_within(5s), 1U) << "the submap of that moment moves";
  // The clock of what comes is told by what comes.
  // Some of it was sent before, and is later than that on the clock of the map.
  for (int i = 2; i < 7; ++i) EXPECT_EQ(code_of(pose(0.05 * i, 1)), "taken");
  EXPECT_EQ(code_of(depth(0.25)), "taken");
  while (units_within(400ms) > 0) {
  }
  corrected.poses[0][1] = 2;
  EXPECT_EQ(code_of(send(corrected)), "taken");
  EXPECT_GT(units_within(5s), 1U) << "and again, although another clock is known now";
}

TEST_F(LiveFeedTest, CorrectedPosesMoveTheMap) {
  begin_in_parts();
  map_a_picture();
  FrameHead corrected;
  corrected.kind = FramesKind::CorrectedPoses;
  corrected.poses = {{0.05, 0, 0, 1, 0, 0, 0, 1}, {0.1, 0, 0, 1, 0, 0, 0, 0.5}};
  EXPECT_EQ(code_of(send(corrected)), "bad_pose");
  EXPECT_EQ(units_within(700ms), 0U) << "all of it, or nothing";
  corrected.poses.pop_back();
  EXPECT_EQ(code_of(send(corrected)), "taken");
  EXPECT_GT(units_within(5s), 1U) << "gone where it was, there where it is";
  // On from there: poses before and after the correction are of one world now.
  FrameHead after;
  after.kind = FramesKind::Poses;
  after.poses = {{0.2, 0, 0, 1, 0, 0, 0, 1}};
  EXPECT_EQ(code_of(send(after)), "taken");
  EXPECT_EQ(code_of(depth(0.18)), "taken");
  EXPECT_EQ(own_->faults().of(mapping::FaultKind::JumpingPose).count, 0U);
}

TEST_F(LiveFeedTest, PosesAreAnsweredWhenTheyAreApplied) {
  ASSERT_EQ(begun(), "begun");
  code_of(calibrate());
  EXPECT_EQ(code_of(pose(0)), "taken");
  std::vector<Answer> answers;
  {
    // Who maps waits for this, with at most the first of them.
    const std::lock_guard lock(mutex_);
    answers.push_back(pose(0.01));
    std::this_thread::sleep_for(200ms);
    for (int i = 2; i < 20; ++i) answers.push_back(pose(0.01 * i));
    for (std::size_t i = 1; i < answers.size(); ++i) {
      EXPECT_EQ(answers[i].wait_for(0ms), std::future_status::timeout)
          << "credit does not bound what is answered at once";
    }
  }
  for (Answer& answer : answers) EXPECT_EQ(code_of(std::move(answer)), "taken");
}

TEST_F(LiveFeedTest, StampsThatCannotBeMeantDoNotEndMapping) {
  mapping::MapperSettings tracking = settings();
  tracking.is_tracking = true;
  own_ = feed_of(tracking);
  ASSERT_EQ(begun(), "begun");
  code_of(calibrate());
  EXPECT_EQ(code_of(depth(1e12)), "far_stamp");
  EXPECT_EQ(code_of(depth(0)), "taken");
  EXPECT_EQ(code_of(depth(1e12)), "far_stamp");
  EXPECT_EQ(code_of(pose(1e9)), "far_stamp") << "tracking goes by the pictures";
  EXPECT_EQ(code_of(depth(1e9)), "far_stamp");
  EXPECT_EQ(code_of(depth(0.1)), "lost_track") << "a bare wall, of which it was looked where it is";
  EXPECT_EQ(own_->faults().of(mapping::FaultKind::FarStamp).count, 4U);
}

TEST_F(LiveFeedTest, OneStrayPoseDoesNotSetTheClock) {
  ASSERT_EQ(begun(), "begun");
  code_of(calibrate());
  EXPECT_EQ(code_of(pose(1e12)), "far_stamp");
  EXPECT_EQ(code_of(pose(0)), "taken");
  EXPECT_EQ(code_of(depth(0)), "taken");
  EXPECT_EQ(code_of(pose(1e9)), "taken") << "stills may be far apart";
  Answer between = depth(0.04);
  EXPECT_EQ(code_of(pose(0.05)), "taken") << "the clock was not set";
  EXPECT_EQ(code_of(std::move(between)), "taken");
  EXPECT_EQ(code_of(pose(0.1)), "taken");
  EXPECT_EQ(code_of(depth(0.08)), "taken");
  const mapping::FaultLog faults = own_->faults();
  EXPECT_EQ(faults.of(mapping::FaultKind::FarStamp).count, 2U);
  EXPECT_EQ(faults.of(mapping::FaultKind::BackwardPose).count, 0U);
  expect_robot_is_here_now();
}

TEST_F(LiveFeedTest, TheFirstPoseMayBeTheStrayOne) {
  for (const bool is_tracking : {false, true}) {
    mapping::MapperSettings either = settings();
    either.is_tracking = is_tracking;
    own_ = feed_of(either);
    ASSERT_EQ(begun(), "begun");
    code_of(calibrate());
    EXPECT_EQ(code_of(pose(1e9, 7)), "taken");
    EXPECT_EQ(code_of(pose(0)), "taken");
    EXPECT_EQ(code_of(pose(0.05)), "taken");
    EXPECT_EQ(code_of(depth(0.05)), "taken");
    EXPECT_EQ(code_of(pose(0.1)), "taken");
    EXPECT_EQ(own_->faults().of(mapping::FaultKind::FarStamp).count, 1U);
    expect_robot_is_here_now();
  }
}

TEST_F(LiveFeedTest, PicturesBeforeTheFirstPoseDoNotSetTheClock) {
  ASSERT_EQ(begun(), "begun");
  code_of(calibrate());
  Answer stray = depth(1e9);
  EXPECT_EQ(code_of(pose(0)), "taken");
  EXPECT_EQ(code_of(pose(0.05)), "taken");
  EXPECT_EQ(code_of(depth(0.05)), "taken");
  EXPECT_EQ(code_of(std::move(stray)), "no_pose");
  expect_robot_is_here_now();
}

TEST_F(LiveFeedTest, PicturesOfAClockThatIsForgottenAreNotMapped) {
  ASSERT_EQ(begun(), "begun");
  code_of(calibrate());
  Answer first = depth(0);
  EXPECT_EQ(code_of(pose(1000)), "taken");
  EXPECT_EQ(code_of(pose(1000.05)), "taken");
  EXPECT_EQ(code_of(std::move(first)), "no_pose");
  EXPECT_EQ(code_of(depth(1000.05)), "taken");
  own_->end();
  // On the map's clock its stamps, and those of the poses after it, begin at the same moment.
  ASSERT_EQ(begun(), "begun");
  Answer second = depth(0);
  EXPECT_EQ(code_of(pose(50)), "taken");
  EXPECT_EQ(code_of(pose(50.05)), "taken");
  EXPECT_EQ(code_of(std::move(second)), "no_pose");
  EXPECT_EQ(code_of(depth(50.05)), "taken");
  expect_robot_is_here_now();
}

TEST_F(LiveFeedTest, StillsMayBeMinutesApart) {
  ASSERT_EQ(begun(), "begun");
  code_of(calibrate());
  Answer first = depth(0);
  EXPECT_EQ(code_of(pose(0)), "taken") << "the picture may come before its pose";
  EXPECT_EQ(code_of(std::move(first)), "taken");
  for (int i = 1; i < 4; ++i) {
    EXPECT_EQ(code_of(pose(60 * i)), "taken");
    EXPECT_EQ(code_of(depth(60 * i)), "taken");
  }
  EXPECT_EQ(own_->faults().of(mapping::FaultKind::FarStamp).count, 0U);
}

TEST_F(LiveFeedTest, WhereTrackingBeginsMayBeToldLongBefore) {
  mapping::MapperSettings tracking = settings();
  tracking.is_tracking = true;
  own_ = feed_of(tracking);
  ASSERT_EQ(begun(), "begun");
  code_of(calibrate());
  EXPECT_EQ(code_of(pose(0, 2)), "taken");
  EXPECT_EQ(code_of(depth(1000)), "taken");
  EXPECT_EQ(code_of(depth(1000.1)), "lost_track") << "a bare wall";
  const std::lock_guard lock(mutex_);
  ASSERT_FALSE(poses_.empty());
  EXPECT_NEAR(poses_.back().position.x, 2, 0.01);
}

TEST_F(LiveFeedTest, AClockThatIsSetBackIsSaidAndCounted) {
  ASSERT_EQ(begun(), "begun");
  code_of(calibrate());
  for (int i = 0; i < 3; ++i) {
    const double begin_s = 1e6 - 1e5 * i;
    if (i > 0) {
      EXPECT_EQ(code_of(pose(begin_s - 0.1)), "backward_pose");
      EXPECT_EQ(code_of(pose(begin_s - 0.05)), "backward_pose");
    }
    EXPECT_EQ(code_of(pose(begin_s)), "taken") << "the third in a row: the clock was set back";
    EXPECT_EQ(code_of(pose(begin_s + 0.05)), "taken");
    EXPECT_EQ(code_of(depth(begin_s + 0.02)), "taken");
  }
  EXPECT_EQ(own_->faults().of(mapping::FaultKind::ClockBegunAnew).count, 2U);
}

TEST_F(LiveFeedTest, WhenMappingEndsEverybodyIsTold) {
  LiveFeed::Sinks failing = sinks();
  failing.hand_over = [](auto, const auto&, auto&) { throw std::runtime_error("no memory"); };
  own_ = std::make_unique<LiveFeed>(settings(), failing, [] { return true; });
  ASSERT_EQ(begun(), "begun");
  code_of(calibrate());
  code_of(pose(0));
  EXPECT_EQ(code_of(depth(0)), "taken");
  auto why = ended_.get_future();
  ASSERT_EQ(why.wait_for(10s), std::future_status::ready);
  EXPECT_NE(why.get().find("no memory"), std::string::npos);
  EXPECT_EQ(code_of(pose(0.1)), "not_mapping");
  EXPECT_EQ(code_of(depth(0.1)), "not_mapping");
  own_->end();
  EXPECT_EQ(begun(), "503 not_mapping");
}

TEST_F(LiveFeedTest, WhatWaitsIsAnsweredWhenMappingEnds) {
  LiveFeed::Sinks failing = sinks();
  failing.moved = [this](const RobotPose&, bool) {
    const std::lock_guard lock(mutex_);
    throw std::runtime_error("broken");
  };
  own_ = std::make_unique<LiveFeed>(settings(), failing, [] { return true; });
  ASSERT_EQ(begun(), "begun");
  code_of(calibrate());
  code_of(pose(-0.1));
  std::vector<Answer> answers;
  {
    const std::lock_guard lock(mutex_);
    answers.push_back(pose(0));
    std::this_thread::sleep_for(100ms);
    answers.push_back(pose(0.1));
    answers.push_back(depth(0.05));
  }
  EXPECT_EQ(code_of(std::move(answers[0])), "taken");
  EXPECT_EQ(code_of(std::move(answers[1])), "not_mapping");
  EXPECT_EQ(code_of(std::move(answers[2])), "not_mapping");
}

TEST_F(LiveFeedTest, AMapThatIsBehindIsNotWaitedFor) {
  room_ = 0;
  ASSERT_EQ(begun(), "begun");
  code_of(calibrate());
  for (int i = 0; i < 6; ++i) code_of(pose(0.1 * i));
  for (int i = 0; i < 5; ++i) EXPECT_EQ(code_of(depth(0.1 * i)), "taken") << "mapping goes on";
  EXPECT_EQ(units_within(400ms), 0U);
  room_ = 32;
  EXPECT_GT(units_within(5s), 0U);
}

TEST_F(LiveFeedTest, WhatIsLeftIsHandedOverWhenThereIsNothingElseToDo) {
  room_ = UnitHandOver::kUnderWay / 2;
  mapping::MapperSettings fine = settings();
  fine.voxel_m = 0.005;  // some 90 units
  // While frames come, no more than the first hand-over.
  own_ = std::make_unique<LiveFeed>(
      fine, sinks(), [] { return true; }, 1h);
  ASSERT_EQ(begun(), "begun");
  code_of(calibrate());
  code_of(pose(0));
  EXPECT_EQ(code_of(depth(0)), "taken");
  std::size_t count = 0;
  while (count <= 60) {
    const std::size_t more = units_within(10s);
    ASSERT_GT(more, 0U) << "after " << count;
    count += more;
  }
}

TEST_F(LiveFeedTest, AMapInOnePieceTakesNoCorrections) {
  EXPECT_EQ(begun(), "begun");
  EXPECT_EQ(code_of(calibrate()), "taken");
  FrameHead corrected;
  corrected.kind = FramesKind::CorrectedPoses;
  corrected.poses = {{0.05, 0, 0, 1, 0, 0, 0, 1}};
  EXPECT_EQ(code_of(send(corrected)), "no_submaps");
}

}  // namespace
}  // namespace spectra::sources
