#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "fusion/base/error.hpp"
#include "fusion/base/progress.hpp"
#include "server/jobs/worker_pool.hpp"
#include "server/mapping/surface_mesh.hpp"
#include "server/mapping/unit_publisher.hpp"

namespace spectra::mapping {

/// Writes a mesh as PLY: x, y, z, red, green, blue, and where it has any temperature also temperature (degC), temperature_sigma (kelvin)
/// and seen (seconds of the source's clock, which showed `begin_s` at the map's first moment; NaN where nothing was seen). The file appears
/// whole or not at all. `progress` is told of kWritingPhase.
base::Result<void> write_map_ply(const std::filesystem::path& file, const UnitMesh& mesh, double begin_s,
                                 const base::Progress& progress = {});

/// The same in memory: what a server takes as a block. `begin_unix_s`: when the map's first moment was, Unix seconds. Inconsistent where the mesh
/// has fewer values of a kind than vertices.
base::Result<std::string> block_ply(const UnitMesh& mesh, double begin_unix_s);

/// The same of units, by all threads of a pool; empty for one without a surface.
std::vector<base::Result<std::string>> block_plys(std::span<const PublishedUnit> units, double begin_unix_s,
                                                  jobs::WorkerPool& pool);

/// When a map's first moment was on the clock of this machine, Unix seconds: `begin_s` where the source counts so, else what makes
/// `newest_s` of the source now.
double unix_begin_s(double begin_s, double newest_s, double now_unix_s);

}  // namespace spectra::mapping
