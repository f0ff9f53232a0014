#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "server/jobs/worker_pool.hpp"
#include "server/mapping/camera.hpp"
#include "server/mapping/voxel_map.hpp"

namespace spectra::mapping {

/// A voxel beside a surface as a camera sees it.
struct SurfaceVoxel {
  std::int32_t block = -1;
  std::uint16_t voxel = 0;
  bool is_reached = false;  ///< Nothing of the map lies before it.
  float u = 0, v = 0;       ///< Where its place on the surface falls in the picture, pixels.
  float z_m = 0;
  float cosine = 0;  ///< Between the line of sight and the surface's normal.
};

/// The surfaces of the map as a camera sees them: drawn as squares as large as voxels into a picture of depth, in which those that lie
/// behind others are told.
struct SurfaceView {
  /// Of some blocks together each, in rising order of blocks; those that look away from the camera are left out.
  std::vector<std::vector<SurfaceVoxel>> voxels;
  std::vector<float> depth_m;              ///< A pixel each; infinite where the map has nothing.
  std::vector<std::uint8_t> is_near_edge;  ///< 1 within 3 pixels of a jump of depth, or of where the map has nothing.
};

/// Draws the map at a pose. The same for any number of threads.
SurfaceView draw_surfaces(const VoxelMap& map, const CameraModel& camera, const Eigen::Isometry3d& world_from_camera,
                          jobs::WorkerPool& pool);

}  // namespace spectra::mapping
