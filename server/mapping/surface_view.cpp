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
constexpr int kEdgeReach = 3, kHoleReach = 2;

/// 1 where any value within `reach` is 1, along both axes.
std::vector<std::uint8_t> widened(const std::vector<std::uint8_t>& mask, int width, int height, int reach,
                                  jobs::WorkerPool& pool) {
  const auto w = static_cast<std::size_t>(width), h = static_cast<std::size_t>(height);
  std::vector<std::uint8_t> across(mask.size(), 0), both(mask.size(), 0);
  const auto n = static_cast<std::size_t>(reach);
  for_each_row(h, pool, [&](std::size_t y) {
    const std::uint8_t* from = &mask[y * w];
    std::uint8_t* to = &across[y * w];
    std::size_t until = 0;  // one past the last pixel that some 1 covers
    for (std::size_t x = 0; x < w + n; ++x) {
      if (x < w && from[x] != 0) until = x + 2 * n + 1;
      if (x >= n && x < until) to[x - n] = 1;
    }
  });
  for_each_row(h, pool, [&](std::size_t y) {
    const std::size_t low = y >= n ? y - n : 0, high = std::min(h - 1, y + n);
    std::uint8_t* to = &both[y * w];
    for (std::size_t row = low; row <= high; ++row) {
      const std::uint8_t* from = &across[row * w];
      for (std::size_t x = 0; x < w; ++x) to[x] |= from[x];
    }
  });
  return both;
}

std::vector<std::uint8_t> edges_of(const std::vector<float>& depth, int width, int height, float voxel_m,
                                   jobs::WorkerPool& pool) {
  const auto w = static_cast<std::size_t>(width), h = static_cast<std::size_t>(height);
  std::vector<std::uint8_t> jumps(depth.size(), 0), something(depth.size(), 0);
  for (std::size_t i = 0; i < depth.size(); ++i) something[i] = depth[i] < kFarthest ? 1 : 0;
  // Nothing counts where it is more than a gap between the squares that were drawn.
  const std::vector<std::uint8_t> covered = widened(something, width, height, kHoleReach, pool);
  // 1 / z is linear over a plane, however askew it is: what it bends by, as a depth, is a jump.
  for_each_row(h, pool, [&, all = depth.data()](std::size_t y) {
    const auto bend = [all](std::size_t before, std::size_t i, std::size_t after) {
      if (all[before] == kFarthest || all[after] == kFarthest) return 0.0F;
      const float z = all[i];
      return z * z * std::abs(1 / all[before] + 1 / all[after] - 2 / z);
    };
    for (std::size_t x = 0; x < w; ++x) {
      const std::size_t i = y * w + x;
      const float z = all[i];
      if (z == kFarthest) continue;
      const float most =
          std::max(x > 0 && x + 1 < w ? bend(i - 1, i, i + 1) : 0, y > 0 && y + 1 < h ? bend(i - w, i, i + w) : 0);
      if (most > std::max(3 * voxel_m, 0.02F * z)) jumps[i] = 1;
    }
  });
  std::vector<std::uint8_t> near = widened(jumps, width, height, kEdgeReach, pool);
  std::vector<std::uint8_t> nothing(depth.size());
  for (std::size_t i = 0; i < depth.size(); ++i) nothing[i] = covered[i] == 0 ? 1 : 0;
  const std::vector<std::uint8_t> beside = widened(nothing, width, height, kHoleReach + kEdgeReach, pool);
  for (std::size_t i = 0; i < near.size(); ++i) near[i] |= beside[i];
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
    for (std::size_t i = 0; i < seen.count; ++i) {
      out.push_back(
          {index, static_cast<std::uint16_t>(seen.voxel[i]), false, seen.u[i], seen.v[i], seen.z_m[i], seen.cosine[i]});
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
