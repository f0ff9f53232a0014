// What rounding positions leaves of the form of scenes, and what their geometry weighs beside one step for all of it.
//   form_bench [--seeds N] SCENE.ply...

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "fusion/files/ply_reader.hpp"
#include "fusion/files/scene_survey.hpp"
#include "server/map/scene_store.hpp"
#include "server/stream/tile_encoder.hpp"
#include "server/stream/viewer_stream.hpp"
#include "tests/unit/stream/form.hpp"

namespace {

using namespace spectra;

void measure(const std::string& path, std::size_t seed_count) {
  auto loaded = files::read_ply(path);
  const std::string name = path.substr(path.find_last_of('/') + 1);
  if (!loaded) {
    std::printf("%-30s refused\n", name.c_str());
    return;
  }
  files::survey(loaded.value());
  jobs::WorkerPool pool(2);
  map::SceneStore scenes;
  const auto scene = scenes.replace(std::move(loaded).value(), pool, map::LevelsOfDetail::All);
  std::size_t root_bytes = 0, leaf_bytes = 0, bytes = 0, uniform_bytes = 0, uniform_leaf_bytes = 0;
  for (const auto& tile : scene->tiles()) {
    const auto geometry = stream::encoded_tile(*tile, scene->suggested_position_step_m(), 7);
    if (!geometry) {
      std::printf("%s: %s\n", name.c_str(), geometry.error().message.c_str());
      std::exit(1);
    }
    const std::size_t size = geometry.value().payload->size();
    map::Tile uniform = *tile;
    uniform.step_halvings.clear();
    const std::size_t uniform_size =
        stream::encoded_tile(uniform, scene->suggested_position_step_m(), 7).value().payload->size();
    bytes += size;
    uniform_bytes += uniform_size;
    if (tile->child_mask == 0) {
      leaf_bytes += size;
      uniform_leaf_bytes += uniform_size;
    }
    if (tile == scene->tiles().front()) root_bytes = size;
  }
  const stream::testing::FormReport form = stream::testing::form_of(*scene, seed_count);
  std::printf(
      "%-30s step %-11.6g geometry: leaves %8zu (%.3f of one step) all %8zu (%.3f) root %6zu | pieces %5zu: flattened "
      "%zu, "
      "merged %zu | "
      "patches %6zu: flattened %zu, merged %zu, worst side %.3f | torn %zu\n",
      name.c_str(), static_cast<double>(scene->suggested_position_step_m()), leaf_bytes,
      static_cast<double>(leaf_bytes) / static_cast<double>(uniform_leaf_bytes), bytes,
      static_cast<double>(bytes) / static_cast<double>(uniform_bytes), root_bytes, form.piece_count,
      form.flattened_piece_count, form.merged_piece_count, form.patch_count, form.flattened_patch_count,
      form.merged_patch_count, form.worst_side_change, form.torn_count);
}

}  // namespace

int main(int argc, char** argv) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  std::size_t seed_count = 20'000;
  std::vector<std::string> paths;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--seeds" && i + 1 < argc) {
      seed_count = std::stoul(argv[++i]);
    } else {
      paths.push_back(argument);
    }
  }
  if (paths.empty()) {
    std::fprintf(stderr, "usage: form_bench [--seeds N] SCENE.ply...\n");
    return 2;
  }
  for (const std::string& path : paths) measure(path, seed_count);
  return 0;
}
