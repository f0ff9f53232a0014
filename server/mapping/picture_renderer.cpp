#include "server/mapping/picture_renderer.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace spectra::mapping {
namespace {

constexpr float kNearest = 0.05F;

struct Corner {
  float u = 0, v = 0, nearness = 0;  ///< 1 / z; 0: too near or behind.
};

void shade(const mesh::MultispectralMesh& mesh, const std::vector<Corner>& corners, const CameraModel& camera,
           const Eigen::Matrix3f& turn, RenderedPicture& picture) {
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      const std::size_t pixel =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width) + static_cast<std::size_t>(x);
      const std::uint32_t triangle = picture.triangle[pixel];
      if (triangle == RenderedPicture::kNothing) continue;
      const base::Triangle& t = mesh.triangles()[triangle];
      const Corner &a = corners[t[0]], &b = corners[t[1]], &c = corners[t[2]];
      const float area = (b.u - a.u) * (c.v - a.v) - (c.u - a.u) * (b.v - a.v);
      const auto px = static_cast<float>(x), py = static_cast<float>(y);
      const float of_b = ((px - a.u) * (c.v - a.v) - (c.u - a.u) * (py - a.v)) / area;
      const float of_c = ((b.u - a.u) * (py - a.v) - (px - a.u) * (b.v - a.v)) / area;
      const float z = picture.depth_m[pixel];
      picture.share_b[pixel] = of_b * b.nearness * z;
      picture.share_c[pixel] = of_c * c.nearness * z;
      const auto at = [&](std::size_t i) {
        const base::Vec3f& p = mesh.positions()[t[i]];
        return Eigen::Vector3f(p.x, p.y, p.z);
      };
      const Eigen::Vector3f normal = (at(1) - at(0)).cross(at(2) - at(0));
      const Eigen::Vector3f ray = turn * Eigen::Vector3f(static_cast<float>((x - camera.cx) / camera.fx),
                                                         static_cast<float>((y - camera.cy) / camera.fy), 1);
      const float lengths = normal.norm() * ray.norm();
      picture.cosine[pixel] = lengths > 0 ? std::abs(normal.dot(ray)) / lengths : 0;
    }
  }
}

}  // namespace

RenderedPicture render(const mesh::MultispectralMesh& mesh, const CameraModel& camera,
                       const Eigen::Isometry3d& world_from_camera) {
  RenderedPicture picture;
  picture.width = camera.width;
  picture.height = camera.height;
  const std::size_t count = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  picture.depth_m.assign(count, std::numeric_limits<float>::infinity());
  picture.triangle.assign(count, RenderedPicture::kNothing);
  picture.share_b.assign(count, 0);
  picture.share_c.assign(count, 0);
  picture.cosine.assign(count, 0);

  const Eigen::Isometry3f camera_from_world = world_from_camera.inverse().cast<float>();
  const Lens lens(camera);
  std::vector<Corner> corners(mesh.vertex_count());
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const base::Vec3f& p = mesh.positions()[i];
    const Eigen::Vector3f seen = camera_from_world * Eigen::Vector3f(p.x, p.y, p.z);
    if (seen.z() < kNearest) continue;
    corners[i] = {lens.fx * seen.x() / seen.z() + lens.cx, lens.fy * seen.y() / seen.z() + lens.cy, 1 / seen.z()};
  }
  const auto right = static_cast<float>(camera.width - 1), bottom = static_cast<float>(camera.height - 1);
  for (std::size_t triangle = 0; triangle < mesh.triangle_count(); ++triangle) {
    const base::Triangle& t = mesh.triangles()[triangle];
    const Corner &a = corners[t[0]], &b = corners[t[1]], &c = corners[t[2]];
    if (a.nearness == 0 || b.nearness == 0 || c.nearness == 0) continue;
    const float low_u = std::ceil(std::max(0.0F, std::min({a.u, b.u, c.u}))),
                high_u = std::min(right, std::max({a.u, b.u, c.u}));
    const float low_v = std::ceil(std::max(0.0F, std::min({a.v, b.v, c.v}))),
                high_v = std::min(bottom, std::max({a.v, b.v, c.v}));
    if (low_u > high_u || low_v > high_v) continue;
    const float area = (b.u - a.u) * (c.v - a.v) - (c.u - a.u) * (b.v - a.v);
    if (area == 0) continue;
    for (float y = low_v; y <= high_v; ++y) {
      for (float x = low_u; x <= high_u; ++x) {
        const float of_b = ((x - a.u) * (c.v - a.v) - (c.u - a.u) * (y - a.v)) / area;
        const float of_c = ((b.u - a.u) * (y - a.v) - (x - a.u) * (b.v - a.v)) / area;
        const float of_a = 1 - of_b - of_c;
        if (of_a < 0 || of_b < 0 || of_c < 0) continue;
        const float z = 1 / (of_a * a.nearness + of_b * b.nearness + of_c * c.nearness);
        const std::size_t pixel =
            static_cast<std::size_t>(y) * static_cast<std::size_t>(camera.width) + static_cast<std::size_t>(x);
        if (z >= picture.depth_m[pixel]) continue;
        picture.depth_m[pixel] = z;
        picture.triangle[pixel] = static_cast<std::uint32_t>(triangle);
      }
    }
  }
  shade(mesh, corners, camera, world_from_camera.linear().cast<float>(), picture);
  return picture;
}

}  // namespace spectra::mapping
