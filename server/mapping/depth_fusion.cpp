#include "server/mapping/depth_fusion.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "server/mapping/block_kernels.hpp"
#include "server/mapping/picture_rows.hpp"
#include "server/mapping/place_kernel.hpp"
#include "server/mapping/surface_view.hpp"
#include "server/mapping/whole_numbers.hpp"

namespace spectra::mapping {
namespace {

constexpr double kBehindSigmas = 2.5;  ///< Of the noise; so far behind a surface it is looked at, or kBehindVoxels.
constexpr float kNearest = 0.05F;      ///< Metres before the camera.
/// The blocks that lie within the truncation of what is seen, in the order of their places.
std::vector<GridPlace> blocks_near_surface(const DepthLook& look, double voxel_m, jobs::WorkerPool& pool) {
  constexpr int kBand = 32, kStride = 2;
  // Relative to the camera's own block, so that single precision holds wherever the map is.
  const double per_m = 1 / (kBlockEdge * voxel_m);
  const Eigen::Vector3d eye = look.world_from_camera.translation() * per_m;
  const Eigen::Vector3d home(std::floor(eye.x()), std::floor(eye.y()), std::floor(eye.z()));
  const Eigen::Matrix3f turn = (look.world_from_camera.linear() * per_m).cast<float>();
  const Eigen::Vector3f from = (eye - home).cast<float>();
  PlaceKernel kernel{{},
                     {from.x(), from.y(), from.z()},
                     kNearest,
                     static_cast<float>(kTruncationVoxels * voxel_m),
                     static_cast<float>(kBehindVoxels * voxel_m),
                     static_cast<float>(kBehindSigmas * look.noise.base_m),
                     static_cast<float>(kBehindSigmas * look.noise.growth_per_m),
                     static_cast<float>(look.noise.from_m)};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      kernel.turn[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)] = turn(row, column);
    }
  }
  const GridPlace base{static_cast<std::int32_t>(home.x()), static_cast<std::int32_t>(home.y()),
                       static_cast<std::int32_t>(home.z())};
  const auto width = static_cast<std::size_t>(look.frame.width);
  const int bands = (look.frame.height + kBand - 1) / kBand;
  std::vector<std::vector<GridPlace>> found(static_cast<std::size_t>(bands));
  pool.for_each(found.size(), [&](std::size_t band) {
    RecentPlaces recent;
    std::vector<GridPlace>& places = found[band];
    std::vector<float> depth_m(width / std::size_t{kStride} + 1 + kPacked, 0), ray_x = depth_m, ray_y = depth_m;
    const int first = static_cast<int>(band) * kBand, last = std::min(first + kBand, look.frame.height);
    for (int y = first; y < last; y += kStride) {
      const std::size_t row = static_cast<std::size_t>(y) * width;
      std::size_t count = 0;
      for (std::size_t pixel = row; pixel < row + width; pixel += std::size_t{kStride}) {
        depth_m[count] = look.frame.depth_m[pixel];
        ray_x[count] = look.rays.x[pixel];
        ray_y[count] = look.rays.y[pixel];
        count += look.frame.weight[pixel] > 0 ? 1U : 0U;
      }
      find_places(kernel, {depth_m.data(), ray_x.data(), ray_y.data(), count}, recent, places);
    }
    std::sort(places.begin(), places.end());
    places.erase(std::unique(places.begin(), places.end()), places.end());
  });
  std::vector<GridPlace> all;
  for (const auto& places : found) all.insert(all.end(), places.begin(), places.end());
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  for (GridPlace& place : all) place = {place.x + base.x, place.y + base.y, place.z + base.z};
  return all;
}

/// One number a pixel, 0xBBGGRR.
std::vector<std::uint32_t> packed(const PictureRgb& picture, jobs::WorkerPool& pool) {
  std::vector<std::uint32_t> pixels(picture.pixels.size());
  const auto width = static_cast<std::size_t>(picture.width);
  for_each_row(static_cast<std::size_t>(picture.height), pool, [&](std::size_t y) {
    for (std::size_t i = y * width; i < (y + 1) * width; ++i) {
      const base::Rgb8& c = picture.pixels[i];
      pixels[i] = static_cast<std::uint32_t>(c.r | c.g << 8 | c.b << 16);
    }
  });
  return pixels;
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

std::size_t fuse_depth(VoxelMap& map, const DepthLook& depth, const ColourLook* colour, jobs::WorkerPool& pool,
                       std::uint64_t most_bytes) {
  const double voxel_m = map.voxel_m();
  const DistanceKernel kernel{KernelCamera(depth.camera, depth.world_from_camera, voxel_m),
                              depth.frame.packed.data(),
                              depth.frame.unit_m,
                              static_cast<float>(kTruncationVoxels * voxel_m),
                              static_cast<float>(voxel_m),
                              static_cast<float>(kBehindVoxels * voxel_m),
                              static_cast<float>(kBehindSigmas * depth.noise.base_m),
                              static_cast<float>(kBehindSigmas * depth.noise.growth_per_m),
                              static_cast<float>(depth.noise.from_m)};
  std::vector<std::uint8_t> is_near;
  std::size_t not_made = 0;
  for (const GridPlace& place : blocks_near_surface(depth, voxel_m, pool)) {
    if (map.would_be_beyond(place, most_bytes)) {
      ++not_made;
      continue;
    }
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
      if (!kernel.camera.view.is_before(middle, 5 * radius_m, kernel.camera.lens, depth.camera)) continue;
      for (const std::int32_t block : unit.blocks) {
        if (block >= 0 && may_be_seen(depth, kernel.camera, map.head(block).at, radius_m, behind_m)) {
          seen_in[group].push_back(block);
        }
      }
    }
  });
  std::vector<std::int32_t> blocks;
  for (const auto& part : seen_in) blocks.insert(blocks.end(), part.begin(), part.end());
  std::sort(blocks.begin(), blocks.end());

  std::optional<ColourKernel> colours;
  std::vector<std::uint32_t> pixels;
  if (colour != nullptr) {
    pixels = packed(colour->picture, pool);
    const bool is_depth_camera =
        colour->camera == depth.camera && colour->world_from_camera.matrix() == depth.world_from_camera.matrix();
    colours.emplace(ColourKernel{KernelCamera(colour->camera, colour->world_from_camera, voxel_m), is_depth_camera,
                                 pixels.data(), depth.frame.packed.data()});
  }
  constexpr std::size_t kChunk = 64;
  pool.for_each((blocks.size() + kChunk - 1) / kChunk, [&](std::size_t chunk) {
    NearPixels near;
    const std::size_t end = std::min(blocks.size(), (chunk + 1) * kChunk);
    for (std::size_t i = chunk * kChunk; i < end; ++i) {
      BlockHead& head = map.head(blocks[i]);
      VoxelBlock& voxels = map.voxels(blocks[i]);
      const BlockChange change = fuse_distances(kernel, kernel.camera.view.corner(head.at), voxels, near);
      head.has_surface = change.has_surface;
      head.is_free = change.is_free;
      head.has_inside = change.has_inside;
      head.has_outside = change.has_outside;
      head.moved += change.moved / kDistanceOne * static_cast<float>(kTruncationVoxels);
      if (colours && change.has_surface) {
        head.recoloured += fuse_colours(*colours, colours->camera.view.corner(head.at), voxels, near);
      }
    }
  });
  // What holds nothing needs no room, unless something is about to come there.
  for (const std::int32_t block : blocks) {
    if (map.head(block).is_free && is_near[static_cast<std::size_t>(block)] == 0) map.remove(block);
  }
  return not_made;
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
