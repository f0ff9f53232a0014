#include "server/mapping/camera.hpp"

#include <algorithm>

namespace spectra::mapping {
namespace {

Eigen::Vector2d distorted(const std::array<double, 4>& d, const Eigen::Vector2d& p) {
  const double x = p.x(), y = p.y(), rr = p.squaredNorm();
  const double radial = 1 + rr * (d[0] + rr * d[1]);
  return {x * radial + 2 * d[2] * x * y + d[3] * (rr + 2 * x * x),
          y * radial + d[2] * (rr + 2 * y * y) + 2 * d[3] * x * y};
}

}  // namespace

bool CameraModel::has_distortion() const {
  return std::any_of(distortion.begin(), distortion.end(), [](double k) { return k != 0; });
}

Eigen::Vector2d CameraModel::pixel_of(const Eigen::Vector3d& point) const {
  const Eigen::Vector2d seen = distorted(distortion, point.head<2>() / point.z());
  return {fx * seen.x() + cx, fy * seen.y() + cy};
}

Eigen::Vector3d CameraModel::ray_of(double u, double v) const {
  const Eigen::Vector2d seen((u - cx) / fx, (v - cy) / fy);
  Eigen::Vector2d ray = seen;
  if (has_distortion()) {
    for (int i = 0; i < 20; ++i) ray += seen - distorted(distortion, ray);
  }
  return {ray.x(), ray.y(), 1};
}

Lens::Lens(const CameraModel& camera)
    : fx(static_cast<float>(camera.fx)),
      fy(static_cast<float>(camera.fy)),
      cx(static_cast<float>(camera.cx)),
      cy(static_cast<float>(camera.cy)),
      k1(static_cast<float>(camera.distortion[0])),
      k2(static_cast<float>(camera.distortion[1])),
      p1(static_cast<float>(camera.distortion[2])),
      p2(static_cast<float>(camera.distortion[3])) {}

}  // namespace spectra::mapping
