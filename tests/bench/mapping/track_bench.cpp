// Poses told from the map against those that are known, and the processor time that telling them takes.
//
//   track_bench FRAMES [--voxel M] [--first N] [--dark] [--no-thermal] [--verbose] [--check MM]
//   track_bench --drive [--seconds S] [--seed N] ...
//
// FRAMES: a folder whose poses are the truth; --drive: the simulated drive. --dark: no colour pictures. Each pose that was found is compared with the
// known one: as it is (the first is given), and after the rigid motion that brings all of them nearest to each other (the absolute trajectory error,
// Sturm et al., IROS 2012). How well pictures fit the map of those before tells which of both is nearer to what was seen. --check: ends with status 1 when that error is more than so many millimetres, or a frame was lost.
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "comparison.hpp"
#include "server/mapping/mapper.hpp"
#include "server/mapping/simulated_drive.hpp"
#include "tests/bench/processor_time.hpp"

using namespace spectra;
using namespace spectra::mapping;

namespace {

double root_mean_square(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b,
                        const Eigen::Isometry3d& b_from_a) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (b_from_a * a[i] - b[i]).squaredNorm();
  return a.empty() ? 0 : std::sqrt(sum / static_cast<double>(a.size()));
}

/// The rigid motion that brings `a` nearest to `b` (Horn; Umeyama).
Eigen::Isometry3d nearest(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b) {
  Eigen::Matrix3Xd from(3, static_cast<Eigen::Index>(a.size())), to(3, static_cast<Eigen::Index>(a.size()));
  for (std::size_t i = 0; i < a.size(); ++i) {
    from.col(static_cast<Eigen::Index>(i)) = a[i];
    to.col(static_cast<Eigen::Index>(i)) = b[i];
  }
  return Eigen::Isometry3d(Eigen::umeyama(from, to, false));
}

/// How well pictures fit the map of those before them.
struct Fit {
  std::size_t points = 0, matching = 0;
  double squares = 0;

  void add(const Alignment& fit) {
    points += fit.point_count;
    matching += fit.matching_count;
    squares += static_cast<double>(fit.matching_count) * fit.residual_m * fit.residual_m;
  }
  void print(const char* name) const {
    const auto count = static_cast<double>(std::max<std::size_t>(1, matching));
    std::printf("at poses that were %s %.1f %% of the points lie on the map of the pictures before, off by %.2f mm\n",
                name, 100 * count / static_cast<double>(std::max<std::size_t>(1, points)),
                1000 * std::sqrt(squares / count));
  }
};

}  // namespace

int main(int argc, char** argv) {
  DriveOptions options;
  std::string frames_folder;
  double voxel_m = 0.01, most_mm = 0;
  std::size_t most_frames = 0;
  bool is_dark = false, has_thermal = true, is_verbose = false;
  for (int i = 1; i < argc; ++i) {
    const auto is = [&](const char* name) { return std::strcmp(argv[i], name) == 0 && i + 1 < argc; };
    if (is("--seconds"))
      options.seconds = std::atof(argv[++i]);
    else if (is("--seed"))
      options.seed = static_cast<std::uint64_t>(std::atoll(argv[++i]));
    else if (is("--voxel"))
      voxel_m = std::atof(argv[++i]);
    else if (is("--first"))
      most_frames = static_cast<std::size_t>(std::atoll(argv[++i]));
    else if (is("--check"))
      most_mm = std::atof(argv[++i]);
    else if (std::strcmp(argv[i], "--dark") == 0)
      is_dark = true;
    else if (std::strcmp(argv[i], "--no-thermal") == 0)
      has_thermal = false;
    else if (std::strcmp(argv[i], "--verbose") == 0)
      is_verbose = true;
    else if (argv[i][0] != '-')
      frames_folder = argv[i];
  }
  jobs::WorkerPool pool(1);
  FaultLog faults;
  std::vector<Frame> frames;
  Calibration calibration;
  Trajectory truth;
  if (frames_folder.empty()) {
    const SimulatedDrive drive(options);
    calibration = drive.calibration();
    truth = drive.trajectory();
    frames.resize(drive.frame_count());
    pool.for_each(frames.size(), [&](std::size_t i) { frames[i] = drive.frame(i); });
  } else {
    const auto folder = FrameFolder::open(frames_folder);
    if (!folder) {
      std::fprintf(stderr, "%s\n", folder.error().message.c_str());
      return 1;
    }
    calibration = folder.value().calibration();
    truth = folder.value().trajectory();
    for (std::size_t i = 0; i < folder.value().rows().size(); ++i) frames.push_back(folder.value().load(i, faults));
  }
  if (most_frames > 0 && most_frames < frames.size()) frames.resize(most_frames);

  std::vector<double> given_ms, tracked_ms;
  Fit given_fit, tracked_fit;
  MapperSettings settings;
  settings.voxel_m = voxel_m;
  const RayTable rays(calibration.depth.camera);
  std::unique_ptr<Mapper> mapper;
  for (const bool is_tracking : {false, true}) {
    settings.is_tracking = is_tracking;
    mapper = std::make_unique<Mapper>(calibration, settings, pool);
    double waiting_ms = 0;
    for (const Frame& whole : frames) {
      Frame frame = whole;
      if (is_dark) frame.colour = {};
      if (!has_thermal) frame.thermal = {};
      const double time = frame.time_s + calibration.depth.delay_s;
      const PoseAnswer known = truth.at(time);
      if (!is_tracking && !frame.depth.empty() && known.state == PoseState::Known && mapper->map().block_count() > 0) {
        const DepthFrame depth =
            prepared_depth(frame.depth, calibration.depth, rays, kTruncationVoxels * voxel_m, pool);
        const SeenPoints seen = seen_points(depth, rays, calibration.depth.noise, voxel_m, {}, {}, {});
        given_fit.add(fit_at(mapper->map(), seen, seen.points.size(), known.pose, pool));
      }
      const double begin = bench::cpu_ms();
      mapper->fuse(frame, truth, faults);
      waiting_ms += bench::cpu_ms() - begin;
      if (frame.depth.empty()) continue;
      // With tracking thermal pictures wait for the depth picture after them; so that both are alike, they count with it without, too.
      (is_tracking ? tracked_ms : given_ms).push_back(waiting_ms);
      waiting_ms = 0;
      if (!is_tracking || mapper->last_alignment().point_count == 0) continue;
      const Alignment last = mapper->last_alignment();
      const PoseAnswer found = mapper->tracked().at(time);
      if (found.state == PoseState::Known) tracked_fit.add(last);
      if (!is_verbose) continue;
      std::printf(
          "%8.3f %s off %6.1f mm, %zu points, %zu known, %zu on the surface, sigma %.2f mm, told %.2f %%, %d rounds\n",
          time, found.state == PoseState::Known ? "found" : "lost ",
          1000 * (found.pose.translation() - known.pose.translation()).norm(), last.point_count, last.known_count,
          last.matching_count, 1000 * last.sigma_m, 100 * last.told, last.rounds);
    }
  }
  std::vector<Eigen::Vector3d> found, known;
  double length = 0;
  for (const Frame& frame : frames) {
    const double time = frame.time_s + calibration.depth.delay_s;
    if (frame.depth.empty()) continue;
    const PoseAnswer a = mapper->tracked().at(time), b = truth.at(time);
    if (a.state != PoseState::Known || b.state != PoseState::Known) continue;
    if (!known.empty()) length += (b.pose.translation() - known.back()).norm();
    found.push_back(a.pose.translation());
    known.push_back(b.pose.translation());
  }
  const double aligned = found.size() < 3 ? 0 : root_mean_square(found, known, nearest(found, known));
  const MapperFigures& figures = mapper->figures();
  std::printf("%zu poses over %.2f m, %zu found, %zu lost; residual %.1f mm\n", known.size(), length,
              figures.tracked_frames, figures.lost_frames, 1000 * figures.tracking_residual_m);
  std::printf("absolute trajectory error %.1f mm; without bringing them together %.1f mm\n", 1000 * aligned,
              1000 * root_mean_square(found, known, Eigen::Isometry3d::Identity()));
  given_fit.print("given");
  tracked_fit.print("found");
  std::printf(
      "processor time of a depth picture and the thermal ones before it: %.1f ms with known poses, %.1f ms with "
      "tracking (medians; p95 %.1f and "
      "%.1f)\n",
      quantile(given_ms, 0.5), quantile(tracked_ms, 0.5), quantile(given_ms, 0.95), quantile(tracked_ms, 0.95));
  for (const FrameFault& fault : faults.all()) {
    if (fault.count > 0) std::printf("  %s (%zu times)\n", fault.what.c_str(), fault.count);
  }
  return most_mm > 0 && (1000 * aligned > most_mm || figures.lost_frames > 0) ? 1 : 0;
}
