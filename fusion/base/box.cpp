#include "fusion/base/box.hpp"

#include <limits>

namespace spectra::base {

Bounds empty_bounds() {
  constexpr float infinity = std::numeric_limits<float>::infinity();
  return {{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
}

Bounds bounds_of(std::span<const Vec3f> positions) {
  Bounds bounds = empty_bounds();
  for (const Vec3f& p : positions) include(bounds, p);
  return bounds;
}

std::uint64_t morton_code(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
  const auto spread = [](std::uint64_t v) {
    v &= 0x1fffff;
    v = (v | v << 32) & 0x1f00000000ffff;
    v = (v | v << 16) & 0x1f0000ff0000ff;
    v = (v | v << 8) & 0x100f00f00f00f00f;
    v = (v | v << 4) & 0x10c30c30c30c30c3;
    return (v | v << 2) & 0x1249249249249249;
  };
  return spread(x) | spread(y) << 1 | spread(z) << 2;
}

}  // namespace spectra::base
