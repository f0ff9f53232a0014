#pragma once

#include "fusion/vertex_types.hpp"

namespace spectra::fusion {

/// The origin for positions between `min` and `max` (both finite): on each axis 0, unless the coordinates lie further
/// from 0 than twice the scene's largest extent; then the centre, rounded to a multiple of the power of two that is not
/// smaller than that extent. Float coordinates minus such an origin are floats again, without any rounding; double ones keep
/// at least the precision that a float has at the size of the extent.
Vec3d scene_origin(const Vec3d& min, const Vec3d& max);

/// The position as it is stored: relative to the origin, in float.
inline Vec3f relative_to(const Vec3d& origin, const Vec3d& position) {
  return {static_cast<float>(position.x - origin.x), static_cast<float>(position.y - origin.y),
          static_cast<float>(position.z - origin.z)};
}

}  // namespace spectra::fusion
