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

/// Smallest box of some positions; of none: min above max.
Bounds bounds_of(std::span<const Vec3f> positions);

/// Interleaves the lowest 21 bits of three coordinates, x lowest.
std::uint64_t morton_code(std::uint32_t x, std::uint32_t y, std::uint32_t z);

}  // namespace spectra::base
