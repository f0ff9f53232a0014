#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "server/mapping/voxel_map.hpp"

namespace spectra::mapping {

/// Lines of sight through a grid of blocks, and how much of each counts: from `before_m` before what is seen, but not before `nearest_m`, to
/// max(behind_m, base_m + growth_per_m max(0, z - from_m)^2) behind it.
struct PlaceKernel {
  std::array<std::array<float, 3>, 3> turn;  ///< Of a ray with z = 1, to blocks a metre; row after row.
  std::array<float, 3> eye;                  ///< In blocks.
  float nearest_m, before_m, behind_m, base_m, growth_per_m, from_m;
};

/// Places that were found last, so that few are told twice.
struct RecentPlaces {
  static constexpr std::size_t kRoom = 1024;
  RecentPlaces();
  alignas(64) std::array<std::int32_t, kRoom> x, y, z;
};

/// What is seen of a row of pixels, packed: depths, and directions with z = 1. All have kPacked values more than there are pixels.
inline constexpr std::size_t kPacked = 16;
struct PackedPixels {
  const float *depth_m, *ray_x, *ray_y;
  std::size_t count;
};

/// Adds the blocks that lines of sight go through, looked at every half of a block or closer; some of them more than once. Every instruction set
/// gives the same.
void find_places(const PlaceKernel& kernel, const PackedPixels& pixels, RecentPlaces& recent,
                 std::vector<GridPlace>& places);

}  // namespace spectra::mapping
