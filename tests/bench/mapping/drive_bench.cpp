// The map of a simulated drive against the truth, and the processor time that a frame takes.
//
//   drive_bench [--seconds S] [--seed N] [--voxel M] [--vertices N] [--rules] [--check] [--pose-drift M]
//
// --pose-drift: poses are told that wander, by so many metres after a second; beside the map of them that of submaps which the true poses have moved, and that
// of the true poses.
// --rules: the same without each of the rules of the thermal model. --check: ends with status 1 when the map is far from the truth.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "comparison.hpp"
#include "server/mapping/mapper.hpp"
#include "server/mapping/simulated_drive.hpp"
#include "tests/bench/processor_time.hpp"

using namespace spectra;
using namespace spectra::mapping;

int main(int argc, char** argv) {
  mapping::DriveOptions options;
  double voxel_m = 0.01;
  bool with_rules = false, is_checked = false, is_good = true;
  for (int i = 1; i < argc; ++i) {
    const auto is = [&](const char* name) { return std::strcmp(argv[i], name) == 0 && i + 1 < argc; };
    if (is("--seconds"))
      options.seconds = std::atof(argv[++i]);
    else if (is("--seed"))
      options.seed = static_cast<std::uint64_t>(std::atoll(argv[++i]));
    else if (is("--voxel"))
      voxel_m = std::atof(argv[++i]);
    else if (is("--vertices"))
      options.vertex_count = static_cast<std::uint64_t>(std::atoll(argv[++i]));
    else if (is("--pose-drift"))
      options.pose_drift_m = std::atof(argv[++i]);
    else if (std::strcmp(argv[i], "--check") == 0)
      is_checked = true;
    else if (std::strcmp(argv[i], "--rules") == 0)
      with_rules = true;
  }
  const mapping::SimulatedDrive drive(options);
  jobs::WorkerPool pool(1);
  std::vector<mapping::Frame> frames(drive.frame_count());
  pool.for_each(frames.size(), [&](std::size_t i) { frames[i] = drive.frame(i); });

  mapping::Trajectory true_poses;
  for (double time_s = 0; time_s <= options.seconds; time_s += 0.02) true_poses.add(time_s, drive.true_pose(time_s));
  mapping::StampedPoses corrected;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (!drive.is_thermal(i)) corrected.emplace_back(drive.stamp_s(i), drive.true_pose(drive.stamp_s(i)));
  }
  const mapping::Trajectory* poses = &drive.trajectory();
  const auto run = [&](const char* name, const std::function<void(mapping::MapperSettings&)>& change) {
    mapping::MapperSettings settings;
    settings.voxel_m = voxel_m;
    change(settings);
    mapping::Mapper mapper(drive.calibration(), settings, pool);
    mapping::FaultLog faults;
    std::vector<double> depth_ms, heat_ms;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const double begin = bench::cpu_ms();
      mapper.fuse(frames[i], *poses, faults);
      (drive.is_thermal(i) ? heat_ms : depth_ms).push_back(bench::cpu_ms() - begin);
    }
    if (settings.submaps) {
      const mapping::CorrectionReport moved = mapper.correct(corrected);
      std::printf("%zu of %zu submaps moved\n", moved.moved, mapper.submap_count());
    }
    const double begin = bench::cpu_ms();
    const mapping::UnitMesh mesh = mapper.whole_mesh();
    const double mesh_ms = bench::cpu_ms() - begin;
    const Comparison found = compare(mesh, drive.truth());
    print(name, found);
    is_good = is_good && found.vertices > 10'000 && found.temperatures > found.vertices / 3 &&
              found.surface_median_m < 0.008 && found.surface_beyond_50mm < 0.02 && found.heat_mean_error < 0.5 &&
              found.within_two_sigma > 0.8;
    std::printf(
        "  processor time of all threads: depth+colour %.1f ms (p95 %.1f), heat %.1f ms (p95 %.1f), whole mesh %.0f "
        "ms, %.1f bytes a voxel, %zu "
        "blocks\n",
        quantile(depth_ms, 0.5), quantile(depth_ms, 0.95), quantile(heat_ms, 0.5), quantile(heat_ms, 0.95), mesh_ms,
        static_cast<double>(mapper.size_bytes()) /
            static_cast<double>(mapper.map().block_count() * mapping::kBlockVoxels),
        mapper.map().block_count());
    for (const mapping::FrameFault& fault : faults.all()) {
      if (fault.count > 0) std::printf("  %s (%zu times)\n", fault.what.c_str(), fault.count);
    }
  };
  print_head();
  run("all", [](mapping::MapperSettings&) {});
  if (options.pose_drift_m > 0) {
    run("corrected", [](mapping::MapperSettings& s) { s.submaps.emplace(); });
    poses = &true_poses;
    run("true poses", [](mapping::MapperSettings&) {});
  }
  if (!with_rules) return is_checked && !is_good ? 1 : 0;
  run("plain mean", [](mapping::MapperSettings& s) {
    mapping::HeatRules& r = s.heat;
    r.occlusion = r.edges = r.angle = r.weights = r.frame_offset = r.shutter = false;
    r.process_kelvin = 0;
  });
  run("without occlusion", [](mapping::MapperSettings& s) { s.heat.occlusion = false; });
  run("without edges", [](mapping::MapperSettings& s) { s.heat.edges = false; });
  run("without angle", [](mapping::MapperSettings& s) { s.heat.angle = false; });
  run("without weights", [](mapping::MapperSettings& s) { s.heat.weights = false; });
  run("without offset", [](mapping::MapperSettings& s) { s.heat.frame_offset = false; });
  run("without shutter", [](mapping::MapperSettings& s) { s.heat.shutter = false; });
  return 0;
}
