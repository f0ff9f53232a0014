#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "server/mapping/block_kernels.hpp"

namespace spectra::mapping {

/// Voxels of some blocks beside their surfaces as a camera sees them, block after block; the first `count` of each array.
struct SeenVoxels {
  struct Block {
    std::int32_t index = -1;
    std::size_t end = 0;  ///< One past its last voxel.
  };
  std::vector<Block> blocks;
  std::size_t count = 0;
  std::vector<std::uint16_t> voxel;
  std::vector<float> u, v;    ///< Where the place on the surface falls in the picture, pixels.
  std::vector<float> z_m;     ///< Its depth.
  std::vector<float> cosine;  ///< Between the line of sight and the surface's normal.

  /// Its memory is used again.
  void clear() {
    blocks.clear();
    count = 0;
  }
};

/// Appends the voxels of a block that lie within `beside` of a surface (of kDistanceOne) and look towards the camera, and draws those within a voxel
/// of it into a picture of depth, where that is farther: the plane of the surface through the pixels that a voxel covers, within twice its size.
/// `off_per_step`: metres of one step of a distance. Every instruction set gives the same.
void see_voxels(const KernelCamera& camera, const VoxelBlock& block, const std::array<float, 3>& corner, float voxel_m,
                float beside, float off_per_step, SeenVoxels& out, float* depth_m);

}  // namespace spectra::mapping
