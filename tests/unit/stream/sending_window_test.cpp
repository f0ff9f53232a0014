#include "server/stream/sending_window.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <queue>

namespace spectra::stream {
namespace {

/// A sender that always has frames of one size, on a link of a given rate and delay, in simulated time.
class Link {
 public:
  explicit Link(std::size_t frame_bytes) : frame_bytes_(frame_bytes) {}

  void run(double seconds, double bytes_per_s, double round_trip_s) {
    const double end_s = now_s_ + seconds;
    arrived_bytes = 0;
    longest_queue_s = 0;
    while (now_s_ < end_s) {
      while (window.admits(frame_bytes_)) {
        window.on_sent(++last_sequence_, frame_bytes_, now_s_);
        free_s_ = std::max(free_s_, now_s_) + static_cast<double>(frame_bytes_) / bytes_per_s;
        longest_queue_s = std::max(longest_queue_s, free_s_ - now_s_);
        acknowledgements_.push({free_s_ + round_trip_s, last_sequence_});
      }
      now_s_ = acknowledgements_.front().first;
      EXPECT_TRUE(window.on_acknowledged(acknowledgements_.front().second, now_s_));
      acknowledgements_.pop();
      arrived_bytes += static_cast<double>(frame_bytes_);
    }
  }

  /// Everything on its way arrives.
  void drain() {
    for (; !acknowledgements_.empty(); acknowledgements_.pop()) {
      now_s_ = acknowledgements_.front().first;
      EXPECT_TRUE(window.on_acknowledged(acknowledgements_.front().second, now_s_));
    }
  }

  double now_s() const { return now_s_; }
  std::uint32_t last_sequence() const { return last_sequence_; }

  SendingWindow window;
  double arrived_bytes = 0;
  double longest_queue_s = 0;

 private:
  std::size_t frame_bytes_;
  std::uint32_t last_sequence_ = 0;
  std::queue<std::pair<double, std::uint32_t>> acknowledgements_;
  double now_s_ = 0;
  double free_s_ = 0;
};

TEST(SendingWindow, FillsALinkWithoutFlooding) {
  for (const double rate : {30e3, 625e3, 5e6, 20e6}) {
    for (const double round_trip_s : {0.002, 0.1, 0.15}) {
      Link link(30'000);
      link.run(3, rate, round_trip_s);
      link.run(10, rate, round_trip_s);
      EXPECT_GE(link.arrived_bytes, 0.9 * 10 * rate) << rate << " B/s, " << round_trip_s << " s";
      EXPECT_NEAR(link.window.rate_bytes_per_s(), rate, 0.1 * rate);
      const double frame_s = 30'000 / rate;
      EXPECT_LE(link.longest_queue_s, 4 * frame_s + 0.5 * round_trip_s) << rate << " B/s, " << round_trip_s << " s";
    }
  }
}

TEST(SendingWindow, FollowsALinkThatChanges) {
  Link link(30'000);
  link.run(5, 625e3, 0.1);
  link.run(5, 5e6, 0.1);
  link.run(5, 5e6, 0.1);
  EXPECT_GE(link.arrived_bytes, 0.85 * 5 * 5e6);
  link.run(15, 200e3, 0.1);
  link.run(5, 200e3, 0.1);
  EXPECT_NEAR(link.window.rate_bytes_per_s(), 200e3, 20e3);
  EXPECT_LE(static_cast<double>(link.window.size_bytes()), 200e3);
}

TEST(SendingWindow, StaysBelowItsCeiling) {
  Link link(30'000);
  link.window.set_ceiling(100'000);
  link.run(3, 50e6, 0.1);
  EXPECT_LE(link.window.in_flight_bytes(), 100'000U);
  EXPECT_LE(link.window.size_bytes(), 100'000U);
  Link unlimited(30'000);
  unlimited.window.set_ceiling(1u << 30);
  unlimited.run(3, 500e6, 0.1);
  EXPECT_LE(unlimited.window.size_bytes(), SendingWindow::kDefaultCeilingBytes);
}

TEST(SendingWindow, AFrameLargerThanItGoesAlone) {
  SendingWindow window;
  window.set_ceiling(1);
  EXPECT_TRUE(window.admits(1'000'000));
  window.on_sent(1, 1'000'000, 0);
  EXPECT_FALSE(window.admits(1));
  EXPECT_TRUE(window.on_acknowledged(1, 1));
  EXPECT_TRUE(window.admits(1'000'000));
}

TEST(SendingWindow, DetailWaitsUntilWhatWasOvertakenHasArrived) {
  using Urgency = SendingWindow::Urgency;
  constexpr std::size_t kFrame = SendingWindow::kInitialBytes / 2;
  SendingWindow window;
  window.on_sent(1, kFrame, 0);
  EXPECT_TRUE(window.admits(kFrame, Urgency::Detail));
  window.on_overtaken();
  EXPECT_FALSE(window.admits(kFrame, Urgency::Detail));
  EXPECT_TRUE(window.admits(kFrame, Urgency::Answer));
  window.on_sent(2, kFrame, 0);
  EXPECT_TRUE(window.on_acknowledged(1, 0.001));
  EXPECT_FALSE(window.admits(kFrame, Urgency::Detail)) << "the next frame is still on its way";
  EXPECT_TRUE(window.admits(kFrame, Urgency::Answer));
  window.on_sent(3, kFrame, 0.001);
  EXPECT_TRUE(window.on_acknowledged(2, 0.002));
  EXPECT_TRUE(window.admits(kFrame, Urgency::Detail));
}

TEST(SendingWindow, IgnoresAcknowledgementsThatMakeNoSense) {
  SendingWindow window;
  EXPECT_FALSE(window.on_acknowledged(1, 0));
  window.on_sent(1, 100, 0);
  window.on_sent(2, 100, 0);
  EXPECT_FALSE(window.on_acknowledged(3, 0.1));
  EXPECT_FALSE(window.on_acknowledged(0, 0.1));
  EXPECT_EQ(window.in_flight_bytes(), 200U);
  EXPECT_TRUE(window.on_acknowledged(1, 0.1));
  EXPECT_FALSE(window.on_acknowledged(1, 0.2));
  EXPECT_EQ(window.in_flight_bytes(), 100U);
}

TEST(SendingWindow, APauseDoesNotCountAsASlowLink) {
  Link link(30'000);
  link.run(3, 5e6, 0.05);
  link.drain();
  SendingWindow& window = link.window;
  ASSERT_EQ(window.in_flight_bytes(), 0U);
  const double before = window.rate_bytes_per_s();
  // Some small frames, far apart.
  std::uint32_t sequence = link.last_sequence();
  double now_s = link.now_s();
  for (int i = 0; i < 30; ++i) {
    now_s += 1;
    window.on_idle();
    window.on_sent(++sequence, 500, now_s);
    EXPECT_TRUE(window.on_acknowledged(sequence, now_s + 0.05));
  }
  EXPECT_GE(window.rate_bytes_per_s(), 0.9 * before);
}

}  // namespace
}  // namespace spectra::stream
