#include "server/mapping/mapper.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "server/mapping/depth_fusion.hpp"

namespace spectra::mapping {
namespace {

constexpr std::size_t kLeastEvidence = 200;   ///< Pixels of fit_of that match.
constexpr double kLeastFit = 0.5;             ///< Of those where both have something.
constexpr double kLongestWaitSeconds = 1;     ///< Of a thermal picture, for the pose after it.
constexpr std::size_t kEnoughSpreads = 4096;  ///< For their median to stand.

std::string seconds_text(double seconds) {
  std::string text = std::to_string(seconds);
  return text.substr(0, text.size() - 3) + " s";
}

std::string far_text(double time_s) {
  return "at " + seconds_text(time_s) + " the pose is 1,000 km or more from 0, where voxels are not counted";
}

/// The pose and motion of a camera that is rigidly beside another.
PoseAnswer beside(const PoseAnswer& depth, const Eigen::Isometry3d& from_depth) {
  PoseAnswer other = depth;
  other.pose = depth.pose * from_depth.inverse();
  other.linear_m_per_s += depth.angular_rad_per_s.cross(other.pose.translation() - depth.pose.translation());
  return other;
}

}  // namespace

Mapper::Mapper(const Calibration& calibration, const MapperSettings& settings, jobs::WorkerPool& pool)
    : calibration_(calibration),
      settings_(settings),
      pool_(pool),
      rays_(calibration.depth.camera),
      map_(settings.voxel_m) {
  if (settings.is_tracking) tracker_.emplace(calibration_, rays_, settings.tracker);
  if (settings.submaps && !settings.is_tracking) submaps_.emplace(settings.voxel_m, *settings.submaps);
  if (!calibration.thermal || !settings.use_thermal) return;
  heat_.emplace(*calibration.thermal, settings.heat);
  heat_->set_vignetting(calibration.thermal->vignetting);
}

base::Result<void> Mapper::set_vignetting(PictureFloat picture) {
  const CameraModel* camera = calibration_.thermal ? &calibration_.thermal->camera : nullptr;
  if (camera == nullptr || picture.width != camera->width || picture.height != camera->height) {
    return base::failure(base::ErrorCode::Inconsistent,
                         "the vignetting picture is not of the size of the thermal camera in calibration.json");
  }
  calibration_.thermal->vignetting = picture;
  if (heat_) heat_->set_vignetting(std::move(picture));
  return base::success();
}

void Mapper::fuse(const Frame& frame, const Trajectory& trajectory, FaultLog& faults, FaultLog* faults_of_earlier) {
  if (tracker_) {
    note_time(frame);
    return fuse_tracked(frame, trajectory, faults, faults_of_earlier != nullptr ? *faults_of_earlier : faults);
  }
  if (!frame.depth.empty() && !fuse_surface(frame, trajectory, faults)) return;
  if (!frame.thermal.empty() && heat_) fuse_heat(frame, trajectory, faults);
}

void Mapper::note_time(const Frame& frame) {
  newest_s_ = begin_s_ ? std::max(newest_s_, frame.time_s) : frame.time_s;
  if (!begin_s_) begin_s_ = frame.time_s;
}

bool Mapper::find_pose(const Trajectory& trajectory, double time_s, PoseAnswer& answer, FaultLog& faults) {
  answer = trajectory.at(time_s);
  if (answer.state == PoseState::Unknown) {
    faults.add(FaultKind::NoPose, "at " + seconds_text(time_s) + " no pose is known within 100 ms");
    return false;
  }
  if (answer.state == PoseState::Known && !is_in_range(answer.pose)) {
    faults.add(FaultKind::NoPose, far_text(time_s));
    return false;
  }
  if (answer.state == PoseState::Jumping || answer.jumps_before > jumps_seen_) {
    faults.add(FaultKind::JumpingPose, "at " + seconds_text(time_s) + " the poses jump faster than anything moves");
    jumps_seen_ = std::max(jumps_seen_, answer.jumps_before);
    is_doubtful_ = true;
  }
  return answer.state == PoseState::Known;
}

bool Mapper::fuse_surface(const Frame& frame, const Trajectory& trajectory, FaultLog& faults) {
  PoseAnswer pose;
  if (!find_pose(trajectory, frame.time_s + calibration_.depth.delay_s, pose, faults)) return false;
  note_time(frame);
  depth_ = prepared_depth(frame.depth, calibration_.depth, rays_, kTruncationVoxels * settings_.voxel_m, pool_,
                          std::move(depth_));
  const DepthLook look{depth_, calibration_.depth.camera, rays_, calibration_.depth.noise, pose.pose};
  // Poses after a correction are of another world than those before.
  if (submaps_ && !submaps_->is_open()) is_doubtful_ = false;
  if (is_doubtful_ && fused().block_count() > 0) {
    const FitOfDepth fit = fit_of(fused(), look, pool_);
    const auto both = static_cast<double>(fit.matching + fit.other);
    if (fit.matching < kLeastEvidence || static_cast<double>(fit.matching) < kLeastFit * both) {
      faults.add(FaultKind::UnfittingPose,
                 "at " + seconds_text(frame.time_s) +
                     " the picture does not fit the map where the pose puts it, after poses have jumped");
      return false;
    }
    is_doubtful_ = false;
  }
  if (submaps_ && !submaps_->step(frame.time_s + calibration_.depth.delay_s, pose.pose,
                                  most_bytes_of_fused() > fused().block_bytes())) {
    faults.add(FaultKind::MapFull, full_text(frame.time_s));
    return false;
  }
  fuse_prepared(frame, look, trajectory, faults);
  return true;
}

void Mapper::fuse_prepared(const Frame& frame, const DepthLook& look, const Trajectory& trajectory, FaultLog& faults) {
  std::optional<ColourLook> colour;
  if (!frame.colour.empty() && settings_.use_colour) {
    const PoseAnswer at = trajectory.at(frame.colour_time_s.value_or(frame.time_s) + calibration_.colour->delay_s);
    if (at.state == PoseState::Known) {
      colour.emplace(
          ColourLook{frame.colour, calibration_.colour->camera, at.pose * calibration_.colour->from_depth.inverse()});
      ++figures_.colour_frames;
    }
  }
  const std::size_t not_made = fuse_depth(fused(), look, colour ? &*colour : nullptr, pool_, most_bytes_of_fused());
  if (not_made > 0) faults.add(FaultKind::MapFull, full_text(frame.time_s));
  ++figures_.depth_frames;
}

std::uint64_t Mapper::most_bytes_of_fused() {
  if (!submaps_) return settings_.most_bytes;
  // What is new in a submap is soon in the map that is made of all of them, too.
  const std::uint64_t taken = map_.block_bytes() + submaps_->block_bytes() + submaps_->unbaked_bytes();
  const std::uint64_t rest = settings_.most_bytes > taken ? settings_.most_bytes - taken : 0;
  return fused().block_bytes() + rest / 2;
}

std::string Mapper::full_text(double time_s) const {
  return "at " + seconds_text(time_s) + " the voxels of the map take " + std::to_string(settings_.most_bytes) +
         " bytes, as many as they may: nothing new is mapped, what is known goes on; map with larger voxels, or with "
         "another --limit scene-bytes";
}

std::optional<Eigen::Isometry3d> Mapper::track(const Frame& frame, const DepthFrame& depth,
                                               const Trajectory& trajectory, FaultLog& faults) {
  TrackedMoment moment;
  moment.time_s = frame.time_s + calibration_.depth.delay_s;
  if (!tracker_->has_begun()) {
    // Whoever gives one pose need not give it at the moment of a picture.
    PoseAnswer first = trajectory.at(moment.time_s);
    if (first.state != PoseState::Known && trajectory.size() > 0) first.pose = trajectory.nearest(moment.time_s);
    if (!is_in_range(first.pose)) {
      faults.add(FaultKind::NoPose, far_text(moment.time_s));
      return std::nullopt;
    }
    tracker_->begin(moment.time_s, depth, first.pose);
    return first.pose;
  }
  moment.depth = &depth;
  if (!frame.colour.empty() && calibration_.colour) {
    moment.colour = &frame.colour;
    moment.colour_s = frame.colour_time_s.value_or(frame.time_s) + calibration_.colour->delay_s;
  }
  if (newest_thermal_s_) {
    moment.thermal = &newest_thermal_;
    moment.thermal_s = *newest_thermal_s_;
  }
  const std::optional<Eigen::Isometry3d> pose = tracker_->find(map_, moment, pool_);
  if (!pose) {
    ++figures_.lost_frames;
    faults.add(FaultKind::LostTrack,
               "at " + seconds_text(frame.time_s) +
                   " what is seen no longer tells where it is seen from; nothing is fused until it "
                   "fits the map again");
    return std::nullopt;
  }
  ++figures_.tracked_frames;
  residual_squares_ += tracker_->last().residual_m * tracker_->last().residual_m;
  figures_.tracking_residual_m = std::sqrt(residual_squares_ / static_cast<double>(figures_.tracked_frames));
  return pose;
}

void Mapper::fuse_tracked(const Frame& frame, const Trajectory& trajectory, FaultLog& faults,
                          FaultLog& faults_of_earlier) {
  if (!frame.thermal.empty() && heat_) {
    Frame held;
    held.time_s = frame.time_s;
    held.thermal = frame.thermal;
    held_.push_back(std::move(held));
    if (frame.thermal.pixels != newest_thermal_.pixels) {
      newest_thermal_ = frame.thermal;
      newest_thermal_s_ = frame.time_s + calibration_.thermal->delay_s;
    }
  }
  if (!frame.depth.empty()) {
    depth_ = prepared_depth(frame.depth, calibration_.depth, rays_, kTruncationVoxels * settings_.voxel_m, pool_,
                            std::move(depth_));
    if (const auto pose = track(frame, depth_, trajectory, faults)) {
      tracked_.add(frame.time_s + calibration_.depth.delay_s, *pose);
      fuse_prepared(frame, {depth_, calibration_.depth.camera, rays_, calibration_.depth.noise, *pose}, tracked_,
                    faults);
    }
  }
  // What was taken before the last pose that is known has one, or will never have one.
  const double known_s = tracked_.size() > 0 ? tracked_.end_s() : -std::numeric_limits<double>::infinity();
  const auto waits = [&](const Frame& held) {
    return held.time_s + calibration_.thermal->delay_s > known_s && frame.time_s - held.time_s < kLongestWaitSeconds;
  };
  for (const Frame& held : held_) {
    if (!waits(held)) fuse_heat(held, tracked_, held.time_s < frame.time_s ? faults_of_earlier : faults);
  }
  std::erase_if(held_, [&](const Frame& held) { return !waits(held); });
  if (held_.size() <= kMostHeld) return;
  faults_of_earlier.add(FaultKind::NoPose,
                        "at " + seconds_text(held_.front().time_s) + " more than " + std::to_string(kMostHeld) +
                            " thermal pictures wait for the pose of a depth picture: the oldest are left out");
  held_.erase(held_.begin());
}

void Mapper::fuse_heat(const Frame& frame, const Trajectory& trajectory, FaultLog& faults) {
  PoseAnswer pose;
  const double moment = frame.time_s + calibration_.thermal->delay_s;
  if (!find_pose(trajectory, moment, pose, faults)) return;
  note_time(frame);
  if (is_doubtful_ || (submaps_ && !submaps_->is_open())) return;
  const HeatReport report =
      heat_->fuse(fused(), frame.thermal, beside(pose, calibration_.thermal->from_depth), moment - *begin_s_, pool_);
  ++(report.is_frozen ? figures_.frozen_frames : figures_.thermal_frames);
  if (report.spread_kelvin > 0 && spreads_kelvin_.size() < kEnoughSpreads) {
    const auto at = std::upper_bound(spreads_kelvin_.begin(), spreads_kelvin_.end(), report.spread_kelvin);
    spreads_kelvin_.insert(at, report.spread_kelvin);
    figures_.spread_kelvin = spreads_kelvin_[spreads_kelvin_.size() / 2];
  }
  figures_.largest_offset_kelvin = std::max(figures_.largest_offset_kelvin, std::abs(report.offset_kelvin));
}

PoseAnswer Mapper::found_pose() const {
  PoseAnswer answer;
  if (tracked_.size() == 0) return answer;
  answer = tracked_.at(tracked_.end_s());
  answer.state = tracker_ && !tracker_->is_lost() ? PoseState::Known : PoseState::Unknown;
  return answer;
}

CorrectionReport Mapper::correct(const StampedPoses& poses) {
  return submaps_ ? submaps_->correct(poses) : CorrectionReport{};
}

MeshRules Mapper::mesh_rules() const {
  MeshRules rules = settings_.mesh;
  rules.least_sigma_kelvin =
      std::max(rules.least_sigma_kelvin, static_cast<float>(kSystematic * figures_.spread_kelvin));
  return rules;
}

std::vector<PublishedUnit> Mapper::changed_units(UnitPublisher& publisher, const Eigen::Vector3d& eye,
                                                 jobs::WorkerPool& pool, std::size_t most) {
  if (submaps_) submaps_->bake(map_, false, pool);
  return publisher.take(map_, mesh_rules(), eye, pool, most);
}

UnitMesh Mapper::whole_mesh(const base::Progress& progress) {
  if (submaps_) submaps_->bake(map_, true, pool_);
  std::vector<UnitMesh> units(map_.units().size());
  const MeshRules rules = mesh_rules();
  std::size_t done = 0;
  constexpr std::size_t kGroup = 64;
  while (done < units.size()) {
    const std::size_t count = std::min(kGroup, units.size() - done);
    pool_.for_each(count, [&](std::size_t i) {
      units[done + i] = mesh_of_unit(map_, static_cast<std::int32_t>(done + i), rules);
    });
    done += count;
    base::report(progress, kMeshingPhase, static_cast<double>(done) / static_cast<double>(units.size()));
  }
  return joined(units);
}

}  // namespace spectra::mapping
