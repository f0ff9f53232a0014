// What it costs the processor to put a block of 10,000 vertices into the middle of a live map, as dense as what is there: until
// its leaves are published, and until the coarse tiles above have followed. The maps are demo scenes of several sizes. How a block
// lies to the cells of the grid decides how many it touches, whatever the size of the map: so it is put in several places, and
// their mean is told. Which part of an edge the position step is decides, too: sizes of which one is four times the other have
// the same.
//   update_bench [--rounds N] [VERTICES ...]     (without: 100,000, 1,000,000 and 10,000,000; the last takes minutes)
// With --rate: what one of 5,041 vertices costs in all where so many a second come and coarse tiles are made meanwhile, as in the
// server, by one thread that lets all others go first, and afterwards until everything has followed. The maps are made of such blocks,
// which are replaced: one in the middle again and again, and one here, one there. All blocks that come while a coarse tile is made share
// the next one: where processors are busy otherwise it is made less often, and the figure is smaller.
//   update_bench --rate BLOCKS_PER_SECOND [--seconds S] [VERTICES ...]

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "fusion/demo/demo_scene.hpp"
#include "server/map/living_map.hpp"
#include "server/map/scene_store.hpp"
#include "tests/bench/processor_time.hpp"

namespace {

using namespace spectra;
using bench::cpu_ms;

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double ratio_of_extremes(const std::vector<double>& values) {
  const auto [least, most] = std::minmax_element(values.begin(), values.end());
  return *most / *least;
}

void add_grid_triangles(mesh::MultispectralMesh& mesh, std::uint32_t side) {
  for (std::uint32_t row = 0; row + 1 < side; ++row) {
    for (std::uint32_t column = 0; column + 1 < side; ++column) {
      const std::uint32_t a = row * side + column;
      mesh.triangles().push_back({a, a + 1, a + side});
      mesh.triangles().push_back({a + 1, a + side + 1, a + side});
    }
  }
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
  add_grid_triangles(mesh, kSide);
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

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// Makes coarse tiles from now on whenever there are some to make, at the priority that this has in the server.
class CoarseMaker {
 public:
  explicit CoarseMaker(map::SceneStore& store) : store_(store), thread_([this] { run(); }) {}
  ~CoarseMaker() { finish(); }
  CoarseMaker(const CoarseMaker&) = delete;
  CoarseMaker& operator=(const CoarseMaker&) = delete;

  void call() {
    ++calls_;
    calls_.notify_one();
  }
  /// Returns when everything is made.
  void finish() {
    is_ending_ = true;
    call();
    if (thread_.joinable()) thread_.join();
  }
  /// Of processors, and how many tiles, once it has finished.
  double spent_ms() const { return spent_ms_; }
  int made_count() const { return made_count_; }

 private:
  void run() {
    constexpr int kNiceness = 10;
    setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNiceness);
    unsigned seen = 0;
    for (bool is_last = false; !is_last;) {
      calls_.wait(seen);
      is_last = is_ending_;
      seen = calls_;
      while (store_.make_coarse()) ++made_count_;
    }
    timespec spent{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &spent);
    spent_ms_ = static_cast<double>(spent.tv_sec) * 1e3 + static_cast<double>(spent.tv_nsec) / 1e6;
  }

  map::SceneStore& store_;
  std::atomic<bool> is_ending_{false};
  std::atomic<unsigned> calls_{0};
  int made_count_ = 0;
  double spent_ms_ = 0;
  std::thread thread_;
};

/// Hilly ground that is made of blocks of 71 x 71 vertices, 2 cm apart; neighbours share those on their borders.
class Ground {
 public:
  explicit Ground(std::uint64_t vertex_count)
      : columns_(static_cast<std::uint32_t>(std::lround(std::sqrt(static_cast<double>(vertex_count))) / kSide)) {}

  std::uint32_t block_count() const { return columns_ * columns_; }
  std::uint32_t middle() const { return columns_ / 2 * columns_ + columns_ / 2; }

  map::BlockPut block(std::uint32_t number, float celsius) const {
    map::BlockPut put{.id = "block " + std::to_string(number), .scene = {}, .observed_at = {}};
    mesh::MultispectralMesh& mesh = put.scene.mesh;
    mesh.resize_vertices(std::size_t{kSide} * kSide);
    mesh.has_visible = mesh.has_temperature = true;
    for (std::uint32_t v = 0; v < kSide * kSide; ++v) {
      const float x = 0.02F * static_cast<float>(number % columns_ * (kSide - 1) + v % kSide);
      const float z = 0.02F * static_cast<float>(number / columns_ * (kSide - 1) + v / kSide);
      mesh.positions()[v] = {x, 0.1F * std::sin(5 * x) * std::cos(4 * z), z};
      mesh.visible()[v] = {static_cast<std::uint8_t>(v % 251), 90, 120};
      mesh.temperature_celsius()[v] = celsius + std::sin(static_cast<float>(v));
    }
    add_grid_triangles(mesh, kSide);
    return put;
  }

 private:
  static constexpr std::uint32_t kSide = 71;
  std::uint32_t columns_;
};

struct Pace {
  double blocks_per_s = 0;
  double seconds = 10;
};

/// Processor time of a block in all, in ms. The n-th is put where it was before, at number_of(n).
template <class NumberOf>
double cost_at(const Pace& pace, const Ground& ground, map::SceneStore& store, jobs::WorkerPool& pool,
               const char* where, std::uint32_t name_count, NumberOf number_of) {
  const auto count = static_cast<std::uint32_t>(std::lround(pace.blocks_per_s * pace.seconds));
  const double before_ms = cpu_ms();
  const Clock::time_point begin = Clock::now();
  CoarseMaker coarse(store);
  std::uint32_t change_count = 0;
  double latest_s = 0;
  for (std::uint32_t next = 0; next < count; ++change_count) {
    const double due_s = next / pace.blocks_per_s;
    std::this_thread::sleep_until(begin +
                                  std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(due_s)));
    // What waits is taken at once, one of each name.
    const auto come = static_cast<std::uint32_t>(seconds_since(begin) * pace.blocks_per_s) + 1;
    const std::uint32_t end = std::min({count, std::max(come, next + 1), next + name_count});
    map::MapChange change;
    for (; next < end; ++next) {
      change.put.push_back(ground.block(number_of(next), 24 + static_cast<float>((next / name_count) % 5)));
    }
    store.change(std::move(change), pool);
    latest_s = std::max(latest_s, seconds_since(begin) - due_s);
    coarse.call();
  }
  const double taken_s = seconds_since(begin);
  coarse.finish();
  const double cost_ms = (cpu_ms() - before_ms) / count;
  std::printf(
      "%9llu vertices, %s: %5.1f ms a block, %5.1f of them for %.2f coarse tiles; %u blocks in %u changes, %.1f a "
      "second, "
      "published after at most %.0f ms, all coarse tiles %.2f s after the last\n",
      static_cast<unsigned long long>(store.current()->vertex_count()), where, cost_ms, coarse.spent_ms() / count,
      static_cast<double>(coarse.made_count()) / count, count, change_count, count / taken_s, 1e3 * latest_s,
      seconds_since(begin) - taken_s);
  std::fflush(stdout);
  return cost_ms;
}

void measure_at(const Pace& pace, const std::vector<std::uint64_t>& counts) {
  std::vector<double> in_place, all_over;
  for (const std::uint64_t count : counts) {
    const Ground ground(count);
    jobs::WorkerPool pool(2);
    map::SceneStore store;
    map::MapChange all;
    for (std::uint32_t number = 0; number < ground.block_count(); ++number) all.put.push_back(ground.block(number, 20));
    store.change(std::move(all), pool);
    while (store.make_coarse()) {
    }
    const std::uint32_t middle = ground.middle();
    in_place.push_back(cost_at(pace, ground, store, pool, "in one place", 1, [&](std::uint32_t) { return middle; }));
    // A prime that no number of blocks has: it comes to all of them before it comes again.
    const auto elsewhere = [&](std::uint32_t n) {
      return static_cast<std::uint32_t>(std::uint64_t{n} * 7919 % ground.block_count());
    };
    all_over.push_back(cost_at(pace, ground, store, pool, "all over it ", ground.block_count(), elsewhere));
  }
  std::printf("largest / smallest, with all coarse tiles: in one place %.2f, all over the map %.2f\n",
              ratio_of_extremes(in_place), ratio_of_extremes(all_over));
}

}  // namespace

int main(int argc, char** argv) {
  int rounds = 5;
  Pace pace;
  std::vector<std::uint64_t> counts;
  for (int i = 1; i < argc; ++i) {
    const std::string option = argv[i];
    if (option == "--rounds" && i + 1 < argc) {
      rounds = std::max(2, std::atoi(argv[++i]));
    } else if (option == "--rate" && i + 1 < argc) {
      pace.blocks_per_s = std::max(0.1, std::atof(argv[++i]));
    } else if (option == "--seconds" && i + 1 < argc) {
      pace.seconds = std::max(1.0, std::atof(argv[++i]));
    } else {
      counts.push_back(std::strtoull(argv[i], nullptr, 10));
    }
  }
  if (counts.empty()) counts = {100'000, 1'000'000, 10'000'000};
  if (pace.blocks_per_s > 0) {
    measure_at(pace, counts);
    return 0;
  }
  std::vector<double> leaves, all;
  for (const std::uint64_t count : counts) {
    const Cost cost = cost_of(count, rounds);
    leaves.push_back(cost.leaves_ms);
    all.push_back(cost.leaves_ms + cost.coarse_ms);
  }
  std::printf("largest / smallest: until the leaves are published %.2f, with all coarse tiles %.2f\n",
              ratio_of_extremes(leaves), ratio_of_extremes(all));
}
