#pragma once

#include <array>

#include "fusion/base/vertex_types.hpp"

namespace spectra::stream {

/// Where a viewer looks from; metres relative to the scene origin.
struct Camera {
  base::Vec3f eye, target, up;
  double fov_y_deg = 50;
  std::array<int, 2> viewport{1280, 720};
};

}  // namespace spectra::stream
