#include "server/stream/lattice.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>

#include "fake_scene.hpp"
#include "server/stream/viewer_stream.hpp"

namespace spectra::stream {
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

TEST(PositionStep, IsTheWantedOneOrElseTheScenes) {
  EXPECT_EQ(position_step_in_force(0.002F, 1), lattice_step(static_cast<double>(0.002F)));
  EXPECT_EQ(position_step_in_force(0, 0.01F), lattice_step(static_cast<double>(0.01F)));
}

TEST(PositionStep, OfAFileIsRaisedWhereTheSceneIsTooLargeForIt) {
  const float step = lattice_step(0.002);
  EXPECT_EQ(one_step_for_all(step, {{0, 0, 0}, {10, 10, 3}}), step);
  const float raised = one_step_for_all(step, {{-1e6F, 0, 0}, {1e6F, 10, 3}});
  EXPECT_LT(2e6F / raised, 1 << 21);
  EXPECT_GT(2e6F / raised, 1 << 19);
}

TEST(PositionStep, OfAWholeSceneIsTheCoarsestThatItsTilesHave) {
  const float step = lattice_step(0.0078125);
  const auto near = testing::patch_tile({1, 0, 0, 0}, 20, 0, 20);
  auto far = std::make_shared<map::Tile>(*testing::patch_tile({1, 1, 0, 0}, 20, 1, 20));
  EXPECT_EQ(coarsest_step(*testing::scene_of({near, far}), step), step);
  for (base::Vec3f& p : far->positions) p.x += 5e6F;
  far->bounds.min.x += 5e6F;
  far->bounds.max.x += 5e6F;
  const float coarsest = coarsest_step(*testing::scene_of({near, far}), step);
  EXPECT_EQ(coarsest, tile_lattice(*far, step).value().coarsest_step_m);
  EXPECT_GT(coarsest, step);
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

TEST(TileLattice, HoldsEveryCornerOfTheLargestTileThatAStepIsKeptFor) {
  // A step of 1.25 m up to 2^21 steps and a little beyond, where it is doubled.
  constexpr float kStep = 1.25F;
  constexpr int kMostSteps = 1 << 21;
  std::set<float> steps;
  for (float steps_wide = kMostSteps - 4; steps_wide < kMostSteps + 2; steps_wide += 0.25F) {
    for (const float low_share : {0.0F, 0.5F, 1.0F}) {
      const float reach_m = kStep * steps_wide;
      const float low_m = -low_share * reach_m;
      auto tile = testing::patch_tile({}, 2, 0, 20);
      tile->positions[0] = {low_m, 0, 0};
      tile->positions[3] = {low_m + reach_m, 1, 1};
      const auto lattice = tile_lattice(*tile, kStep);
      ASSERT_TRUE(lattice.has_value()) << reach_m << " m from " << low_m << " m: " << lattice.error().message;
      steps.insert(lattice.value().coarsest_step_m);
      for (const auto& point : lattice.value().points) EXPECT_LT(point[0], kMostSteps);
    }
  }
  EXPECT_EQ(steps, (std::set{kStep, 2 * kStep}));
}

TEST(TileLattice, RoundsEachVertexToItsOwnStep) {
  const float step = lattice_step(0.05);
  const auto tile = testing::patch_tile({}, 12, 0, 20);
  tile->step_halvings.assign(tile->positions.size(), {0, 0, 0});
  for (std::size_t v = 0; v < 60; ++v) tile->step_halvings[v] = {3, 5, 1};
  const TileLattice lattice = tile_lattice(*tile, step).value();
  EXPECT_EQ(lattice.step_m, step / 32);
  EXPECT_EQ(lattice.coarsest_step_m, step);
  for (std::size_t v = 0; v < tile->positions.size(); ++v) {
    const std::array<float, 3> p{tile->positions[v].x, tile->positions[v].y, tile->positions[v].z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float own = std::ldexp(step, -int{tile->step_halvings[v][axis]});
      const float decoded = lattice.origin_m[axis] + static_cast<float>(lattice.points[v][axis]) * lattice.step_m;
      EXPECT_EQ(decoded / own, std::floor(decoded / own));
      EXPECT_LE(std::abs(decoded - p[axis]), own / 2 * 1.0001F);
    }
  }
}

TEST(TileLattice, HoldsVerticesOfCoarserStepsThatAreRoundedBeyondTheOthers) {
  // Its ends ask for steps of 8 m, what lies between for the finest that so many metres leave.
  map::Tile tile;
  tile.positions = {{203.5F, 0, 0}, {250, 10, 0}, {250, 10.001F, 0}, {324.5F, 0, 0}};
  tile.triangles = {{0, 1, 2}, {1, 2, 3}};
  tile.step_halvings = {{0, 0, 0}, {24, 24, 24}, {24, 24, 24}, {0, 0, 0}};
  const auto lattice = tile_lattice(tile, 8);
  ASSERT_TRUE(lattice.has_value());
  for (const auto& point : lattice.value().points) {
    for (const std::int32_t steps : point) EXPECT_LT(steps, std::int32_t{1} << 23);
  }
  EXPECT_EQ(lattice.value().coarsest_step_m, 8);
  EXPECT_EQ(lattice.value().step_m, 0x1p-15F);
}

TEST(TileLattice, DoublesAStepThatFloatsDoNotTellApart) {
  auto tile = testing::patch_tile({}, 12, 0, 20);
  const auto decoded_x = [&](const TileLattice& lattice, std::size_t v) {
    return lattice.origin_m[0] + static_cast<float>(lattice.points[v][0]) * lattice.step_m;
  };
  for (const float step : {0x1p-10F, 0x1.4p-10F}) {
    tile->positions[4].x = 31'000;  // 2^25 of these steps away
    const TileLattice lattice = tile_lattice(*tile, step).value();
    EXPECT_LT(31'000 / lattice.step_m, 1 << 23);
    EXPECT_NEAR(decoded_x(lattice, 4), 31'000, lattice.coarsest_step_m / 2);
    EXPECT_NEAR(decoded_x(lattice, 5), tile->positions[5].x, lattice.coarsest_step_m / 2);
  }
  // What is not drawn has no say.
  tile->positions.push_back({1e9F, 0, 0});
  tile->visible.emplace_back();
  tile->temperature_celsius.push_back(20);
  tile->positions[4].x = 0.5F;
  EXPECT_EQ(tile_lattice(*tile, 0x1p-10F).value().coarsest_step_m, 0x1p-10F);
}

TEST(TileLattice, RefusesWhatIsNotFinite) {
  auto tile = testing::patch_tile({}, 3, 0, 20);
  tile->positions[4].y = std::numeric_limits<float>::quiet_NaN();
  EXPECT_FALSE(tile_lattice(*tile, 0.5F).has_value());
}

}  // namespace
}  // namespace spectra::stream
