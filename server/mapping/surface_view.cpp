#include "server/mapping/surface_view.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "server/mapping/block_kernels.hpp"
#include "server/mapping/depth_fusion.hpp"
#include "server/mapping/picture_rows.hpp"
#include "server/mapping/surface_kernel.hpp"

namespace spectra::mapping {
namespace {

constexpr float kBesideVoxels = 1.5F;  ///< What lies so near to a surface is an end of an edge that crosses it.
constexpr float kFarthest = std::numeric_limits<float>::infinity();
constexpr std::size_t kEdgeReach = 3, kHoleReach = 2;  ///< Pixels.

/// 1 where either is 1. Without captured sizes, which bytes that are written might change for all that a compiler knows.
void add_marks(const std::uint8_t* from, std::size_t count, std::uint8_t* to) {
  for (std::size_t i = 0; i < count; ++i) to[i] |= from[i];
}

void take_nearer(const float* from, std::size_t count, float* to) {
  for (std::size_t i = 0; i < count; ++i) to[i] = from[i] < to[i] ? from[i] : to[i];
}

/// 1 where any value within `reach` is 1, along both axes.
std::vector<std::uint8_t> widened(const std::vector<std::uint8_t>& mask, std::size_t width, std::size_t height,
                                  std::size_t reach, jobs::WorkerPool& pool) {
  std::vector<std::uint8_t> across = mask, both(mask.size(), 0);
  for_each_row(height, pool, [&](std::size_t y) {
    const std::uint8_t* from = &mask[y * width];
    std::uint8_t* to = &across[y * width];
    for (std::size_t step = 1; step <= std::min(reach, width - 1); ++step) {
      add_marks(from + step, width - step, to);
      add_marks(from, width - step, to + step);
    }
  });
  for_each_row(height, pool, [&](std::size_t y) {
    const std::size_t low = y >= reach ? y - reach : 0, high = std::min(height - 1, y + reach);
    for (std::size_t row = low; row <= high; ++row) add_marks(&across[row * width], width, &both[y * width]);
  });
  return both;
}

/// 1 / z is linear over a plane, however askew it is: what it bends by from one neighbour to the other, as a depth, is a jump. `before`, `here` and `after` are
/// 1 / z of the pixels of a row and of those beside them on both sides, 0 where there is nothing.
void mark_jumps(const float* depth_m, const float* before, const float* here, const float* after, std::size_t count,
                float least_m, std::uint8_t* jumps) {
  for (std::size_t i = 0; i < count; ++i) {
    const float z = depth_m[i];
    const float bend = z * z * std::abs(before[i] + after[i] - 2 * here[i]);
    const float most = std::max(least_m, 0.02F * z);
    // Infinite and 0 make what is no number, and that is not larger.
    const bool is_jump = (bend > most) & (z < kFarthest) & (before[i] > 0) & (after[i] > 0);
    jumps[i] |= static_cast<std::uint8_t>(is_jump);
  }
}

}  // namespace

std::vector<std::uint8_t> edges_of(const std::vector<float>& depth, const CameraModel& camera, float voxel_m,
                                   jobs::WorkerPool& pool) {
  const auto w = static_cast<std::size_t>(camera.width), h = static_cast<std::size_t>(camera.height);
  std::vector<std::uint8_t> jumps(depth.size(), 0), something(depth.size());
  std::vector<float> inverse(depth.size());
  for_each_row(h, pool, [&](std::size_t y) {
    for (std::size_t i = y * w; i < (y + 1) * w; ++i) inverse[i] = 1 / depth[i];
    for (std::size_t i = y * w; i < (y + 1) * w; ++i) something[i] = depth[i] < kFarthest ? 1 : 0;
  });
  // Nothing counts where it is more than a gap between the squares that were drawn.
  std::vector<std::uint8_t> nothing = widened(something, w, h, kHoleReach, pool);
  for (std::uint8_t& mark : nothing) mark ^= 1;
  for_each_row(h, pool, [&](std::size_t y) {
    const float* here = &inverse[y * w];
    if (w > 2) mark_jumps(&depth[y * w + 1], here, here + 1, here + 2, w - 2, 3 * voxel_m, &jumps[y * w + 1]);
    if (y > 0 && y + 1 < h) mark_jumps(&depth[y * w], here - w, here, here + w, w, 3 * voxel_m, &jumps[y * w]);
  });
  std::vector<std::uint8_t> near = widened(jumps, w, h, kEdgeReach, pool);
  const std::vector<std::uint8_t> beside = widened(nothing, w, h, kHoleReach + kEdgeReach, pool);
  add_marks(beside.data(), beside.size(), near.data());
  return near;
}

SurfaceView draw_surfaces(const VoxelMap& map, const CameraModel& camera, const Eigen::Isometry3d& world_from_camera,
                          jobs::WorkerPool& pool, SurfaceView view) {
  const KernelCamera kernel(camera, world_from_camera, map.voxel_m());
  const auto voxel_m = static_cast<float>(map.voxel_m());
  const float radius_m = 0.87F * kBlockEdge * voxel_m;
  std::vector<std::int32_t> blocks;
  for (const MapUnit& unit : map.units()) {
    const GridPlace middle{unit.at.x * kUnitBlocks + 2, unit.at.y * kUnitBlocks + 2, unit.at.z * kUnitBlocks + 2};
    if (!kernel.view.is_before(middle, 5 * radius_m, kernel.lens, camera)) continue;
    for (const std::int32_t block : unit.blocks) {
      if (block < 0 || !map.head(block).has_surface) continue;
      if (kernel.view.is_before(map.head(block).at, 2 * radius_m, kernel.lens, camera)) blocks.push_back(block);
    }
  }
  std::sort(blocks.begin(), blocks.end());

  constexpr std::size_t kChunk = 64;
  constexpr auto kTruncation = static_cast<float>(kTruncationVoxels);
  const float beside = std::floor(kBesideVoxels / kTruncation * kDistanceOne);
  const std::size_t chunks = (blocks.size() + kChunk - 1) / kChunk;
  if (view.voxels.size() < chunks) view.voxels.resize(chunks);
  for (SeenVoxels& seen : view.voxels) seen.clear();
  // Each thread draws into a picture of its own; the nearest of all is the same whoever has drawn what.
  view.drawn_m.resize(std::min<std::size_t>(pool.thread_count() + 1, std::max<std::size_t>(1, chunks)));
  std::atomic<std::size_t> next_chunk{0};
  pool.for_each(view.drawn_m.size(), [&](std::size_t picture) {
    std::vector<float>& drawn_m = view.drawn_m[picture];
    drawn_m.assign(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height), kFarthest);
    for (std::size_t chunk = next_chunk++; chunk < chunks; chunk = next_chunk++) {
      SeenVoxels& seen = view.voxels[chunk];
      const std::size_t end = std::min(blocks.size(), (chunk + 1) * kChunk);
      for (std::size_t i = chunk * kChunk; i < end; ++i) {
        const std::size_t before = seen.count;
        see_voxels(kernel, map.voxels(blocks[i]), kernel.view.corner(map.head(blocks[i]).at), voxel_m, beside,
                   kTruncation * voxel_m / kDistanceOne, seen, drawn_m.data());
        if (seen.count > before) seen.blocks.push_back({blocks[i], seen.count});
      }
    }
  });
  view.depth_m = view.drawn_m[0];
  for (std::size_t picture = 1; picture < view.drawn_m.size(); ++picture) {
    take_nearer(view.drawn_m[picture].data(), view.depth_m.size(), view.depth_m.data());
  }
  return view;
}

}  // namespace spectra::mapping
