#pragma once

#include <span>
#include <string>

#include "fusion/error.hpp"
#include "fusion/mesh/multispectral_mesh.hpp"
#include "fusion/vertex_types.hpp"

namespace spectra::server {

/// The bytes of a binary glTF 2.0 file with one mesh: POSITION, COLOR_0 (normalised bytes, opaque), _TEMPERATURE when
/// the mesh has temperature, and triangles or points. TooLarge when a buffer would pass the 4 GiB of the format.
fusion::Result<std::string> glb_file(const fusion::MultispectralMesh& mesh, std::span<const fusion::Rgb8> colours);

}  // namespace spectra::server
