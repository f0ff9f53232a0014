#include "server/mapping/vignetting.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

namespace spectra::mapping {
namespace {

using base::ErrorCode;

constexpr int kCellsAcross = 12;           ///< Of the grid on whose corners the function is found; as square as can be.
constexpr std::size_t kLooksOfPoint = 16;  ///< More are thinned out evenly.
constexpr std::size_t kMostPoints = 30'000;
constexpr std::size_t kLeastPictures = 6, kLeastLooks = 5000;
constexpr int kRounds = 5;              ///< Of least squares with weights from the round before.
constexpr double kLeastCellsApart = 1;  ///< Of places at which a point is seen.
constexpr double kLeastScale = 0.05;    ///< Kelvin; residuals of less are not told apart.
/// Looks are not independent of each other: so many count as one, against what is expected of the function beforehand.
constexpr double kLooksAlike = 50;
constexpr double kExpectedKelvin = 1,
                 kExpectedBendKelvin = 0.15;  ///< Its size, and its second differences on the grid.

struct Look {
  std::uint32_t point;
  int picture;
  float u, v;
  float celsius;
};

struct Grid {
  int across, down;  ///< Corners.
  double step_u, step_v;

  explicit Grid(const CameraModel& camera) : across(kCellsAcross + 1) {
    const int cells = std::max(2, static_cast<int>(std::lround(kCellsAcross * static_cast<double>(camera.height) /
                                                               static_cast<double>(camera.width))));
    down = cells + 1;
    step_u = (camera.width - 1) / static_cast<double>(kCellsAcross);
    step_v = (camera.height - 1) / static_cast<double>(cells);
  }
  int count() const { return across * down; }

  /// Corners about a place and their shares.
  void shares(double u, double v, std::array<int, 4>& corners, std::array<double, 4>& share) const {
    const double x = u / step_u, y = v / step_v;
    const int i = std::clamp(static_cast<int>(x), 0, across - 2), j = std::clamp(static_cast<int>(y), 0, down - 2);
    const double a = x - i, b = y - j;
    corners = {j * across + i, j * across + i + 1, (j + 1) * across + i, (j + 1) * across + i + 1};
    share = {(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b};
  }
};

/// What is found together: the function on the grid, then an offset a picture.
struct Fit {
  Eigen::VectorXd unknowns;
  double residual_kelvin = 0;  ///< Robust.
};

class Solver {
 public:
  Solver(const CameraModel& camera, std::vector<Look> looks, int picture_count)
      : grid_(camera), looks_(std::move(looks)), picture_count_(picture_count) {}

  const Grid& grid() const { return grid_; }

  /// `which`: 0 and 1 take every second picture, others all. Without the function only offsets are found.
  Fit fit(int which, bool has_function) const {
    const int count = grid_.count() + picture_count_;
    Fit found{Eigen::VectorXd::Zero(count), 0};
    std::vector<double> weights;
    for (const Look& look : looks_) weights.push_back(which < 2 && look.picture % 2 != which ? 0 : 1);
    const std::vector<double> chosen = weights;
    for (int round = 0; round < kRounds; ++round) {
      Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(count, count);
      Eigen::VectorXd right = Eigen::VectorXd::Zero(count);
      for_each_point([&](std::size_t first, std::size_t end) { add_point(first, end, weights, normal, right); });
      expect(has_function, normal, right);
      found.unknowns = normal.ldlt().solve(right);
      // Weights of the next round: what is far off counts little.
      std::vector<double> residuals(looks_.size(), 0);
      std::vector<double> absolute;
      for_each_point([&](std::size_t first, std::size_t end) {
        double sum = 0, all = 0;
        std::size_t used = 0;
        for (std::size_t i = first; i < end; ++i) {
          residuals[i] = static_cast<double>(looks_[i].celsius) - without_temperature(looks_[i], found.unknowns);
          sum += weights[i] * residuals[i];
          all += weights[i];
          if (chosen[i] > 0) ++used;
        }
        for (std::size_t i = first; i < end; ++i) {
          residuals[i] -= all > 0 ? sum / all : 0;
          if (chosen[i] > 0 && used > 1) absolute.push_back(std::abs(residuals[i]));
        }
      });
      if (absolute.empty()) return found;
      const auto middle = absolute.begin() + static_cast<std::ptrdiff_t>(absolute.size() / 2);
      std::nth_element(absolute.begin(), middle, absolute.end());
      const double scale = std::max(kLeastScale, 3 * *middle);
      double squares = 0, used = 0;
      for (std::size_t i = 0; i < weights.size(); ++i) {
        if (chosen[i] == 0) continue;
        const double x = 1 + residuals[i] * residuals[i] / (scale * scale);
        weights[i] = 1 / (x * x);
        squares += residuals[i] * residuals[i] / x;
        used += 1;
      }
      found.residual_kelvin = std::sqrt(squares / used);
    }
    return found;
  }

  double value(const Eigen::VectorXd& unknowns, double u, double v) const {
    std::array<int, 4> corners;
    std::array<double, 4> share;
    grid_.shares(u, v, corners, share);
    double sum = 0;
    for (std::size_t k = 0; k < 4; ++k) sum += share[k] * unknowns[corners[k]];
    return sum;
  }

  /// Corners of the grid about which points were looked at.
  std::vector<bool> looked_at() const {
    std::vector<bool> is_seen(static_cast<std::size_t>(grid_.count()), false);
    for (const Look& look : looks_) {
      std::array<int, 4> corners;
      std::array<double, 4> share;
      grid_.shares(static_cast<double>(look.u), static_cast<double>(look.v), corners, share);
      for (std::size_t k = 0; k < 4; ++k) {
        if (share[k] > 0.25) is_seen[static_cast<std::size_t>(corners[k])] = true;
      }
    }
    return is_seen;
  }

 private:
  template <class Work>
  void for_each_point(const Work& work) const {
    for (std::size_t first = 0; first < looks_.size();) {
      std::size_t end = first;
      while (end < looks_.size() && looks_[end].point == looks_[first].point) ++end;
      work(first, end);
      first = end;
    }
  }

  double without_temperature(const Look& look, const Eigen::VectorXd& unknowns) const {
    return value(unknowns, static_cast<double>(look.u), static_cast<double>(look.v)) +
           unknowns[grid_.count() + look.picture];
  }

  /// The equations of a point with its temperature eliminated.
  void add_point(std::size_t first, std::size_t end, const std::vector<double>& weights, Eigen::MatrixXd& normal,
                 Eigen::VectorXd& right) const {
    std::vector<std::pair<int, double>> mean;  // of the rows, not yet divided
    double all = 0, sum = 0;
    for (std::size_t i = first; i < end; ++i) {
      const double w = weights[i];
      if (w == 0) continue;
      const Look& look = looks_[i];
      std::array<int, 4> corners;
      std::array<double, 4> share;
      grid_.shares(static_cast<double>(look.u), static_cast<double>(look.v), corners, share);
      std::array<std::pair<int, double>, 5> row;
      for (std::size_t k = 0; k < 4; ++k) row[k] = {corners[k], share[k]};
      row[4] = {grid_.count() + look.picture, 1};
      const auto y = static_cast<double>(look.celsius);
      for (const auto& [a, p] : row) {
        right[a] += w * p * y;
        for (const auto& [b, q] : row) normal(a, b) += w * p * q;
        mean.emplace_back(a, w * p);
      }
      all += w;
      sum += w * y;
    }
    if (all == 0) return;
    for (const auto& [a, p] : mean) {
      right[a] -= p * sum / all;
      for (const auto& [b, q] : mean) normal(a, b) -= p * q / all;
    }
  }

  /// What is expected beforehand: a function that is small and bends little; offsets are held where no point tells them.
  void expect(bool has_function, Eigen::MatrixXd& normal, Eigen::VectorXd& right) const {
    static_cast<void>(right);
    const double noise = 0.2 * 0.2 * kLooksAlike;
    const double size = has_function ? noise / (kExpectedKelvin * kExpectedKelvin) : 1e12;
    const double bend = noise / (kExpectedBendKelvin * kExpectedBendKelvin);
    for (int i = 0; i < grid_.count(); ++i) normal(i, i) += size;
    for (int i = grid_.count(); i < normal.rows(); ++i) normal(i, i) += 1e-3;
    const auto add_bend = [&](int before, int at, int after) {
      const std::array<std::pair<int, double>, 3> row{{{before, 1}, {at, -2}, {after, 1}}};
      for (const auto& [a, p] : row) {
        for (const auto& [b, q] : row) normal(a, b) += bend * p * q;
      }
    };
    for (int y = 0; y < grid_.down; ++y) {
      for (int x = 0; x < grid_.across; ++x) {
        const int at = y * grid_.across + x;
        if (x > 0 && x + 1 < grid_.across) add_bend(at - 1, at, at + 1);
        if (y > 0 && y + 1 < grid_.down) add_bend(at - grid_.across, at, at + grid_.across);
      }
    }
  }

  const Grid grid_;
  const std::vector<Look> looks_;  ///< Those of a point follow each other.
  const int picture_count_;
};

/// Of the looks at a point from the first of them, in the middle over all, pixels.
double median_distance(const std::vector<Look>& looks) {
  std::vector<float> distances;
  std::size_t first = 0;
  for (std::size_t i = 0; i < looks.size(); ++i) {
    if (looks[i].point != looks[first].point) first = i;
    if (i != first) distances.push_back(std::hypot(looks[i].u - looks[first].u, looks[i].v - looks[first].v));
  }
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return static_cast<double>(*middle);
}

std::string text(double value) {
  const std::string words = std::to_string(value);
  return words.substr(0, words.find('.') + 3);
}

}  // namespace

base::Result<Vignetting> find_vignetting(const SurfacePoints& points, const ThermalPictures& pictures,
                                         const ThermalCalibration& calibration, const Trajectory& trajectory,
                                         jobs::WorkerPool& pool, const base::Progress& progress) {
  const auto refused = [](const std::string& what) {
    return base::failure(ErrorCode::Inconsistent, "the vignetting of the thermal camera cannot be told: " + what);
  };
  std::vector<std::vector<HeatLook>> seen(pictures.pictures.size());
  pool.for_each(seen.size(), [&](std::size_t i) {
    const PoseAnswer depth = trajectory.at(pictures.stamps_s[i] + calibration.delay_s);
    if (depth.state != PoseState::Known) return;
    seen[i] = looks_at(points, pictures.pictures[i], calibration.camera, depth.pose * calibration.from_depth.inverse());
  });
  base::report(progress, kVignettingPhase, 0.2);
  // Points that several pictures show, in the order of the points.
  std::vector<std::vector<Look>> of_point(points.positions.size());
  Vignetting found;
  int picture = 0;
  for (const auto& looks : seen) {
    if (looks.empty()) continue;
    for (const HeatLook& look : looks)
      of_point[look.point].push_back({look.point, picture, look.u, look.v, look.celsius});
    ++picture;
  }
  std::erase_if(of_point, [](const auto& looks) { return looks.size() < 2; });
  const std::size_t step = of_point.size() / kMostPoints + 1;
  std::vector<Look> looks;
  for (std::size_t i = 0; i < of_point.size(); i += step) {
    const std::size_t count = std::min(kLooksOfPoint, of_point[i].size());
    for (std::size_t k = 0; k < count; ++k) looks.push_back(of_point[i][k * of_point[i].size() / count]);
    ++found.point_count;
  }
  found.picture_count = static_cast<std::size_t>(picture);
  found.look_count = looks.size();
  if (found.picture_count < kLeastPictures || found.look_count < kLeastLooks) {
    return refused(std::to_string(found.picture_count) + " pictures with a pose see points together " +
                   std::to_string(found.look_count) + " times, and " + std::to_string(kLeastPictures) + " and " +
                   std::to_string(kLeastLooks) + " are wanted");
  }
  const CameraModel& camera = calibration.camera;
  const double apart = median_distance(looks), wanted = kLeastCellsApart * camera.width / kCellsAcross;
  if (apart < wanted) {
    return refused("the same points are seen at places only " + text(apart) + " pixels apart in the middle, and " +
                   text(wanted) + " are wanted; turn and move the camera more");
  }
  const Solver solver(camera, std::move(looks), picture);
  std::array<Fit, 4> fits;  // of the halves, of all, of all without the function
  pool.for_each(fits.size(), [&](std::size_t i) { fits[i] = solver.fit(static_cast<int>(i), i < 3); });
  base::report(progress, kVignettingPhase, 0.9);
  found.residual_after_kelvin = fits[2].residual_kelvin;
  found.residual_before_kelvin = fits[3].residual_kelvin;

  const std::vector<bool> is_seen = solver.looked_at();
  const auto corners = static_cast<double>(is_seen.size());
  const auto seen_count = static_cast<double>(std::count(is_seen.begin(), is_seen.end(), true));
  found.covered = seen_count / corners;
  std::array<double, 3> mean{};
  for (std::size_t k = 0; k < is_seen.size(); ++k) {
    for (std::size_t f = 0; f < 3 && is_seen[k]; ++f)
      mean[f] += fits[f].unknowns[static_cast<Eigen::Index>(k)] / seen_count;
  }
  std::vector<double> differences;
  for (std::size_t k = 0; k < is_seen.size(); ++k) {
    if (!is_seen[k]) continue;
    const auto of = [&](std::size_t f) { return fits[f].unknowns[static_cast<Eigen::Index>(k)] - mean[f]; };
    // Each half errs by twice the variance of the whole; they differ by four times.
    differences.push_back(0.5 * std::abs(of(0) - of(1)));
    found.spread_kelvin += of(2) * of(2) / seen_count;
  }
  found.spread_kelvin = std::sqrt(found.spread_kelvin);
  const auto middle = differences.begin() + static_cast<std::ptrdiff_t>(differences.size() / 2);
  std::nth_element(differences.begin(), middle, differences.end());
  found.sigma_kelvin = *middle / 0.6745;
  if (!(found.spread_kelvin > 2 * found.sigma_kelvin)) {
    return refused("what was found, " + text(found.spread_kelvin) +
                   " K in root mean square, is not more than twice its error, " + text(found.sigma_kelvin) +
                   " K; there is none that counts, or more pictures from other places are needed");
  }
  found.picture = {camera.width, camera.height, {}};
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x)
      found.picture.pixels.push_back(static_cast<float>(solver.value(fits[2].unknowns, x, y) - mean[2]));
  }
  return found;
}

}  // namespace spectra::mapping
