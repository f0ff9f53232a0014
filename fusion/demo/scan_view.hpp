#pragma once

#include <vector>

#include "fusion/demo/depth_image.hpp"

namespace spectra::demo {

/// Where the robot stopped to look.
struct ScanPose {
  Vec from, to;
  double half_width;  ///< Of the picture, per metre of distance: the tangent of half the horizontal angle.
};

/// Where a point falls in a view: pixels from the middle of the first one, and metres along the axis.
struct ScanPoint {
  double x = 0, y = 0, depth = 0;
};

/// One camera at one stop, with what it sees first in every pixel.
class ScanView {
 public:
  /// Looks at `stand_in`; `values`, one a vertex or none, go into the picture.
  ScanView(const ScanPose& pose, std::size_t width, std::size_t height, const SurfaceMesh& stand_in,
           const std::vector<float>& values);

  /// Finds the point in the picture; false when it is outside, turned away more than `least_slope` allows (the cosine
  /// against the line of sight), or hidden.
  bool sees(Vec position, Vec normal, double least_slope, ScanPoint& found, double& slope) const;

  DepthImage& image() { return image_; }
  const DepthImage& image() const { return image_; }

 private:
  ScanPoint project(Vec position) const;

  Frame pose_;  ///< `out` points back, from the scene to the camera.
  double focal_pixels_;
  DepthImage image_;
};

/// What the depth camera has covered: what it never saw is not part of the mesh.
class ScanCoverage {
 public:
  explicit ScanCoverage(const SurfaceMesh& stand_in);
  bool has_seen(Vec position, Vec normal) const;

 private:
  std::vector<ScanView> views_;
};

}  // namespace spectra::demo
