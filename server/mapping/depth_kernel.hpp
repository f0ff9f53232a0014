#pragma once

#include <cstddef>

#include "server/mapping/calibration.hpp"

namespace spectra::mapping {

/// How a pixel of a depth picture is weighed (prepared_depth).
inline constexpr int kEdgeReach = 2;    ///< Pixels.
inline constexpr int kNormalReach = 3;  ///< Pixels.
inline constexpr float kLeastCosine = 0.17F;
inline constexpr float kSteepest = 5.67F;  ///< The tangent of 80 degrees.

/// A depth picture in metres, and the directions of its pixels with z = 1.
struct DepthPixels {
  const float *depth_m, *ray_x, *ray_y;
  std::ptrdiff_t width;
  float focal;
  DepthNoise noise;
  double truncation_m;
};

/// Fewer pixels are not weighed at a time.
inline constexpr std::size_t kLeastWeighed = 16;

/// Weighs `count` pixels of a row from one on, at least kLeastWeighed, all of them with neighbours as far as kNormalReach in the picture. Every
/// instruction set gives the same.
void weigh_pixels(const DepthPixels& pixels, std::size_t first, std::size_t count, float* weight);

}  // namespace spectra::mapping
