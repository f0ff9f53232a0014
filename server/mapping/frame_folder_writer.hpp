#pragma once

#include <filesystem>

#include "fusion/error.hpp"
#include "fusion/progress.hpp"
#include "server/mapping/simulated_drive.hpp"
#include "server/scene/worker_pool.hpp"

namespace spectra::mapping {

/// Writes a drive as a folder that FrameFolder reads, with the truth beside it: truth.ply (surfaces, colours, temperatures) and
/// true_poses.txt. frames.txt comes last, so that a folder that was not finished is not taken for one. The folder is made when it is not
/// there; one that holds frames is refused. `progress` is told of kWritingPhase.
fusion::Result<void> write_drive(const std::filesystem::path& folder, const SimulatedDrive& drive,
                                 server::WorkerPool& pool, const fusion::Progress& progress = {});

}  // namespace spectra::mapping
