#include "server/net/ping_watch.hpp"

#include <gtest/gtest.h>

namespace spectra::net {
namespace {

using namespace std::chrono_literals;

TEST(PingWatch, HasOnePingOutUntilItIsWrittenAndAnswered) {
  const PingWatch::Clock::time_point begin{};
  PingWatch pings(begin);
  EXPECT_EQ(pings.next(begin + 3s, 4s), std::nullopt);
  const auto first = pings.next(begin + 4s, 4s);
  ASSERT_TRUE(first);
  EXPECT_TRUE(pings.is_out());
  EXPECT_EQ(pings.answered(*first, begin + 5s), 1s);
  EXPECT_TRUE(pings.is_out()) << "its writing has not ended";
  EXPECT_EQ(pings.next(begin + 20s, 4s), std::nullopt);
  pings.written();
  EXPECT_FALSE(pings.is_out());
  const auto second = pings.next(begin + 20s, 4s);
  ASSERT_TRUE(second);
  EXPECT_NE(*second, *first);
}

TEST(PingWatch, APongThatNobodyAskedForIsNoAnswer) {
  const PingWatch::Clock::time_point begin{};
  PingWatch pings(begin);
  EXPECT_EQ(pings.answered("", begin), std::nullopt);
  const auto first = pings.next(begin + 4s, 4s);
  ASSERT_TRUE(first);
  pings.written();
  EXPECT_EQ(pings.answered("", begin + 5s), std::nullopt);
  EXPECT_EQ(pings.answered("another", begin + 5s), std::nullopt);
  EXPECT_TRUE(pings.is_out());
  EXPECT_EQ(pings.answered(*first, begin + 6s), 2s);
  EXPECT_FALSE(pings.is_out());
  EXPECT_EQ(pings.answered(*first, begin + 7s), std::nullopt) << "once";
  const auto second = pings.next(begin + 8s, 4s);
  ASSERT_TRUE(second);
  pings.written();
  EXPECT_EQ(pings.answered(*first, begin + 9s), std::nullopt) << "that of before";
}

}  // namespace
}  // namespace spectra::net
