#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "fusion/mesh/multispectral_mesh.hpp"
#include "server/mapping/camera.hpp"

namespace spectra::mapping {

/// What a camera without faults sees, a pixel each.
struct RenderedPicture {
  static constexpr std::uint32_t kNothing = 0xffffffff;
  int width = 0, height = 0;
  std::vector<float> depth_m;           ///< Along the axis of the camera; infinite where there is nothing.
  std::vector<std::uint32_t> triangle;  ///< kNothing: none.
  std::vector<float> share_b, share_c;  ///< Of the triangle's second and third corner, on the surface.
  std::vector<float> cosine;            ///< Between the line of sight and the normal.
};

/// Draws a mesh of small triangles with a depth buffer; triangles that come nearer than 5 cm are left out. No distortion.
RenderedPicture render(const mesh::MultispectralMesh& mesh, const CameraModel& camera,
                       const Eigen::Isometry3d& world_from_camera);

}  // namespace spectra::mapping
