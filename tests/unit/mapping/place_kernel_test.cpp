#include "server/mapping/place_kernel.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "tests/property/instruction_sets.hpp"

namespace spectra::mapping {
namespace {

std::vector<GridPlace> sorted(std::vector<GridPlace> places) {
  std::sort(places.begin(), places.end());
  places.erase(std::unique(places.begin(), places.end()), places.end());
  return places;
}

/// Rays one by one.
std::vector<GridPlace> one_by_one(const PlaceKernel& k, const PackedPixels& pixels) {
  std::vector<GridPlace> places;
  for (std::size_t i = 0; i < pixels.count; ++i) {
    const float z = pixels.depth_m[i];
    std::array<float, 3> ray{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      ray[axis] = k.turn[axis][0] * pixels.ray_x[i] + k.turn[axis][1] * pixels.ray_y[i] + k.turn[axis][2];
    }
    const float beyond = std::max(0.0F, z - k.from_m);
    const float begin = std::max(k.nearest_m, z - k.before_m);
    const float length = z + std::max(k.behind_m, k.base_m + k.growth_per_m * (beyond * beyond)) - begin;
    const float norm = std::sqrt(ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2]);
    const float steps = std::max(1.0F, std::ceil(length * norm * 2));
    for (float step = 0; step <= steps; ++step) {
      const float at = begin + length / steps * step;
      const auto block = [&](std::size_t axis) {
        return static_cast<std::int32_t>(std::floor(k.eye[axis] + ray[axis] * at));
      };
      places.push_back({block(0), block(1), block(2)});
    }
  }
  return sorted(places);
}

TEST(PlaceKernel, EveryInstructionSetFindsTheBlocksOfEveryRayWhateverTheirNumber) {
  const PlaceKernel kernel{
      {{{10, 1, -4}, {-2, 11, 3}, {5, -1, 9}}}, {0.3F, 0.9F, 0.5F}, 0.05F, 0.04F, 0.03F, 0.003F, 0.005F, 0.4F};
  for (const std::size_t count : std::vector<std::size_t>{0, 1, 15, 16, 17, 320}) {
    std::mt19937 random(static_cast<unsigned>(count));
    std::vector<float> depth_m, ray_x, ray_y;
    for (std::size_t i = 0; i < count + kPacked; ++i) {
      // What comes after the last does not count.
      depth_m.push_back(i < count ? 0.06F + 0.001F * static_cast<float>(random() % 4000) : 50);
      ray_x.push_back(0.001F * static_cast<float>(static_cast<int>(random() % 1000) - 500));
      ray_y.push_back(0.001F * static_cast<float>(static_cast<int>(random() % 800) - 400));
    }
    const PackedPixels pixels{depth_m.data(), ray_x.data(), ray_y.data(), count};
    for (const std::int64_t target : fusion::test::instruction_sets()) {
      const fusion::test::UsingInstructionSet use(target);
      RecentPlaces recent;
      std::vector<GridPlace> places;
      find_places(kernel, pixels, recent, places);
      EXPECT_EQ(sorted(places), one_by_one(kernel, pixels)) << count << " pixels, " << fusion::test::name_of(target);
    }
  }
}

TEST(PlaceKernel, WhatWasFoundJustBeforeIsNotToldAgain) {
  const PlaceKernel kernel{{{{10, 0, 0}, {0, 10, 0}, {0, 0, 10}}}, {0.5F, 0.5F, 0.5F}, 0.05F, 0.04F, 0.03F, 0, 0, 0};
  const std::vector<float> depth_m(100 + kPacked, 1), ray(100 + kPacked, 0.01F);
  RecentPlaces recent;
  std::vector<GridPlace> places;
  for (int row = 0; row < 3; ++row) find_places(kernel, {depth_m.data(), ray.data(), ray.data(), 100}, recent, places);
  EXPECT_EQ(places, sorted(places));
}

}  // namespace
}  // namespace spectra::mapping
