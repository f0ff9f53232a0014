#include "server/mapping/seen_points.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace spectra::mapping {
namespace {

constexpr std::size_t kLevels = 4;
constexpr double kWantedPoints = 19'200;  ///< If all counted: every fourth pixel each way of 640 x 480.
constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

/// Between four pixels; NaN outside.
template <class P>
float between(const P& picture, float u, float v) {
  if (!(u >= 0 && v >= 0 && u < static_cast<float>(picture.width - 1) && v < static_cast<float>(picture.height - 1)))
    return kNone;
  const int x = static_cast<int>(u), y = static_cast<int>(v);
  const float a = u - static_cast<float>(x), b = v - static_cast<float>(y);
  const auto value = [&](int i, int j) { return static_cast<float>(picture.at(x + i, y + j)); };
  return (1 - b) * ((1 - a) * value(0, 0) + a * value(1, 0)) + b * ((1 - a) * value(0, 1) + a * value(1, 1));
}

/// Where a camera beside sees a point; false behind it.
bool project(const Lens& lens, const Eigen::Isometry3f& from_depth, const Eigen::Vector3f& place, float& u, float& v,
             float& z) {
  const Eigen::Vector3f p = from_depth * place;
  if (p.z() < 0.1F) return false;
  lens.project(p.x() / p.z(), p.y() / p.z(), u, v);
  z = p.z();
  return true;
}

}  // namespace

LumaPictures::LumaPictures(const PictureRgb& picture, jobs::WorkerPool& pool) {
  levels_.resize(kLevels);
  Picture<float>& first = levels_[0];
  first = {picture.width, picture.height, std::vector<float>(picture.pixels.size())};
  const auto width = static_cast<std::size_t>(picture.width);
  pool.for_each(static_cast<std::size_t>(picture.height), [&](std::size_t row) {
    for (std::size_t i = row * width; i < (row + 1) * width; ++i) {
      const base::Rgb8& c = picture.pixels[i];
      first.pixels[i] = 0.299F * c.r + 0.587F * c.g + 0.114F * c.b;
    }
  });
  for (std::size_t level = 1; level < kLevels; ++level) {
    const Picture<float>& finer = levels_[level - 1];
    Picture<float>& own = levels_[level];
    own = {finer.width / 2, finer.height / 2, {}};
    own.pixels.reserve(static_cast<std::size_t>(own.width) * static_cast<std::size_t>(own.height));
    for (int y = 0; y < own.height; ++y) {
      for (int x = 0; x < own.width; ++x) {
        own.pixels.push_back(0.25F * (finer.at(2 * x, 2 * y) + finer.at(2 * x + 1, 2 * y) + finer.at(2 * x, 2 * y + 1) +
                                      finer.at(2 * x + 1, 2 * y + 1)));
      }
    }
  }
}

float LumaPictures::at(float u, float v, float pixel_size) const {
  const int level = std::clamp(static_cast<int>(std::lround(std::log2(std::max(1.0F, pixel_size)))), 0,
                               static_cast<int>(kLevels) - 1);
  const auto scale = static_cast<float>(1 << level);
  return between(levels_[static_cast<std::size_t>(level)], (u + 0.5F) / scale - 0.5F, (v + 0.5F) / scale - 0.5F);
}

SeenPoints seen_points(const DepthFrame& frame, const RayTable& rays, const DepthNoise& noise, double voxel_m,
                       const BesideLook<LumaPictures>& colour, const BesideLook<Picture16>& thermal,
                       const PictureFloat& vignetting) {
  SeenPoints seen;
  const Lens colour_lens(colour.picture != nullptr ? *colour.camera : CameraModel{}),
      thermal_lens(thermal.picture != nullptr ? *thermal.camera : CameraModel{});
  const Eigen::Isometry3f to_colour = colour.from_depth.cast<float>(), to_thermal = thermal.from_depth.cast<float>();
  const auto voxel = static_cast<float>(voxel_m);
  const int stride = std::max(
      1, static_cast<int>(std::lround(std::sqrt(static_cast<double>(frame.width) * frame.height / kWantedPoints))));
  const auto add = [&](int x, int y) {
    const std::size_t pixel =
        static_cast<std::size_t>(y) * static_cast<std::size_t>(frame.width) + static_cast<std::size_t>(x);
    if (frame.weight[pixel] <= 0) return;
    SeenPoint point;
    const float z = frame.depth_m[pixel];
    point.place = {rays.x[pixel] * z, rays.y[pixel] * z, z};
    point.sigma_m = static_cast<float>(noise.sigma_m(static_cast<double>(z)));
    float u = 0, v = 0, away = 0;
    if (colour.picture != nullptr && project(colour_lens, to_colour, point.place, u, v, away))
      point.luma = colour.picture->at(u, v, voxel * colour_lens.fx / away);
    if (thermal.picture != nullptr && project(thermal_lens, to_thermal, point.place, u, v, away)) {
      point.celsius = 0.01F * between(*thermal.picture, u, v) - 273.15F;
      if (!vignetting.empty()) point.celsius -= between(vignetting, u, v);
    }
    seen.points.push_back(point);
  };
  for (const bool is_coarse : {true, false}) {
    for (int y = stride / 2; y < frame.height; y += stride) {
      for (int x = stride / 2; x < frame.width; x += stride) {
        const bool is_first = (x / stride) % 2 == 0 && (y / stride) % 2 == 0;
        if (is_first == is_coarse) add(x, y);
      }
    }
    if (is_coarse) seen.coarse_count = seen.points.size();
  }
  return seen;
}

}  // namespace spectra::mapping
