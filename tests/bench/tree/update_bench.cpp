// What it costs the processor to put a block of 10,000 vertices into the middle of a live map, as dense as what is there: until
// its leaves are published, and until the coarse tiles above have followed. The maps are demo scenes of several sizes. How a block
// lies to the cells of the grid decides how many it touches, whatever the size of the map: so it is put in several places, and
// their mean is told. Which part of an edge the position step is decides, too: sizes of which one is four times the other have
// the same.
//   update_bench [--rounds N] [VERTICES ...]     (without: 100,000, 1,000,000 and 10,000,000; the last takes minutes)

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

#include "fusion/demo/demo_scene.hpp"
#include "server/map/living_map.hpp"
#include "tests/bench/processor_time.hpp"

namespace {

using namespace spectra;
using bench::cpu_ms;

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// A bumpy patch of 10,000 vertices, `extent` metres wide around `middle`.
map::BlockPut patch(const base::Vec3f& middle, float extent, float celsius) {
  constexpr std::uint32_t kSide = 100;
  map::BlockPut put{.id = "patch", .scene = {}, .observed_at = {}};
  mesh::MultispectralMesh& mesh = put.scene.mesh;
  mesh.resize_vertices(std::size_t{kSide} * kSide);
  mesh.has_visible = mesh.has_temperature = true;
  for (std::uint32_t v = 0; v < kSide * kSide; ++v) {
    const float x = static_cast<float>(v % kSide) / kSide - 0.5F, z = static_cast<float>(v / kSide) / kSide - 0.5F;
    mesh.positions()[v] = {middle.x + extent * x, middle.y + extent * 0.05F * std::sin(9 * x) * std::cos(7 * z),
                           middle.z + extent * z};
    mesh.visible()[v] = {static_cast<std::uint8_t>(v % 251), 90, 120};
    mesh.temperature_celsius()[v] = celsius + std::sin(static_cast<float>(v));
  }
  for (std::uint32_t row = 0; row + 1 < kSide; ++row) {
    for (std::uint32_t column = 0; column + 1 < kSide; ++column) {
      const std::uint32_t a = row * kSide + column;
      mesh.triangles().push_back({a, a + 1, a + kSide});
      mesh.triangles().push_back({a + 1, a + kSide + 1, a + kSide});
    }
  }
  return put;
}

struct Cost {
  double leaves_ms = 0, coarse_ms = 0;
};

Cost cost_of(std::uint64_t vertex_count, int rounds) {
  jobs::WorkerPool pool(2);
  map::LivingMap map(
      {.levels = map::LevelsOfDetail::All, .leaf_vertex_count = map::kLiveLeafVertexCount, .first_level = 12});
  std::uint32_t revision = 0;
  std::vector<map::BlockPut> whole(1);
  whole[0].id = "scene";
  whole[0].scene.mesh = demo::demo_scene({.vertex_count = vertex_count});
  map.apply({.put = std::move(whole), .removed = {}}, ++revision, pool);
  // As dense as the scene, whose vertices are about 12 m / sqrt(their number) apart.
  const float extent = 100 * 12 / std::sqrt(static_cast<float>(vertex_count));
  constexpr int kPlaces = 7;
  Cost cost;
  std::vector<double> leaves_of_places;
  std::size_t tile_count = 0, coarse_count = 0;
  for (int place = 0; place < kPlaces; ++place) {
    // Steps that are no part of any cell.
    const float by = extent * 0.377F * static_cast<float>(place);
    std::vector<double> leaves, coarse;
    for (int round = 0; round < rounds; ++round) {
      std::vector<map::BlockPut> block;
      block.push_back(patch({by, 1.2F, 0.5F + 0.7F * by}, extent, 24 + static_cast<float>(round % 5)));
      const double before = cpu_ms();
      tile_count = map.apply({.put = std::move(block), .removed = {}}, ++revision, pool)->tiles().size();
      const double between = cpu_ms();
      std::size_t count = 0;
      while (auto work = map.next_coarse()) {
        work->run();
        map.take_coarse(*work, ++revision);
        ++count;
      }
      if (round == 0) continue;  // It comes from elsewhere, and is not replaced.
      coarse_count += count;
      leaves.push_back(between - before);
      coarse.push_back(cpu_ms() - between);
    }
    leaves_of_places.push_back(median(leaves));
    cost.leaves_ms += leaves_of_places.back() / kPlaces;
    cost.coarse_ms += median(coarse) / kPlaces;
  }
  const auto [least, most] = std::minmax_element(leaves_of_places.begin(), leaves_of_places.end());
  std::printf("%9llu vertices, %4zu tiles: leaves %6.1f ms (by place %.0f to %.0f), %.1f coarse tiles %7.1f ms\n",
              static_cast<unsigned long long>(vertex_count), tile_count, cost.leaves_ms, *least, *most,
              static_cast<double>(coarse_count) / (kPlaces * (rounds - 1)), cost.coarse_ms);
  std::fflush(stdout);
  return cost;
}

}  // namespace

int main(int argc, char** argv) {
  int rounds = 5;
  std::vector<std::uint64_t> counts;
  for (int i = 1; i < argc; ++i) {
    if (std::string(argv[i]) == "--rounds" && i + 1 < argc) {
      rounds = std::max(2, std::atoi(argv[++i]));
    } else {
      counts.push_back(std::strtoull(argv[i], nullptr, 10));
    }
  }
  if (counts.empty()) counts = {100'000, 1'000'000, 10'000'000};
  std::vector<double> leaves, all;
  for (const std::uint64_t count : counts) {
    const Cost cost = cost_of(count, rounds);
    leaves.push_back(cost.leaves_ms);
    all.push_back(cost.leaves_ms + cost.coarse_ms);
  }
  const auto ratio = [](const std::vector<double>& values) {
    const auto [least, most] = std::minmax_element(values.begin(), values.end());
    return *most / *least;
  };
  std::printf("largest / smallest: until the leaves are published %.2f, with all coarse tiles %.2f\n", ratio(leaves),
              ratio(all));
}
