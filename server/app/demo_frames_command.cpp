#include <algorithm>
#include <string>
#include <thread>

#include "server/app/command_output.hpp"
#include "server/app/commands.hpp"
#include "server/app/interruption.hpp"
#include "server/app/progress_line.hpp"
#include "server/jobs/worker_pool.hpp"
#include "server/mapping/frame_folder_writer.hpp"
#include "server/mapping/simulated_drive.hpp"

namespace spectra::app {

int run_demo_frames(const DemoFramesOptions& options) {
  const Interruption interruption;
  ProgressLine line({{base::kModellingPhase, "modelling the demo office", 2},
                     {base::kWritingPhase, "driving through it", options.seconds}});
  mapping::DriveOptions drive_options;
  drive_options.seconds = options.seconds;
  drive_options.seed = options.seed;
  drive_options.pose_drift_m = options.pose_drift_m;
  drive_options.clock_offset_s = options.clock_offset_s;
  const mapping::SimulatedDrive drive(drive_options, line.sink());
  jobs::WorkerPool pool(std::max(2U, std::thread::hardware_concurrency()) - 1);
  const auto written = mapping::write_drive(options.folder, drive, pool, line.sink());
  line.end();
  return written ? kDone : fail(written.error());
}

}  // namespace spectra::app
