#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "server/mapping/block_kernels.hpp"

namespace spectra::mapping {

/// Voxels of a block beside its surface as a camera sees them; the first `count` of each array.
struct SeenVoxels {
  static constexpr std::size_t kRoom = kBlockVoxels + 16;  ///< A whole register is written at the end.
  std::size_t count = 0;
  alignas(64) std::array<std::int32_t, kRoom> voxel;
  std::array<float, kRoom> u, v;          ///< Where the place on the surface falls in the picture, pixels.
  std::array<float, kRoom> z_m;           ///< Its depth.
  std::array<float, kRoom> cosine;        ///< Between the line of sight and the surface's normal.
  std::array<float, kRoom> per_u, per_v;  ///< How the depth of the surface grows with a pixel, metres.
  std::array<float, kRoom> half;          ///< Of the square that the voxel covers, pixels.
  std::array<float, kRoom> off_m;         ///< How far the voxel is from the surface along the line of sight.
};

/// Finds those that lie within `beside` of a surface (of kDistanceOne) and look towards the camera; `off_per_step`: metres of one step of a
/// distance. Every instruction set gives the same.
void see_voxels(const KernelCamera& camera, const VoxelBlock& block, const std::array<float, 3>& corner, float voxel_m,
                float beside, float off_per_step, SeenVoxels& out);

}  // namespace spectra::mapping
