#include "fusion/demo/thermal_sensor.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "fusion/demo/noise.hpp"

namespace spectra::demo {
namespace {

constexpr std::size_t kWidth = 384, kHeight = 288;
/// Depth is drawn this many times finer each way, so that a pixel is the mean of what falls into it.
constexpr std::size_t kFiner = 3;
constexpr double kNoiseKelvin = 0.05, kStepKelvin = 0.04, kDriftKelvin = 0.12;
constexpr float kOutsideCelsius = 16.5F;

/// Fewer stops than the depth camera made: some of what is in the mesh has no temperature.
constexpr std::array<ScanPose, 9> kPoses{{
    {{-0.8, 1.9, 4.6}, {-0.3, 0.9, 0.0}, 0.75},
    {{-2.9, 1.5, 2.3}, {1.2, 0.6, -0.9}, 0.70},
    {{2.6, 1.7, 3.6}, {-0.9, 0.6, -0.8}, 0.70},
    {{-1.5, 1.5, 0.6}, {-2.5, 1.0, -2.8}, 0.72},
    {{0.2, 1.2, 2.7}, {0.6, 0.15, 1.2}, 0.55},
    {{0.1, 1.6, 0.4}, {0.9, 1.1, -2.8}, 0.70},
    {{-1.2, 1.7, -0.1}, {-3.6, 0.8, 0.1}, 0.70},
    {{3.0, 1.5, 3.4}, {2.6, 0.7, -0.5}, 0.75},
    {{-1.4, 1.6, 0.4}, {0.8, 0.1, 1.1}, 0.70},
}};

/// The weights of a Gaussian of 1.2 pixels, which is a point spread of about 1.5 pixels to where it halves.
constexpr std::array<float, 9> kSpread{0.0013F, 0.0146F, 0.0831F, 0.2352F, 0.3316F, 0.2352F, 0.0831F, 0.0146F, 0.0013F};

void blur(std::vector<float>& image) {
  constexpr std::ptrdiff_t reach = kSpread.size() / 2;
  std::vector<float> across(image.size());
  const auto pass = [&](const std::vector<float>& in, std::vector<float>& out, bool along_rows) {
    for (std::size_t y = 0; y < kHeight; ++y) {
      for (std::size_t x = 0; x < kWidth; ++x) {
        float sum = 0, weight = 0;
        for (std::ptrdiff_t k = -reach; k <= reach; ++k) {
          const std::ptrdiff_t i = static_cast<std::ptrdiff_t>(x) + (along_rows ? k : 0);
          const std::ptrdiff_t j = static_cast<std::ptrdiff_t>(y) + (along_rows ? 0 : k);
          if (i < 0 || j < 0 || i >= static_cast<std::ptrdiff_t>(kWidth) || j >= static_cast<std::ptrdiff_t>(kHeight)) {
            continue;
          }
          const float share = kSpread[static_cast<std::size_t>(k + reach)];
          sum += share * in[static_cast<std::size_t>(j) * kWidth + static_cast<std::size_t>(i)];
          weight += share;
        }
        out[y * kWidth + x] = sum / weight;
      }
    }
  };
  pass(image, across, true);
  pass(across, image, false);
}

}  // namespace

ThermalSensor::ThermalSensor(const SurfaceMesh& stand_in, std::uint64_t seed) {
  Random random(seed);
  for (const ScanPose& pose : kPoses) {
    ScanView view(pose, kFiner * kWidth, kFiner * kHeight, stand_in, stand_in.celsius);
    DepthImage& fine = view.image();
    std::vector<float> picture(kWidth * kHeight);
    for (std::size_t i = 0; i < fine.value.size(); ++i) {
      const std::size_t x = i % fine.width / kFiner, y = i / fine.width / kFiner;
      picture[y * kWidth + x] += (fine.nearness[i] > 0 ? fine.value[i] : kOutsideCelsius) / (kFiner * kFiner);
    }
    fine.value = {};
    blur(picture);
    const double drift = kDriftKelvin * random.normal();
    for (float& celsius : picture) {
      const double read = static_cast<double>(celsius) + drift + kNoiseKelvin * random.normal();
      celsius = static_cast<float>(std::floor(read / kStepKelvin + 0.5) * kStepKelvin);
    }
    views_.push_back({std::move(view), std::move(picture)});
  }
}

float ThermalSensor::celsius_at(Vec position, Vec normal) const {
  double sum = 0, weights = 0;
  for (const View& view : views_) {
    ScanPoint found;
    double slope = 0;
    if (!view.depth.sees(position, normal, 0.06, found, slope)) continue;
    // From the middles of the fine pixels to those of the sensor's.
    const double x = std::clamp((found.x + 0.5) / kFiner - 0.5, 0.0, kWidth - 1.001);
    const double y = std::clamp((found.y + 0.5) / kFiner - 0.5, 0.0, kHeight - 1.001);
    const auto i = static_cast<std::size_t>(x), j = static_cast<std::size_t>(y);
    const double u = x - static_cast<double>(i), v = y - static_cast<double>(j);
    const float* row = &view.celsius[j * kWidth + i];
    const double celsius = mix(mix(static_cast<double>(row[0]), static_cast<double>(row[1]), u),
                               mix(static_cast<double>(row[kWidth]), static_cast<double>(row[kWidth + 1]), u), v);
    // A view fades towards its border, so that its drift does not end in a visible seam.
    const double border = std::min({x, y, kWidth - 1 - x, kHeight - 1 - y});
    const double weight = slope / (found.depth * found.depth) * (0.02 + smooth_step(0, 40, border));
    sum += weight * celsius;
    weights += weight;
  }
  return weights > 0 ? static_cast<float>(sum / weights) : std::numeric_limits<float>::quiet_NaN();
}

}  // namespace spectra::demo
