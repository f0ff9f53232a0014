#include "server/mapping/depth_fusion.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "server/mapping/block_view.hpp"
#include "server/mapping/surface_view.hpp"

namespace spectra::mapping {
namespace {

constexpr int kLanes = kBlockEdge;
constexpr double kBehindSigmas = 2.5;  ///< Of the noise; so far behind a surface it is looked at, or kBehindVoxels.
constexpr float kNearest = 0.05F;      ///< Metres before the camera.
using Row = std::array<float, kLanes>;

/// What the kernel needs of a camera and its picture.
struct KernelCamera {
  BlockView view;
  Lens lens;
  bool is_distorted;
  int width, height;

  KernelCamera(const CameraModel& camera, const Eigen::Isometry3d& world_from_camera, double voxel_m)
      : view(world_from_camera, voxel_m),
        lens(camera),
        is_distorted(camera.has_distortion()),
        width(camera.width),
        height(camera.height) {}
};

/// z of eight voxels in a row and the pixels that they fall into; `outside` where there is none.
[[gnu::always_inline]] inline void project_row(const KernelCamera& camera, const std::array<float, 3>& first, Row& z,
                                               std::array<std::int32_t, kLanes>& pixel) {
  const auto& step = camera.view.step(0);
  const std::int32_t outside = camera.width * camera.height;
  const auto across = static_cast<float>(camera.width), down = static_cast<float>(camera.height);
  for (std::size_t i = 0; i < kLanes; ++i) {
    const auto n = static_cast<float>(i);
    z[i] = first[2] + n * step[2];
    const float inverse = 1 / std::max(z[i], kNearest);
    const float x = (first[0] + n * step[0]) * inverse, y = (first[1] + n * step[1]) * inverse;
    float u = 0, v = 0;
    if (camera.is_distorted) {
      camera.lens.project(x, y, u, v);
    } else {
      u = camera.lens.fx * x + camera.lens.cx;
      v = camera.lens.fy * y + camera.lens.cy;
    }
    // Half a pixel more, so that cutting off the fraction rounds; what is outside is brought to the border first.
    u = std::min(std::max(u + 0.5F, -1.0F), across);
    v = std::min(std::max(v + 0.5F, -1.0F), down);
    const bool is_inside = z[i] > kNearest && u >= 0 && v >= 0 && u < across && v < down;
    const std::int32_t at = static_cast<std::int32_t>(v) * camera.width + static_cast<std::int32_t>(u);
    pixel[i] = is_inside ? at : outside;
  }
}

/// The mean after one more value: rounded, at least one step of 1 towards it.
[[gnu::always_inline]] inline float mean_after(float mean, float value, float share) {
  const float step = (value - mean) * share;
  const float rounded = static_cast<float>(static_cast<std::int32_t>(step + (step < 0 ? -0.5F : 0.5F)));
  const float least = value > mean ? std::min(1.0F, value - mean) : std::max(-1.0F, value - mean);
  return mean + (rounded == 0 ? static_cast<float>(static_cast<std::int32_t>(least)) : rounded);
}

/// What has changed in a block, at most.
struct BlockChange {
  float moved = 0;  ///< Of kDistanceOne.
  float recoloured = 0;
  bool has_surface = false;
  bool is_free = false;
};

struct Kernel {
  KernelCamera depth;
  const float* depth_m;
  const float* weight;
  DepthNoise noise;
  float truncation_m, behind_m, voxel_m;
};

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_THREAD__) && \
    !defined(__SANITIZE_ADDRESS__)
#define SPECTRA_VECTOR_CLONES [[gnu::target_clones("default", "avx2")]]
#else
#define SPECTRA_VECTOR_CLONES
#endif

/// Distances and weights of a block; `near` gets, per voxel, the pixel of those that are near what was seen, or -1.
SPECTRA_VECTOR_CLONES
BlockChange fuse_distances(const Kernel& kernel, GridPlace at, VoxelBlock& block,
                           std::array<std::int32_t, kBlockVoxels>& near) {
  const float per_m = kDistanceOne / kernel.truncation_m;
  const auto base = static_cast<float>(kBehindSigmas * kernel.noise.base_m),
             growth = static_cast<float>(kBehindSigmas * kernel.noise.growth_per_m),
             from = static_cast<float>(kernel.noise.from_m);
  float moved = 0;
  std::int32_t surfaces = 0, filled = 0;
  const auto corner = kernel.depth.view.corner(at);
  for (int row = 0; row < kBlockEdge * kBlockEdge; ++row) {
    const auto first = kernel.depth.view.row(corner, row);
    Row z;
    std::array<std::int32_t, kLanes> pixel;
    project_row(kernel.depth, first, z, pixel);
    std::int16_t* distances = &block.distance[static_cast<std::size_t>(row) * kLanes];
    std::uint16_t* weights = &block.weight[static_cast<std::size_t>(row) * kLanes];
    std::int32_t* nears = &near[static_cast<std::size_t>(row) * kLanes];
    for (std::size_t i = 0; i < kLanes; ++i) {
      const auto p = static_cast<std::size_t>(pixel[i]);
      const float metres = kernel.depth_m[p] - z[i];
      // The same weight for all that may err, whether towards the camera or away: else the surface would move one way.
      const float beyond = std::max(0.0F, kernel.depth_m[p] - from);
      const float behind = std::max(kernel.behind_m, base + growth * beyond * beyond);
      const float w = metres > -behind ? kernel.weight[p] : 0.0F;
      const float old_weight = weights[i], old = distances[i];
      const float target = std::min(kDistanceOne, std::max(-kDistanceOne, metres * per_m));
      const float next = w > 0 ? mean_after(old, target, w / std::max(1.0F, old_weight + w)) : old;
      distances[i] = static_cast<std::int16_t>(static_cast<std::int32_t>(next));
      weights[i] = static_cast<std::uint16_t>(static_cast<std::int32_t>(std::min(kWeightMost, old_weight + w)));
      const bool is_surface = std::min(std::abs(next), std::abs(old)) < 0.5F * kDistanceOne;
      moved = std::max(moved, is_surface ? std::abs(next - old) : 0.0F);
      surfaces |= is_surface ? 1 : 0;
      filled |= next < 0.5F * kDistanceOne ? 1 : 0;
      nears[i] = w > 0 && std::abs(metres) < 2 * kernel.voxel_m ? pixel[i] : -1;
    }
  }
  return {moved, 0, surfaces != 0, filled == 0};
}

float fuse_channel(std::uint16_t& channel, std::uint8_t level, float share) {
  const float old = channel;
  const float next = mean_after(old, 256.0F * static_cast<float>(level), share);
  channel = static_cast<std::uint16_t>(static_cast<std::int32_t>(next));
  return std::abs(next - old) / 256;
}

/// Colours of the voxels near what was seen; the largest change in levels.
float fuse_colours(const ColourLook& look, const KernelCamera& camera, bool is_depth_camera, const Kernel& kernel,
                   GridPlace at, VoxelBlock& block, const std::array<std::int32_t, kBlockVoxels>& near) {
  constexpr float kMostColourWeight = 255;
  float recoloured = 0;
  const auto corner = camera.view.corner(at);
  const std::int32_t outside = camera.width * camera.height;
  for (int row = 0; row < kBlockEdge * kBlockEdge; ++row) {
    const std::int32_t* nears = &near[static_cast<std::size_t>(row) * kLanes];
    if (std::all_of(nears, nears + kLanes, [](std::int32_t pixel) { return pixel < 0; })) continue;
    Row z{};
    std::array<std::int32_t, kLanes> pixel;
    if (is_depth_camera) {
      std::copy_n(nears, kLanes, pixel.begin());
    } else {
      project_row(camera, camera.view.row(corner, row), z, pixel);
    }
    for (std::size_t i = 0; i < kLanes; ++i) {
      if (nears[i] < 0 || pixel[i] == outside) continue;
      const std::size_t voxel = static_cast<std::size_t>(row) * kLanes + i;
      // The nearer and the less askew, the more: the weight of the distance, of which little is left beyond 3 m, by its root.
      const float trust = std::sqrt(kernel.weight[static_cast<std::size_t>(nears[i])] / kWeightOne);
      const float w = std::max(1.0F, std::round(16 * trust));
      const float old_weight = block.colour_weight[voxel];
      const float share = w / (old_weight + w);
      const base::Rgb8& seen = look.picture.pixels[static_cast<std::size_t>(pixel[i])];
      recoloured =
          std::max({recoloured, fuse_channel(block.red[voxel], seen.r, share),
                    fuse_channel(block.green[voxel], seen.g, share), fuse_channel(block.blue[voxel], seen.b, share)});
      block.colour_weight[voxel] = static_cast<std::uint8_t>(std::min(kMostColourWeight, old_weight + w));
    }
  }
  return recoloured;
}

/// The blocks that lie within the truncation of what is seen, in the order of their places.
std::vector<GridPlace> blocks_near_surface(const DepthLook& look, double voxel_m, jobs::WorkerPool& pool) {
  constexpr int kBand = 32, kStride = 2;
  const auto before = static_cast<float>(kTruncationVoxels * voxel_m),
             behind = static_cast<float>(kBehindVoxels * voxel_m);
  const float per_m = static_cast<float>(1 / (kBlockEdge * voxel_m));
  const Eigen::Matrix3f turn = look.world_from_camera.linear().cast<float>();
  // Relative to the camera's own block, so that single precision holds wherever the map is.
  const Eigen::Vector3d camera = look.world_from_camera.translation() / (kBlockEdge * voxel_m);
  const Eigen::Vector3d home(std::floor(camera.x()), std::floor(camera.y()), std::floor(camera.z()));
  const Eigen::Vector3f from = (camera - home).cast<float>();
  const GridPlace base{static_cast<std::int32_t>(home.x()), static_cast<std::int32_t>(home.y()),
                       static_cast<std::int32_t>(home.z())};
  const int bands = (look.frame.height + kBand - 1) / kBand;
  std::vector<std::vector<GridPlace>> found(static_cast<std::size_t>(bands));
  pool.for_each(found.size(), [&](std::size_t band) {
    std::array<GridPlace, 1024> recent;
    recent.fill({INT32_MIN, 0, 0});
    std::vector<GridPlace>& places = found[band];
    const int first = static_cast<int>(band) * kBand, last = std::min(first + kBand, look.frame.height);
    for (int y = first; y < last; y += kStride) {
      for (int x = 0; x < look.frame.width; x += kStride) {
        const std::size_t pixel =
            static_cast<std::size_t>(y) * static_cast<std::size_t>(look.frame.width) + static_cast<std::size_t>(x);
        if (look.frame.weight[pixel] <= 0) continue;
        const float z = look.frame.depth_m[pixel];
        const Eigen::Vector3f ray = turn * Eigen::Vector3f(look.rays.x[pixel], look.rays.y[pixel], 1) * per_m;
        const auto noise = static_cast<float>(kBehindSigmas * look.noise.sigma_m(static_cast<double>(z)));
        const float begin = std::max(kNearest, z - before), end = z + std::max(behind, noise);
        const int steps = static_cast<int>(std::ceil((end - begin) * ray.norm() * 2));
        for (int s = 0; s <= steps; ++s) {
          const Eigen::Vector3f at =
              from + ray * (begin + (end - begin) * static_cast<float>(s) / static_cast<float>(std::max(steps, 1)));
          const GridPlace place{base.x + static_cast<std::int32_t>(std::floor(at.x())),
                                base.y + static_cast<std::int32_t>(std::floor(at.y())),
                                base.z + static_cast<std::int32_t>(std::floor(at.z()))};
          GridPlace& known =
              recent[index_within(place, 3) * 2 % recent.size() + (static_cast<std::size_t>(place.x) >> 3 & 1)];
          if (known == place) continue;
          known = place;
          places.push_back(place);
        }
      }
    }
    std::sort(places.begin(), places.end());
    places.erase(std::unique(places.begin(), places.end()), places.end());
  });
  std::vector<GridPlace> all;
  for (const auto& places : found) all.insert(all.end(), places.begin(), places.end());
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  return all;
}

/// Whether any pixel over a block sees it or something behind it.
bool may_be_seen(const DepthLook& look, const KernelCamera& camera, GridPlace at, float radius_m, float behind_m) {
  const auto centre = camera.view.centre(at);
  if (centre[2] + radius_m < kNearest) return false;
  const float nearest = std::max(centre[2] - radius_m, kNearest);
  float low_u = 0, low_v = 0, high_u = static_cast<float>(camera.width - 1),
        high_v = static_cast<float>(camera.height - 1);
  if (centre[2] > 2 * radius_m) {
    float u = 0, v = 0;
    camera.lens.project(centre[0] / centre[2], centre[1] / centre[2], u, v);
    // Lenses bend little over the width of a block; a tenth more covers it.
    const float reach = 1.1F * camera.lens.fx * radius_m / nearest + 2;
    low_u = std::max(low_u, u - reach);
    low_v = std::max(low_v, v - reach);
    high_u = std::min(high_u, u + reach);
    high_v = std::min(high_v, v + reach);
  }
  if (!(low_u <= high_u && low_v <= high_v)) return false;
  constexpr int kTile = DepthFrame::kTile;
  const int right = static_cast<int>(high_u) / kTile, bottom = static_cast<int>(high_v) / kTile;
  for (int y = static_cast<int>(low_v) / kTile; y <= bottom; ++y) {
    for (int x = static_cast<int>(low_u) / kTile; x <= right; ++x) {
      const float farthest = look.frame.farthest_m[static_cast<std::size_t>(y * look.frame.tiles_across + x)];
      if (farthest > 0 && farthest + behind_m > centre[2] - radius_m) return true;
    }
  }
  return false;
}

}  // namespace

void fuse_depth(VoxelMap& map, const DepthLook& depth, const ColourLook* colour, jobs::WorkerPool& pool) {
  const double voxel_m = map.voxel_m();
  const Kernel kernel{KernelCamera(depth.camera, depth.world_from_camera, voxel_m),
                      depth.frame.depth_m.data(),
                      depth.frame.weight.data(),
                      depth.noise,
                      static_cast<float>(kTruncationVoxels * voxel_m),
                      static_cast<float>(kBehindVoxels * voxel_m),
                      static_cast<float>(voxel_m)};
  std::vector<std::uint8_t> is_near;
  for (const GridPlace& place : blocks_near_surface(depth, voxel_m, pool)) {
    const auto block = static_cast<std::size_t>(map.ensure(place));
    if (block >= is_near.size()) is_near.resize(static_cast<std::size_t>(map.block_end()), 0);
    is_near[block] = 1;
  }
  is_near.resize(static_cast<std::size_t>(map.block_end()), 0);

  // All blocks that a pixel sees, or looks through.
  const float radius_m = static_cast<float>(0.5 * std::sqrt(3.0) * kBlockEdge * voxel_m);
  // As deep as the least certain pixel that counts.
  const float behind_m = std::max(kernel.behind_m, static_cast<float>(kBehindSigmas) * kernel.truncation_m);
  constexpr std::size_t kGroup = 256;
  const std::size_t groups = (map.units().size() + kGroup - 1) / kGroup;
  std::vector<std::vector<std::int32_t>> seen_in(groups);
  pool.for_each(groups, [&](std::size_t group) {
    const std::size_t end = std::min(map.units().size(), (group + 1) * kGroup);
    for (std::size_t u = group * kGroup; u < end; ++u) {
      const MapUnit& unit = map.units()[u];
      const GridPlace middle{unit.at.x * kUnitBlocks + 2, unit.at.y * kUnitBlocks + 2, unit.at.z * kUnitBlocks + 2};
      // The corner of the third block is the middle of the unit.
      if (!kernel.depth.view.is_before(middle, 5 * radius_m, kernel.depth.lens, depth.camera)) continue;
      for (const std::int32_t block : unit.blocks) {
        if (block >= 0 && may_be_seen(depth, kernel.depth, map.head(block).at, radius_m, behind_m)) {
          seen_in[group].push_back(block);
        }
      }
    }
  });
  std::vector<std::int32_t> blocks;
  for (const auto& part : seen_in) blocks.insert(blocks.end(), part.begin(), part.end());
  std::sort(blocks.begin(), blocks.end());

  const bool is_depth_camera = colour != nullptr && colour->camera == depth.camera &&
                               colour->world_from_camera.matrix() == depth.world_from_camera.matrix();
  const KernelCamera colour_camera(colour != nullptr ? colour->camera : depth.camera,
                                   colour != nullptr ? colour->world_from_camera : depth.world_from_camera, voxel_m);
  constexpr std::size_t kChunk = 64;
  pool.for_each((blocks.size() + kChunk - 1) / kChunk, [&](std::size_t chunk) {
    std::array<std::int32_t, kBlockVoxels> near;
    const std::size_t end = std::min(blocks.size(), (chunk + 1) * kChunk);
    for (std::size_t i = chunk * kChunk; i < end; ++i) {
      BlockHead& head = map.head(blocks[i]);
      VoxelBlock& voxels = map.voxels(blocks[i]);
      const BlockChange change = fuse_distances(kernel, head.at, voxels, near);
      head.has_surface = change.has_surface;
      head.is_free = change.is_free;
      head.moved += change.moved / kDistanceOne * static_cast<float>(kTruncationVoxels);
      if (colour != nullptr && change.has_surface) {
        head.recoloured += fuse_colours(*colour, colour_camera, is_depth_camera, kernel, head.at, voxels, near);
      }
    }
  });
  // What holds nothing needs no room, unless something is about to come there.
  for (const std::int32_t block : blocks) {
    if (map.head(block).is_free && is_near[static_cast<std::size_t>(block)] == 0) map.remove(block);
  }
}

FitOfDepth fit_of(const VoxelMap& map, const DepthLook& depth, jobs::WorkerPool& pool) {
  constexpr int kStride = 4;
  const SurfaceView view = draw_surfaces(map, depth.camera, depth.world_from_camera, pool);
  const auto truncation = static_cast<float>(kTruncationVoxels * map.voxel_m());
  FitOfDepth fit;
  for (int y = 0; y < depth.frame.height; y += kStride) {
    for (int x = 0; x < depth.frame.width; x += kStride) {
      const std::size_t pixel =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(depth.frame.width) + static_cast<std::size_t>(x);
      if (depth.frame.weight[pixel] <= 0 || !std::isfinite(view.depth_m[pixel])) continue;
      ++(std::abs(depth.frame.depth_m[pixel] - view.depth_m[pixel]) < truncation ? fit.matching : fit.other);
    }
  }
  return fit;
}

}  // namespace spectra::mapping
