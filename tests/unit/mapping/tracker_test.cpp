#include "server/mapping/tracker.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "box_world.hpp"
#include "server/mapping/mapper.hpp"

namespace spectra::mapping {
namespace {

/// A camera that looks into a corner with a box, or at a bare wall, and is told only where it begins.
class TrackerTest : public testing::Test {
 protected:
  TrackerTest() {
    settings_.voxel_m = 0.02;
    settings_.is_tracking = true;
    for (int i = 0; i <= 400; ++i) trajectory_.add(0.01 * i, pose_at(0.01 * i));
  }

  static Eigen::Isometry3d pose_at(double time_s) {
    Eigen::Isometry3d pose = looking_ahead(0.15 * std::sin(time_s), 0.05 * time_s, 0.1 * std::sin(0.7 * time_s),
                                           0.05 * std::sin(1.2 * time_s));
    return pose;
  }

  Frame depth_at(double time_s, const BoxWorld& world) const {
    Frame frame;
    frame.time_s = time_s;
    frame.depth = world.depth(calibration_.depth.camera, pose_at(time_s));
    return frame;
  }
  Frame thermal_at(double time_s, const BoxWorld& world) const {
    Frame frame;
    frame.time_s = time_s;
    frame.thermal = world.thermal(calibration_.thermal->camera, pose_at(time_s));
    return frame;
  }

  /// The largest distance of a pose that was found from the true one, and how many were found.
  double largest_error(const Mapper& mapper, double begin_s, double end_s, std::size_t& count) const {
    double largest = 0;
    count = 0;
    for (int i = 0; i <= 200; ++i) {
      const double time = 0.05 * i;
      const PoseAnswer found = mapper.tracked().at(time);
      if (time < begin_s || time > end_s || found.state != PoseState::Known) continue;
      largest = std::max(largest, (found.pose.translation() - pose_at(time).translation()).norm());
      ++count;
    }
    return largest;
  }

  static double pattern(const Eigen::Vector3d& p) { return 22 + 3 * std::sin(9 * p.x()) * std::cos(8 * p.y()); }

  const BoxWorld corner_{{{{-1.6, -1.2, 2}, {1.6, 1.2, 2.4}, pattern},
                          {{-1.6, -1.2, 0.6}, {-0.7, 1.2, 2.2}, pattern},
                          {{-1.6, 0.5, 0.6}, {1.6, 1.2, 2.2}, pattern},
                          {{0.1, -0.3, 1.5}, {0.5, 0.3, 1.8}, pattern}}};
  const BoxWorld wall_{{{{-2.5, -2, 1.5}, {2.5, 2, 2}, pattern}}};
  Calibration calibration_ = small_cameras();
  MapperSettings settings_;
  Trajectory trajectory_;
  jobs::WorkerPool pool_{1};
  FaultLog faults_;
};

TEST_F(TrackerTest, FindsPosesFromDepthAlone) {
  Mapper mapper(calibration_, settings_, pool_);
  for (int i = 0; i <= 40; ++i) mapper.fuse(depth_at(0.05 * i, corner_), trajectory_, faults_);
  std::size_t count = 0;
  EXPECT_LT(largest_error(mapper, 0, 2, count), 0.006);
  EXPECT_EQ(count, 41U);
  EXPECT_EQ(mapper.figures().tracked_frames, 40U);
  EXPECT_EQ(mapper.figures().lost_frames, 0U);
  EXPECT_LT(mapper.figures().tracking_residual_m, 0.005);
}

TEST_F(TrackerTest, FollowsMotionsThatReachBeyondWhatTheMapKnows) {
  // From the second picture on at 0.8 rad/s: walls move by 16 cm between two pictures, the map knows 8 about them.
  const auto turning_at = [](int i) { return looking_ahead(0.1 - 0.03 * i, 0, 0.02 * i, 0.1 - 0.08 * i); };
  Trajectory first;
  first.add(0, turning_at(0));
  Mapper mapper(calibration_, settings_, pool_);
  for (int i = 0; i <= 5; ++i) {
    Frame frame;
    frame.time_s = 0.1 * i;
    frame.depth = corner_.depth(calibration_.depth.camera, turning_at(i));
    mapper.fuse(frame, first, faults_);
    const PoseAnswer found = mapper.tracked().at(frame.time_s);
    ASSERT_EQ(found.state, PoseState::Known) << i;
    EXPECT_LT((found.pose.translation() - turning_at(i).translation()).norm(), 0.01) << i;
  }
}

TEST_F(TrackerTest, TakesOnlyTheFirstPoseAsGiven) {
  Trajectory wrong;
  for (int i = 0; i <= 40; ++i) wrong.add(0.2 * i, i == 0 ? pose_at(0) : looking_ahead(0, 0, -3));
  Mapper mapper(calibration_, settings_, pool_);
  for (int i = 0; i <= 20; ++i) mapper.fuse(depth_at(0.05 * i, corner_), wrong, faults_);
  std::size_t count = 0;
  EXPECT_LT(largest_error(mapper, 0, 1, count), 0.006);
  EXPECT_EQ(count, 21U);
  for (const FrameFault& fault : faults_.all()) EXPECT_EQ(fault.count, 0U) << fault.what;
}

TEST_F(TrackerTest, BeginsAtTheOriginWithoutPoses) {
  Mapper mapper(calibration_, settings_, pool_);
  for (int i = 0; i <= 4; ++i) mapper.fuse(depth_at(0.05 * i, corner_), Trajectory(), faults_);
  EXPECT_EQ(mapper.tracked().size(), 5U);
  EXPECT_TRUE(mapper.tracked().at(0).pose.isApprox(Eigen::Isometry3d::Identity()));
}

TEST_F(TrackerTest, SurvivesDarknessBeforeABareWallByItsTemperatures) {
  Mapper mapper(calibration_, settings_, pool_);
  for (int i = 0; i <= 30; ++i) {
    Frame frame = depth_at(0.05 * i, wall_);
    frame.thermal = thermal_at(0.05 * i, wall_).thermal;
    mapper.fuse(frame, trajectory_, faults_);
  }
  std::size_t count = 0;
  EXPECT_LT(largest_error(mapper, 0, 1.5, count), 0.02);
  EXPECT_EQ(count, 31U);
}

TEST_F(TrackerTest, SaysThatABareWallDoesNotTellAndFusesNothing) {
  Mapper mapper(calibration_, settings_, pool_);
  for (int i = 0; i <= 10; ++i) mapper.fuse(depth_at(0.05 * i, wall_), trajectory_, faults_);
  EXPECT_EQ(mapper.figures().depth_frames, 1U);
  EXPECT_EQ(mapper.figures().lost_frames, 10U);
  EXPECT_EQ(faults_.of(FaultKind::LostTrack).count, 10U);
  EXPECT_NE(faults_.of(FaultKind::LostTrack).what.find("0.050 s"), std::string::npos);
}

TEST_F(TrackerTest, LosesItselfCleanlyAndComesBack) {
  Mapper mapper(calibration_, settings_, pool_);
  for (int i = 0; i <= 10; ++i) mapper.fuse(depth_at(0.05 * i, corner_), trajectory_, faults_);
  const std::size_t fused = mapper.figures().depth_frames;
  // Somewhere else for a while, as after a jump: nothing of it may get into the map.
  for (int i = 11; i <= 20; ++i) {
    Frame frame = depth_at(0.05 * i, corner_);
    frame.depth = corner_.depth(calibration_.depth.camera, looking_ahead(0.5, -0.3, -0.9, 0.9));
    mapper.fuse(frame, trajectory_, faults_);
  }
  EXPECT_EQ(mapper.figures().depth_frames, fused);
  EXPECT_EQ(mapper.figures().lost_frames, 10U);
  for (int i = 21; i <= 30; ++i) {
    Frame frame = depth_at(0.05 * i, corner_);
    frame.depth = corner_.depth(calibration_.depth.camera, pose_at(0.05 * (31 - i)));
    mapper.fuse(frame, trajectory_, faults_);
  }
  EXPECT_GE(mapper.figures().depth_frames, fused + 5);
  const auto back = mapper.tracked().at(0.05 * 30);
  ASSERT_EQ(back.state, PoseState::Known);
  EXPECT_LT((back.pose.translation() - pose_at(0.05).translation()).norm(), 0.01);
  for (const base::Vec3f& p : mapper.whole_mesh().positions) {
    const bool is_surface = std::abs(p.z - 2) < 0.04F || std::abs(p.x + 0.7F) < 0.04F || std::abs(p.y - 0.5F) < 0.04F ||
                            (p.x > 0.04F && p.x < 0.56F && p.z > 1.4F);
    EXPECT_TRUE(is_surface) << p.x << " " << p.y << " " << p.z;
  }
}

TEST_F(TrackerTest, IsTheSameForEveryNumberOfThreads) {
  jobs::WorkerPool more(3);
  Mapper one(calibration_, settings_, pool_), many(calibration_, settings_, more);
  for (int i = 0; i <= 6; ++i) {
    for (Mapper* mapper : {&one, &many}) {
      mapper->fuse(depth_at(0.05 * i, corner_), trajectory_, faults_);
      mapper->fuse(thermal_at(0.05 * i + 0.02, corner_), trajectory_, faults_);
    }
  }
  ASSERT_EQ(one.tracked().size(), 7U);
  EXPECT_TRUE(one.tracked().at(0.3).pose.matrix() == many.tracked().at(0.3).pose.matrix());
}

}  // namespace
}  // namespace spectra::mapping
