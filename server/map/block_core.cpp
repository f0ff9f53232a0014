#include "server/map/block_core.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>

#include "fusion/base/distance_text.hpp"
#include "fusion/mesh/surface.hpp"

namespace spectra::map {
namespace {

/// At most so large a part of the vertices may be left out.
constexpr std::uint64_t kFewOfVertices = 10;
/// Scattered blocks that are no part of anything large: nobody looks further.
constexpr int kMostSeeds = 8;

struct Part {
  const std::string* name;
  base::Bounds box;
  std::uint64_t vertex_count;
};

double distance(const base::Bounds& a, const base::Bounds& b) {
  const auto gap = [](float low, float high, float its_low, float its_high) {
    return std::max({0.0, double{its_low} - double{high}, double{low} - double{its_high}});
  };
  return std::hypot(gap(a.min.x, a.max.x, b.min.x, b.max.x), gap(a.min.y, a.max.y, b.min.y, b.max.y),
                    gap(a.min.z, a.max.z, b.min.z, b.max.z));
}

double diagonal(const base::Bounds& box) {
  return std::sqrt(mesh::squared_distance(box.min, box.max));
}

void include(base::Bounds& box, const base::Bounds& other) {
  base::include(box, other.min);
  base::include(box, other.max);
}

/// A heap of blocks: the first, and all that is near it, near those, and so on. It stands before the rest then.
struct Heap {
  base::Bounds box;
  std::size_t block_count = 1;
  std::uint64_t vertex_count = 0;
};

Heap gathered(std::span<Part> parts) {
  Heap heap{parts[0].box, 1, parts[0].vertex_count};
  for (bool has_grown = true; has_grown;) {
    // Two passes make the diagonal longer by a factor of 1.4 at least, or nothing is taken in any more.
    const double reach = diagonal(heap.box);
    has_grown = false;
    for (std::size_t i = heap.block_count; i < parts.size(); ++i) {
      if (distance(heap.box, parts[i].box) > std::max(reach, diagonal(parts[i].box))) continue;
      include(heap.box, parts[i].box);
      heap.vertex_count += parts[i].vertex_count;
      std::swap(parts[heap.block_count++], parts[i]);
      has_grown = true;
    }
  }
  return heap;
}

files::Note note_of(std::span<const Part> left_out, const base::Bounds& core) {
  double farthest_m = 0;
  const std::string* first = left_out.front().name;
  for (const Part& part : left_out) {
    farthest_m = std::max(farthest_m, distance(core, part.box));
    if (*part.name < *first) first = part.name;
  }
  const bool is_one = left_out.size() == 1;
  return {
      "stray_blocks", left_out.size(),
      (is_one ? "Block " + *first + " lies" : std::to_string(left_out.size()) + " blocks lie (" + *first + " is one)") +
          " far from everything else, up to " + base::distance_text(farthest_m) +
          " away: " + (is_one ? "it stays" : "they stay") + " in the map, and views are fitted to the rest"};
}

}  // namespace

BlockCore core_of(const BlocksByName& blocks) {
  std::vector<Part> parts;
  std::uint64_t vertex_count = 0;
  for (const auto& [name, block] : blocks) {
    if (!block->core_bounds) continue;
    parts.push_back({&name, *block->core_bounds, block->facts.vertex_count});
    vertex_count += block->facts.vertex_count;
  }
  if (parts.empty()) return {};
  std::stable_sort(parts.begin(), parts.end(),
                   [](const Part& a, const Part& b) { return a.vertex_count > b.vertex_count; });
  BlockCore core{parts[0].box, std::nullopt};
  for (const Part& part : parts) include(*core.bounds, part.box);
  const std::uint64_t needed = vertex_count - vertex_count / kFewOfVertices;
  std::vector<Part> passed;
  std::uint64_t remaining = vertex_count;
  for (int seed = 0; seed < kMostSeeds && remaining >= needed && !parts.empty(); ++seed) {
    const Heap heap = gathered(parts);
    const auto end = parts.begin() + static_cast<std::ptrdiff_t>(heap.block_count);
    if (heap.vertex_count >= needed) {
      passed.insert(passed.end(), end, parts.end());
      if (passed.empty()) return core;
      return {heap.box, note_of(passed, heap.box)};
    }
    remaining -= heap.vertex_count;
    passed.insert(passed.end(), parts.begin(), end);
    parts.erase(parts.begin(), end);
  }
  return core;
}

}  // namespace spectra::map
