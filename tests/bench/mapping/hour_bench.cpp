// A robot that stays in one room: the memory of its map while the same places are seen again and again, with new noise each time.
//
//   hour_bench [--seconds S] [--hz N] [--voxel M] [--report-each S]
//
// A simulated drive of an hour by default, whose way takes a minute; of depth and colour twice a second by default, thermal pictures a quarter more often, half as many pixels each way. What has changed is
// meshed and told every second.
#include <malloc.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "server/mapping/map_ply.hpp"
#include "server/mapping/mapper.hpp"
#include "server/mapping/simulated_drive.hpp"

using namespace spectra;
using namespace spectra::mapping;

namespace {

double resident_mb() {
  malloc_trim(0);
  long pages = 0;
  if (FILE* file = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(file, "%*s %ld", &pages) != 1) pages = 0;
    std::fclose(file);
  }
  return static_cast<double>(pages) * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

}  // namespace

int main(int argc, char** argv) {
  DriveOptions options;
  options.seconds = 3600;
  options.depth_hz = 2;
  options.finer_than = 2;
  options.seed = 2;
  MapperSettings settings;
  settings.voxel_m = 0.02;
  double report_each_s = 300;
  for (int i = 1; i + 1 < argc; i += 2) {
    const auto is = [&](const char* name) { return std::strcmp(argv[i], name) == 0; };
    if (is("--seconds")) options.seconds = std::atof(argv[i + 1]);
    if (is("--hz")) options.depth_hz = std::atof(argv[i + 1]);
    if (is("--voxel")) settings.voxel_m = std::atof(argv[i + 1]);
    if (is("--report-each")) report_each_s = std::atof(argv[i + 1]);
  }
  options.thermal_hz = 1.25 * options.depth_hz;
  const SimulatedDrive drive(options);
  jobs::WorkerPool pool(1);
  Mapper mapper(drive.calibration(), settings, pool);
  UnitPublisher publisher;
  FaultLog faults;
  std::size_t told_units = 0;
  double next_told_s = 1, next_report_s = report_each_s;
  std::printf("%8s %10s %8s %8s %10s %10s\n", "seconds", "blocks", "map MB", "told MB", "resident", "units told");
  for (std::size_t i = 0; i < drive.frame_count(); ++i) {
    const double time_s = drive.stamp_s(i);
    mapper.fuse(drive.frame(i), drive.trajectory(), faults);
    if (time_s >= next_told_s) {
      const auto changed = mapper.changed_units(publisher, drive.true_pose(time_s).translation(), pool);
      told_units += changed.size();
      next_told_s = time_s + 1;
    }
    if (time_s >= next_report_s || i + 1 == drive.frame_count()) {
      std::printf("%8.0f %10zu %8.1f %8.1f %10.1f %10zu\n", time_s, mapper.map().block_count(),
                  static_cast<double>(mapper.size_bytes()) / 1e6, static_cast<double>(publisher.size_bytes()) / 1e6,
                  resident_mb(), told_units);
      std::fflush(stdout);
      told_units = 0;
      next_report_s += report_each_s;
    }
  }
  for (const FrameFault& fault : faults.all()) {
    if (fault.count > 0) std::printf("  %s (%zu times)\n", fault.what.c_str(), fault.count);
  }
  return 0;
}
