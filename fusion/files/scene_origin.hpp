#pragma once

#include <optional>

#include "fusion/base/vertex_types.hpp"
#include "fusion/files/position_sample.hpp"

namespace spectra::files {

/// The origin for positions between `min` and `max` (both finite): on each axis 0, unless the coordinates lie further
/// from 0 than twice the scene's largest extent; then the centre, rounded to a multiple of the power of two that is not
/// smaller than that extent. Float coordinates minus such an origin are floats again, without any rounding; double ones keep
/// at least the precision that a float has at the size of the extent.
base::Vec3d scene_origin(const base::Vec3d& min, const base::Vec3d& max);

/// The same, unless strays decide it to the harm of the rest: where a float at that distance from the origin would be rounded
/// by more than a 20,000th of the bulk's size, it is the origin of the bulk. Strays may then lose what a float loses at their
/// distance.
base::Vec3d scene_origin(const base::Vec3d& min, const base::Vec3d& max, const std::optional<Bulk>& bulk);

/// What a float loses at most of a coordinate of the bulk when it is relative to the origin.
double largest_rounding(const Bulk& bulk, const base::Vec3d& origin);

/// The position as it is stored: relative to the origin, in float.
inline base::Vec3f relative_to(const base::Vec3d& origin, const base::Vec3d& position) {
  return {static_cast<float>(position.x - origin.x), static_cast<float>(position.y - origin.y),
          static_cast<float>(position.z - origin.z)};
}

}  // namespace spectra::files
