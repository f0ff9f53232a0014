#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <future>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "fusion/files/output_file.hpp"
#include "server/app/command_output.hpp"
#include "server/app/commands.hpp"
#include "server/app/frame_faults.hpp"
#include "server/app/interruption.hpp"
#include "server/app/progress_line.hpp"
#include "server/app/unit_sender.hpp"
#include "server/jobs/worker_pool.hpp"
#include "server/mapping/frame_folder.hpp"
#include "server/mapping/map_ply.hpp"
#include "server/mapping/mapper.hpp"

namespace spectra::app {
namespace {

constexpr std::string_view kMappingPhase = "mapping";

struct LoadedFrame {
  mapping::Frame frame;
  mapping::FaultLog faults;
};

/// The frames of a folder in order, each read while the one before is fused.
class FrameReader {
 public:
  explicit FrameReader(const mapping::FrameFolder& folder) : folder_(folder) { begin(0); }

  LoadedFrame take(std::size_t row) {
    LoadedFrame loaded = next_.get();
    if (row + 1 < folder_.rows().size()) begin(row + 1);
    return loaded;
  }

 private:
  void begin(std::size_t row) {
    next_ = std::async(std::launch::async, [this, row] {
      LoadedFrame loaded;
      loaded.frame = folder_.load(row, loaded.faults);
      return loaded;
    });
  }

  const mapping::FrameFolder& folder_;
  std::future<LoadedFrame> next_;
};

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at = static_cast<std::size_t>(share * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(at), values.end());
  return values[at];
}

base::Result<void> save_poses(const std::filesystem::path& file, const mapping::Trajectory& poses) {
  const std::string text = poses.to_text();
  BOOST_OUTCOME_TRY(auto out, files::OutputFile::create(file));
  BOOST_OUTCOME_TRYV(out.write(std::as_bytes(std::span(text))));
  return out.commit();
}

void print_figures(const mapping::Mapper& mapper, const mapping::UnitMesh& mesh, const std::vector<double>& frame_ms,
                   double seconds) {
  const mapping::MapperFigures& figures = mapper.figures();
  fmt::print("frames       {} of depth, {} of colour, {} of temperature", figures.depth_frames, figures.colour_frames,
             figures.thermal_frames);
  if (figures.frozen_frames > 0) fmt::print(", {} of a closed shutter left out", figures.frozen_frames);
  if (figures.tracked_frames + figures.lost_frames > 0) {
    fmt::print("\ntracking     {} poses found, {:.1f} mm off the map; {} lost", figures.tracked_frames,
               1000 * figures.tracking_residual_m, figures.lost_frames);
  }
  fmt::print("\nmap          {} blocks of 8 x 8 x 8 voxels, {:.1f} MB, {:.1f} bytes a voxel\n",
             mapper.map().block_count(), static_cast<double>(mapper.size_bytes()) / 1e6,
             static_cast<double>(mapper.size_bytes()) /
                 static_cast<double>(std::max<std::size_t>(1, mapper.map().block_count() * mapping::kBlockVoxels)));
  fmt::print("mesh         {} vertices, {} triangles\n", mesh.positions.size(), mesh.triangles.size());
  std::vector<double> sigmas;
  for (const float sigma : mesh.sigma_kelvin) {
    if (!std::isnan(sigma)) sigmas.push_back(static_cast<double>(sigma));
  }
  if (!sigmas.empty()) {
    fmt::print(
        "temperature  {:.1f} % of the vertices, sigma {:.2f} K in the middle, {:.2f} K at 95 %; drift taken out: up to "
        "{:.2f} K\n",
        100.0 * static_cast<double>(sigmas.size()) / static_cast<double>(mesh.positions.size()), quantile(sigmas, 0.5),
        quantile(sigmas, 0.95), figures.largest_offset_kelvin);
  }
  fmt::print("time         {:.1f} s; a frame {:.0f} ms in the middle, {:.0f} ms at 95 %\n", seconds,
             quantile(frame_ms, 0.5), quantile(frame_ms, 0.95));
}

}  // namespace

int run_map(const MapOptions& options) {
  using Clock = std::chrono::steady_clock;
  const Interruption interruption;
  if (options.output.empty() && options.to.empty()) {
    return fail(kWrongUsage, "name a file to write (OUT.ply), a server to send to (--to URL), or both");
  }
  if (!options.output.empty() && options.output.extension() != ".ply")
    return fail(kWrongUsage, options.output.string() + ": the output must end in .ply");
  if (!options.output.empty()) {
    if (const auto is_writable = files::OutputFile::check(options.output); !is_writable)
      return fail(is_writable.error());
  }
  std::optional<UnitSender> sender;
  if (!options.to.empty()) {
    auto opened = UnitSender::to(options.to, options.token_file);
    if (const auto* wrong = std::get_if<std::string>(&opened)) return fail(kWrongUsage, *wrong);
    sender.emplace(std::get<UnitSender>(std::move(opened)));
  }
  const auto begin = Clock::now();
  auto folder = mapping::FrameFolder::open(options.frames, options.poses, !options.is_tracking);
  if (!folder) return fail(folder.error());
  const unsigned threads = options.thread_count > 0 ? options.thread_count : std::thread::hardware_concurrency();
  jobs::WorkerPool pool(std::max(2U, threads) - 1);  // this one works as well
  mapping::MapperSettings settings;
  settings.voxel_m = options.voxel_m;
  settings.is_tracking = options.is_tracking;
  mapping::FaultLog faults = folder.value().faults();
  mapping::StampedPoses corrected;
  if (options.corrected_poses) {
    auto poses = folder.value().read_poses(*options.corrected_poses, faults);
    if (!poses) return fail(poses.error());
    corrected = poses.value().stamped();
    settings.submaps.emplace();
  }
  mapping::Mapper mapper(folder.value().calibration(), settings, pool);
  if (options.vignetting) {
    auto picture = mapping::read_pfm(*options.vignetting);
    if (!picture) return fail(picture.error());
    if (const auto fits = mapper.set_vignetting(std::move(picture).value()); !fits) return fail(fits.error());
  }

  const std::size_t count = folder.value().rows().size();
  ProgressLine line({{kMappingPhase, "mapping " + options.frames.filename().string(), static_cast<double>(count)},
                     {mapping::Mapper::kMeshingPhase, "meshing", 10},
                     {base::kWritingPhase, "writing " + options.output.filename().string(), 5}});
  const base::Progress progress = line.sink();
  std::vector<double> frame_ms;
  std::size_t moved_count = 0;
  FrameReader reader(folder.value());
  for (std::size_t row = 0; row < count; ++row) {
    const LoadedFrame loaded = reader.take(row);
    faults.add(loaded.faults);
    const auto before = Clock::now();
    mapper.fuse(loaded.frame, folder.value().trajectory(), faults);
    frame_ms.push_back(std::chrono::duration<double, std::milli>(Clock::now() - before).count());
    const bool is_last = row + 1 == count;
    if (is_last && options.corrected_poses) moved_count = mapper.correct(corrected).moved;
    if (sender) {
      const mapping::Trajectory& poses = options.is_tracking ? mapper.tracked() : folder.value().trajectory();
      const auto problem = sender->send_changes(mapper, poses.at(loaded.frame.time_s), is_last, pool);
      if (problem) return fail(kJobFailed, *problem);
    }
    base::report(progress, kMappingPhase, static_cast<double>(row + 1) / static_cast<double>(count));
  }
  const std::string nothing_written = sender && sender->sent_count() > 0
                                          ? "no file was written, and " + std::to_string(sender->sent_count()) +
                                                " units of the map stay where they were sent"
                                          : "nothing was written";
  if (options.corrected_poses && moved_count == 0) {
    line.end();
    print_faults(faults);
    return fail(kJobFailed, options.corrected_poses->string() +
                                ": none of its poses differs from what the map was made with, at a time when there "
                                "were frames; " +
                                nothing_written);
  }
  const mapping::UnitMesh mesh = mapper.whole_mesh(progress);
  if (mesh.triangles.empty()) {
    line.end();
    print_faults(faults);
    return fail(kJobFailed, options.frames.string() + ": none of its frames gives a surface; " + nothing_written);
  }
  const auto written = options.output.empty()
                           ? base::Result<void>(base::success())
                           : mapping::write_map_ply(options.output, mesh, mapper.begin_s(), progress);
  line.end();
  print_faults(faults);
  if (!written) return fail(written.error());
  if (options.found_poses) {
    const auto saved = save_poses(*options.found_poses, mapper.tracked());
    if (!saved) return fail(saved.error());
  }
  if (sender) {
    fmt::print("sent         {} units, {} of them again, {} refused\n", sender->sent_count(), sender->again_count(),
               sender->refused_count());
  }
  if (options.corrected_poses) fmt::print("submaps      {}, {} of them moved\n", mapper.submap_count(), moved_count);
  print_figures(mapper, mesh, frame_ms, std::chrono::duration<double>(Clock::now() - begin).count());
  return kDone;
}

}  // namespace spectra::app
