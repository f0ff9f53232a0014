#pragma once

#include <filesystem>

#include "fusion/base/error.hpp"
#include "fusion/base/progress.hpp"
#include "server/jobs/worker_pool.hpp"
#include "server/mapping/simulated_drive.hpp"

namespace spectra::mapping {

/// Writes a drive as a folder that FrameFolder reads, with the truth beside it: truth.ply (surfaces, colours, temperatures) and
/// true_poses.txt. frames.txt comes last, so that a folder that was not finished is not taken for one. The folder is made when it is not
/// there; one that holds frames is refused. `progress` is told of kWritingPhase.
base::Result<void> write_drive(const std::filesystem::path& folder, const SimulatedDrive& drive, jobs::WorkerPool& pool,
                               const base::Progress& progress = {});

}  // namespace spectra::mapping
