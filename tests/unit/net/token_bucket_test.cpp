#include "server/access/token_bucket.hpp"

#include <gtest/gtest.h>

namespace spectra::net {
namespace {

TEST(TokenBucket, LetsABurstThroughAndThenTheRate) {
  access::TokenBucket bucket(10, 5);
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(bucket.take(100)) << i;
  EXPECT_FALSE(bucket.take(100));
  EXPECT_NEAR(bucket.wait_s(100), 0.1, 1e-9);
  EXPECT_TRUE(bucket.take(100.11));
  EXPECT_FALSE(bucket.take(100.11));
}

TEST(TokenBucket, KeepsNoMoreThanItsBurst) {
  access::TokenBucket bucket(10, 5);
  int taken = 0;
  while (bucket.take(1e6)) ++taken;
  EXPECT_EQ(taken, 5);
  EXPECT_EQ(bucket.wait_s(2e6), 0);
}

TEST(TokenBucket, GivesManyAtOnceAndMoreThanItHoldsWhenItIsFull) {
  access::TokenBucket bucket(100, 50);
  EXPECT_TRUE(bucket.take(10, 30));
  EXPECT_FALSE(bucket.take(10, 30));
  EXPECT_NEAR(bucket.wait_s(10, 30), 0.1, 1e-9);
  EXPECT_TRUE(bucket.take(10.2, 30));
  EXPECT_TRUE(bucket.take(20, 1000)) << "else it would never come";
  EXPECT_FALSE(bucket.take(20, 1));
}

TEST(TokenBucket, WhoReservesWaitsForThoseBefore) {
  access::TokenBucket bucket(10, 2);
  EXPECT_EQ(bucket.reserve_s(50), 0);
  EXPECT_EQ(bucket.reserve_s(50), 0);
  EXPECT_NEAR(bucket.reserve_s(50), 0.1, 1e-9);
  EXPECT_NEAR(bucket.reserve_s(50), 0.2, 1e-9);
  EXPECT_NEAR(bucket.reserve_s(50.25), 0.05, 1e-9);
  EXPECT_EQ(bucket.reserve_s(60), 0);
}

TEST(TokenBucket, NeverRefusesASliderAtItsPace) {
  access::TokenBucket bucket(300, 600);
  for (int i = 0; i < 10'000; ++i) ASSERT_TRUE(bucket.take(i / 120.0));
}

}  // namespace
}  // namespace spectra::net
