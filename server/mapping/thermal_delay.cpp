#include "server/mapping/thermal_delay.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Dense>

namespace spectra::mapping {
namespace {

using base::ErrorCode;

constexpr std::size_t kParts = 8;           ///< Of the drive, for the standard error.
constexpr std::size_t kLeastPictures = 16;  ///< Two in each part.
constexpr std::size_t kLeastLooks = 20'000;
constexpr double kCoarseStep = 0.04, kMiddleStep = 0.01, kFineStep = 0.004;
constexpr int kFineReach = 4;       ///< Steps to each side of the least.
constexpr double kLeastDip = 0.02;  ///< By which the least must lie below the typical, of that.
constexpr double kLargestSigma = 0.005;

/// What a delay leaves unexplained, in each part of the drive.
struct Residuals {
  std::array<double, kParts> sum{}, count{};
  double median_kelvin = 0;  ///< Of the absolute residuals.

  double mean_without(std::size_t part) const {
    double s = 0, n = 0;
    for (std::size_t i = 0; i < kParts; ++i) {
      if (i != part) s += sum[i], n += count[i];
    }
    return n > 0 ? s / n : 0;
  }
  double mean() const { return mean_without(kParts); }
  double looks() const {
    double n = 0;
    for (const double c : count) n += c;
    return n;
  }
};

double median_of(std::vector<float>& values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return static_cast<double>(*middle);
}

class Trial {
 public:
  Trial(const SurfacePoints& points, const ThermalPictures& pictures, const ThermalCalibration& calibration,
        const Trajectory& trajectory, jobs::WorkerPool& pool)
      : points_(points), pictures_(pictures), calibration_(calibration), trajectory_(trajectory), pool_(pool) {}

  void choose(std::vector<std::size_t> pictures) { chosen_ = std::move(pictures); }
  /// Residuals well above this count as if they were this.
  void set_scale(double kelvin) { scale_ = kelvin; }

  Residuals residuals(double delay_s) const {
    std::vector<std::vector<HeatLook>> looks(chosen_.size());
    pool_.for_each(looks.size(), [&](std::size_t i) {
      const PoseAnswer depth = trajectory_.at(pictures_.stamps_s[chosen_[i]] + delay_s);
      if (depth.state != PoseState::Known) return;
      looks[i] = looks_at(points_, pictures_.pictures[chosen_[i]], calibration_.camera,
                          depth.pose * calibration_.from_depth.inverse());
    });
    std::vector<double> offsets(looks.size(), 0);
    std::vector<double> sum(points_.positions.size(), 0), weight(points_.positions.size(), 0);
    // First one after the other, each against what is known by then; then all against all.
    for (std::size_t i = 0; i < looks.size(); ++i) {
      std::vector<float> differences;
      for (const HeatLook& look : looks[i]) {
        if (weight[look.point] > 0)
          differences.push_back(look.celsius - static_cast<float>(sum[look.point] / weight[look.point]));
      }
      offsets[i] = differences.empty() ? 0 : median_of(differences);
      for (const HeatLook& look : looks[i]) {
        sum[look.point] += static_cast<double>(look.celsius) - offsets[i];
        weight[look.point] += 1;
      }
    }
    const std::vector<double> count = weight;
    const auto trust = [this](double r) {
      const double x = 1 + r * r / (scale_ * scale_);
      return 1 / (x * x);
    };
    for (int round = 0; round < 3; ++round) {
      std::vector<double> next_sum(sum.size(), 0), next_weight(sum.size(), 0);
      for (std::size_t i = 0; i < looks.size(); ++i) {
        double off = 0, all = 0;
        for (const HeatLook& look : looks[i]) {
          const double own = static_cast<double>(look.celsius) - sum[look.point] / weight[look.point];
          const double w = count[look.point] > 1 ? trust(own - offsets[i]) : 0;
          off += w * own;
          all += w;
        }
        if (all > 0) offsets[i] = off / all;
        for (const HeatLook& look : looks[i]) {
          const double value = static_cast<double>(look.celsius) - offsets[i];
          const double w = trust(value - sum[look.point] / weight[look.point]);
          next_sum[look.point] += w * value;
          next_weight[look.point] += w;
        }
      }
      sum = std::move(next_sum);
      weight = std::move(next_weight);
    }
    Residuals found;
    std::vector<float> absolute;
    for (std::size_t i = 0; i < looks.size(); ++i) {
      const std::size_t part = i * kParts / looks.size();
      for (const HeatLook& look : looks[i]) {
        if (count[look.point] < 2) continue;
        const double r = static_cast<double>(look.celsius) - offsets[i] - sum[look.point] / weight[look.point];
        found.sum[part] += r * r / (1 + r * r / (scale_ * scale_));
        found.count[part] += 1;
        absolute.push_back(static_cast<float>(std::abs(r)));
      }
    }
    found.median_kelvin = median_of(absolute);
    return found;
  }

 private:
  const SurfacePoints& points_;
  const ThermalPictures& pictures_;
  const ThermalCalibration& calibration_;
  const Trajectory& trajectory_;
  jobs::WorkerPool& pool_;
  std::vector<std::size_t> chosen_;
  double scale_ = 1;
};

/// Where a parabola through values at steps -n .. n about 0 is least, in steps; nothing when it opens downwards.
std::optional<double> least_of_parabola(const std::vector<double>& values) {
  const auto n = static_cast<int>(values.size() / 2);
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (int k = -n; k <= n; ++k) {
    const Eigen::Vector3d row(1, k, k * k);
    normal += row * row.transpose();
    right += row * values[static_cast<std::size_t>(k + n)];
  }
  const Eigen::Vector3d fit = normal.ldlt().solve(right);
  if (!(fit[2] > 0)) return std::nullopt;
  return -0.5 * fit[1] / fit[2];
}

std::string text(double value, int digits) {
  std::string words = std::to_string(value);
  return words.substr(0, words.find('.') + 1 + static_cast<std::size_t>(digits));
}

}  // namespace

base::Result<ThermalDelay> find_thermal_delay(const SurfacePoints& points, const ThermalPictures& pictures,
                                              const ThermalCalibration& calibration, const Trajectory& trajectory,
                                              const DelaySearch& search, jobs::WorkerPool& pool,
                                              const base::Progress& progress) {
  const auto refused = [](const std::string& what) {
    return base::failure(ErrorCode::Inconsistent, "the delay of the thermal camera cannot be told: " + what);
  };
  const double low = search.middle_s - search.reach_s - kMiddleStep,
               high = search.middle_s + search.reach_s + kMiddleStep;
  std::vector<std::size_t> known;
  for (std::size_t i = 0; i < pictures.stamps_s.size(); ++i) {
    bool is_known = true;
    for (double d = low; is_known && d < high + kCoarseStep; d += kCoarseStep)
      is_known = trajectory.at(pictures.stamps_s[i] + std::min(d, high)).state == PoseState::Known;
    if (is_known) known.push_back(i);
  }
  if (known.size() < kLeastPictures) {
    return refused("only " + std::to_string(known.size()) + " of " + std::to_string(pictures.stamps_s.size()) +
                   " thermal pictures have poses from " + text(search.reach_s, 2) +
                   " s before them to as long after; " + std::to_string(kLeastPictures) +
                   " are wanted of a drive without breaks");
  }
  if (points.positions.empty()) return refused("the depth pictures show no surface");

  Trial trial(points, pictures, calibration, trajectory, pool);
  std::vector<std::size_t> some;
  const std::size_t step = std::max<std::size_t>(1, known.size() / 80);
  for (std::size_t i = 0; i < known.size(); i += step) some.push_back(known[i]);
  trial.choose(some);
  trial.set_scale(std::max(0.1, 3 * trial.residuals(search.middle_s).median_kelvin));
  // Coarse over all, then finer about the least.
  std::vector<double> coarse;
  double least = 0, at = search.middle_s;
  const int reach = static_cast<int>(std::ceil(search.reach_s / kCoarseStep - 1e-9));
  for (int k = -reach; k <= reach; ++k) {
    const double delay = search.middle_s + search.reach_s * k / std::max(1, reach);
    coarse.push_back(trial.residuals(delay).mean());
    if (coarse.size() == 1 || coarse.back() < least) least = coarse.back(), at = delay;
    base::report(progress, kDelayPhase, 0.5 * (k + reach) / (2.0 * reach + 1));
  }
  const double coarse_at = at, coarse_step = search.reach_s / std::max(1, reach);
  trial.set_scale(std::max(0.1, 3 * trial.residuals(at).median_kelvin));
  least = 0;
  const int finer = static_cast<int>(std::ceil(coarse_step / kMiddleStep));
  for (int k = -finer; k <= finer; ++k) {
    const double delay = coarse_at + kMiddleStep * k;
    const double here = trial.residuals(delay).mean();
    if (k == -finer || here < least) least = here, at = delay;
    base::report(progress, kDelayPhase, 0.5 + 0.2 * (k + finer) / (2.0 * finer + 1));
  }
  trial.choose(known);
  std::vector<Residuals> fine;
  for (int k = -kFineReach; k <= kFineReach; ++k) {
    fine.push_back(trial.residuals(at + kFineStep * k));
    base::report(progress, kDelayPhase, 0.7 + 0.3 * (k + kFineReach) / (2.0 * kFineReach + 1));
  }
  const auto found = [&](std::size_t without) {
    std::vector<double> values;
    for (const Residuals& r : fine) values.push_back(r.mean_without(without));
    return least_of_parabola(values);
  };
  ThermalDelay delay;
  delay.picture_count = known.size();
  delay.point_count = points.positions.size();
  const Residuals& middle = fine[fine.size() / 2];
  delay.look_count = static_cast<std::size_t>(middle.looks());
  delay.residual_kelvin = std::sqrt(middle.mean());
  std::nth_element(coarse.begin(), coarse.begin() + static_cast<std::ptrdiff_t>(coarse.size() / 2), coarse.end());
  const double typical = coarse[coarse.size() / 2];
  delay.typical_residual_kelvin = std::sqrt(typical);
  if (delay.look_count < kLeastLooks) {
    return refused("points of the surface are seen " + std::to_string(delay.look_count) +
                   " times in the thermal pictures, and " + std::to_string(kLeastLooks) + " are wanted");
  }
  if (!(middle.mean() < (1 - kLeastDip) * typical)) {
    return refused("whatever it is, the pictures agree as well with each other (" + text(delay.residual_kelvin, 3) +
                   " K); drive or turn to and fro past something warm, at different speeds");
  }
  const auto all = found(kParts);
  if (std::abs(at - search.middle_s) > search.reach_s || !all || std::abs(*all) > kFineReach) {
    return refused("what fits best lies at the end of what was tried, " + text(at, 3) +
                   " s; search farther (--within)");
  }
  delay.delay_s = at + kFineStep * *all;
  double squares = 0;
  std::array<double, kParts> others{};
  double mean = 0;
  for (std::size_t part = 0; part < kParts; ++part) {
    others[part] = at + kFineStep * found(part).value_or(1e3);
    mean += others[part] / kParts;
  }
  for (const double other : others) squares += (other - mean) * (other - mean);
  delay.sigma_s = std::sqrt(squares * (kParts - 1) / kParts);
  if (!(delay.sigma_s < kLargestSigma)) {
    return refused("parts of the drive contradict each other, by more than " + text(1000 * kLargestSigma, 0) +
                   " ms in standard error; drive longer, at different speeds, past something warm");
  }
  base::report(progress, kDelayPhase, 1);
  return delay;
}

}  // namespace spectra::mapping
