#pragma once

#include <span>
#include <string>
#include <string_view>

#include "fusion/files/read_options.hpp"
#include "fusion/mesh/multispectral_mesh.hpp"

namespace spectra::files {

inline constexpr std::string_view kMetres = "metres";

struct LengthUnit {
  std::string_view name;    ///< Plural.
  std::string_view metres;  ///< In one of it.
};

/// By its name, of those that ToldCoordinates has but metres; or nullptr.
const LengthUnit* length_unit(std::string_view name);

/// What the lines "comment ..." and "obj_info ..." say of up and of the unit of positions as they are read: where the options
/// say something, it is that; positions that were scaled are in metres.
mesh::ToldCoordinates told_coordinates(std::span<const std::string> comments, const ReadOptions& options);

/// The same as one line, without "comment", from which told_coordinates() reads it again; empty when there is nothing to say.
std::string comment_of(const mesh::ToldCoordinates& told);

}  // namespace spectra::files
