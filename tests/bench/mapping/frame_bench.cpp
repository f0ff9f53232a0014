// What a whole frame takes: a depth and colour picture, the thermal pictures that come until the next one, meshing what has changed and
// making blocks of it for a server.
//
//   frame_bench FRAMES [TRUTH.ply] [--voxel M] [--threads N] [--every N] [--most N] [--from S]
//
// Threads: with the one that calls; 2 by default. --every: frames between two hand-overs, 1 by default. --most: units that are
// meshed at a time, all by default; what was too much waits for the next frame. --from: frames before so many
// seconds are mapped and not counted. Pictures are decoded beforehand. TRUTH.ply: the map is compared with it at the end.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "comparison.hpp"
#include "fusion/files/ply_reader.hpp"
#include "server/mapping/map_ply.hpp"
#include "server/mapping/mapper.hpp"
#include "tests/bench/processor_time.hpp"

using namespace spectra;
using namespace spectra::mapping;

namespace {

/// Milliseconds of each frame, by what they were for.
struct Stage {
  const char* name;
  std::vector<double> wall, processor;

  template <class Work>
  void add_to_last(const Work& work) {
    const double processor_begin = bench::cpu_ms();
    const auto begin = std::chrono::steady_clock::now();
    work();
    wall.back() += std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
    processor.back() += bench::cpu_ms() - processor_begin;
  }
  void begin_frame() {
    wall.push_back(0);
    processor.push_back(0);
  }
  void print() const {
    std::printf("%-28s %8.1f %8.1f %8.1f %8.1f\n", name, quantile(wall, 0.5), quantile(wall, 0.95),
                quantile(processor, 0.5), quantile(processor, 0.95));
  }
};

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> files;
  MapperSettings settings;
  unsigned threads = 2;
  std::size_t every = 1, most = UnitPublisher::kAll;
  double from_s = 0;
  for (int i = 1; i < argc; ++i) {
    const auto is = [&](const char* name) { return std::strcmp(argv[i], name) == 0 && i + 1 < argc; };
    if (is("--voxel"))
      settings.voxel_m = std::atof(argv[++i]);
    else if (is("--threads"))
      threads = static_cast<unsigned>(std::max(1, std::atoi(argv[++i])));
    else if (is("--every"))
      every = static_cast<std::size_t>(std::max(1, std::atoi(argv[++i])));
    else if (is("--most"))
      most = static_cast<std::size_t>(std::max(1, std::atoi(argv[++i])));
    else if (is("--from"))
      from_s = std::atof(argv[++i]);
    else
      files.emplace_back(argv[i]);
  }
  const auto folder = files.empty() ? base::Result<FrameFolder>(base::failure(base::ErrorCode::FileUnreadable,
                                                                              "usage: frame_bench FRAMES [TRUTH.ply]"))
                                    : FrameFolder::open(files[0]);
  if (!folder) {
    std::fprintf(stderr, "%s\n", folder.error().message.c_str());
    return 2;
  }
  jobs::WorkerPool pool(threads - 1);
  Mapper mapper(folder.value().calibration(), settings, pool);
  UnitPublisher publisher;
  FaultLog faults;
  const std::vector<FrameRow>& rows = folder.value().rows();
  Stage depth{"depth and colour", {}, {}}, heat{"temperature", {}, {}}, units{"changed units", {}, {}},
      hand_over{"blocks of them", {}, {}}, whole{"whole frame", {}, {}};
  const std::vector<Stage*> stages{&depth, &heat, &units, &hand_over};
  std::size_t frame_count = 0, unit_count = 0, byte_count = 0, checksum = 0;
  const auto publish = [&](double time_s) {
    std::vector<PublishedUnit> changed;
    std::vector<base::Result<std::string>> blocks;
    const Eigen::Vector3d eye = folder.value().trajectory().at(time_s).pose.translation();
    units.add_to_last([&] { changed = mapper.changed_units(publisher, eye, pool, most); });
    hand_over.add_to_last([&] { blocks = block_plys(changed, 0, pool); });
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      if (blocks[i].value().empty()) blocks[i] = block_ply(changed[i].mesh, 0);
      const std::string& block = blocks[i].value();
      byte_count += block.size();
      checksum = checksum * 31 + std::hash<std::string>()(block);
    }
    unit_count += changed.size();
  };
  for (std::size_t i = 0; i < rows.size();) {
    std::vector<Frame> frames;  // from one depth picture to the next
    do {
      frames.push_back(folder.value().load(i++, faults));
    } while (i < rows.size() && rows[i].depth.empty());
    for (Stage* stage : stages) stage->begin_frame();
    for (const Frame& frame : frames) {
      (frame.depth.empty() ? heat : depth).add_to_last([&] {
        mapper.fuse(frame, folder.value().trajectory(), faults);
      });
    }
    if (++frame_count % every == 0) publish(frames.front().time_s);
    if (frames.front().time_s - rows.front().time_s < from_s) {
      for (Stage* stage : stages) stage->wall.pop_back(), stage->processor.pop_back();
      continue;
    }
    whole.begin_frame();
    for (const Stage* stage : stages) {
      whole.wall.back() += stage->wall.back();
      whole.processor.back() += stage->processor.back();
    }
  }
  std::printf(
      "%zu frames, %u threads, %zu units told (%.1f MB, checksum %016zx), %zu blocks of voxels, %.1f bytes a voxel\n",
      frame_count, threads, unit_count, static_cast<double>(byte_count) / 1e6, checksum, mapper.map().block_count(),
      static_cast<double>(mapper.map().size_bytes()) /
          static_cast<double>(std::max<std::size_t>(1, mapper.map().block_count()) * kBlockVoxels));
  std::printf("kept of what was told of %zu units: %.1f MB\n", publisher.told_count(),
              static_cast<double>(publisher.size_bytes()) / 1e6);
  std::printf("%-28s %8s %8s %8s %8s\n", "ms a frame", "wall", "p95", "cpu", "p95");
  for (const Stage* stage : stages) stage->print();
  whole.print();
  if (files.size() < 2) return 0;
  const auto truth = files::read_ply(files[1], {});
  if (!truth) {
    std::fprintf(stderr, "%s\n", truth.error().message.c_str());
    return 1;
  }
  print_head();
  print("all", compare(mapper.whole_mesh(), truth.value().mesh));
  return 0;
}
