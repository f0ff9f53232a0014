#pragma once

#include "fusion/base/vertex_types.hpp"

namespace spectra::base {

/// Smallest and largest coordinates of something, metres relative to the scene's origin.
struct Bounds {
  Vec3f min, max;
  friend bool operator==(const Bounds&, const Bounds&) = default;
};

}  // namespace spectra::base
