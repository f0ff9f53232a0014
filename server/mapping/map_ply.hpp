#pragma once

#include <filesystem>
#include <string>

#include "fusion/base/error.hpp"
#include "fusion/base/progress.hpp"
#include "server/mapping/surface_mesh.hpp"

namespace spectra::mapping {

/// Writes a mesh as PLY: x, y, z, red, green, blue, and where it has any temperature also temperature (degC), temperature_sigma (kelvin)
/// and seen (seconds of the source's clock, which showed `begin_s` at the map's first moment; NaN where nothing was seen). The file appears
/// whole or not at all. `progress` is told of kWritingPhase.
base::Result<void> write_map_ply(const std::filesystem::path& file, const UnitMesh& mesh, double begin_s,
                                 const base::Progress& progress = {});

/// The same without temperature_sigma and seen, in memory: what a server takes as a block.
std::string block_ply(const UnitMesh& mesh);

}  // namespace spectra::mapping
