#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <string>
#include <thread>

#include "server/app/command_output.hpp"
#include "server/app/commands.hpp"
#include "server/app/frame_faults.hpp"
#include "server/app/interruption.hpp"
#include "server/app/progress_line.hpp"
#include "server/jobs/worker_pool.hpp"
#include "server/mapping/thermal_delay.hpp"
#include "server/mapping/vignetting.hpp"

namespace spectra::app {
namespace {

constexpr std::size_t kMostDepthFrames = 200, kMostThermalPictures = 240;

unsigned helpers(unsigned thread_count) {
  return std::max(2U, thread_count > 0 ? thread_count : std::thread::hardware_concurrency()) - 1;
}

std::string no_thermal_camera(const std::filesystem::path& frames) {
  return frames.string() + ": calibration.json has no thermal camera";
}

}  // namespace

int run_calibrate_delay(const CalibrateOptions& options) {
  const Interruption interruption;
  auto folder = mapping::FrameFolder::open(options.frames);
  if (!folder) return fail(folder.error());
  const auto& thermal = folder.value().calibration().thermal;
  if (!thermal) return fail(kJobFailed, no_thermal_camera(options.frames));
  jobs::WorkerPool pool(helpers(options.thread_count));
  ProgressLine line({{mapping::kSurfacePhase, "finding the surface", 10},
                     {mapping::kThermalPhase, "reading thermal pictures", 5},
                     {mapping::kDelayPhase, "trying delays", 20}});
  mapping::FaultLog faults = folder.value().faults();
  const auto points = mapping::surface_of(folder.value(), options.voxel_m, kMostDepthFrames, pool, faults, line.sink());
  const auto pictures = mapping::thermal_pictures(folder.value(), kMostThermalPictures, faults, line.sink());
  const auto found = mapping::find_thermal_delay(points, pictures, *thermal, folder.value().trajectory(),
                                                 {options.within_s, thermal->delay_s}, pool, line.sink());
  line.end();
  print_faults(faults);
  if (!found) return fail(kJobFailed, options.frames.string() + ": " + found.error().message);
  const mapping::ThermalDelay& delay = found.value();
  fmt::print("seen         {} points {} times, in {} thermal pictures\n", delay.point_count, delay.look_count,
             delay.picture_count);
  fmt::print("residual     {:.3f} K; {:.3f} K in the middle over the delays that were tried\n", delay.residual_kelvin,
             delay.typical_residual_kelvin);
  fmt::print("delay        {:+.1f} ms, standard error {:.1f} ms; calibration.json says {:+.1f} ms\n",
             1000 * delay.delay_s, 1000 * delay.sigma_s, 1000 * thermal->delay_s);
  fmt::print("in calibration.json, under \"thermal\":\n  \"delay_s\": {:.4f}\n", delay.delay_s);
  return kDone;
}

int run_calibrate_vignetting(const CalibrateOptions& options) {
  const Interruption interruption;
  if (options.output.extension() != ".pfm")
    return fail(kWrongUsage, options.output.string() + ": the output must end in .pfm");
  auto folder = mapping::FrameFolder::open(options.frames);
  if (!folder) return fail(folder.error());
  const auto& thermal = folder.value().calibration().thermal;
  if (!thermal) return fail(kJobFailed, no_thermal_camera(options.frames));
  jobs::WorkerPool pool(helpers(options.thread_count));
  ProgressLine line({{mapping::kSurfacePhase, "finding the surface", 10},
                     {mapping::kThermalPhase, "reading thermal pictures", 5},
                     {mapping::kVignettingPhase, "comparing pictures", 10}});
  mapping::FaultLog faults = folder.value().faults();
  const auto points = mapping::surface_of(folder.value(), options.voxel_m, kMostDepthFrames, pool, faults, line.sink());
  const auto pictures = mapping::thermal_pictures(folder.value(), kMostThermalPictures, faults, line.sink());
  const auto found =
      mapping::find_vignetting(points, pictures, *thermal, folder.value().trajectory(), pool, line.sink());
  line.end();
  print_faults(faults);
  if (!found) return fail(kJobFailed, options.frames.string() + ": " + found.error().message);
  const mapping::Vignetting& vignetting = found.value();
  const auto written = mapping::write_pfm(options.output, vignetting.picture);
  if (!written) return fail(written.error());
  const auto [low, high] = std::minmax_element(vignetting.picture.pixels.begin(), vignetting.picture.pixels.end());
  fmt::print("seen         {} points {} times, in {} thermal pictures, over {:.0f} % of their area\n",
             vignetting.point_count, vignetting.look_count, vignetting.picture_count, 100 * vignetting.covered);
  fmt::print("residual     {:.3f} K without it, {:.3f} K with it\n", vignetting.residual_before_kelvin,
             vignetting.residual_after_kelvin);
  fmt::print("vignetting   {:+.2f} to {:+.2f} K, root mean square {:.2f} K, standard error {:.2f} K\n",
             static_cast<double>(*low), static_cast<double>(*high), vignetting.spread_kelvin, vignetting.sigma_kelvin);
  return kDone;
}

}  // namespace spectra::app
