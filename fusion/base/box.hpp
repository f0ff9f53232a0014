#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "fusion/base/bounds.hpp"
#include "fusion/base/vertex_types.hpp"

namespace spectra::base {

/// Of nothing: min above max.
Bounds empty_bounds();
inline void include(Bounds& bounds, const Vec3f& p) {
  bounds.min = {std::min(bounds.min.x, p.x), std::min(bounds.min.y, p.y), std::min(bounds.min.z, p.z)};
  bounds.max = {std::max(bounds.max.x, p.x), std::max(bounds.max.y, p.y), std::max(bounds.max.z, p.z)};
}

/// Whether two boxes have a point in common; their sides count.
inline bool overlap(const Bounds& a, const Bounds& b) {
  return a.min.x <= b.max.x && b.min.x <= a.max.x && a.min.y <= b.max.y && b.min.y <= a.max.y && a.min.z <= b.max.z &&
         b.min.z <= a.max.z;
}

/// Smallest box of some positions; of none: min above max.
Bounds bounds_of(std::span<const Vec3f> positions);

/// Interleaves the lowest 21 bits of three coordinates, x lowest.
std::uint64_t morton_code(std::uint32_t x, std::uint32_t y, std::uint32_t z);

}  // namespace spectra::base
