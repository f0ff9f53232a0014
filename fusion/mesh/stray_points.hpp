#pragma once

#include <cstdint>
#include <span>

#include "fusion/base/bounds.hpp"
#include "fusion/base/vertex_types.hpp"

namespace spectra::mesh {

/// Vertices that lie far from everything else, and where everything else is.
struct StrayPoints {
  std::uint64_t count = 0;
  double farthest_m = 0;  ///< The largest distance of one of them from `core`.
  base::Bounds core;      ///< Of all other vertices: of all when none is a stray.
};

/// Finds the few vertices that would make a scene look empty: single points, triangles and tiny pieces that are farther from
/// the rest than the rest is large. No stray is
/// - a piece of 50 vertices or more, unless it is both less than 1/2000 of the vertices and of a twentieth of the size, or all in
///   exactly one place;
/// - a piece of surface of a quarter of the size of the rest, or one that reaches round it;
/// - anything when there would be more of them than a tenth of the vertices (three: than an eighth), or than 50 and a thousandth.
/// A vertex whose triangles all stand on the rest with their other two corners is one (a spike), unless more than a tenth of all triangles
/// are of it (a spire, the tip of a cone); any other triangle holds its corners together. Linear in time; finite positions, indices in range.
StrayPoints stray_points(std::span<const base::Vec3f> positions, std::span<const base::Triangle> triangles);

}  // namespace spectra::mesh
