#include "fusion/files/scene_origin.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace spectra::files {

namespace {

double axis_origin(double min, double max, double extent) {
  if (std::max(std::abs(min), std::abs(max)) <= 2 * extent) return 0;
  const double centre = min + (max - min) / 2;
  if (extent == 0) return static_cast<double>(static_cast<float>(centre)) == centre ? 0 : centre;
  int exponent = 0;
  const double mantissa = std::frexp(extent, &exponent);
  const double step = std::ldexp(1.0, mantissa == 0.5 ? exponent - 1 : exponent);
  const double steps = std::round(centre / step);
  // Beyond 2^53 every double is a multiple of the step already.
  return std::abs(steps) < 0x1p53 ? steps * step : centre;
}

}  // namespace

base::Vec3d scene_origin(const base::Vec3d& min, const base::Vec3d& max) {
  const double extent = std::max({max.x - min.x, max.y - min.y, max.z - min.z});
  return {axis_origin(min.x, max.x, extent), axis_origin(min.y, max.y, extent), axis_origin(min.z, max.z, extent)};
}

base::Vec3d scene_origin(const base::Vec3d& min, const base::Vec3d& max, const std::optional<Bulk>& bulk) {
  const base::Vec3d origin = scene_origin(min, max);
  constexpr double kTooCoarse = 1.0 / 20'000;
  if (!bulk || largest_rounding(*bulk, origin) <= kTooCoarse * bulk->extent()) return origin;
  return scene_origin(bulk->min, bulk->max);
}

double largest_rounding(const Bulk& bulk, const base::Vec3d& origin) {
  const double farthest =
      std::max({std::abs(bulk.min.x - origin.x), std::abs(bulk.max.x - origin.x), std::abs(bulk.min.y - origin.y),
                std::abs(bulk.max.y - origin.y), std::abs(bulk.min.z - origin.z), std::abs(bulk.max.z - origin.z)});
  int exponent = 0;
  std::frexp(farthest, &exponent);
  return std::ldexp(1.0, exponent - std::numeric_limits<float>::digits - 1);
}

}  // namespace spectra::files
