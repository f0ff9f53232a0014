#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "fusion/base/progress.hpp"
#include "server/jobs/worker_pool.hpp"
#include "server/mapping/calibration.hpp"
#include "server/mapping/frame_folder.hpp"
#include "server/mapping/picture_file.hpp"
#include "server/mapping/surface_mesh.hpp"

namespace spectra::mapping {

/// Points of a surface and which way it faces, metres, in the axes of the poses; one about every `spacing_m`.
struct SurfacePoints {
  std::vector<Eigen::Vector3f> positions, normals;
  float spacing_m = 0;
};

/// Points of a mesh, at most one in each cube of the spacing.
SurfacePoints points_of(const UnitMesh& mesh, double spacing_m);

/// The surface that the depth pictures of a folder show, from at most `most_frames` of them, spread evenly.
SurfacePoints surface_of(const FrameFolder& folder, double voxel_m, std::size_t most_frames, jobs::WorkerPool& pool,
                         FaultLog& faults, const base::Progress& progress);

/// What a thermal picture says of a point.
struct HeatLook {
  std::uint32_t point;
  float u, v;  ///< Where, pixels.
  float celsius;
};

/// Looks at all points that the camera sees from a pose: nothing that lies behind others, is seen at more than 75 degrees, or lies within some
/// pixels of a jump of depth. In the order of the points.
std::vector<HeatLook> looks_at(const SurfacePoints& points, const Picture16& picture, const CameraModel& camera,
                               const Eigen::Isometry3d& world_from_camera);

/// Thermal pictures of a folder, at most so many, spread evenly; those of a closed shutter, which repeat the one before, are left out.
struct ThermalPictures {
  std::vector<double> stamps_s;
  std::vector<Picture16> pictures;
};
ThermalPictures thermal_pictures(const FrameFolder& folder, std::size_t most, FaultLog& faults,
                                 const base::Progress& progress);

inline constexpr std::string_view kSurfacePhase = "finding the surface", kThermalPhase = "reading thermal pictures";

}  // namespace spectra::mapping
