#include "server/sources/robot_track.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace spectra::sources {
namespace {

double distance(const base::Vec3d& a, const base::Vec3d& b) {
  return std::hypot(a.x - b.x, a.y - b.y, a.z - b.z);
}

/// To whole millimetres: nobody sees more, and as text they are a third as long.
base::Vec3d rounded(const base::Vec3d& v) {
  const auto millimetre = [](double metres) { return std::round(metres * 1000) / 1000; };
  return {millimetre(v.x), millimetre(v.y), millimetre(v.z)};
}

bool is_finite(const base::Vec3d& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

}  // namespace

bool RobotTrack::take(const RobotPose& pose, bool is_last) {
  const std::lock_guard lock(mutex_);
  const bool is_turn = !pose_ || pose_->is_lost != pose.is_lost;
  pose_ = {pose.at, rounded(pose.position), rounded(pose.forward), rounded(pose.up), pose.is_lost};
  ++moves_;
  if (!pose.is_lost && (points_.empty() || distance(points_.back(), pose.position) >= spacing_m_)) {
    points_.push_back(rounded(pose.position));
    if (points_.size() > kMostPoints) {
      std::size_t kept = 0;
      for (std::size_t i = 0; i < points_.size(); i += 2) points_[kept++] = points_[i];
      points_.resize(kept);
      spacing_m_ *= 2;
      ++thinnings_;
    }
  }
  const bool is_due = std::abs(pose.at - told_at_) >= kTellEveryS;
  if (is_any_told_ && !is_due && !is_turn && !is_last) return false;
  is_any_told_ = true;
  told_at_ = pose.at;
  return true;
}

void RobotTrack::moved(const RobotPose& pose, bool is_last) {
  if (!is_finite(pose.position) || !is_finite(pose.forward) || !is_finite(pose.up) || !std::isfinite(pose.at)) return;
  if (!take(pose, is_last)) return;
  std::vector<std::shared_ptr<const Listener>> listening;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& listener : listeners_) {
      if (auto held = listener.lock()) listening.push_back(std::move(held));
    }
  }
  for (const auto& listener : listening) (*listener)();
}

std::optional<RobotTrack::News> RobotTrack::news(Told& told) const {
  const std::lock_guard lock(mutex_);
  if (!pose_ || told.moves == moves_) return std::nullopt;
  News news{*pose_, told.thinnings == thinnings_ ? told.points : 0, {}};
  news.points.assign(points_.begin() + static_cast<std::ptrdiff_t>(news.first_point), points_.end());
  told = {moves_, thinnings_, points_.size()};
  return news;
}

std::shared_ptr<const RobotTrack::Listener> RobotTrack::subscribe(Listener listener) {
  auto held = std::make_shared<const Listener>(std::move(listener));
  const std::lock_guard lock(mutex_);
  // Without a robot nobody else ever looks through them.
  std::erase_if(listeners_, [](const auto& other) { return other.expired(); });
  listeners_.push_back(held);
  return held;
}

}  // namespace spectra::sources
