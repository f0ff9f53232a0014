#pragma once

#include <optional>
#include <span>
#include <string>

#include "fusion/base/bounds.hpp"
#include "fusion/base/up_axis.hpp"
#include "fusion/mesh/multispectral_mesh.hpp"

namespace spectra::files {

/// Which way is up as the lines "comment ..." and "obj_info ..." of a file tell it, in the ways that programs and people write it: "up y",
/// "Y-up", "Z_UP", "up axis: z", "up = -y", "up vector (0, 1, 0)", "y = elevation", "x right, y down", "gravity 0 -9.81 0", "ENU". Nothing when none
/// does, or when they do not agree.
std::optional<base::UpAxis> up_told(std::span<const std::string> comments);

/// Which way is up as the shape shows it: only for a map, a surface that is wide (300 m and more) in two directions and
/// flat in the third, with most of its area facing there. No wall is that large; anything smaller may as well be one.
/// Nothing when it shows none. `core`: of the mesh without strays.
std::optional<base::UpAxis> up_seen(const mesh::MultispectralMesh& mesh, const base::Bounds& core);

}  // namespace spectra::files
