#pragma once

#include <array>
#include <cstdint>

#include "server/mapping/block_view.hpp"
#include "server/mapping/camera.hpp"
#include "server/mapping/voxel_map.hpp"

namespace spectra::mapping {

/// A camera as the kernels need it: its lens, and where the voxels of a block are in its axes, seen from the block's first one, metres.
struct KernelCamera {
  KernelCamera(const CameraModel& camera, const Eigen::Isometry3d& world_from_camera, double voxel_m);

  alignas(64) std::array<float, kBlockVoxels> x, y, z;
  BlockView view;
  Lens lens;
  bool is_distorted;
  std::int32_t width, height;
};

/// What the kernel of distances needs.
struct DistanceKernel {
  KernelCamera camera;
  const std::uint32_t* pixels;  ///< DepthFrame::packed.
  float unit_m;
  float truncation_m, voxel_m;
  /// Voxels count so far behind a surface at z: max(behind_m, base_m + growth_per_m max(0, z - from_m)^2).
  float behind_m, base_m, growth_per_m, from_m;
};

/// What has changed in a block, at most.
struct BlockChange {
  float moved = 0;                               ///< Of kDistanceOne, of voxels near a surface.
  bool has_surface = false;                      ///< Some voxel is within half of the truncation.
  bool is_free = false;                          ///< No voxel is nearer than half of the truncation.
  bool has_inside = false, has_outside = false;  ///< Some voxel has a distance below 0; some has not.
};

/// The pixel of each voxel that is near what was seen; -1 for the others.
using NearPixels = std::array<std::int32_t, kBlockVoxels>;

/// Moves distances and weights of a block to what was seen. `corner`: its first voxel in the camera's axes, metres.
/// Every instruction set gives the same bytes.
BlockChange fuse_distances(const DistanceKernel& kernel, const std::array<float, 3>& corner, VoxelBlock& block,
                           NearPixels& near);

/// What the kernel of colours needs.
struct ColourKernel {
  KernelCamera camera;
  bool is_depth_camera;               ///< Both pictures have the same pixels.
  const std::uint32_t* pixels;        ///< 0xBBGGRR.
  const std::uint32_t* depth_pixels;  ///< As DistanceKernel::pixels.
};

/// Moves the colours of the voxels near what was seen; the largest change in levels. Every instruction set gives the same bytes.
float fuse_colours(const ColourKernel& kernel, const std::array<float, 3>& corner, VoxelBlock& block,
                   const NearPixels& near);

}  // namespace spectra::mapping
