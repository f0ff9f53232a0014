#include "server/mapping/surface_view.hpp"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <limits>

#include "server/mapping/block_view.hpp"
#include "server/mapping/depth_fusion.hpp"

namespace spectra::mapping {
namespace {

constexpr float kNearest = 0.1F;
constexpr float kBesideVoxels = 1.5F;  ///< What lies so near to a surface is an end of an edge that crosses it.
constexpr float kFarthest = std::numeric_limits<float>::infinity();
constexpr int kEdgeReach = 3, kHoleReach = 2;

/// Positive floats are ordered as their bits are.
void keep_nearest(float& depth, float z) {
  const std::atomic_ref<std::uint32_t> bits(reinterpret_cast<std::uint32_t&>(depth));  // NOLINT
  const auto mine = std::bit_cast<std::uint32_t>(z);
  std::uint32_t held = bits.load(std::memory_order_relaxed);
  while (mine < held && !bits.compare_exchange_weak(held, mine, std::memory_order_relaxed)) {
  }
}

/// Half the difference across a voxel along one axis, or the whole one to the neighbour that is in the block.
float slope(const VoxelBlock& block, std::size_t voxel, int at, std::size_t stride) {
  const std::size_t low = at > 0 && block.weight[voxel - stride] > 0 ? voxel - stride : voxel;
  const std::size_t high = at + 1 < kBlockEdge && block.weight[voxel + stride] > 0 ? voxel + stride : voxel;
  const float difference = static_cast<float>(block.distance[high]) - static_cast<float>(block.distance[low]);
  return high - low == 2 * stride ? 0.5F * difference : difference;
}

/// 1 where any value within `reach` is 1, along both axes.
std::vector<std::uint8_t> widened(const std::vector<std::uint8_t>& mask, int width, int height, int reach) {
  const auto w = static_cast<std::size_t>(width), h = static_cast<std::size_t>(height);
  std::vector<std::uint8_t> across(mask.size(), 0), both(mask.size(), 0);
  const auto n = static_cast<std::size_t>(reach);
  for (std::size_t y = 0; y < h; ++y) {
    std::size_t until = 0;  // one past the last pixel that some 1 covers
    for (std::size_t x = 0; x < w + n; ++x) {
      if (x < w && mask[y * w + x] != 0) until = x + 2 * n + 1;
      if (x >= n && x < until) across[y * w + x - n] = 1;
    }
  }
  for (std::size_t y = 0; y < h; ++y) {
    const std::size_t low = y >= n ? y - n : 0, high = std::min(h - 1, y + n);
    for (std::size_t row = low; row <= high; ++row) {
      for (std::size_t x = 0; x < w; ++x) both[y * w + x] |= across[row * w + x];
    }
  }
  return both;
}

std::vector<std::uint8_t> edges_of(const std::vector<float>& depth, int width, int height, float voxel_m) {
  const auto w = static_cast<std::size_t>(width), h = static_cast<std::size_t>(height);
  std::vector<std::uint8_t> jumps(depth.size(), 0), something(depth.size(), 0);
  for (std::size_t i = 0; i < depth.size(); ++i) something[i] = depth[i] < kFarthest ? 1 : 0;
  // Nothing counts where it is more than a gap between the squares that were drawn.
  const std::vector<std::uint8_t> covered = widened(something, width, height, kHoleReach);
  // 1 / z is linear over a plane, however askew it is: what it bends by, as a depth, is a jump.
  const auto bend = [&](std::size_t before, std::size_t i, std::size_t after) {
    if (depth[before] == kFarthest || depth[after] == kFarthest) return 0.0F;
    const float z = depth[i];
    return z * z * std::abs(1 / depth[before] + 1 / depth[after] - 2 / z);
  };
  for (std::size_t y = 0; y < h; ++y) {
    for (std::size_t x = 0; x < w; ++x) {
      const std::size_t i = y * w + x;
      const float z = depth[i];
      if (z == kFarthest) continue;
      const float most =
          std::max(x > 0 && x + 1 < w ? bend(i - 1, i, i + 1) : 0, y > 0 && y + 1 < h ? bend(i - w, i, i + w) : 0);
      if (most > std::max(3 * voxel_m, 0.02F * z)) jumps[i] = 1;
    }
  }
  std::vector<std::uint8_t> near = widened(jumps, width, height, kEdgeReach);
  std::vector<std::uint8_t> nothing(depth.size());
  for (std::size_t i = 0; i < depth.size(); ++i) nothing[i] = covered[i] == 0 ? 1 : 0;
  const std::vector<std::uint8_t> beside = widened(nothing, width, height, kHoleReach + kEdgeReach);
  for (std::size_t i = 0; i < near.size(); ++i) near[i] |= beside[i];
  return near;
}

struct Drawing {
  const VoxelMap& map;
  const CameraModel& camera;
  const BlockView& view;
  const Lens& lens;
  std::vector<float>& depth_m;

  /// Finds the voxels of a block beside its surface and draws them.
  void draw(std::int32_t index, std::vector<SurfaceVoxel>& out) const {
    const VoxelBlock& block = map.voxels(index);
    const auto voxel_m = static_cast<float>(map.voxel_m());
    const float beside = kBesideVoxels / static_cast<float>(kTruncationVoxels) * kDistanceOne;
    const float metres = static_cast<float>(kTruncationVoxels) * voxel_m / kDistanceOne;
    const auto corner = view.corner(map.head(index).at);
    std::array<std::uint16_t, kBlockVoxels> near;
    std::size_t count = 0;
    const auto most = static_cast<std::int16_t>(beside);
    for (std::size_t voxel = 0; voxel < kBlockVoxels; ++voxel) {
      near[count] = static_cast<std::uint16_t>(voxel);
      const bool is_near = block.distance[voxel] <= most && block.distance[voxel] >= -most && block.weight[voxel] > 0;
      count += is_near ? 1 : 0;
    }
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t voxel = near[i];
      const auto distance = static_cast<float>(block.distance[voxel]);
      const int x = static_cast<int>(voxel) % kBlockEdge, y = static_cast<int>(voxel) / kBlockEdge % kBlockEdge,
                z = static_cast<int>(voxel) / (kBlockEdge * kBlockEdge);
      const float gx = slope(block, voxel, x, 1), gy = slope(block, voxel, y, kBlockEdge),
                  gz = slope(block, voxel, z, std::size_t{kBlockEdge} * kBlockEdge);
      const float squared = gx * gx + gy * gy + gz * gz;
      if (squared <= 0) continue;
      // From the voxel along the normal to the surface; distances along lines of sight are longer than those to the surface, as the
      // gradient is larger.
      const float back = std::clamp(-distance / squared, -2 / std::sqrt(squared), 2 / std::sqrt(squared));
      std::array<float, 3> p{}, n{};
      for (std::size_t k = 0; k < 3; ++k) {
        n[k] = gx * view.step(0)[k] + gy * view.step(1)[k] + gz * view.step(2)[k];
        p[k] = corner[k] + static_cast<float>(x) * view.step(0)[k] + static_cast<float>(y) * view.step(1)[k] +
               static_cast<float>(z) * view.step(2)[k] + back * n[k];
      }
      if (p[2] < kNearest) continue;
      const float along = -(n[0] * p[0] + n[1] * p[1] + n[2] * p[2]);
      const float lengths =
          std::sqrt((n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) * (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]));
      if (along <= 0 || lengths <= 0) continue;
      SurfaceVoxel seen;
      lens.project(p[0] / p[2], p[1] / p[2], seen.u, seen.v);
      // The square reaches its neighbours' even where they are apart by a diagonal.
      const float half = 0.75F * voxel_m * lens.fx / p[2];
      if (!(seen.u > -half && seen.v > -half && seen.u < static_cast<float>(camera.width) + half &&
            seen.v < static_cast<float>(camera.height) + half)) {
        continue;
      }
      seen.voxel = static_cast<std::uint16_t>(voxel);
      seen.z_m = p[2];
      seen.cosine = std::min(1.0F, along / lengths);
      out.push_back(seen);
      if (std::abs(distance) * metres > voxel_m) continue;  // the surface is drawn by those next to it
      const int left = std::max(0, static_cast<int>(std::ceil(seen.u - half))),
                right = std::min(camera.width - 1, static_cast<int>(std::floor(seen.u + half))),
                top = std::max(0, static_cast<int>(std::ceil(seen.v - half))),
                bottom = std::min(camera.height - 1, static_cast<int>(std::floor(seen.v + half)));
      // Its plane through the pixels that it covers; beyond twice its size it is no longer the surface.
      const float plane = -along;
      for (int row = top; row <= bottom; ++row) {
        float* pixels = &depth_m[static_cast<std::size_t>(row) * static_cast<std::size_t>(camera.width)];
        const float ry = p[1] / p[2] + (static_cast<float>(row) - seen.v) / lens.fy;
        for (int column = left; column <= right; ++column) {
          const float rx = p[0] / p[2] + (static_cast<float>(column) - seen.u) / lens.fx;
          const float facing = n[0] * rx + n[1] * ry + n[2];
          const float depth = facing < 0 ? plane / facing : p[2];
          keep_nearest(pixels[column], std::clamp(depth, p[2] - 2 * voxel_m, p[2] + 2 * voxel_m));
        }
      }
    }
  }
};

}  // namespace

SurfaceView draw_surfaces(const VoxelMap& map, const CameraModel& camera, const Eigen::Isometry3d& world_from_camera,
                          jobs::WorkerPool& pool) {
  SurfaceView drawn;
  const BlockView view(world_from_camera, map.voxel_m());
  const Lens lens(camera);
  const auto voxel_m = static_cast<float>(map.voxel_m());
  const float radius_m = 0.87F * kBlockEdge * voxel_m;
  for (const MapUnit& unit : map.units()) {
    const GridPlace middle{unit.at.x * kUnitBlocks + 2, unit.at.y * kUnitBlocks + 2, unit.at.z * kUnitBlocks + 2};
    if (!view.is_before(middle, 5 * radius_m, lens, camera)) continue;
    for (const std::int32_t block : unit.blocks) {
      if (block < 0 || !map.head(block).has_surface) continue;
      if (view.is_before(map.head(block).at, 2 * radius_m, lens, camera)) drawn.blocks.push_back({block, {}});
    }
  }
  std::sort(drawn.blocks.begin(), drawn.blocks.end(), [](const auto& a, const auto& b) { return a.block < b.block; });
  drawn.depth_m.assign(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height), kFarthest);

  const Drawing drawing{map, camera, view, lens, drawn.depth_m};
  constexpr std::size_t kChunk = 64;
  const std::size_t chunks = (drawn.blocks.size() + kChunk - 1) / kChunk;
  pool.for_each(chunks, [&](std::size_t chunk) {
    const std::size_t end = std::min(drawn.blocks.size(), (chunk + 1) * kChunk);
    for (std::size_t i = chunk * kChunk; i < end; ++i) drawing.draw(drawn.blocks[i].block, drawn.blocks[i].voxels);
  });
  drawn.is_near_edge = edges_of(drawn.depth_m, camera.width, camera.height, voxel_m);

  pool.for_each(chunks, [&](std::size_t chunk) {
    const std::size_t end = std::min(drawn.blocks.size(), (chunk + 1) * kChunk);
    for (std::size_t i = chunk * kChunk; i < end; ++i) {
      for (SurfaceVoxel& seen : drawn.blocks[i].voxels) {
        const int x = static_cast<int>(std::lround(seen.u)), y = static_cast<int>(std::lround(seen.v));
        if (x < 0 || y < 0 || x >= camera.width || y >= camera.height) continue;
        const float before = drawn.depth_m[static_cast<std::size_t>(y) * static_cast<std::size_t>(camera.width) +
                                           static_cast<std::size_t>(x)];
        // A square lies across the line of sight whatever its surface does: what is askew has more depth within a voxel.
        const float c = std::max(seen.cosine, 0.1F);
        seen.is_reached = seen.z_m < before + voxel_m * (1.5F + 1.5F * std::sqrt(1 - c * c) / c);
      }
    }
  });
  return drawn;
}

}  // namespace spectra::mapping
