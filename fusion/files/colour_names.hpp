#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "fusion/files/ply_header.hpp"

namespace spectra::files {

/// Properties for red, green and blue whose names have no more than that and words such as "colour" or "vertex" in them:
/// colour_red, color_r, vertexRed. nullopt: the element has none.
std::optional<std::array<std::size_t, 3>> plain_colour_channels(const PlyElement& element);

/// Properties that might be colours by their names, though not surely: Rf Gf Bf, ambient_red ..., scalar_rgb, intensity.
std::vector<std::size_t> possible_colours(const PlyElement& element);

}  // namespace spectra::files
