#include "server/stream/quality_frontier.hpp"

#include <gtest/gtest.h>

namespace spectra::stream {
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

std::uint64_t vertices_at(double pixel_error) {
  return static_cast<std::uint64_t>(1'000'000 / pixel_error);
}

TEST(FirstAnswer, IsInFullWhenNothingElseIsAskedForOrKnown) {
  StreamQuality quality;
  EXPECT_EQ(first_answer(quality, 1e3, 1, ColourCost(), vertices_at), (QualityPoint{1, 8}));
  quality.automatic = true;
  quality.colour_bits = 7;
  EXPECT_EQ(first_answer(quality, 0, 0, ColourCost(), vertices_at), (QualityPoint{1, 7})) << "rate not known";
}

TEST(FirstAnswer, IsTheFinestThatArrivesInTime) {
  StreamQuality quality;
  quality.automatic = true;
  const ColourCost cost;
  const auto rate_for = [&](const QualityPoint& point) {
    return cost.bytes_per_vertex(point.colour_bits) * static_cast<double>(vertices_at(point.pixel_error_factor)) / 0.2;
  };
  for (const QualityPoint& point : quality_frontier()) {
    EXPECT_EQ(first_answer(quality, rate_for(point) * 1.001, 0, cost, vertices_at), point);
    if (point != quality_frontier().back()) {
      EXPECT_NE(first_answer(quality, rate_for(point) * 1.001, 0.1, cost, vertices_at), point) << "a longer way";
    }
  }
  EXPECT_EQ(first_answer(quality, 1, 10, cost, vertices_at), quality_frontier().back());
  quality.colour_bits = 5;
  EXPECT_EQ(first_answer(quality, rate_for({1, 5}) * 1.001, 0, cost, vertices_at), (QualityPoint{1, 5}));
}

}  // namespace
}  // namespace spectra::stream
