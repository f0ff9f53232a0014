#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "fusion/vertex_types.hpp"
#include "server/scene/surface.hpp"

namespace spectra::server {

/// A surface with what is seen on it, and what of it must stay.
struct SimplifyInput {
  const Surface& surface;  ///< Without degenerate triangles.
  std::span<const fusion::Rgb8> visible;
  std::span<const float> temperature_celsius;  ///< NaN = none, infinite = beyond what the sensor can tell.
  const std::vector<bool>& is_locked;          ///< Stays, as it is.
  double span_celsius = 1;                     ///< A difference that counts as much as one between black and white.
};

/// Fewer triangles over the same vertices. Values count at vertices that are used.
struct Simplified {
  std::vector<fusion::Triangle> triangles;
  std::vector<fusion::Rgb8> visible;
  std::vector<float> temperature_celsius;
};

/// Draws vertices into neighbours, always where that changes the least of form, colour and temperature together, until about
/// `wanted_count` are left.
///
/// The change is measured by quadrics: squared distances from the planes of the triangles that a vertex stands for, and
/// squared differences from colour and temperature as these triangles spread them, weighted by area. Full contrast weighs as
/// much as a shift by half the mean distance of the vertices that are left. What remains takes the colour and the temperature that fit
/// what it stands for best. Open edges are drawn along themselves alone; where sheets meet nothing moves; topology does not
/// change.
///
/// A hot or cold spot that stands out from all around it by at least a sixteenth of `span_celsius` counts as much as
/// what one vertex will stand for, however small it is, and its apex keeps its temperature: it is still there, and its
/// surroundings are not warmer for it.
Simplified simplified(const SimplifyInput& input, std::size_t wanted_count);

}  // namespace spectra::server
