#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace spectra::base {

/// A visible or fused colour: sRGB-encoded, 8 bits a channel, three bytes without padding.
struct Rgb8 {
  std::uint8_t r = 0, g = 0, b = 0;
  friend bool operator==(const Rgb8&, const Rgb8&) = default;
};
static_assert(sizeof(Rgb8) == 3);

/// A position in metres, relative to an origin that is kept in double precision beside it.
struct Vec3f {
  float x = 0, y = 0, z = 0;
  friend bool operator==(const Vec3f&, const Vec3f&) = default;
};
static_assert(sizeof(Vec3f) == 12);

/// A position or origin in metres, in the coordinates of the input file.
struct Vec3d {
  double x = 0, y = 0, z = 0;
  friend bool operator==(const Vec3d&, const Vec3d&) = default;
};

/// What is known of the vertices that are fused: one value per vertex in each span.
struct VertexValues {
  std::span<const float> temperature_celsius;
  std::span<const Rgb8> visible;
  std::span<const float> baseline_celsius = {};  ///< What the temperature is compared with; empty = no vertex has any.
  std::span<const std::uint8_t> freshness = {};  ///< In eighths, 0..8, see AgeSteps; empty = 8 for every vertex.

  /// Those of `count` vertices from `first` on.
  VertexValues subspan(std::size_t first, std::size_t count) const {
    return {temperature_celsius.subspan(first, count), visible.subspan(first, count),
            baseline_celsius.empty() ? baseline_celsius : baseline_celsius.subspan(first, count),
            freshness.empty() ? freshness : freshness.subspan(first, count)};
  }
};

/// Three vertex indices, counter-clockwise as in the input.
using Triangle = std::array<std::uint32_t, 3>;

}  // namespace spectra::base
