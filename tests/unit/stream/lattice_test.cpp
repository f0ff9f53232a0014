#include "server/stream/lattice.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>

#include "fake_scene.hpp"
#include "server/stream/viewer_stream.hpp"

namespace spectra::server {
namespace {

TEST(LatticeStep, IsTheLargestOfItsFormThatIsNotAbove) {
  for (double wanted = 1e-6; wanted < 1e3; wanted *= 1.0371) {
    const auto step = static_cast<double>(lattice_step(wanted));
    int exponent = 0;
    const double eighths = 8 * std::frexp(step, &exponent);
    EXPECT_EQ(eighths, std::floor(eighths));
    EXPECT_GE(eighths, 4);
    EXPECT_LE(step, wanted);
    EXPECT_GT(std::ldexp(eighths + 1, exponent - 3), wanted);
  }
  EXPECT_EQ(lattice_step(0.5), 0.5F);
  EXPECT_EQ(lattice_step(7), 7.0F);
  EXPECT_EQ(lattice_step(7.99), 7.0F);
}

TEST(LatticeStep, TimesALatticeCoordinateIsExactInFloat) {
  for (const double wanted : {0.0013, 0.002, 0.0029, 1.7}) {
    const float step = lattice_step(wanted);
    for (const std::int32_t coordinate : {1, 3, 12'345, (1 << 21) - 1}) {
      EXPECT_EQ(static_cast<double>(static_cast<float>(coordinate) * step), coordinate * static_cast<double>(step));
    }
  }
}

TEST(LatticeStep, StaysFiniteAndPositiveForAnyNumber) {
  for (const double wanted : {0.0, -1.0, 1e-300, 1e300, std::numeric_limits<double>::infinity(), std::nan("")}) {
    EXPECT_TRUE(std::isfinite(lattice_step(wanted)));
    EXPECT_GT(lattice_step(wanted), 0);
  }
}

TEST(PositionStep, IsRaisedWhereTheSceneIsTooLargeForIt) {
  const Bounds room{{0, 0, 0}, {10, 10, 3}};
  EXPECT_EQ(position_step_in_force(0.002F, 1, room), lattice_step(static_cast<double>(0.002F)));
  EXPECT_EQ(position_step_in_force(0, 0.01F, room), lattice_step(static_cast<double>(0.01F)));
  const Bounds country{{-1e6F, 0, 0}, {1e6F, 10, 3}};
  const float step = position_step_in_force(0.002F, 1, country);
  EXPECT_EQ(step, lattice_step(static_cast<double>(step)));
  EXPECT_LT(2e6F / step, 1 << 21);
  EXPECT_GT(2e6F / step, 1 << 19);
}

TEST(TileLattice, IsWithinHalfAStepAndSharedByNeighbours) {
  const float step = lattice_step(0.003);
  const auto left = testing::patch_tile({1, 0, 0, 0}, 20, 0, 20);
  const auto right = testing::patch_tile({1, 1, 0, 0}, 20, 1, 20);
  const auto left_lattice = tile_lattice(*left, step).value();
  const auto right_lattice = tile_lattice(*right, step).value();
  const auto decoded_x = [&](const TileLattice& lattice, std::size_t i) {
    return lattice.origin_m[0] + static_cast<float>(lattice.points[i][0]) * step;
  };
  for (std::size_t i = 0; i < left->positions.size(); ++i) {
    EXPECT_GE(left_lattice.points[i][0], 0);
    EXPECT_LE(std::abs(decoded_x(left_lattice, i) - left->positions[i].x), step / 2 * 1.0001F);
  }
  // The right edge of the one is the left edge of the other.
  for (std::size_t row = 0; row < 20; ++row) {
    ASSERT_EQ(left->positions[row * 20 + 19].x, right->positions[row * 20].x);
    EXPECT_EQ(decoded_x(left_lattice, row * 20 + 19), decoded_x(right_lattice, row * 20));
  }
}

TEST(TileLattice, HoldsEveryCornerOfTheLargestSceneThatAStepIsKeptFor) {
  // A step of 1 m up to 2^21 steps and a little beyond: where a scene is too large for it, it must have been raised.
  constexpr int kMostSteps = 1 << 21;
  std::set<float> steps;
  for (float reach_m = kMostSteps - 4; reach_m < kMostSteps + 2; reach_m += 0.25F) {
    for (const float low_share : {0.0F, 0.5F, 1.0F}) {
      const float low_m = -low_share * reach_m;
      const Bounds bounds{{low_m, 0, 0}, {low_m + reach_m, 1, 1}};
      const float step = position_step_in_force(0, 1, bounds);
      steps.insert(step);
      auto tile = testing::patch_tile({}, 2, 0, 20);
      tile->positions[0] = bounds.min;
      tile->positions[3] = bounds.max;
      const auto lattice = tile_lattice(*tile, step);
      ASSERT_TRUE(lattice.has_value()) << reach_m << " m from " << low_m << " m: " << lattice.error().message;
      for (const auto& point : lattice.value().points) EXPECT_LT(point[0], kMostSteps);
    }
  }
  EXPECT_EQ(steps, (std::set{1.0F, 2.0F}));
}

TEST(TileLattice, RefusesWhatItCannotHold) {
  auto tile = testing::patch_tile({}, 3, 0, 20);
  tile->positions[4].y = std::numeric_limits<float>::quiet_NaN();
  EXPECT_FALSE(tile_lattice(*tile, 0.5F).has_value());
  tile->positions[4].y = 3e7F;
  EXPECT_FALSE(tile_lattice(*tile, 0.5F).has_value());
}

}  // namespace
}  // namespace spectra::server
