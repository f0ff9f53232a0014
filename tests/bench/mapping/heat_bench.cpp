// What each rule of the thermal model buys on a folder of frames, against a mesh whose temperatures are known.
//
//   heat_bench FRAMES REFERENCE.ply [--scale METRES_PER_UNIT] [--vignetting FILE.pfm] [--voxel M] [--only NAME]
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "comparison.hpp"
#include "fusion/files/ply_reader.hpp"
#include "server/mapping/mapper.hpp"

using namespace spectra;
using namespace spectra::mapping;

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: heat_bench FRAMES REFERENCE.ply [--scale S] [--vignetting FILE] [--voxel M]\n");
    return 2;
  }
  files::ReadOptions read;
  std::optional<mapping::PictureFloat> vignetting;
  double voxel_m = 0.01;
  std::string only;
  for (int i = 3; i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--scale") == 0) read.metres_per_unit = std::atof(argv[i + 1]);
    if (std::strcmp(argv[i], "--voxel") == 0) voxel_m = std::atof(argv[i + 1]);
    if (std::strcmp(argv[i], "--only") == 0) only = argv[i + 1];
    if (std::strcmp(argv[i], "--vignetting") == 0) vignetting = mapping::read_pfm(argv[i + 1]).value();
  }
  const auto folder = mapping::FrameFolder::open(argv[1]);
  const auto reference = files::read_ply(argv[2], read);
  if (!folder || !reference) {
    std::fprintf(stderr, "%s\n", (folder ? reference.error() : folder.error()).message.c_str());
    return 1;
  }
  mapping::FaultLog faults;
  jobs::WorkerPool pool(1);

  const auto run = [&](const char* name, bool with_vignetting, const std::function<void(mapping::HeatRules&)>& change) {
    if (!only.empty() && only != name) return;
    mapping::MapperSettings settings;
    settings.voxel_m = voxel_m;
    settings.use_colour = false;
    change(settings.heat);
    mapping::Mapper mapper(folder.value().calibration(), settings, pool);
    if (with_vignetting && !mapper.set_vignetting(*vignetting)) std::exit(1);
    for (std::size_t i = 0; i < folder.value().rows().size(); ++i) {
      mapper.fuse(folder.value().load(i, faults), folder.value().trajectory(), faults);
    }
    print(name, compare(mapper.whole_mesh(), reference.value().mesh));
  };
  const auto plain = [](mapping::HeatRules& r) {
    r.occlusion = r.edges = r.angle = r.weights = r.frame_offset = r.shutter = false;
    r.process_kelvin = 0;
  };
  print_head();
  run("plain mean of everything", false, plain);
  run(" and occlusion", false, [&](mapping::HeatRules& r) { plain(r), r.occlusion = true; });
  run(" and angle and edges", false, [&](mapping::HeatRules& r) { plain(r), r.occlusion = r.edges = r.angle = true; });
  run(" and one offset a frame", false,
      [&](mapping::HeatRules& r) { plain(r), r.occlusion = r.edges = r.angle = r.frame_offset = true; });
  run(" and the weights", false,
      [&](mapping::HeatRules& r) { plain(r), r.occlusion = r.edges = r.angle = r.frame_offset = r.weights = true; });
  run("all", false, [](mapping::HeatRules&) {});
  run("all without offset", false, [](mapping::HeatRules& r) { r.frame_offset = false; });
  run("all without occlusion", false, [](mapping::HeatRules& r) { r.occlusion = false; });
  run("all without edges", false, [](mapping::HeatRules& r) { r.edges = false; });
  run("all without weights", false, [](mapping::HeatRules& r) { r.weights = false; });
  run("all without process noise", false, [](mapping::HeatRules& r) { r.process_kelvin = 0; });
  if (vignetting) {
    run("all, vignetting", true, [](mapping::HeatRules&) {});
    run("all, vignetting, no process noise", true, [](mapping::HeatRules& r) { r.process_kelvin = 0; });
  }
  return 0;
}
