#include "server/sources/live_feed.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
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
    feed_.take({std::move(head), "head" + body, 4},
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
  Answer depth(double time_s) {
    FrameHead head;
    head.kind = FramesKind::Picture;
    head.sensor = FrameSensor::Depth;
    head.encoding = FrameEncoding::Raw16;
    head.width = kWidth;
    head.height = kHeight;
    head.time = time_s;
    std::string body;
    for (int i = 0; i < kWidth * kHeight; ++i) body += "\xdc\x05";  // 1500 mm
    return send(head, body);
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
  LiveFeed feed_{0.02,
                 {[this](auto units, const FeedMoment&) {
                    const std::lock_guard lock(mutex_);
                    unit_count_ += units.size();
                    return true;
                  },
                  [this](const RobotPose& pose, bool) {
                    const std::lock_guard lock(mutex_);
                    poses_.push_back(pose);
                  }},
                 [] { return true; }};
};

TEST_F(LiveFeedTest, TakesOneSenderAtATime) {
  EXPECT_TRUE(feed_.begin());
  EXPECT_FALSE(feed_.begin());
  feed_.end();
  EXPECT_TRUE(feed_.begin());
}

TEST_F(LiveFeedTest, WaitsForThePoseOfAPictureAndMapsInTheOrderOfTime) {
  ASSERT_TRUE(feed_.begin());
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
  ASSERT_TRUE(feed_.begin());
  code_of(calibrate());
  EXPECT_EQ(code_of(depth(5)), "no_pose") << "when nothing else comes";
  Answer waiting = depth(6);
  Answer later = depth(6.5);
  EXPECT_EQ(code_of(std::move(waiting)), "no_pose");
  FrameHead end;
  end.kind = FramesKind::End;
  EXPECT_EQ(code_of(send(end)), "taken");
  EXPECT_EQ(code_of(std::move(later)), "no_pose");
  EXPECT_EQ(feed_.faults().of(mapping::FaultKind::NoPose).count, 3U);
}

TEST_F(LiveFeedTest, SkipsTheOldestWhenTooManyWait) {
  ASSERT_TRUE(feed_.begin());
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
  EXPECT_EQ(skipped, feed_.skipped_count());
  EXPECT_GE(skipped, 39 - LiveFeed::kMostWaiting);
  EXPECT_LE(skipped, 40 - LiveFeed::kMostWaiting);
}

TEST_F(LiveFeedTest, GoesOnWithAClockThatIsBehindAndKeepsItsCalibration) {
  ASSERT_TRUE(feed_.begin());
  code_of(calibrate());
  code_of(pose(100));
  EXPECT_EQ(code_of(depth(100)), "taken");
  EXPECT_EQ(code_of(depth(99)), "backward_clock");
  EXPECT_EQ(code_of(pose(99)), "backward_pose");
  EXPECT_EQ(code_of(depth(200)), "no_pose") << "a stamp from nowhere does not stop the clock";
  code_of(pose(100.1));
  EXPECT_EQ(code_of(depth(100.1)), "taken");
  feed_.end();
  ASSERT_TRUE(feed_.begin());
  EXPECT_EQ(code_of(calibrate(R"(,"delay_s":0.5)")), "other_calibration");
  EXPECT_EQ(code_of(calibrate()), "taken");
  code_of(pose(1));
  EXPECT_EQ(code_of(depth(1)), "taken");
}

}  // namespace
}  // namespace spectra::sources
