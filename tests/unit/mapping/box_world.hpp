#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <vector>

#include "server/mapping/calibration.hpp"
#include "server/mapping/picture_file.hpp"

namespace spectra::mapping {

/// A box with a temperature, metres.
struct WarmBox {
  Eigen::Vector3d low, high;
  std::function<double(const Eigen::Vector3d&)> celsius;
};

/// A world of boxes that cameras without noise look at.
struct BoxWorld {
  std::vector<WarmBox> boxes;

  /// Depth in millimetres, 0 where nothing is.
  Picture16 depth(const CameraModel& camera, const Eigen::Isometry3d& world_from_camera) const;
  /// Centikelvin; -10 degC where nothing is.
  Picture16 thermal(const CameraModel& camera, const Eigen::Isometry3d& world_from_camera,
                    double offset_kelvin = 0) const;

 private:
  /// Distance along the ray, and the box; null where there is none.
  const WarmBox* first_hit(const Eigen::Vector3d& from, const Eigen::Vector3d& ray, double& distance) const;
};

/// A wall 2 m wide at z = 2 m, 20 degC.
WarmBox wall(double celsius = 20);

/// Small cameras side by side.
Calibration small_cameras();
CameraModel small_camera(int width = 160, int height = 120, double focal = 140);

/// A camera at a place that looks along +z, turned about y.
Eigen::Isometry3d looking_ahead(double x = 0, double y = 0, double z = 0, double yaw_rad = 0);

}  // namespace spectra::mapping
