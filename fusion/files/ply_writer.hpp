#pragma once

#include <filesystem>
#include <iosfwd>
#include <span>
#include <string>

#include "fusion/base/error.hpp"
#include "fusion/base/progress.hpp"
#include "fusion/mesh/multispectral_mesh.hpp"

namespace spectra::files {

/// Writes binary little-endian PLY: x,y,z (double when the input was), red,green,blue from `colours` (one a vertex),
/// temperature when the mesh has one, and the triangles. Vertices keep order and number; those of the input that were left
/// out of the mesh stand in their places again, in their visible colour. A comment says what was told of the coordinates.
base::Result<void> write_ply(std::ostream& out, const mesh::MultispectralMesh& mesh,
                             std::span<const base::Rgb8> colours);

/// The same into a file that appears whole or not at all: written beside it, synced, then renamed. `comment`: a line
/// of the header, in place of what was told. `progress` is told of kWritingPhase.
base::Result<void> write_ply(const std::filesystem::path& path, const mesh::MultispectralMesh& mesh,
                             std::span<const base::Rgb8> colours, const std::string& comment = {},
                             const base::Progress& progress = {});

}  // namespace spectra::files
