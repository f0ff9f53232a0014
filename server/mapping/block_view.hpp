#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>

#include "server/mapping/camera.hpp"
#include "server/mapping/voxel_map.hpp"

namespace spectra::mapping {

/// Where voxels are in the axes of a camera: corners of blocks in double precision, from there on in steps of single precision.
class BlockView {
 public:
  BlockView(const Eigen::Isometry3d& world_from_camera, double voxel_m)
      : camera_from_world_(world_from_camera.inverse()), voxel_m_(voxel_m) {
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d step = camera_from_world_.linear().col(axis) * voxel_m;
      steps_[static_cast<std::size_t>(axis)] = {static_cast<float>(step.x()), static_cast<float>(step.y()),
                                                static_cast<float>(step.z())};
    }
  }

  /// From a voxel to the next along an axis of the world.
  const std::array<float, 3>& step(std::size_t axis) const { return steps_[axis]; }

  /// The first voxel of a block.
  std::array<float, 3> corner(GridPlace block) const { return at(block, 0); }
  /// Its middle.
  std::array<float, 3> centre(GridPlace block) const { return at(block, 0.5 * (kBlockEdge - 1)); }

  /// The first voxel of a row along x; rows count along y, then z.
  std::array<float, 3> row(const std::array<float, 3>& corner, int row) const {
    const auto y = static_cast<float>(row % kBlockEdge), z = static_cast<float>(row / kBlockEdge);
    std::array<float, 3> first{};
    for (std::size_t i = 0; i < 3; ++i) first[i] = corner[i] + y * steps_[1][i] + z * steps_[2][i];
    return first;
  }

  /// Whether a ball about the corner of a block may be in the picture.
  bool is_before(GridPlace block, float radius_m, const Lens& lens, const CameraModel& camera) const {
    const auto centre = corner(block);
    if (centre[2] + radius_m <= 0) return false;
    if (centre[2] <= radius_m) return true;
    float u = 0, v = 0;
    lens.project(centre[0] / centre[2], centre[1] / centre[2], u, v);
    // A distorted lens may fold what is far outside back into the picture, which only costs time.
    const float reach = 1.5F * std::max(lens.fx, lens.fy) * radius_m / (centre[2] - radius_m);
    return u > -reach && v > -reach && u < static_cast<float>(camera.width) + reach &&
           v < static_cast<float>(camera.height) + reach;
  }

 private:
  std::array<float, 3> at(GridPlace block, double offset) const {
    const Eigen::Vector3d place((block.x * static_cast<double>(kBlockEdge) + offset) * voxel_m_,
                                (block.y * static_cast<double>(kBlockEdge) + offset) * voxel_m_,
                                (block.z * static_cast<double>(kBlockEdge) + offset) * voxel_m_);
    const Eigen::Vector3d seen = camera_from_world_ * place;
    return {static_cast<float>(seen.x()), static_cast<float>(seen.y()), static_cast<float>(seen.z())};
  }

  Eigen::Isometry3d camera_from_world_;
  double voxel_m_;
  std::array<std::array<float, 3>, 3> steps_{};
};

}  // namespace spectra::mapping
