#include "server/mapping/surface_view.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "server/mapping/block_kernels.hpp"
#include "server/mapping/depth_fusion.hpp"
#include "server/mapping/picture_rows.hpp"
#include "server/mapping/surface_kernel.hpp"
#include "server/mapping/whole_numbers.hpp"

namespace spectra::mapping {
namespace {

constexpr float kBesideVoxels = 1.5F;  ///< What lies so near to a surface is an end of an edge that crosses it.
constexpr float kFarthest = std::numeric_limits<float>::infinity();
constexpr std::size_t kEdgeReach = 3, kHoleReach = 2;  ///< Pixels.

/// 1 where either is 1. Without captured sizes, which bytes that are written might change for all that a compiler knows.
void add_marks(const std::uint8_t* from, std::size_t count, std::uint8_t* to) {
  for (std::size_t i = 0; i < count; ++i) to[i] |= from[i];
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

std::vector<std::uint8_t> edges_of(const std::vector<float>& depth, int width, int height, float voxel_m,
                                   jobs::WorkerPool& pool) {
  const auto w = static_cast<std::size_t>(width), h = static_cast<std::size_t>(height);
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

struct Drawing {
  const VoxelMap& map;
  const CameraModel& camera;
  const KernelCamera& kernel;

  /// Finds the voxels of a block beside its surface and draws them into a picture.
  void draw(std::int32_t index, std::vector<SurfaceVoxel>& out, std::vector<float>& depth_m) const {
    const auto voxel_m = static_cast<float>(map.voxel_m());
    constexpr auto kTruncation = static_cast<float>(kTruncationVoxels);
    const float beside = std::floor(kBesideVoxels / kTruncation * kDistanceOne);
    SeenVoxels seen;
    see_voxels(kernel, map.voxels(index), kernel.view.corner(map.head(index).at), voxel_m, beside,
               kTruncation * voxel_m / kDistanceOne, seen);
    const std::size_t first = out.size();
    out.resize(first + seen.count);
    for (std::size_t i = 0; i < seen.count; ++i) {
      out[first + i] = {
          index, static_cast<std::uint16_t>(seen.voxel[i]), false, seen.u[i], seen.v[i], seen.z_m[i], seen.cosine[i]};
      if (seen.off_m[i] <= voxel_m) draw_square(seen, i, depth_m);  // else the surface is drawn by those next to it
    }
  }

  /// The plane of the surface through the pixels that a voxel covers; beyond twice its size it is no longer the surface.
  void draw_square(const SeenVoxels& seen, std::size_t i, std::vector<float>& depth_m) const {
    const float u = seen.u[i], v = seen.v[i], z = seen.z_m[i], half = seen.half[i];
    const float reach = 2 * static_cast<float>(map.voxel_m());
    const int left = std::max(0, ceil_of(u - half)), right = std::min(camera.width - 1, floor_of(u + half)),
              top = std::max(0, ceil_of(v - half)), bottom = std::min(camera.height - 1, floor_of(v + half));
    for (int row = top; row <= bottom; ++row) {
      float* pixels = &depth_m[static_cast<std::size_t>(row) * static_cast<std::size_t>(camera.width)];
      const float of_row = (static_cast<float>(row) - v) * seen.per_v[i];
      for (int column = left; column <= right; ++column) {
        const float slope = of_row + (static_cast<float>(column) - u) * seen.per_u[i];
        pixels[column] = std::min(pixels[column], z + std::clamp(slope, -reach, reach));
      }
    }
  }
};

}  // namespace

SurfaceView draw_surfaces(const VoxelMap& map, const CameraModel& camera, const Eigen::Isometry3d& world_from_camera,
                          jobs::WorkerPool& pool) {
  SurfaceView drawn;
  const KernelCamera kernel(camera, world_from_camera, map.voxel_m());
  const BlockView& view = kernel.view;
  const Lens& lens = kernel.lens;
  const auto voxel_m = static_cast<float>(map.voxel_m());
  const float radius_m = 0.87F * kBlockEdge * voxel_m;
  std::vector<std::int32_t> blocks;
  for (const MapUnit& unit : map.units()) {
    const GridPlace middle{unit.at.x * kUnitBlocks + 2, unit.at.y * kUnitBlocks + 2, unit.at.z * kUnitBlocks + 2};
    if (!view.is_before(middle, 5 * radius_m, lens, camera)) continue;
    for (const std::int32_t block : unit.blocks) {
      if (block < 0 || !map.head(block).has_surface) continue;
      if (view.is_before(map.head(block).at, 2 * radius_m, lens, camera)) blocks.push_back(block);
    }
  }
  std::sort(blocks.begin(), blocks.end());
  drawn.depth_m.assign(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height), kFarthest);

  const Drawing drawing{map, camera, kernel};
  constexpr std::size_t kChunk = 64, kUsual = 200;  // Voxels of a block.
  const std::size_t chunks = (blocks.size() + kChunk - 1) / kChunk;
  drawn.voxels.resize(chunks);
  // Each thread draws into a picture of its own; the nearest of all is the same whoever has drawn what.
  std::vector<std::vector<float>> pictures(
      std::min<std::size_t>(pool.thread_count() + 1, std::max<std::size_t>(1, chunks)));
  std::atomic<std::size_t> next_chunk{0};
  pool.for_each(pictures.size(), [&](std::size_t picture) {
    pictures[picture].assign(drawn.depth_m.size(), kFarthest);
    for (std::size_t chunk = next_chunk++; chunk < chunks; chunk = next_chunk++) {
      const std::size_t end = std::min(blocks.size(), (chunk + 1) * kChunk);
      drawn.voxels[chunk].reserve(kUsual * kChunk);
      for (std::size_t i = chunk * kChunk; i < end; ++i)
        drawing.draw(blocks[i], drawn.voxels[chunk], pictures[picture]);
    }
  });
  for (const std::vector<float>& picture : pictures) {
    for (std::size_t i = 0; i < picture.size(); ++i) drawn.depth_m[i] = std::min(drawn.depth_m[i], picture[i]);
  }
  drawn.is_near_edge = edges_of(drawn.depth_m, camera.width, camera.height, voxel_m, pool);

  pool.for_each(chunks, [&](std::size_t chunk) {
    for (SurfaceVoxel& seen : drawn.voxels[chunk]) {
      const int x = floor_of(seen.u + 0.5F), y = floor_of(seen.v + 0.5F);
      if (x < 0 || y < 0 || x >= camera.width || y >= camera.height) continue;
      const float before = drawn.depth_m[static_cast<std::size_t>(y) * static_cast<std::size_t>(camera.width) +
                                         static_cast<std::size_t>(x)];
      // A square lies across the line of sight whatever its surface does: what is askew has more depth within a voxel.
      const float c = std::max(seen.cosine, 0.1F);
      seen.is_reached = seen.z_m < before + voxel_m * (1.5F + 1.5F * std::sqrt(1 - c * c) / c);
    }
  });
  return drawn;
}

}  // namespace spectra::mapping
