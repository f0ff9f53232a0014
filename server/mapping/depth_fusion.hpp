#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <limits>
#include <vector>

#include "server/mapping/depth_frame.hpp"
#include "server/mapping/voxel_map.hpp"

namespace spectra::mapping {

/// Distances count up to so many voxels before and behind a surface.
inline constexpr double kTruncationVoxels = 4, kBehindVoxels = 3;

/// A depth picture and where its camera was.
struct DepthLook {
  const DepthFrame& frame;
  const CameraModel& camera;
  const RayTable& rays;
  const DepthNoise& noise;
  Eigen::Isometry3d world_from_camera;
};

/// A colour picture and where its camera was.
struct ColourLook {
  const PictureRgb& picture;
  const CameraModel& camera;
  Eigen::Isometry3d world_from_camera;
};

/// Fuses a depth picture, and a colour picture if there is one, into truncated signed distances along the line of sight (Curless and
/// Levoy, SIGGRAPH 1996). Blocks near what is seen are made; all others before it are cleared towards free, and taken out when nothing is left in them. The same bytes for any number of threads.
///
/// A mean is kept as distance += (new - distance) w / (W + w), rounded to the nearest whole number but at least by one step towards the
/// new value, so that it never stalls however heavy W is; W is at most kWeightMost.
///
/// When the blocks of the map take `most_bytes`, no more are made; what there is goes on. The number of blocks that were not made.
std::size_t fuse_depth(VoxelMap& map, const DepthLook& depth, const ColourLook* colour, jobs::WorkerPool& pool,
                       std::uint64_t most_bytes = std::numeric_limits<std::uint64_t>::max());

/// How well a depth picture fits the map where a pose puts it: pixels of a grid where both have something.
struct FitOfDepth {
  std::size_t matching = 0;  ///< At the same distance, within the truncation.
  std::size_t other = 0;
};
FitOfDepth fit_of(const VoxelMap& map, const DepthLook& depth, jobs::WorkerPool& pool);

}  // namespace spectra::mapping
