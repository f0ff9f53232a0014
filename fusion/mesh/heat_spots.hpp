#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "fusion/mesh/surface.hpp"

namespace spectra::mesh {

/// A small part of a surface that is hotter, or colder, than all around it.
struct HeatSpot {
  std::uint32_t apex = 0;              ///< Its hottest (coldest) vertex.
  std::vector<std::uint32_t> members;  ///< The vertices within `contrast_celsius` of the apex, which is the first.
  double area_m2 = 0;                  ///< What belongs to the members.
};

/// The area that belongs to each vertex: a third of each triangle around it.
std::vector<double> vertex_areas(const Surface& surface);

/// The spots of at most `most_area_m2` that stand out by at least `contrast_celsius`: whoever walks away from the apex to a
/// vertex that is hotter (colder) comes by one that is so much colder (hotter). Something colder (hotter) lies around
/// each; NaN, no temperature, is neither.
std::vector<HeatSpot> heat_spots(const Surface& surface, std::span<const float> temperature_celsius,
                                 std::span<const double> vertex_area_m2, double contrast_celsius, double most_area_m2);

}  // namespace spectra::mesh
