#include "server/mapping/simulated_drive.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "fusion/demo/demo_scene.hpp"
#include "fusion/demo/noise.hpp"
#include "server/mapping/picture_renderer.hpp"

namespace spectra::mapping {
namespace {

using demo::Random;

// Depth: structured light with a base line of 75 mm.
constexpr double kDisparityMetres = 585 * 0.075;  ///< Disparity in pixels = this / z.
constexpr double kDisparityStep = 0.125, kDisparityNoise = 0.067, kJitterPixels = 0.5;
constexpr double kNearestDepth = 0.4, kFarthestDepth = 6;
constexpr float kLeastDepthCosine = 0.1736F;  ///< Of 80 degrees.
// Temperature.
constexpr int kFiner = 2;  ///< Pixels of the rendering to one of the sensor, each way.
constexpr double kSpreadPixels = 1.2, kWhiteKelvin = 0.04, kStepKelvin = 0.04, kLagSeconds = 0.010;
constexpr double kPatternKelvinPerSecond = 0.015, kShutterEvery = 8, kShutterClosed = 0.35;
constexpr double kWalkKelvin = 0.08, kShutterKelvin = 0.3;
constexpr double kEmissivity = 0.95, kReflectedCelsius = 17.5, kOutsideCelsius = 16.5, kKelvin = 273.15;
constexpr double kPoseHz = 50;

struct WayPoint {
  Eigen::Vector3d from, to;
};

/// Where the robot goes and what it looks at, round and round: x to the right, y up, z towards the open front.
const std::array<WayPoint, 13>& way() {
  static const std::array<WayPoint, 13> points{{{{-0.8, 1.7, 4.2}, {-0.3, 0.8, 0.0}},
                                                {{-2.4, 1.5, 2.4}, {0.6, 0.6, -0.9}},
                                                {{-2.2, 1.5, 1.2}, {-3.6, 0.8, 0.1}},
                                                {{-1.2, 1.6, 0.2}, {-3.4, 0.8, -0.6}},
                                                {{-1.4, 1.5, -0.2}, {-2.5, 1.0, -2.6}},
                                                {{-0.4, 1.5, -0.4}, {0.2, 1.1, -2.8}},
                                                {{0.4, 1.5, -0.2}, {1.6, 1.1, -2.8}},
                                                {{0.8, 1.6, 0.4}, {2.8, 0.7, -1.2}},
                                                {{0.0, 1.5, 0.2}, {0.9, 0.3, 1.2}},
                                                {{-0.6, 1.4, 0.9}, {0.3, 0.2, 1.3}},
                                                {{0.1, 1.3, 2.4}, {0.2, 0.2, 1.3}},
                                                {{2.2, 1.7, 3.4}, {0.6, 0.5, -0.6}},
                                                {{1.0, 1.8, 4.2}, {0.6, 0.8, -1.0}}}};
  return points;
}

/// Smooth through p1 and p2 (Catmull and Rom).
Eigen::Vector3d spline(const Eigen::Vector3d& p0, const Eigen::Vector3d& p1, const Eigen::Vector3d& p2,
                       const Eigen::Vector3d& p3, double t) {
  return p1 + 0.5 * t * (p2 - p0 + t * (2 * p0 - 5 * p1 + 4 * p2 - p3 + t * (3 * (p1 - p2) + p3 - p0)));
}

CameraModel pinhole(int width, int height, double focal) {
  CameraModel camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = focal;
  camera.cx = 0.5 * (width - 1);
  camera.cy = 0.5 * (height - 1);
  return camera;
}

double to_fourth(double celsius) {
  const double kelvin = celsius + kKelvin;
  return kelvin * kelvin * kelvin * kelvin;
}

/// What a camera reads of a surface of this temperature: less of its own and more of the room's, the more the more askew.
double apparent_celsius(double celsius, double cosine) {
  const double askew = 1 - cosine;
  const double emissivity = kEmissivity * (1 - askew * askew * askew * askew * askew);
  return std::sqrt(std::sqrt(emissivity * to_fourth(celsius) + (1 - emissivity) * to_fourth(kReflectedCelsius))) -
         kKelvin;
}

/// Spreads a picture by a Gaussian.
void blur(std::vector<float>& picture, int width, int height, double sigma) {
  const int reach = static_cast<int>(std::ceil(3 * sigma));
  std::vector<float> weights;
  float sum = 0;
  for (int k = -reach; k <= reach; ++k) {
    weights.push_back(static_cast<float>(std::exp(-0.5 * k * k / (sigma * sigma))));
    sum += weights.back();
  }
  std::vector<float> across(picture.size());
  const auto pass = [&](const std::vector<float>& in, std::vector<float>& out, int length, int lines, int along,
                        int beside) {
    for (int line = 0; line < lines; ++line) {
      for (int i = 0; i < length; ++i) {
        float total = 0;
        for (int k = -reach; k <= reach; ++k) {
          const int at = std::clamp(i + k, 0, length - 1);
          total +=
              weights[static_cast<std::size_t>(k + reach)] * in[static_cast<std::size_t>(line * beside + at * along)];
        }
        out[static_cast<std::size_t>(line * beside + i * along)] = total / sum;
      }
    }
  };
  pass(picture, across, width, height, 1, width);
  pass(across, picture, height, width, width, 1);
}

template <class Value>
auto mixed(const RenderedPicture& picture, std::size_t pixel, const base::Triangle& t, Value value) {
  const float b = picture.share_b[pixel], c = picture.share_c[pixel];
  return (1 - b - c) * value(t[0]) + b * value(t[1]) + c * value(t[2]);
}

}  // namespace

SimulatedDrive::SimulatedDrive(const DriveOptions& options, const base::Progress& progress)
    : options_(options), truth_(demo::true_demo_scene({options.vertex_count, options.seed}, progress)) {
  const int n = options.finer_than;
  calibration_.depth.camera = pinhole(640 / n, 480 / n, 585.0 / n);
  auto& colour = calibration_.colour.emplace();
  colour.camera = pinhole(640 / n, 480 / n, 525.0 / n);
  colour.from_depth.translation() = Eigen::Vector3d(-0.025, 0, 0);
  auto& thermal = calibration_.thermal.emplace();
  thermal.camera = pinhole(384 / n, 288 / n, 290.0 / n);
  thermal.from_depth.translation() = Eigen::Vector3d(0.045, 0.012, 0);
  thermal.from_depth.linear() = Eigen::AngleAxisd(0.01, Eigen::Vector3d(0.3, 0.9, 0.1).normalized()).toRotationMatrix();
  thermal.netd_kelvin = kWhiteKelvin;
  thermal.emissivity = kEmissivity;
  thermal.reflected_celsius = kReflectedCelsius;
  Random random(options.seed * 7919 + 1);
  const auto count = static_cast<std::size_t>(thermal.camera.width) * static_cast<std::size_t>(thermal.camera.height);
  std::vector<float> columns;
  for (int x = 0; x < thermal.camera.width; ++x) columns.push_back(static_cast<float>(random.normal()));
  for (std::size_t i = 0; i < count; ++i) {
    pattern_.push_back(static_cast<float>(0.8 * random.normal()) + 0.6F * columns[i % columns.size()]);
  }
  plan_rows();
  tell_poses();
}

SimulatedDrive::~SimulatedDrive() = default;

Eigen::Isometry3d SimulatedDrive::true_pose(double time_s) const {
  constexpr double kRoundSeconds = 60;
  const auto& points = way();
  const auto n = static_cast<double>(points.size());
  // Other seeds begin elsewhere and look a little higher or lower.
  Random random(options_.seed);
  const double begin = options_.seed == 1 ? 0 : random.uniform() * n;
  const double higher = options_.seed == 1 ? 0 : random.uniform(-0.15, 0.15);
  double at = std::fmod(begin + time_s / kRoundSeconds * n, n);
  if (at < 0) at += n;
  const auto i = static_cast<std::size_t>(at);
  const double t = at - static_cast<double>(i);
  const auto point = [&](std::size_t k) -> const WayPoint& {
    return points[(i + points.size() + k - 1) % points.size()];
  };
  const Eigen::Vector3d from = spline(point(0).from, point(1).from, point(2).from, point(3).from, t);
  const Eigen::Vector3d to =
      spline(point(0).to, point(1).to, point(2).to, point(3).to, t) + Eigen::Vector3d(0, higher, 0);
  const Eigen::Vector3d ahead = (to - from).normalized(), right = ahead.cross(Eigen::Vector3d::UnitY()).normalized();
  Eigen::Isometry3d pose;
  pose.linear().col(0) = right;
  pose.linear().col(1) = ahead.cross(right);
  pose.linear().col(2) = ahead;
  pose.translation() = from;
  pose.makeAffine();
  return pose;
}

void SimulatedDrive::plan_rows() {
  std::vector<Row> rows;
  for (int i = 0; i / options_.depth_hz < options_.seconds; ++i)
    rows.push_back({i / options_.depth_hz, false, 0, 0, 0});
  Random random(options_.seed * 104729 + 3);
  double offset = 0, last = 0, last_shutter = 0;
  for (int i = 0; 0.013 + i / options_.thermal_hz < options_.seconds; ++i) {
    const double time = 0.013 + i / options_.thermal_hz;
    offset += kWalkKelvin * std::sqrt(time - last) * random.normal();
    last = time;
    const double shutter = std::floor(time / kShutterEvery) * kShutterEvery;
    if (shutter > last_shutter) {
      offset += kShutterKelvin * random.normal();
      last_shutter = shutter;
    }
    rows.push_back({time, true, offset, time - shutter, 0});
  }
  const auto stamp = [this](const Row& row) { return row.time_s + (row.is_thermal ? options_.clock_offset_s : 0); };
  std::sort(rows.begin(), rows.end(), [&stamp](const Row& a, const Row& b) {
    return std::pair(stamp(a), a.is_thermal) < std::pair(stamp(b), b.is_thermal);
  });
  std::size_t open = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const bool is_closed =
        rows[i].is_thermal && rows[i].time_s > kShutterEvery && rows[i].since_shutter_s < kShutterClosed;
    if (rows[i].is_thermal && !is_closed) open = i;
    rows[i].shown = is_closed ? open : i;
  }
  rows_ = std::move(rows);
}

void SimulatedDrive::tell_poses() {
  Random random(options_.seed * 15485863 + 5);
  Eigen::Isometry3d drift = Eigen::Isometry3d::Identity();
  const double step = options_.pose_drift_m / std::sqrt(kPoseHz);
  for (int i = -5; i / kPoseHz < options_.seconds + 0.2; ++i) {
    const double time = i / kPoseHz;
    told_.add(time, drift * true_pose(time));
    if (step <= 0) continue;
    const auto vector = [&random] {
      Eigen::Vector3d v;
      for (double& value : v.reshaped()) value = random.normal();
      return v;
    };
    drift.translation() += step * vector();
    const Eigen::Vector3d turn = step * vector();
    drift.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix() * drift.linear();
  }
}

double SimulatedDrive::stamp_s(std::size_t index) const {
  return rows_[index].time_s + (rows_[index].is_thermal ? options_.clock_offset_s : 0);
}

Frame SimulatedDrive::frame(std::size_t index) const {
  const Row& row = rows_[index];
  Frame frame;
  frame.time_s = stamp_s(index);
  if (row.is_thermal) {
    take_thermal(rows_[row.shown], row.shown, frame);
  } else {
    take_depth(row, index, frame);
  }
  return frame;
}

void SimulatedDrive::take_depth(const Row& row, std::size_t index, Frame& frame) const {
  const CameraModel& camera = calibration_.depth.camera;
  const Eigen::Isometry3d pose = true_pose(row.time_s);
  const RenderedPicture seen = render(truth_, camera, pose);
  Random random(options_.seed * 1'000'003 + index);
  frame.depth = {camera.width, camera.height, std::vector<std::uint16_t>(seen.depth_m.size(), 0)};
  const auto at = [&](int x, int y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(camera.width) + static_cast<std::size_t>(x);
  };
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      // The disparity is that of a place nearby; between near and far it is one between.
      const double u = std::clamp(x + kJitterPixels * random.normal(), 0.0, camera.width - 1.001);
      const double v = std::clamp(y + kJitterPixels * random.normal(), 0.0, camera.height - 1.001);
      const double noise = kDisparityNoise * random.normal();
      const int i = static_cast<int>(u), j = static_cast<int>(v);
      if (seen.cosine[at(x, y)] < kLeastDepthCosine) continue;
      double z = 0;
      bool is_seen = true;
      for (const auto& [du, dv] : {std::pair{0, 0}, {1, 0}, {0, 1}, {1, 1}}) {
        const float depth = seen.depth_m[at(i + du, j + dv)];
        is_seen = is_seen && std::isfinite(depth);
        const double share = (du != 0 ? u - i : 1 - u + i) * (dv != 0 ? v - j : 1 - v + j);
        if (is_seen) z += share * static_cast<double>(depth);
      }
      if (!is_seen || z < kNearestDepth || z > kFarthestDepth) continue;
      const double disparity = std::round((kDisparityMetres / z + noise) / kDisparityStep) * kDisparityStep;
      if (disparity > 0)
        frame.depth.pixels[at(x, y)] = static_cast<std::uint16_t>(std::lround(1000 * kDisparityMetres / disparity));
    }
  }
  const CameraModel& colour_camera = calibration_.colour->camera;
  const RenderedPicture look = render(truth_, colour_camera, pose * calibration_.colour->from_depth.inverse());
  frame.colour = {colour_camera.width, colour_camera.height,
                  std::vector<base::Rgb8>(look.depth_m.size(), {200, 205, 210})};
  for (std::size_t pixel = 0; pixel < look.triangle.size(); ++pixel) {
    if (look.triangle[pixel] == RenderedPicture::kNothing) continue;
    const base::Triangle& t = truth_.triangles()[look.triangle[pixel]];
    const auto level = [&](auto channel) {
      const float value =
          mixed(look, pixel, t, [&](std::uint32_t v) { return static_cast<float>(truth_.visible()[v].*channel); });
      return static_cast<std::uint8_t>(
          std::clamp(value + static_cast<float>(2 * random.normal()) + 0.5F, 0.0F, 255.0F));
    };
    frame.colour.pixels[pixel] = {level(&base::Rgb8::r), level(&base::Rgb8::g), level(&base::Rgb8::b)};
  }
}

void SimulatedDrive::take_thermal(const Row& row, std::size_t index, Frame& frame) const {
  const CameraModel& camera = calibration_.thermal->camera;
  CameraModel fine = pinhole(camera.width * kFiner, camera.height * kFiner, camera.fx * kFiner);
  std::vector<float> celsius(static_cast<std::size_t>(fine.width) * static_cast<std::size_t>(fine.height), 0);
  // A pixel follows what it sees as exp(-t / lag): two moments stand for it (Gauss and Laguerre).
  for (const auto& [lags, weight] : {std::pair{0.585786, 0.853553F}, {3.414214, 0.146447F}}) {
    const Eigen::Isometry3d pose =
        true_pose(row.time_s - lags * kLagSeconds) * calibration_.thermal->from_depth.inverse();
    const RenderedPicture seen = render(truth_, fine, pose);
    for (std::size_t pixel = 0; pixel < celsius.size(); ++pixel) {
      double value = kOutsideCelsius;
      if (seen.triangle[pixel] != RenderedPicture::kNothing) {
        const base::Triangle& t = truth_.triangles()[seen.triangle[pixel]];
        const float own = mixed(seen, pixel, t, [&](std::uint32_t v) { return truth_.temperature_celsius()[v]; });
        value = apparent_celsius(static_cast<double>(own), static_cast<double>(seen.cosine[pixel]));
      }
      celsius[pixel] += weight * static_cast<float>(value);
    }
  }
  blur(celsius, fine.width, fine.height, kSpreadPixels * kFiner);
  Random random(options_.seed * 2'000'003 + index);
  frame.thermal = {camera.width, camera.height, {}};
  frame.thermal.pixels.reserve(pattern_.size());
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      double sum = 0;
      for (int k = 0; k < kFiner * kFiner; ++k) {
        const int u = x * kFiner + k % kFiner, v = y * kFiner + k / kFiner;
        sum += static_cast<double>(
            celsius[static_cast<std::size_t>(v) * static_cast<std::size_t>(fine.width) + static_cast<std::size_t>(u)]);
      }
      const auto pixel =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(camera.width) + static_cast<std::size_t>(x);
      const double pattern = kPatternKelvinPerSecond * row.since_shutter_s * static_cast<double>(pattern_[pixel]);
      const double read = sum / (kFiner * kFiner) + row.offset_kelvin + pattern + kWhiteKelvin * random.normal();
      const double stepped = std::round(read / kStepKelvin) * kStepKelvin;
      frame.thermal.pixels.push_back(static_cast<std::uint16_t>(std::lround(100 * (stepped + kKelvin))));
    }
  }
}

}  // namespace spectra::mapping
