#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "server/jobs/worker_pool.hpp"
#include "server/mapping/camera.hpp"
#include "server/mapping/surface_kernel.hpp"
#include "server/mapping/voxel_map.hpp"

namespace spectra::mapping {

/// The surfaces of the map as a camera sees them: drawn as squares as large as voxels into a picture of depth.
struct SurfaceView {
  /// Of some blocks together each, in rising order of blocks; those that look away from the camera are left out.
  std::vector<SeenVoxels> voxels;
  std::vector<float> depth_m;               ///< A pixel each; infinite where the map has nothing.
  std::vector<std::vector<float>> drawn_m;  ///< What each thread has drawn of it.
};

/// Draws the map at a pose. `view`: an earlier one, whose memory is used again. The same for any number of threads.
SurfaceView draw_surfaces(const VoxelMap& map, const CameraModel& camera, const Eigen::Isometry3d& world_from_camera,
                          jobs::WorkerPool& pool, SurfaceView view = {});

/// 1 for each pixel of a drawn picture within 3 pixels of a jump of depth, or of where the map has nothing.
std::vector<std::uint8_t> edges_of(const std::vector<float>& depth_m, const CameraModel& camera, float voxel_m,
                                   jobs::WorkerPool& pool);

}  // namespace spectra::mapping
