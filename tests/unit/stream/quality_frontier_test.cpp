#include "server/stream/quality_frontier.hpp"

#include <gtest/gtest.h>

namespace spectra::server {
namespace {

TEST(QualityFrontier, FallsFromFullQualityStepByStep) {
  const auto frontier = quality_frontier();
  ASSERT_FALSE(frontier.empty());
  EXPECT_EQ(frontier.front(), (QualityPoint{1, 8}));
  for (std::size_t i = 1; i < frontier.size(); ++i) {
    EXPECT_GE(frontier[i].pixel_error_factor, frontier[i - 1].pixel_error_factor);
    EXPECT_LE(frontier[i].colour_bits, frontier[i - 1].colour_bits);
    EXPECT_NE(frontier[i], frontier[i - 1]);
    EXPECT_GE(frontier[i].colour_bits, 4);
  }
}

TEST(ColourCost, LearnsFromWhatIsSent) {
  ColourCost cost;
  const ColourCost smaller(protocol::ColourTransform::SubtractGreen);
  for (int bits = 5; bits <= 8; ++bits) {
    EXPECT_GT(cost.bytes_per_vertex(bits), cost.bytes_per_vertex(bits - 1));
    EXPECT_GT(smaller.bytes_per_vertex(bits), smaller.bytes_per_vertex(bits - 1));
    EXPECT_LT(smaller.bytes_per_vertex(bits), cost.bytes_per_vertex(bits));
  }
  for (int frame = 0; frame < 100; ++frame) cost.learn(6, 30'000, 15'000);
  EXPECT_NEAR(cost.bytes_per_vertex(6), 0.5, 0.01);
  const double before = cost.bytes_per_vertex(8);
  cost.learn(8, 10, 4'000);
  EXPECT_EQ(cost.bytes_per_vertex(8), before) << "a tiny tile is mostly its fixed part";
}

}  // namespace
}  // namespace spectra::server
