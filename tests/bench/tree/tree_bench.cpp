// Building the tile tree, beside meshoptimizer simplifying the same mesh once to a quarter; what it keeps in memory; what
// the root costs on the wire.
//   tree_bench [SCENE.ply] [--vertices N] [--ordered] [--threads N] [--rounds N]
// Without a scene: a generated rough terrain of N vertices (1,000,000) in random order, or row by row (--ordered; the
// simplifier is several times faster on that).

#include <meshoptimizer.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "fusion/files/ply_reader.hpp"
#include "fusion/fusion_plan.hpp"
#include "fusion/mesh/surface.hpp"
#include "server/map/scene_snapshot.hpp"
#include "server/stream/tile_encoder.hpp"
#include "server/stream/view_selection.hpp"
#include "server/stream/viewer_stream.hpp"
#include "tests/bench/processor_time.hpp"
#include "tests/unit/map/generated_scene.hpp"

namespace {

using namespace spectra;
using bench::cpu_ms;

struct Options {
  std::string path;
  std::uint32_t vertex_count = 1'000'000;
  unsigned thread_count = std::max(1u, std::thread::hardware_concurrency());
  int round_count = 1;
  bool is_ordered = false;
};

/// Time of the wall, and of all processors together: on a machine that others use the latter says more.
struct Times {
  double wall_ms = 0, cpu_ms = 0;
};

template <class Work>
Times timed(Work work) {
  const auto begin = std::chrono::steady_clock::now();
  const double cpu_begin = cpu_ms();
  work();
  return {std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count(),
          cpu_ms() - cpu_begin};
}

double resident_bytes() {
  double total = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> total >> resident;
  return resident * 4096;
}

mesh::MultispectralMesh input(const Options& options) {
  if (options.path.empty()) {
    const auto side = static_cast<std::uint32_t>(std::lround(std::sqrt(options.vertex_count)));
    return testing::terrain({.columns = side, .rows = side, .is_shuffled = !options.is_ordered});
  }
  auto loaded = files::read_ply(options.path);
  if (!loaded) {
    std::fprintf(stderr, "%s\n", loaded.error().message.c_str());
    std::exit(1);
  }
  return std::move(loaded.value().mesh);
}

Times simplify_whole_mesh(const mesh::MultispectralMesh& mesh) {
  std::vector<unsigned> indices(3 * mesh.triangle_count());
  return timed([&] {
    meshopt_simplify(indices.data(), mesh.triangles()[0].data(), indices.size(), &mesh.positions()[0].x,
                     mesh.vertex_count(), sizeof(base::Vec3f), indices.size() / 4, 1, meshopt_SimplifyLockBorder,
                     nullptr);
  });
}

void print_levels(const map::SceneSnapshot& scene) {
  std::printf("\n%-6s %6s %10s %10s %10s   %-27s %-22s %-23s %s\n", "level", "tiles", "vertices", "largest",
              "triangles", "geometric error, m", "colour error, levels", "temperature error, degC", "lost detail, m");
  for (int level = 0; level < scene.level_count(); ++level) {
    std::size_t tiles = 0, vertices = 0, largest = 0, triangles = 0;
    std::array<std::vector<float>, 4> errors;
    for (const auto& tile : scene.tiles()) {
      if (tile->id.level != level) continue;
      ++tiles;
      vertices += tile->positions.size();
      triangles += tile->triangles.size();
      largest = std::max(largest, tile->positions.size());
      if (tile->child_mask == 0) continue;
      errors[0].push_back(tile->geometric_error_m);
      errors[1].push_back(tile->colour_error_levels);
      if (!std::isnan(tile->temperature_error_celsius)) errors[2].push_back(tile->temperature_error_celsius);
      errors[3].push_back(tile->lost_detail_m);
    }
    std::printf("%-6d %6zu %10zu %10zu %10zu", level, tiles, vertices, largest, triangles);
    for (std::vector<float>& error : errors) {
      if (error.empty()) continue;
      std::sort(error.begin(), error.end());
      std::printf("   %.3g .. %.3g .. %.3g", static_cast<double>(error.front()),
                  static_cast<double>(error[error.size() / 2]), static_cast<double>(error.back()));
    }
    std::printf("\n");
  }
}

void print_wire_bytes(const map::SceneSnapshot& scene) {
  const float step = stream::lattice_step(static_cast<double>(scene.suggested_position_step_m()));
  auto settings = fusion::default_settings();
  const auto plan = fusion::FusionPlan::prepare(settings, scene.temperature()).value();
  std::size_t coarse_bytes = 0, leaf_bytes = 0;
  std::map<const map::Tile*, std::size_t> bytes_of;
  for (const auto& tile : scene.tiles()) {
    const auto geometry = stream::encoded_tile(*tile, step, 7);
    if (!geometry) {
      std::fprintf(stderr, "a tile of level %d cannot be encoded: %s\n", int{tile->id.level},
                   geometry.error().message.c_str());
      std::exit(1);
    }
    const auto colours = stream::encoded_tile_colours(*tile, geometry.value(), plan, {}, 8, 7).value();
    const std::size_t bytes = geometry.value().payload->size() + colours->size();
    if (tile->id.level == 0) {
      std::printf("\nroot on the wire (step %g m, speed 7, 8-bit colours): geometry %zu + colours %zu = %zu bytes\n",
                  static_cast<double>(step), geometry.value().payload->size(), colours->size(), bytes);
    }
    bytes_of[tile.get()] = bytes;
    (tile->child_mask == 0 ? leaf_bytes : coarse_bytes) += bytes;
  }
  std::printf("all leaves %zu bytes, all coarser tiles %zu bytes (%.2f of the leaves)\n", leaf_bytes, coarse_bytes,
              static_cast<double>(coarse_bytes) / static_cast<double>(leaf_bytes));

  // What a viewer holds who looks at the whole scene from the front, a third from above.
  const stream::ViewTree tree(scene);
  const auto& [low, high] = scene.bounds();
  const base::Vec3f centre{(low.x + high.x) / 2, (low.y + high.y) / 2, (low.z + high.z) / 2};
  const float radius = static_cast<float>(std::sqrt(mesh::squared_distance(low, high)) / 2);
  for (const auto& viewport : {std::array{900, 640}, std::array{1920, 1080}}) {
    const base::Vec3f eye{centre.x, centre.y + 0.7f * radius, centre.z + 1.5f * radius};
    const stream::Camera camera{.eye = eye, .target = centre, .up = {0, 1, 0}, .viewport = viewport};
    std::size_t bytes = 0, drawn = 0;
    for (const stream::SelectedTile& tile : stream::selected_tiles(tree, camera, 1)) {
      bytes += bytes_of.at(tree.nodes()[tile.node].tile.get());
      if (tile.is_target) drawn += tree.nodes()[tile.node].tile->positions.size();
    }
    std::printf("at rest at %d x %d: %zu bytes, %zu vertices drawn\n", viewport[0], viewport[1], bytes, drawn);
  }
}

void run(const Options& options) {
  jobs::WorkerPool pool(options.thread_count);
  std::shared_ptr<const map::SceneSnapshot> scene;
  for (int round = 0; round < options.round_count; ++round) {
    scene.reset();
    const double before = resident_bytes();
    std::optional<mesh::MultispectralMesh> mesh(input(options));
    const auto count = static_cast<double>(mesh->vertex_count());
    std::printf("%.0f vertices, %zu triangles, %u threads\n", count, mesh->triangle_count(), options.thread_count);
    Times single;
    if (!mesh->is_point_cloud()) {
      single = simplify_whole_mesh(*mesh);
      std::printf("%-42s %8.0f ms, processors %8.0f ms\n", "meshoptimizer, whole mesh to a quarter", single.wall_ms,
                  single.cpu_ms);
    }
    const Times tree =
        timed([&] { scene = map::SceneSnapshot::build(std::move(*mesh), 1, pool, 32'000, map::LevelsOfDetail::All); });
    std::printf("%-42s %8.0f ms, processors %8.0f ms\n", "cut, statistics and tile tree", tree.wall_ms, tree.cpu_ms);
    if (single.wall_ms > 0) {
      std::printf("ratio %.2f (processors %.2f)\n", tree.wall_ms / single.wall_ms, tree.cpu_ms / single.cpu_ms);
    }
    mesh.reset();
    std::printf("resident %.0f bytes a vertex beyond the program\n", (resident_bytes() - before) / count);
  }
  print_levels(*scene);
  print_wire_bytes(*scene);
}

}  // namespace

int main(int argc, char** argv) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const bool has_value = i + 1 < argc;
    if (argument == "--vertices" && has_value) {
      options.vertex_count = static_cast<std::uint32_t>(std::stoul(argv[++i]));
    } else if (argument == "--ordered") {
      options.is_ordered = true;
    } else if (argument == "--threads" && has_value) {
      options.thread_count = static_cast<unsigned>(std::stoul(argv[++i]));
    } else if (argument == "--rounds" && has_value) {
      options.round_count = std::stoi(argv[++i]);
    } else if (argument.starts_with("--") || !options.path.empty()) {
      std::fprintf(stderr, "usage: tree_bench [SCENE.ply] [--vertices N] [--ordered] [--threads N] [--rounds N]\n");
      return 2;
    } else {
      options.path = argument;
    }
  }
  run(options);
  return 0;
}
