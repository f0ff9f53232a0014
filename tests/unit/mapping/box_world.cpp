#include "box_world.hpp"

#include <cmath>
#include <limits>

namespace spectra::mapping {

const WarmBox* BoxWorld::first_hit(const Eigen::Vector3d& from, const Eigen::Vector3d& ray, double& distance) const {
  const WarmBox* hit = nullptr;
  distance = std::numeric_limits<double>::infinity();
  for (const WarmBox& box : boxes) {
    double enter = 1e-6, leave = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
      const double a = (box.low[axis] - from[axis]) / ray[axis], b = (box.high[axis] - from[axis]) / ray[axis];
      enter = std::max(enter, std::min(a, b));
      leave = std::min(leave, std::max(a, b));
    }
    if (enter < leave && enter > 1e-3 && enter < distance) {
      distance = enter;
      hit = &box;
    }
  }
  return hit;
}

Picture16 BoxWorld::depth(const CameraModel& camera, const Eigen::Isometry3d& world_from_camera) const {
  Picture16 picture{camera.width, camera.height, {}};
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      double distance = 0;
      const bool is_hit = first_hit(world_from_camera.translation(), world_from_camera.linear() * camera.ray_of(x, y),
                                    distance) != nullptr;
      picture.pixels.push_back(is_hit ? static_cast<std::uint16_t>(std::lround(1000 * distance)) : std::uint16_t{0});
    }
  }
  return picture;
}

Picture16 BoxWorld::thermal(const CameraModel& camera, const Eigen::Isometry3d& world_from_camera,
                            double offset_kelvin) const {
  Picture16 picture{camera.width, camera.height, {}};
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector3d ray = world_from_camera.linear() * camera.ray_of(x, y);
      double distance = 0;
      const WarmBox* hit = first_hit(world_from_camera.translation(), ray, distance);
      const double celsius = hit != nullptr ? hit->celsius(world_from_camera.translation() + distance * ray) : -10;
      picture.pixels.push_back(static_cast<std::uint16_t>(std::lround(100 * (celsius + offset_kelvin + 273.15))));
    }
  }
  return picture;
}

WarmBox wall(double celsius) {
  return {{-1, -1, 2}, {1, 1, 2.5}, [celsius](const Eigen::Vector3d&) { return celsius; }};
}

CameraModel small_camera(int width, int height, double focal) {
  CameraModel camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = focal;
  camera.cx = 0.5 * (width - 1);
  camera.cy = 0.5 * (height - 1);
  return camera;
}

Calibration small_cameras() {
  Calibration calibration;
  calibration.depth.camera = small_camera();
  calibration.thermal.emplace();
  calibration.thermal->camera = small_camera(120, 90, 110);
  return calibration;
}

Eigen::Isometry3d looking_ahead(double x, double y, double z, double yaw_rad) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = Eigen::Vector3d(x, y, z);
  pose.linear() = Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return pose;
}

}  // namespace spectra::mapping
