#include "server/mapping/depth_frame.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "server/mapping/depth_kernel.hpp"
#include "server/mapping/voxel_map.hpp"

namespace spectra::mapping {
namespace {

constexpr int kBandRows = 16;

/// Weighs the pixels beside the border of the picture, one by one; the others as weigh_pixels() does.
struct BorderPixels {
  const float* depth;
  const RayTable& rays;
  float focal;
  int width, height;

  float at(int x, int y) const {
    return x < 0 || y < 0 || x >= width || y >= height
               ? 0
               : depth[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)];
  }

  /// Metres by which neighbours may differ that are so many pixels apart on one surface.
  float largest_step(float z, float sigma_m, int pixels) const {
    return 6 * sigma_m + static_cast<float>(pixels) * (z / focal * kSteepest);
  }

  bool is_at_edge(int x, int y, float z, float sigma_m) const {
    constexpr std::array<std::array<int, 2>, 4> kAround{{{1, 0}, {-1, 0}, {0, 1}, {0, -1}}};
    for (int reach = 1; reach <= kEdgeReach; ++reach) {
      const float most = largest_step(z, sigma_m, reach);
      for (const auto& [dx, dy] : kAround) {
        const int u = x + reach * dx, v = y + reach * dy;
        if (u < 0 || v < 0 || u >= width || v >= height) continue;
        const float other = at(u, v);
        if (other == 0 ? reach == 1 : std::abs(other - z) > most) return true;
      }
    }
    return false;
  }

  /// The neighbour on one line through a pixel, as a vector from it; the far one or the near one, whichever is on the surface.
  bool step_along(int x, int y, int dx, int dy, float z, float sigma_m, std::array<float, 3>& step) const {
    float ends[2];
    int used[2];
    for (int side = 0; side < 2; ++side) {
      const int sign = side == 0 ? -1 : 1;
      used[side] = 0;
      ends[side] = z;
      for (int reach = kNormalReach; reach > 0; --reach) {
        const float other = at(x + sign * reach * dx, y + sign * reach * dy);
        if (other > 0 && std::abs(other - z) <= largest_step(z, sigma_m, reach)) {
          used[side] = sign * reach;
          ends[side] = other;
          break;
        }
      }
    }
    if (used[0] == used[1]) return false;
    const auto pixel = [&](int side) {
      return static_cast<std::size_t>(y + used[side] * dy) * static_cast<std::size_t>(width) +
             static_cast<std::size_t>(x + used[side] * dx);
    };
    const std::size_t a = pixel(0), b = pixel(1);
    step = {rays.x[b] * ends[1] - rays.x[a] * ends[0], rays.y[b] * ends[1] - rays.y[a] * ends[0], ends[1] - ends[0]};
    return true;
  }

  /// 0 for what lies at an edge, too.
  float cosine_of(int x, int y, float z, float sigma_m) const {
    return is_at_edge(x, y, z, sigma_m) ? 0 : cosine(x, y, z, sigma_m);
  }

  /// Of the angle between the line of sight and the surface's normal; 0 when it cannot be told.
  float cosine(int x, int y, float z, float sigma_m) const {
    std::array<float, 3> a{}, b{};
    if (!step_along(x, y, 1, 0, z, sigma_m, a) || !step_along(x, y, 0, 1, z, sigma_m, b)) return 0;
    const float nx = a[1] * b[2] - a[2] * b[1], ny = a[2] * b[0] - a[0] * b[2], nz = a[0] * b[1] - a[1] * b[0];
    const std::size_t pixel =
        static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
    const float rx = rays.x[pixel], ry = rays.y[pixel];
    const float length = std::sqrt((nx * nx + ny * ny + nz * nz) * (rx * rx + ry * ry + 1));
    return length > 0 ? std::abs(nx * rx + ny * ry + nz) / length : 0;
  }
};

void pack(const std::uint16_t* depth, const float* weight, std::size_t count, std::uint32_t* packed) {
  for (std::size_t i = 0; i < count; ++i) {
    packed[i] =
        static_cast<std::uint32_t>(depth[i]) << 16 | static_cast<std::uint32_t>(static_cast<std::int32_t>(weight[i]));
  }
}

/// Of pixels that count: how many, and the farther of each and of what is known of its column.
std::size_t note_farthest(const float* depth_m, const float* weight, std::size_t count, float* farthest_m) {
  std::int32_t counted = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const bool counts = weight[i] > 0;
    const float z = counts ? depth_m[i] : 0;
    farthest_m[i] = farthest_m[i] < z ? z : farthest_m[i];
    counted += static_cast<std::int32_t>(counts);
  }
  return static_cast<std::size_t>(counted);
}

}  // namespace

RayTable::RayTable(const CameraModel& camera) : width(camera.width), height(camera.height) {
  const auto count = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  x.reserve(count);
  y.reserve(count);
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      const Eigen::Vector3d ray = camera.ray_of(u, v);
      x.push_back(static_cast<float>(ray.x()));
      y.push_back(static_cast<float>(ray.y()));
    }
  }
}

DepthFrame prepared_depth(const Picture16& picture, const DepthCalibration& calibration, const RayTable& rays,
                          double truncation_m, jobs::WorkerPool& pool, DepthFrame frame) {
  frame.width = picture.width;
  frame.height = picture.height;
  const auto width = static_cast<std::size_t>(frame.width), height = static_cast<std::size_t>(frame.height);
  frame.depth_m.resize(width * height);
  frame.weight.assign(width * height, 0);
  frame.packed.assign(width * height + 1, 0);
  frame.tiles_across = (frame.width + DepthFrame::kTile - 1) / DepthFrame::kTile;
  frame.tiles_down = (frame.height + DepthFrame::kTile - 1) / DepthFrame::kTile;
  frame.farthest_m.assign(static_cast<std::size_t>(frame.tiles_across * frame.tiles_down), 0);
  const auto unit = static_cast<float>(calibration.unit_m);
  frame.unit_m = unit;
  std::transform(picture.pixels.begin(), picture.pixels.end(), frame.depth_m.begin(), [&](std::uint16_t value) {
    return value == calibration.invalid ? 0 : static_cast<float>(value) * unit;
  });
  const auto focal = static_cast<float>(calibration.camera.fx);
  const BorderPixels border{frame.depth_m.data(), rays, focal, frame.width, frame.height};
  const DepthPixels pixels{frame.depth_m.data(), rays.x.data(), rays.y.data(), frame.width, focal,
                           calibration.noise,    truncation_m};
  const double reference = 2 * calibration.noise.base_m;
  const auto weigh_one = [&](int x, int y) {
    const std::size_t pixel = static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x);
    const float z = frame.depth_m[pixel];
    if (z <= 0) return;
    const double sigma = calibration.noise.sigma_m(static_cast<double>(z));
    if (sigma > truncation_m) return;
    const float cosine = border.cosine_of(x, y, z, static_cast<float>(sigma));
    if (cosine < kLeastCosine) return;
    const double trust = std::min(1.0, reference * reference / (sigma * sigma));
    const int weight = static_cast<int>(kWeightOne * static_cast<float>(trust) * cosine + 0.5F);
    frame.weight[pixel] = static_cast<float>(std::max(1, weight));
  };
  std::vector<std::size_t> counts(static_cast<std::size_t>(frame.tiles_down), 0);
  static_assert(kBandRows == DepthFrame::kTile);
  pool.for_each(static_cast<std::size_t>(frame.tiles_down), [&](std::size_t band) {
    const int first = static_cast<int>(band) * kBandRows, last = std::min(first + kBandRows, frame.height);
    std::vector<float> columns(width, 0);
    for (int y = first; y < last; ++y) {
      const std::size_t row = static_cast<std::size_t>(y) * width;
      const bool is_inner = y >= kNormalReach && y + kNormalReach < frame.height &&
                            frame.width >= static_cast<int>(kLeastWeighed) + 2 * kNormalReach;
      const int begin = is_inner ? kNormalReach : frame.width,
                end = is_inner ? frame.width - kNormalReach : frame.width;
      for (int x = 0; x < begin; ++x) weigh_one(x, y);
      for (int x = end; x < frame.width; ++x) weigh_one(x, y);
      if (is_inner) {
        const std::size_t pixel = row + static_cast<std::size_t>(begin);
        weigh_pixels(pixels, pixel, static_cast<std::size_t>(end - begin), &frame.weight[pixel]);
      }
      pack(&picture.pixels[row], &frame.weight[row], width, &frame.packed[row]);
      counts[band] += note_farthest(&frame.depth_m[row], &frame.weight[row], width, columns.data());
    }
    float* tiles = &frame.farthest_m[band * static_cast<std::size_t>(frame.tiles_across)];
    for (std::size_t x = 0; x < width; ++x)
      tiles[x / DepthFrame::kTile] = std::max(tiles[x / DepthFrame::kTile], columns[x]);
  });
  frame.counted = std::accumulate(counts.begin(), counts.end(), std::size_t{0});
  return frame;
}

}  // namespace spectra::mapping
