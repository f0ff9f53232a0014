#include "server/mapping/trajectory.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <sstream>

namespace spectra::mapping {
namespace {

constexpr double kSameMoment = 1e-6;

/// Eight numbers; false when there are not as many.
bool parse_line(const std::string& line, std::array<double, 8>& values) {
  const char* at = line.c_str();
  for (double& value : values) {
    char* end = nullptr;
    value = std::strtod(at, &end);
    if (end == at) return false;
    at = end;
  }
  return true;
}

}  // namespace

std::optional<Eigen::Isometry3d> pose_of(std::span<const double> v) {
  if (v.size() != 8) return std::nullopt;
  const Eigen::Quaterniond rotation(v[7], v[4], v[5], v[6]);
  const bool is_finite = std::all_of(v.begin(), v.end(), [](double value) { return std::isfinite(value); });
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = Eigen::Vector3d(v[1], v[2], v[3]);
  if (!is_finite || !is_in_range(pose) || !(std::abs(rotation.norm() - 1) <= 0.05)) return std::nullopt;
  pose.linear() = rotation.normalized().toRotationMatrix();
  return pose;
}

Eigen::Isometry3d pose_between(const Eigen::Isometry3d& first, const Eigen::Isometry3d& second, double share) {
  const Eigen::Quaterniond a(first.linear()), b(second.linear());
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = a.slerp(share, b).normalized().toRotationMatrix();
  pose.translation() = (1 - share) * first.translation() + share * second.translation();
  return pose;
}

base::Result<Trajectory> Trajectory::read(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) return base::failure(base::ErrorCode::FileNotFound, file.string() + ": the poses cannot be read");
  const std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  Trajectory trajectory = from_text(text);
  if (trajectory.size() == 0) {
    return base::failure(
        base::ErrorCode::BadValue,
        file.string() + ": there is no pose in it; lines of timestamp tx ty tz qx qy qz qw are wanted");
  }
  return trajectory;
}

Trajectory Trajectory::from_text(const std::string& text) {
  Trajectory trajectory;
  std::istringstream lines(text);
  std::string line;
  while (std::getline(lines, line)) {
    const auto first = line.find_first_not_of(" \t\r");
    if (first == std::string::npos || line[first] == '#') continue;
    std::array<double, 8> v{};
    const auto pose = parse_line(line, v) ? pose_of(v) : std::nullopt;
    if (!pose) {
      ++trajectory.notes_.unreadable;
      continue;
    }
    trajectory.add(v[0], *pose);
  }
  return trajectory;
}

void Trajectory::add(double time_s, const Eigen::Isometry3d& pose) {
  if (!times_.empty() && !(time_s > times_.back())) {
    ++notes_.backwards;
    return;
  }
  times_.push_back(time_s);
  poses_.push_back(pose);
  const std::size_t last = times_.size() - 1;
  const bool has_jumped = last > 0 && is_near(last - 1) && is_jump(last - 1);
  jumps_.push_back((last > 0 ? jumps_[last - 1] : 0) + (has_jumped ? 1 : 0));
}

void Trajectory::change_to(bool is_world_to_camera, const Eigen::Isometry3d& camera_from_own) {
  const Eigen::Isometry3d own_from_camera = camera_from_own.inverse();
  for (Eigen::Isometry3d& pose : poses_) pose = (is_world_to_camera ? pose.inverse() : pose) * own_from_camera;
}

void Trajectory::move(const Eigen::Isometry3d& by) {
  for (Eigen::Isometry3d& pose : poses_) pose = by * pose;
}

StampedPoses Trajectory::stamped() const {
  StampedPoses all;
  for (std::size_t i = 0; i < times_.size(); ++i) all.emplace_back(times_[i], poses_[i]);
  return all;
}

const Eigen::Isometry3d& Trajectory::nearest(double time_s) const {
  const auto after = static_cast<std::size_t>(std::lower_bound(times_.begin(), times_.end(), time_s) - times_.begin());
  if (after == 0) return poses_.front();
  if (after == times_.size()) return poses_.back();
  return poses_[time_s - times_[after - 1] <= times_[after] - time_s ? after - 1 : after];
}

void Trajectory::forget_before(double time_s) {
  const auto first = std::lower_bound(times_.begin(), times_.end(), time_s) - times_.begin();
  // All but the two before.
  const std::ptrdiff_t gone = std::max<std::ptrdiff_t>(0, first - 2);
  times_.erase(times_.begin(), times_.begin() + gone);
  poses_.erase(poses_.begin(), poses_.begin() + gone);
  jumps_.erase(jumps_.begin(), jumps_.begin() + gone);
}

std::string Trajectory::to_text() const {
  std::string text = "# timestamp tx ty tz qx qy qz qw  (depth camera to world, Hamilton, w last)\n";
  for (std::size_t i = 0; i < times_.size(); ++i) {
    const Eigen::Quaterniond q(poses_[i].linear());
    const Eigen::Vector3d& t = poses_[i].translation();
    char line[200];
    std::snprintf(line, sizeof line, "%.6f %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n", times_[i], t.x(), t.y(), t.z(), q.x(),
                  q.y(), q.z(), q.w());
    text += line;
  }
  return text;
}

bool Trajectory::is_near(std::size_t first) const {
  return times_[first + 1] - times_[first] <= kMaxGapSeconds + kSameMoment;
}

bool Trajectory::is_jump(std::size_t first) const {
  const double seconds = times_[first + 1] - times_[first];
  const double metres = (poses_[first + 1].translation() - poses_[first].translation()).norm();
  const Eigen::Quaterniond a(poses_[first].linear()), b(poses_[first + 1].linear());
  // A little of each is allowed at once, so that close stamps do not make a jump of noise.
  return metres > kMaxMetresPerSecond * seconds + 0.05 || a.angularDistance(b) > kMaxRadiansPerSecond * seconds + 0.05;
}

void Trajectory::set_speed(std::size_t first, std::size_t last, PoseAnswer& answer) const {
  const double seconds = times_[last] - times_[first];
  answer.linear_m_per_s = (poses_[last].translation() - poses_[first].translation()) / seconds;
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(poses_[last].linear() * poses_[first].linear().transpose()));
  answer.angular_rad_per_s = turn.axis() * (turn.angle() / seconds);
}

PoseAnswer Trajectory::at(double time_s) const {
  PoseAnswer answer;
  if (!std::isfinite(time_s) || times_.empty()) return answer;
  const auto after = std::lower_bound(times_.begin(), times_.end(), time_s - kSameMoment);
  if (after == times_.end()) return answer;
  const auto i = static_cast<std::size_t>(after - times_.begin());
  answer.jumps_before = jumps_[i];
  if (*after <= time_s + kSameMoment) {
    const bool has_before = i > 0 && is_near(i - 1), has_next = i + 1 < times_.size() && is_near(i);
    const bool good_before = has_before && !is_jump(i - 1), good_next = has_next && !is_jump(i);
    answer.state = (has_before || has_next) && !good_before && !good_next ? PoseState::Jumping : PoseState::Known;
    answer.pose = poses_[i];
    if (good_before || good_next) set_speed(good_before ? i - 1 : i, good_next ? i + 1 : i, answer);
    return answer;
  }
  if (i == 0 || !is_near(i - 1)) return answer;
  if (is_jump(i - 1)) {
    answer.state = PoseState::Jumping;
    return answer;
  }
  const double share = (time_s - times_[i - 1]) / (times_[i] - times_[i - 1]);
  answer.state = PoseState::Known;
  answer.pose = pose_between(poses_[i - 1], poses_[i], share);
  set_speed(i - 1, i, answer);
  return answer;
}

}  // namespace spectra::mapping
