// Depth, colour and temperature into voxels beside what Open3D's ScalableTSDFVolume (its legacy volume) does with depth and colour alone: the
// same frames and true poses of a simulated drive, the two in turns, frame by frame, in one run.
//
//   OMP_NUM_THREADS=1 peer_bench [--seconds S] [--seed N] [--voxel M] [--threads N]
//
// Milliseconds are processor time, in the mean. Threads of ours beside the one that calls: 1 by default, the fewest. Open3D is to be told one (its threads wait for each other busily, which counts). Its pictures are made beforehand. Bytes are those that
// malloc has given out for each. Complete is the share of the true surface's vertices that have a vertex of the map within one voxel, and within two.
#include <malloc.h>
#include <open3d/geometry/Image.h>
#include <open3d/geometry/KDTreeFlann.h>
#include <open3d/geometry/PointCloud.h>
#include <open3d/geometry/RGBDImage.h>
#include <open3d/pipelines/integration/ScalableTSDFVolume.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <numeric>
#include <vector>

#include "comparison.hpp"
#include "server/mapping/mapper.hpp"
#include "server/mapping/simulated_drive.hpp"
#include "tests/bench/processor_time.hpp"

using namespace spectra;
using namespace spectra::mapping;
namespace peer = open3d::geometry;

namespace {

struct Cost {
  std::vector<double> ms;
  double bytes = 0;

  template <class Work>
  void of(const Work& work) {
    const auto held = [] {
      const struct mallinfo2 info = mallinfo2();
      return static_cast<double>(info.uordblks) + static_cast<double>(info.hblkhd);
    };
    const double held_before = held(), begin = bench::cpu_ms();
    work();
    ms.push_back(bench::cpu_ms() - begin);
    bytes += held() - held_before;
  }
};

peer::RGBDImage rgbd_of(const Frame& frame, double unit_m) {
  constexpr float kFarthest_m = 6;  // As far as the simulated camera sees.
  peer::RGBDImage image;
  image.depth_.Prepare(frame.depth.width, frame.depth.height, 1, 4);
  auto* depth = image.depth_.PointerAs<float>();
  for (std::size_t i = 0; i < frame.depth.pixels.size(); ++i) {
    const auto z = static_cast<float>(frame.depth.pixels[i] * unit_m);
    depth[i] = z < kFarthest_m ? z : 0;
  }
  image.color_.Prepare(frame.colour.width, frame.colour.height, 3, 1);
  std::memcpy(image.color_.data_.data(), frame.colour.pixels.data(), image.color_.data_.size());
  return image;
}

double mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) /
         static_cast<double>(std::max<std::size_t>(1, values.size()));
}

/// Share of the vertices of the truth that a map has reached, percent.
double complete(const std::vector<Eigen::Vector3d>& map, const mesh::MultispectralMesh& truth, double within_m) {
  peer::PointCloud cloud;
  cloud.points_ = map;
  const peer::KDTreeFlann tree(cloud);
  std::size_t reached = 0;
  std::vector<int> indices;
  std::vector<double> squared;
  for (const base::Vec3f& p : truth.positions()) {
    const Eigen::Vector3d at(static_cast<double>(p.x) + truth.origin.x, static_cast<double>(p.y) + truth.origin.y,
                             static_cast<double>(p.z) + truth.origin.z);
    if (tree.SearchHybrid(at, within_m, 1, indices, squared) > 0) ++reached;
  }
  return 100 * static_cast<double>(reached) / static_cast<double>(truth.positions().size());
}

}  // namespace

int main(int argc, char** argv) {
  DriveOptions options;
  options.seconds = 20;
  MapperSettings settings;
  unsigned threads = 1;  // Beside the one that calls.
  for (int i = 1; i + 1 < argc; i += 2) {
    const auto is = [&](const char* name) { return std::strcmp(argv[i], name) == 0; };
    if (is("--seconds")) options.seconds = std::atof(argv[i + 1]);
    if (is("--seed")) options.seed = static_cast<std::uint64_t>(std::atoll(argv[i + 1]));
    if (is("--voxel")) settings.voxel_m = std::atof(argv[i + 1]);
    if (is("--threads")) threads = static_cast<unsigned>(std::max(1, std::atoi(argv[i + 1])));
  }
  const SimulatedDrive drive(options);
  const CameraModel& camera = drive.calibration().depth.camera;
  const open3d::camera::PinholeCameraIntrinsic lens(camera.width, camera.height, camera.fx, camera.fy, camera.cx,
                                                    camera.cy);
  jobs::WorkerPool pool(threads);
  Mapper mapper(drive.calibration(), settings, pool);
  FaultLog faults;
  open3d::pipelines::integration::ScalableTSDFVolume volume(settings.voxel_m, 4 * settings.voxel_m,
                                                            open3d::pipelines::integration::TSDFVolumeColorType::RGB8);
  Trajectory true_poses;
  for (double time_s = 0; time_s <= options.seconds; time_s += 0.02) true_poses.add(time_s, drive.true_pose(time_s));

  Cost ours, depth_alone, of_peer;
  double since_depth_ms = 0;
  for (std::size_t i = 0; i < drive.frame_count(); ++i) {
    const Frame frame = drive.frame(i);
    ours.of([&] { mapper.fuse(frame, true_poses, faults); });
    if (drive.is_thermal(i)) {  // Of the depth picture before it.
      since_depth_ms += ours.ms.back();
      ours.ms.pop_back();
      continue;
    }
    depth_alone.ms.push_back(ours.ms.back());
    if (ours.ms.size() > 1) ours.ms[ours.ms.size() - 2] += since_depth_ms;
    since_depth_ms = 0;
    const peer::RGBDImage image = rgbd_of(frame, drive.calibration().depth.unit_m);
    const Eigen::Matrix4d from_world = drive.true_pose(frame.time_s).inverse().matrix();
    of_peer.of([&] { volume.Integrate(image, lens, from_world); });
  }

  const UnitMesh mesh = mapper.whole_mesh();
  std::vector<Eigen::Vector3d> vertices;
  for (const base::Vec3f& p : mesh.positions) vertices.emplace_back(p.x, p.y, p.z);
  const std::shared_ptr<peer::PointCloud> cloud = volume.ExtractPointCloud();
  UnitMesh of_cloud;
  for (const Eigen::Vector3d& p : cloud->points_) {
    of_cloud.positions.push_back({static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())});
  }
  of_cloud.celsius.resize(of_cloud.positions.size(), std::numeric_limits<float>::quiet_NaN());
  of_cloud.sigma_kelvin = of_cloud.celsius;

  for (const FrameFault& fault : faults.all()) {
    if (fault.count > 0) std::printf("  %s (%zu times)\n", fault.what.c_str(), fault.count);
  }
  if (mapper.figures().depth_frames != of_peer.ms.size()) return 1;
  const double ours_ms = mean(ours.ms), depth_ms = mean(depth_alone.ms), peer_ms = mean(of_peer.ms);
  std::printf("%zu depth pictures, voxels of %g cm, %u threads and the one that calls\n", of_peer.ms.size(),
              100 * settings.voxel_m, threads);
  std::printf("%-34s %10s %9s %10s %6s\n", "", "ms a frame", "MB", "complete", "");
  const auto print_cost = [&](const char* name, double ms, double bytes, const std::vector<Eigen::Vector3d>& map) {
    std::printf("%-34s %10.1f %9.1f %9.2f%% %5.2f%%\n", name, ms, bytes / 1e6,
                complete(map, drive.truth(), settings.voxel_m), complete(map, drive.truth(), 2 * settings.voxel_m));
  };
  print_cost("depth, colour and temperature", ours_ms, ours.bytes, vertices);
  std::printf("%-34s %10.1f\n", "  of it depth and colour", depth_ms);
  print_cost("Open3D, depth and colour", peer_ms, of_peer.bytes, cloud->points_);
  std::printf("%-34s %10.2f %9.2f\n", "share", ours_ms / peer_ms, ours.bytes / of_peer.bytes);
  print_head();
  print("map", compare(mesh, drive.truth()));
  print("Open3D", compare(of_cloud, drive.truth()));
  return 0;
}
