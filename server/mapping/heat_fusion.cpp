#include "server/mapping/heat_fusion.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>

#include "server/mapping/picture_rows.hpp"

namespace spectra::mapping {
namespace {

constexpr float kKelvin = 273.15F;
constexpr float kLeastCosine = 0.2588F;  ///< Of 75 degrees.
constexpr std::size_t kSpread =
    2;  ///< Pixels over which the lens spreads a point: a thin warm thing is not as warm as it is, at its ridge too.
constexpr double kExposureSeconds = 0.010;  ///< A pixel of a microbolometer follows what it sees so slowly.
constexpr double kAfterShutterSeconds = 0.3;
constexpr float kAfterShutter = 10;   ///< Times the variance.
constexpr float kMostVariance = 9;    ///< K^2; a look that knows less says nothing.
constexpr float kNewHeat = 1000;      ///< Kelvin by which a first temperature counts as a change.
constexpr float kContradiction = 25;  ///< Variances; a look that is farther off than that tells of a change.
constexpr float kRemembered = 0.98F;  ///< Of how sure looks were, from one picture to the next.
constexpr std::size_t kLeastCompared = 300;
/// How an offset may have wandered when nothing tells it: at once, and as a random walk.
constexpr double kUntoldKelvin = 0.3, kWanderKelvin = 0.05;

float celsius_of(std::uint16_t centikelvin) {
  return static_cast<float>(centikelvin) * 0.01F - kKelvin;
}

/// A histogram of differences with whole weights: the same whatever the order in which it was filled.
class Differences {
 public:
  void add(float difference, float weight) {
    const double bin = (static_cast<double>(difference) + kReach) / kStep;
    if (!(bin >= 0 && bin < static_cast<double>(kBins))) return;
    bins_[static_cast<std::size_t>(bin)] += static_cast<std::uint64_t>(std::min(1e6F, 64 * weight) + 0.5F) + 1;
    ++count_;
  }
  void add(const Differences& other) {
    for (std::size_t i = 0; i < kBins; ++i) bins_[i] += other.bins_[i];
    count_ += other.count_;
  }
  std::size_t count() const { return count_; }

  double quantile(double share) const {
    const auto all = static_cast<double>(std::accumulate(bins_.begin(), bins_.end(), std::uint64_t{0}));
    double below = 0;
    for (std::size_t i = 0; i < kBins; ++i) {
      const auto here = static_cast<double>(bins_[i]);
      if (below + here >= share * all && here > 0) {
        return (static_cast<double>(i) + (share * all - below) / here) * kStep - kReach;
      }
      below += here;
    }
    return 0;
  }

 private:
  static constexpr double kReach = 20, kStep = 0.01;
  static constexpr std::size_t kBins = 4000;
  std::vector<std::uint64_t> bins_ = std::vector<std::uint64_t>(kBins, 0);
  std::size_t count_ = 0;
};

/// Takes what is larger.
void take_larger(const float* from, std::size_t count, float* to) {
  for (std::size_t i = 0; i < count; ++i) to[i] = to[i] < from[i] ? from[i] : to[i];
}

/// The largest value within kSpread pixels, along both axes.
std::vector<float> largest_around(const std::vector<float>& values, std::size_t width, std::size_t height,
                                  jobs::WorkerPool& pool) {
  std::vector<float> across(values.size()), both(values.size());
  for_each_row(height, pool, [&](std::size_t y) {
    const float* from = &values[y * width];
    float* to = &across[y * width];
    std::copy_n(from, width, to);
    for (std::size_t step = 1; step <= std::min(kSpread, width - 1); ++step) {
      take_larger(from + step, width - step, to);
      take_larger(from, width - step, to + step);
    }
  });
  for_each_row(height, pool, [&](std::size_t y) {
    const std::size_t first = y > kSpread ? y - kSpread : 0, end = std::min(height, y + kSpread + 1);
    for (std::size_t row = first; row < end; ++row) take_larger(&across[row * width], width, &both[y * width]);
  });
  return both;
}

/// Makes values negative that are marked.
void take_out(const std::uint8_t* is_marked, std::size_t count, float* values) {
  for (std::size_t i = 0; i < count; ++i) values[i] = is_marked[i] != 0 ? -1 : values[i];
}

/// Of a row: how temperatures change with a pixel, less `noise`, at least 0. `above` and `below` are the rows beside it, or the row itself.
void find_gradient(const float* above, const float* row, const float* below, std::size_t width, float noise,
                   float* to) {
  const auto at = [&](std::size_t left, std::size_t x, std::size_t right) {
    const float dx = 0.5F * (row[right] - row[left]), dy = 0.5F * (below[x] - above[x]);
    const float steep = std::sqrt(dx * dx + dy * dy) - noise;
    return steep > 0 ? steep : 0;
  };
  to[0] = at(0, 0, std::min<std::size_t>(1, width - 1));
  for (std::size_t x = 1; x + 1 < width; ++x) to[x] = at(x - 1, x, x + 1);
  if (width > 1) to[width - 1] = at(width - 2, width - 1, width - 1);
}

/// The value in the middle of all.
std::uint16_t middle_of(const std::vector<std::uint16_t>& pixels) {
  const auto [lowest, highest] = std::minmax_element(pixels.begin(), pixels.end());
  const std::size_t low = *lowest, range = std::size_t{*highest} - low + 1;
  // Neighbours are mostly the same: counted in turns, so that no count waits for the one before.
  constexpr std::size_t kTurns = 4;
  std::vector<std::uint32_t> counts(kTurns * range, 0);
  for (std::size_t i = 0; i < pixels.size(); ++i) ++counts[i % kTurns * range + pixels[i] - low];
  const auto count_of = [&](std::size_t value) {
    std::size_t count = 0;
    for (std::size_t turn = 0; turn < kTurns; ++turn) count += counts[turn * range + value];
    return count;
  };
  std::size_t value = 0;
  for (std::size_t below = count_of(0); below <= pixels.size() / 2; below += count_of(value)) ++value;
  return static_cast<std::uint16_t>(low + value);
}

}  // namespace

struct HeatFusion::Prepared {
  std::vector<float> celsius;
  std::vector<float> gradient;  ///< Kelvin a pixel: the steepest within kSpread. Below 0: no look.
  float reflected = 0;
};

bool HeatFusion::is_frozen(const Picture16& picture) {
  if (picture.pixels == last_picture_) return true;
  last_picture_ = picture.pixels;
  return false;
}

float HeatFusion::middle_celsius(const Picture16& picture, const std::vector<float>& celsius) const {
  const std::size_t middle = celsius.size() / 2;
  if (!vignetting_.empty()) {
    std::vector<float> sorted = celsius;
    std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(middle), sorted.end());
    return sorted[middle];
  }
  // Without it temperatures are in the order of the values.
  return celsius_of(middle_of(picture.pixels));
}

HeatFusion::Prepared HeatFusion::prepare(const Picture16& picture, jobs::WorkerPool& pool) const {
  Prepared prepared;
  const std::size_t count = picture.pixels.size();
  const auto width = static_cast<std::size_t>(picture.width), height = static_cast<std::size_t>(picture.height);
  prepared.celsius.resize(count);
  prepared.gradient.resize(count);
  std::transform(picture.pixels.begin(), picture.pixels.end(), prepared.celsius.begin(), celsius_of);
  if (!vignetting_.empty()) {
    std::transform(prepared.celsius.begin(), prepared.celsius.end(), vignetting_.pixels.begin(),
                   prepared.celsius.begin(), std::minus<float>());
  }
  if (calibration_.reflected_celsius) {
    prepared.reflected = static_cast<float>(*calibration_.reflected_celsius);
  } else {
    prepared.reflected = middle_celsius(picture, prepared.celsius);
  }
  const auto emissivity = static_cast<float>(calibration_.emissivity);
  const auto to_fourth = [](float celsius) {
    const float kelvin = std::max(celsius + kKelvin, 1.0F);
    return kelvin * kelvin * kelvin * kelvin;
  };
  const float reflected_power = (1 - emissivity) * to_fourth(prepared.reflected);
  if (emissivity < 1) {
    for_each_row(height, pool, [&](std::size_t y) {
      for (std::size_t i = y * width; i < (y + 1) * width; ++i) {
        const float own = std::max(1.0F, (to_fourth(prepared.celsius[i]) - reflected_power) / emissivity);
        prepared.celsius[i] = std::sqrt(std::sqrt(own)) - kKelvin;
      }
    });
  }
  const auto noise = static_cast<float>(2 * calibration_.netd_kelvin);
  for_each_row(height, pool, [&](std::size_t y) {
    const std::size_t above = (y > 0 ? y - 1 : y) * width, below = (y + 1 < height ? y + 1 : y) * width;
    const float* all = prepared.celsius.data();
    // What noise alone makes is none.
    find_gradient(all + above, all + y * width, all + below, width, noise, &prepared.gradient[y * width]);
  });
  prepared.gradient = largest_around(prepared.gradient, width, height, pool);
  return prepared;
}

void HeatFusion::find_offset(const VoxelMap& map, double moment_s, jobs::WorkerPool& pool, HeatReport& report) {
  // Everything that is known tells it, by how well it is known.
  constexpr std::size_t kParts = 4;
  std::array<Differences, kParts> parts;
  pool.for_each(kParts, [&](std::size_t part) {
    for (std::size_t chunk = part; chunk < looks_.size(); chunk += kParts) {
      const HeatSeen& looks = looks_[chunk];
      std::size_t i = 0;
      for (const SeenVoxels::Block& block : looks.blocks) {
        if (map.head(block.index).heat < 0) {
          i = block.end;
          continue;
        }
        const HeatBlock& heat = map.heat(block.index);
        for (; i < block.end; ++i) {
          const float variance = heat.variance[looks.voxel[i]];
          if (variance < kMostVariance) {
            parts[part].add(looks.celsius[i] - heat.celsius[looks.voxel[i]],
                            1 / (variance + looks.own[i] * looks.scale[i]));
          }
        }
      }
    }
  });
  Differences& differences = parts[0];
  for (std::size_t part = 1; part < kParts; ++part) differences.add(parts[part]);
  report.compared = differences.count();
  if (report.compared >= kLeastCompared) {
    const double middle = differences.quantile(0.5);
    const double spread = 0.7413 * (differences.quantile(0.75) - differences.quantile(0.25));
    // Neighbouring voxels err together: about so many of them are one.
    constexpr double kTogether = 100;
    report.offset_kelvin = middle;
    report.spread_kelvin = spread;
    report.offset_sigma_kelvin = 0.01 + 1.25 * spread / std::sqrt(static_cast<double>(report.compared) / kTogether);
  } else if (last_offset_s_) {
    const double wander = kWanderKelvin * kWanderKelvin * (moment_s - *last_offset_s_) + kUntoldKelvin * kUntoldKelvin;
    report.offset_kelvin = last_offset_kelvin_;
    report.offset_sigma_kelvin = std::sqrt(last_offset_sigma_kelvin_ * last_offset_sigma_kelvin_ + wander);
  }
  // The first picture is the gauge of all.
  last_offset_kelvin_ = report.offset_kelvin;
  last_offset_sigma_kelvin_ = std::min(report.offset_sigma_kelvin, 3.0);
  last_offset_s_ = moment_s;
}

HeatReport HeatFusion::fuse(VoxelMap& map, const Picture16& picture, const PoseAnswer& camera, double moment_s,
                            jobs::WorkerPool& pool) {
  HeatReport report;
  if (rules_.shutter && is_frozen(picture)) {
    last_frozen_s_ = moment_s;
    report.is_frozen = true;
    return report;
  }
  Prepared prepared = prepare(picture, pool);
  const CameraModel& model = calibration_.camera;
  view_ = draw_surfaces(map, model, camera.pose, pool, std::move(view_));
  if (rules_.edges) {
    const std::vector<std::uint8_t> is_near_edge =
        edges_of(view_.depth_m, model, static_cast<float>(map.voxel_m()), pool);
    take_out(is_near_edge.data(), is_near_edge.size(), prepared.gradient.data());
  }
  const Eigen::Vector3f linear =
      (camera.pose.linear().transpose() * camera.linear_m_per_s * kExposureSeconds).cast<float>();
  const Eigen::Vector3f angular =
      (camera.pose.linear().transpose() * camera.angular_rad_per_s * kExposureSeconds).cast<float>();
  const bool is_after_shutter = rules_.shutter && moment_s - last_frozen_s_ < kAfterShutterSeconds;
  const LookKernel kernel{Lens(model),
                          model.width,
                          model.height,
                          prepared.celsius.data(),
                          prepared.gradient.data(),
                          rules_.occlusion ? view_.depth_m.data() : nullptr,
                          static_cast<float>(map.voxel_m()),
                          rules_.angle ? kLeastCosine : -1,
                          rules_.weights,
                          {linear.x(), linear.y(), linear.z()},
                          {angular.x(), angular.y(), angular.z()},
                          static_cast<float>(calibration_.netd_kelvin * calibration_.netd_kelvin),
                          prepared.reflected,
                          is_after_shutter ? kAfterShutter : 1.0F,
                          kMostVariance};
  looks_.resize(view_.voxels.size());
  pool.for_each(looks_.size(), [&](std::size_t chunk) { find_looks(kernel, view_.voxels[chunk], looks_[chunk]); });

  if (rules_.frame_offset) find_offset(map, moment_s, pool, report);
  const auto offset = static_cast<float>(report.offset_kelvin);
  const auto common = static_cast<float>(report.offset_sigma_kelvin * report.offset_sigma_kelvin);
  const auto spread = static_cast<float>(report.spread_kelvin * report.spread_kelvin);
  for (const HeatSeen& looks : looks_) {
    report.observed += looks.count;
    for (const SeenVoxels::Block& block : looks.blocks) map.add_heat(block.index);
  }
  const auto process = static_cast<float>(rules_.process_kelvin * rules_.process_kelvin);
  const auto now = static_cast<float>(moment_s);
  const float trusted =
      report.spread_kelvin > 0 ? static_cast<float>(rules_.trusted_gap_s) : std::numeric_limits<float>::infinity();
  pool.for_each(looks_.size(), [&](std::size_t chunk) {
    const HeatSeen& looks = looks_[chunk];
    std::size_t i = 0;
    for (const SeenVoxels::Block& block : looks.blocks) {
      BlockHead& head = map.head(block.index);
      HeatBlock& heat = map.heat(block.index);
      const auto count = static_cast<float>(block.end - i);
      float warmest = 0, hottest = -1000, weights = 0, certain = 0;
      for (; i < block.end; ++i) {
        const std::size_t voxel = looks.voxel[i];
        const float scale = looks.scale[i];
        weights += 1 / scale;
        certain += 1 / (scale * std::sqrt(scale * std::sqrt(scale)));
        float& celsius = heat.celsius[voxel];
        float& variance = heat.variance[voxel];
        const float seen = looks.celsius[i] - offset;
        const float r = scale * (looks.own[i] + (rules_.weights ? common : 0));
        const float before = celsius;
        if (std::isinf(variance)) {
          celsius = seen;
          variance = r;
          warmest = kNewHeat;
        } else {
          const float elapsed = std::max(0.0F, now - heat.seen_s[voxel]);
          float predicted = variance + process * std::min(elapsed, trusted);
          const float innovation = seen - celsius;
          if (innovation * innovation > kContradiction * (predicted + r + spread))
            predicted = variance + process * elapsed;
          const float gain = predicted / (predicted + r);
          celsius += gain * innovation;
          variance = (1 - gain) * predicted;
          warmest = std::max(warmest, std::abs(celsius - before));
        }
        hottest = std::max(hottest, celsius);
        heat.seen_s[voxel] = now;
      }
      head.heat_weight = kRemembered * head.heat_weight + weights / count;
      head.heat_weight_certain = kRemembered * head.heat_weight_certain + certain / count;
      head.warmed += warmest;
      head.hottest = std::max(head.hottest, hottest);
    }
  });
  return report;
}

}  // namespace spectra::mapping
