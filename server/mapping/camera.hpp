#pragma once

#include <Eigen/Core>
#include <array>

namespace spectra::mapping {

/// A pinhole camera with the distortion of Brown and Conrady. Pixels are counted from the middle of the first one; a camera looks along
/// +z, x to the right, y down.
struct CameraModel {
  int width = 0;
  int height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;
  std::array<double, 4> distortion{};  ///< k1, k2 (radial), p1, p2 (tangential), of x / z and y / z.

  friend bool operator==(const CameraModel&, const CameraModel&) = default;

  bool has_distortion() const;
  /// Where a point before the camera (z > 0) is seen, pixels; may lie outside of the picture.
  Eigen::Vector2d pixel_of(const Eigen::Vector3d& point) const;
  /// The direction that is seen at a pixel, with z = 1. Undoes the distortion by iteration, to 1e-9 for lenses that show no point twice.
  Eigen::Vector3d ray_of(double u, double v) const;
};

/// The same camera in single precision, for kernels.
struct Lens {
  float fx = 0, fy = 0, cx = 0, cy = 0, k1 = 0, k2 = 0, p1 = 0, p2 = 0;

  explicit Lens(const CameraModel& camera);

  /// `x` and `y` divided by z.
  void project(float x, float y, float& u, float& v) const {
    const float rr = x * x + y * y;
    const float radial = 1 + rr * (k1 + rr * k2);
    const float xd = x * radial + 2 * p1 * x * y + p2 * (rr + 2 * x * x);
    const float yd = y * radial + p1 * (rr + 2 * y * y) + 2 * p2 * x * y;
    u = fx * xd + cx;
    v = fy * yd + cy;
  }
};

}  // namespace spectra::mapping
