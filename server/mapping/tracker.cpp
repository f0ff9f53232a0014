#include "server/mapping/tracker.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace spectra::mapping {
namespace {

constexpr double kKeyMetres = 0.25, kKeyRadians = 0.26;  ///< Between poses to come back to.
constexpr std::size_t kMostKeys = 400;
constexpr std::size_t kTried = 3;             ///< Of the guesses that fit best.
constexpr double kLongestSpeedSeconds = 0.3;  ///< A motion that was seen so long ago tells nothing of now.

double turn_between(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return Eigen::AngleAxisd(Eigen::Matrix3d(a.linear().transpose() * b.linear())).angle();
}

/// A motion done `share` times.
Eigen::Isometry3d part_of(const Eigen::Isometry3d& motion, double share) {
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(motion.linear()));
  Eigen::Isometry3d part = Eigen::Isometry3d::Identity();
  part.linear() = Eigen::AngleAxisd(share * turn.angle(), turn.axis()).toRotationMatrix();
  part.translation() = share * motion.translation();
  return part;
}

}  // namespace

void Tracker::begin(double time_s, const DepthFrame& depth, const Eigen::Isometry3d& pose) {
  keys_.clear();
  has_speed_ = is_lost_ = false;
  seen_now_m_ = counted_depth(depth, std::move(seen_now_m_));
  keep(time_s, pose);
  has_speed_ = false;
}

void Tracker::keep(double time_s, const Eigen::Isometry3d& pose) {
  has_speed_ = time_s - time_s_ < kLongestSpeedSeconds && time_s > time_s_;
  before_ = pose_;
  before_s_ = time_s_;
  pose_ = pose;
  std::swap(seen_before_m_, seen_now_m_);
  time_s_ = time_s;
  const bool is_new = std::none_of(keys_.begin(), keys_.end(), [&](const Eigen::Isometry3d& key) {
    return (key.translation() - pose.translation()).norm() < kKeyMetres && turn_between(key, pose) < kKeyRadians;
  });
  if (!is_new) return;
  if (keys_.size() == kMostKeys) keys_.erase(keys_.begin());
  keys_.push_back(pose);
}

Eigen::Isometry3d Tracker::expected(double time_s) const {
  if (!has_speed_ || time_s - time_s_ > kLongestSpeedSeconds) return pose_;
  return pose_ * part_of(before_.inverse() * pose_, (time_s - time_s_) / (time_s_ - before_s_));
}

Eigen::Isometry3d Tracker::motion_since(double then_s, double time_s) const {
  if (!has_speed_ || std::abs(time_s - then_s) > kLongestSpeedSeconds) return Eigen::Isometry3d::Identity();
  return part_of(before_.inverse() * pose_, (time_s - then_s) / (time_s_ - before_s_));
}

bool Tracker::is_good(const Alignment& found, double matching) const {
  return found.point_count >= rules_.least_points &&
         static_cast<double>(found.matching_count) >= matching * static_cast<double>(found.point_count) &&
         static_cast<double>(found.matching_count) >= rules_.least_fit * static_cast<double>(found.known_count) &&
         found.told > rules_.least_told;
}

std::vector<Eigen::Isometry3d> Tracker::guesses(const VoxelMap& map, const SeenPoints& seen, double time_s,
                                                jobs::WorkerPool& pool) const {
  std::vector<std::pair<std::size_t, Eigen::Isometry3d>> ranked;
  const auto add = [&](const Eigen::Isometry3d& pose) {
    ranked.emplace_back(fit_at(map, seen, seen.coarse_count, pose, pool).matching_count, pose);
  };
  add(expected(time_s));
  add(pose_);
  if (is_lost_) {
    for (const Eigen::Isometry3d& key : keys_) add(key);
  }
  std::stable_sort(ranked.begin(), ranked.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<Eigen::Isometry3d> best;
  for (std::size_t i = 0; i < std::min(kTried, ranked.size()); ++i) best.push_back(ranked[i].second);
  return best;
}

std::optional<Eigen::Isometry3d> Tracker::find(const VoxelMap& map, const TrackedMoment& moment,
                                               jobs::WorkerPool& pool) {
  const auto& thermal_camera = calibration_.thermal;
  std::optional<LumaPictures> luma;
  BesideLook<LumaPictures> colour;
  if (rules_.terms.colour && moment.colour != nullptr && calibration_.colour) {
    luma.emplace(*moment.colour, pool);
    colour = {&*luma, &calibration_.colour->camera,
              calibration_.colour->from_depth * motion_since(moment.colour_s, moment.time_s)};
  }
  BesideLook<Picture16> thermal;
  if (rules_.terms.thermal && moment.thermal != nullptr && thermal_camera &&
      std::abs(moment.thermal_s - moment.time_s) < kLongestSpeedSeconds) {
    thermal = {moment.thermal, &thermal_camera->camera,
               thermal_camera->from_depth * motion_since(moment.thermal_s, moment.time_s)};
  }
  const SeenPoints seen = seen_points(*moment.depth, rays_, calibration_.depth.noise, map.voxel_m(), colour, thermal,
                                      thermal_camera ? thermal_camera->vignetting : PictureFloat{});
  last_ = {};
  if (seen.points.size() >= rules_.least_points) {
    const double matching = is_lost_ ? rules_.again_matching : rules_.least_matching;
    seen_now_m_ = counted_depth(*moment.depth, std::move(seen_now_m_));
    if (!is_lost_) {
      Eigen::Isometry3d guess = expected(moment.time_s);
      const Eigen::Isometry3d moved =
          pose_ * motion_between(seen_before_m_, seen_now_m_, rays_, calibration_.depth.camera, seen,
                                 pose_.inverse() * guess, pool);
      const auto matching_at = [&](const Eigen::Isometry3d& pose) {
        return fit_at(map, seen, seen.coarse_count, pose, pool).matching_count;
      };
      if (matching_at(moved) > matching_at(guess)) guess = moved;
      last_ = align(map, seen, guess, rules_.terms, pool);
    }
    if (!is_good(last_, matching)) {
      for (const Eigen::Isometry3d& guess : guesses(map, seen, moment.time_s, pool)) {
        const Alignment found = align(map, seen, guess, rules_.terms, pool);
        if (found.matching_count > last_.matching_count) last_ = found;
        if (is_good(last_, matching)) break;
      }
    }
    if (is_good(last_, matching)) {
      again_ = is_lost_ ? again_ + 1 : 0;
      keep(moment.time_s, last_.world_from_camera);
      if (!is_lost_ || again_ >= rules_.again_count) {
        is_lost_ = false;
        return last_.world_from_camera;
      }
      return std::nullopt;
    }
  }
  is_lost_ = true;
  again_ = 0;
  has_speed_ = false;
  return std::nullopt;
}

}  // namespace spectra::mapping
