#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <limits>
#include <vector>

#include "server/jobs/worker_pool.hpp"
#include "server/mapping/camera.hpp"
#include "server/mapping/depth_frame.hpp"
#include "server/mapping/voxel_map.hpp"

namespace spectra::mapping {

/// A point that a depth camera sees, and what the other cameras say of it.
struct SeenPoint {
  Eigen::Vector3f place;                                    ///< In the axes of the depth camera, metres.
  float sigma_m = 0;                                        ///< Of its distance.
  float luma = std::numeric_limits<float>::quiet_NaN();     ///< Levels; NaN: none.
  float celsius = std::numeric_limits<float>::quiet_NaN();  ///< NaN: none.
};

/// Points of one moment; the first `coarse_count` are spread over all of the picture.
struct SeenPoints {
  std::vector<SeenPoint> points;
  std::size_t coarse_count = 0;
};

/// What counts when a pose is looked for.
struct AlignmentTerms {
  bool colour = true, thermal = true;
};

/// A pose, and how well what is seen from it fits the map.
struct Alignment {
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  std::size_t point_count = 0;        ///< Looked up.
  std::size_t known_count = 0;        ///< Of these, where the map knows something near a surface.
  std::size_t matching_count = 0;     ///< Of these, those on the surface, within what noise allows.
  double residual_m = 0;              ///< Root mean square of the distances from the surface, of those that match.
  double sigma_m = 0, sigma_rad = 0;  ///< Of the pose along its least certain direction; infinite: nothing tells.
  /// Share of the points that would tell as much along the least certain direction, if they lay on planes across it: a third where surfaces face all
  /// ways, next to nothing before a bare wall.
  double told = 0;
  int rounds = 0;
};

/// Counts how many of the first `count` points fit from a pose; pose and rounds of the answer are as given and 0.
Alignment fit_at(const VoxelMap& map, const SeenPoints& seen, std::size_t count,
                 const Eigen::Isometry3d& world_from_camera, jobs::WorkerPool& pool);

/// Finds the pose near `guess` from which points lie on the surface of the map (point to plane: the distances of the map along its own gradient, Bylow,
/// Sturm, Kerl, Kahl and Cremers, RSS 2013) and have the brightness and the temperature that it has there: Gauss and Newton on the six numbers of a
/// small motion, each residual over its noise, Huber's weights. A change of all brightnesses or temperatures in common is taken out. What nothing
/// tells stays as guessed. The same for any number of threads.
Alignment align(const VoxelMap& map, const SeenPoints& seen, const Eigen::Isometry3d& guess,
                const AlignmentTerms& terms, jobs::WorkerPool& pool);

/// The depth of the pixels that count, metres; 0: it does not. `depth_m`: memory to use again.
std::vector<float> counted_depth(const DepthFrame& frame, std::vector<float> depth_m = {});

/// How a depth camera moved between two of its pictures (before_from_now), of each of which counted_depth() is given, near `guess`: what the first
/// `coarse_count` points see of planes lies on the planes of the earlier picture into whose pixels they fall, of those within some decimetres that face
/// alike (Rusinkiewicz and Levoy, 3DIM 2001). It reaches farther than align(), whose map knows nothing beyond its truncation, and is less exact. The
/// guess where too little falls on anything. The same for any number of threads.
Eigen::Isometry3d motion_between(const std::vector<float>& before_m, const std::vector<float>& now_m,
                                 const RayTable& rays, const CameraModel& camera, const SeenPoints& seen,
                                 const Eigen::Isometry3d& guess, jobs::WorkerPool& pool);

}  // namespace spectra::mapping
