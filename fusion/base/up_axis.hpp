#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "fusion/base/vertex_types.hpp"

namespace spectra::base {

/// The direction that is up in a scene's coordinates.
enum class UpAxis : std::uint8_t { X, Y, Z, MinusX, MinusY, MinusZ };

/// By its name: "x", "y", "z", "-x", "-y", "-z".
std::optional<UpAxis> up_axis(std::string_view name);
/// The same as a person writes it: "Y" and "+y", too.
std::optional<UpAxis> up_axis_written(std::string_view name);
std::string_view to_string(UpAxis up);

/// As a vector of length 1.
Vec3f direction_of(UpAxis up);

}  // namespace spectra::base
