#pragma once

#include <cstddef>
#include <vector>

#include "fusion/demo/tessellator.hpp"

namespace spectra::demo {

/// A vertex in an image: x and y in pixels (centres at .5) and a nearness that is linear across the image plane and
/// larger for what is nearer. Nearness 0 or less is behind the camera and is not drawn.
struct ImagePoint {
  float x = 0, y = 0, nearness = 0;
};

/// What each pixel of a view sees first; 0 where it sees nothing.
struct DepthImage {
  std::size_t width = 0, height = 0;
  std::vector<float> nearness;
  std::vector<float> value;  ///< The vertices' values, interpolated; empty when none were given.
};

/// Draws triangles with a depth buffer. `values` is one number a vertex, or empty.
DepthImage draw(const std::vector<ImagePoint>& points, const std::vector<base::Triangle>& triangles,
                const std::vector<float>& values, std::size_t width, std::size_t height);

}  // namespace spectra::demo
