#include "server/mapping/trajectory.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "box_world.hpp"

namespace spectra::mapping {
namespace {

TEST(Trajectory, InterpolatesBetweenNeighbours) {
  Trajectory trajectory;
  trajectory.add(10.00, looking_ahead(0, 0, 0, 0));
  trajectory.add(10.10, looking_ahead(0.2, 0, 0, 0.1));
  const PoseAnswer answer = trajectory.at(10.025);
  ASSERT_EQ(answer.state, PoseState::Known);
  EXPECT_NEAR(answer.pose.translation().x(), 0.05, 1e-9);
  EXPECT_NEAR(Eigen::AngleAxisd(answer.pose.linear()).angle(), 0.025, 1e-9);
  EXPECT_NEAR(answer.linear_m_per_s.x(), 2, 1e-9);
  EXPECT_NEAR(answer.angular_rad_per_s.y(), 1, 1e-9);
}

TEST(Trajectory, DoesNotReachAcrossGaps) {
  Trajectory trajectory;
  trajectory.add(0, looking_ahead());
  trajectory.add(0.15, looking_ahead());
  EXPECT_EQ(trajectory.at(0.07).state, PoseState::Unknown);
  EXPECT_EQ(trajectory.at(0.15).state, PoseState::Known);
  EXPECT_EQ(trajectory.at(-0.01).state, PoseState::Unknown);
  EXPECT_EQ(trajectory.at(0.16).state, PoseState::Unknown);
  EXPECT_EQ(trajectory.at(std::nan("")).state, PoseState::Unknown);
}

TEST(Trajectory, LeavesOutPosesThatAreTooFarAway) {
  const Trajectory read =
      Trajectory::from_text("0 0 0 0 0 0 0 1\n1 0 1e6 0 0 0 0 1\n2 0 0 1e308 0 0 0 1\n3 0 0 999999 0 0 0 1\n");
  EXPECT_EQ(read.size(), 2U);
  EXPECT_EQ(read.notes().unreadable, 2U);
}

TEST(Trajectory, KnowsTheNearestPose) {
  Trajectory trajectory;
  for (int i = 0; i < 3; ++i) trajectory.add(i, looking_ahead(i, 0, 0));
  EXPECT_EQ(trajectory.nearest(-5).translation().x(), 0);
  EXPECT_EQ(trajectory.nearest(0.9).translation().x(), 1);
  EXPECT_EQ(trajectory.nearest(1.4).translation().x(), 1);
  EXPECT_EQ(trajectory.nearest(9).translation().x(), 2);
}

TEST(Trajectory, TakesOnePoseThatJumpsAwayAndBackForWrong) {
  Trajectory trajectory;
  for (int i = 0; i < 10; ++i) trajectory.add(0.033 * i, looking_ahead(i == 5 ? 3 : 0.01 * i, 0, 0));
  EXPECT_EQ(trajectory.at(0.033 * 5).state, PoseState::Jumping);
  EXPECT_EQ(trajectory.at(0.033 * 4.5).state, PoseState::Jumping);
  EXPECT_EQ(trajectory.at(0.033 * 4).state, PoseState::Known);
  EXPECT_EQ(trajectory.at(0.033 * 2.5).state, PoseState::Known);
}

TEST(Trajectory, LeavesOutLinesThatAreNoPoseAndCountsThem) {
  const Trajectory trajectory = Trajectory::from_text(
      "# a comment\n0 0 0 0 0 0 0 1\n0.03 nan 0 0 0 0 0 1\n0.06 0 0 0 0 0 0 0\n0.02 1 2\n\n0.05 1 2 3 0 0 0 1\r\n0.04 "
      "1 2 3 0 0 0 1\n");
  EXPECT_EQ(trajectory.size(), 2U);
  EXPECT_EQ(trajectory.notes().unreadable, 3U);
  EXPECT_EQ(trajectory.notes().backwards, 1U);
}

TEST(Trajectory, IsReadAsItWasWritten) {
  Trajectory trajectory;
  trajectory.add(0.25, looking_ahead(1, -2, 3, 0.4));
  trajectory.add(0.3, looking_ahead(1.5, 2, 3, -0.4));
  const Trajectory read = Trajectory::from_text(trajectory.to_text());
  ASSERT_EQ(read.size(), 2U);
  EXPECT_EQ(read.notes().unreadable, 0U);
  EXPECT_TRUE(read.at(0.25).pose.isApprox(trajectory.at(0.25).pose, 1e-8));
  EXPECT_TRUE(read.at(0.3).pose.isApprox(trajectory.at(0.3).pose, 1e-8));
}

TEST(Trajectory, BecomesThatOfAnotherCamera) {
  Trajectory trajectory;
  const Eigen::Isometry3d colour_from_depth = looking_ahead(0.1, 0, 0, 0.3),
                          world_from_depth = looking_ahead(1, 2, 3, 0.5);
  trajectory.add(0, (world_from_depth * colour_from_depth.inverse()).inverse());
  trajectory.change_to(true, colour_from_depth.inverse());
  EXPECT_TRUE(trajectory.at(0).pose.isApprox(world_from_depth, 1e-12));
}

}  // namespace
}  // namespace spectra::mapping
