#include "server/sources/robot_track.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <tuple>
#include <vector>

namespace spectra::sources {
namespace {

RobotPose at(double time, double x, bool is_lost = false) {
  return {time, {x, 2, 3}, {0, 1, 0}, {0, 0, 1}, is_lost};
}

TEST(RobotTrack, TellsEachListenerWhatItDoesNotKnow) {
  RobotTrack track;
  RobotTrack::Told early, late;
  EXPECT_FALSE(track.news(early));
  track.moved(at(10, 0));
  track.moved(at(11, 0.0101234));  // Nearer than the spacing: no point of the way.
  auto news = track.news(early);
  ASSERT_TRUE(news);
  EXPECT_EQ(news->pose.position.x, 0.010) << "to the millimetre";
  EXPECT_EQ(news->first_point, 0U);
  EXPECT_EQ(news->points.size(), 1U);
  EXPECT_FALSE(track.news(early)) << "it knows that";
  track.moved(at(12, 1));
  track.moved(at(13, 2));
  news = track.news(early);
  EXPECT_EQ(news->first_point, 1U);
  EXPECT_EQ(news->points.size(), 2U);
  EXPECT_EQ(track.news(late)->points.size(), 3U) << "who comes later is told all of it";
}

TEST(RobotTrack, ThinsTheWayEvenlyAndTellsItAnewThen) {
  RobotTrack track;
  RobotTrack::Told told;
  std::vector<base::Vec3d> held;
  for (int i = 0; i < 5000; ++i) {
    track.moved(at(i, 0.1 * i));
    if (i % 3 != 0) continue;
    const auto news = track.news(told);
    ASSERT_LE(news->first_point, held.size());
    held.resize(news->first_point);
    held.insert(held.end(), news->points.begin(), news->points.end());
  }
  track.moved(at(5000, 499.9), true);
  const auto whole = [&] {
    RobotTrack::Told nothing;
    return track.news(nothing)->points;
  }();
  EXPECT_LE(whole.size(), RobotTrack::kMostPoints);
  EXPECT_GE(whole.size(), RobotTrack::kMostPoints / 4);
  EXPECT_LE(held.size(), whole.size());
  for (std::size_t i = 0; i < held.size(); ++i) EXPECT_EQ(held[i], whole[i]);
  EXPECT_EQ(whole.front().x, 0);
  for (std::size_t i = 1; i < whole.size(); ++i) EXPECT_LT(whole[i].x - whole[i - 1].x, 5);
}

TEST(RobotTrack, WakesListenersFiveTimesASecondAndWhenTheRobotIsLost) {
  RobotTrack track;
  int count = 0;
  auto subscription = track.subscribe([&count] { ++count; });
  for (int i = 0; i <= 16; ++i) track.moved(at(0.0625 * i, 0.0625 * i));
  EXPECT_EQ(count, 5);
  track.moved(at(1.01, 1, true));
  EXPECT_EQ(count, 6);
  RobotTrack::Told told;
  EXPECT_TRUE(track.news(told)->pose.is_lost);
  track.moved(at(1.02, 1));
  EXPECT_EQ(count, 7);
  track.moved(at(1.03, 1), true);
  EXPECT_EQ(count, 8) << "the last one is not held back";
  track.moved(at(std::numeric_limits<double>::quiet_NaN(), 1));
  track.moved(at(5, std::numeric_limits<double>::infinity()));
  EXPECT_EQ(count, 8) << "what is no number is not told";
  subscription.reset();
  track.moved(at(9, 9));
  EXPECT_EQ(count, 8);
}

TEST(RobotTrack, ForgetsWhoHasGoneThoughNoRobotMoves) {
  RobotTrack track;
  const auto stays = track.subscribe([] {});
  for (int i = 0; i < 100; ++i) std::ignore = track.subscribe([] {});
  EXPECT_LE(track.listener_count(), 2U);
}

}  // namespace
}  // namespace spectra::sources
