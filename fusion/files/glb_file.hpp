#pragma once

#include <span>
#include <string>

#include "fusion/base/error.hpp"
#include "fusion/base/vertex_types.hpp"
#include "fusion/mesh/multispectral_mesh.hpp"

namespace spectra::files {

/// Stands for a missing temperature in a GLB: colder than anything can be.
inline constexpr float kGlbMissingCelsius = -1000;

/// The bytes of a binary glTF 2.0 file with one mesh: POSITION, COLOR_0, _TEMPERATURE when the mesh has temperature, and
/// triangles or points. `up` is the mesh's upward direction, along one of its axes; the file is turned to have +Y up as
/// glTF wants it, exactly, by exchanging coordinates. COLOR_0 is linear, as glTF wants it: normalised unsigned shorts,
/// opaque, each the nearest to the sRGB channel's linear value, so that a viewer shows the colour that went in. TooLarge
/// when a buffer would pass the 4 GiB of the format.
base::Result<std::string> glb_file(const mesh::MultispectralMesh& mesh, std::span<const base::Rgb8> colours,
                                   base::Vec3f up);

}  // namespace spectra::files
