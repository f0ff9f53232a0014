#include "fusion/demo/scan_view.hpp"

#include <algorithm>
#include <array>

namespace spectra::demo {
namespace {

constexpr double kNearestMetres = 0.15;

constexpr std::array<ScanPose, 11> kCoveragePoses{{
    {{-0.8, 1.9, 4.6}, {-0.3, 0.7, 0.0}, 0.95},
    {{-0.5, 2.0, 4.8}, {1.8, 1.2, 0.0}, 0.95},
    {{-2.9, 1.5, 2.3}, {1.2, 0.6, -0.9}, 0.90},
    {{2.6, 1.9, 3.8}, {-0.9, 0.6, -0.8}, 0.90},
    {{3.0, 1.5, 3.4}, {2.6, 0.7, -0.5}, 0.90},
    {{-1.5, 1.5, 0.6}, {-2.5, 1.0, -2.8}, 0.90},
    {{0.2, 1.2, 2.7}, {0.6, 0.15, 1.2}, 0.80},
    {{0.1, 1.6, 0.4}, {0.9, 1.1, -2.8}, 0.90},
    {{-1.2, 1.7, -0.1}, {-3.6, 0.8, 0.1}, 0.90},
    {{-1.4, 1.6, 0.4}, {0.8, 0.1, 1.1}, 0.90},
    {{0.3, 1.4, -1.0}, {-0.6, 0.1, 1.6}, 0.95},
}};

}  // namespace

ScanView::ScanView(const ScanPose& pose, std::size_t width, std::size_t height, const SurfaceMesh& stand_in,
                   const std::vector<float>& values)
    : pose_(facing(pose.from, pose.from - pose.to)), focal_pixels_(static_cast<double>(width) / 2 / pose.half_width) {
  image_.width = width;
  image_.height = height;
  std::vector<ImagePoint> points(stand_in.positions.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const base::Vec3f& p = stand_in.positions[i];
    const ScanPoint q = project({p.x, p.y, p.z});
    if (q.depth < kNearestMetres) continue;
    points[i] = {static_cast<float>(q.x + 0.5), static_cast<float>(q.y + 0.5), static_cast<float>(1 / q.depth)};
  }
  image_ = draw(points, stand_in.triangles, values, width, height);
}

ScanPoint ScanView::project(Vec position) const {
  const Vec q = position - pose_.origin;
  const double depth = -dot(q, pose_.out);
  if (depth < kNearestMetres) return {0, 0, depth};
  const double scale = focal_pixels_ / depth;
  return {static_cast<double>(image_.width) / 2 + scale * dot(q, pose_.right) - 0.5,
          static_cast<double>(image_.height) / 2 - scale * dot(q, pose_.up) - 0.5, depth};
}

bool ScanView::sees(Vec position, Vec normal, double least_slope, ScanPoint& found, double& slope) const {
  const Vec sight = pose_.origin - position;
  slope = dot(sight, normal) / length(sight);
  if (slope < least_slope) return false;
  found = project(position);
  if (found.depth < kNearestMetres || found.x < 0 || found.y < 0 || found.x >= static_cast<double>(image_.width - 1) ||
      found.y >= static_cast<double>(image_.height - 1)) {
    return false;
  }
  const std::size_t pixel = static_cast<std::size_t>(found.y) * image_.width + static_cast<std::size_t>(found.x);
  // One of the four pixels around is enough: at an edge the background takes a little of what is before it.
  const auto hidden_from = static_cast<float>(1 / std::max(found.depth * 0.994 - 0.02, 0.05));
  const auto shows = [&](std::size_t at) { return image_.nearness[at] > 0 && image_.nearness[at] < hidden_from; };
  return shows(pixel) || shows(pixel + 1) || shows(pixel + image_.width) || shows(pixel + image_.width + 1);
}

ScanCoverage::ScanCoverage(const SurfaceMesh& stand_in) {
  for (const ScanPose& pose : kCoveragePoses) views_.emplace_back(pose, 640, 480, stand_in, std::vector<float>{});
}

bool ScanCoverage::has_seen(Vec position, Vec normal) const {
  ScanPoint found;
  double slope = 0;
  return std::any_of(views_.begin(), views_.end(),
                     [&](const ScanView& view) { return view.sees(position, normal, -0.05, found, slope); });
}

}  // namespace spectra::demo
