#include "server/mapping/thermal_delay.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "box_world.hpp"

namespace spectra::mapping {
namespace {

/// A camera that turns and slides to and fro before a wall with a warm patch, and stamps its pictures late.
class ThermalDelayTest : public testing::Test {
 protected:
  static constexpr double kLate = 0.062;

  ThermalDelayTest() {
    points_.spacing_m = 0.03F;
    for (int y = -30; y <= 30; ++y) {
      for (int x = -45; x <= 45; ++x) {
        points_.positions.emplace_back(0.03F * static_cast<float>(x), 0.03F * static_cast<float>(y), 2.0F);
        points_.normals.emplace_back(0, 0, -1);
      }
    }
  }

  static Eigen::Isometry3d moving(double time_s) {
    return looking_ahead(0.2 * std::sin(1.3 * time_s), 0, 0, 0.12 * std::sin(2.1 * time_s));
  }
  static Eigen::Isometry3d standing(double) { return looking_ahead(); }

  void drive(Eigen::Isometry3d (*pose)(double), int count = 60) {
    for (int i = -10; i <= 20 + count * 2; ++i) trajectory_.add(0.05 * i, pose(0.05 * i));
    for (int i = 0; i < count; ++i) {
      const double time = 0.31 + 0.09 * i;
      pictures_.stamps_s.push_back(time + kLate);
      // The offset wanders, as a camera's does.
      pictures_.pictures.push_back(world_.thermal(thermal_.camera, pose(time), 0.3 * std::sin(0.7 * time)));
    }
  }

  base::Result<ThermalDelay> find(double reach_s = 0.2, double middle_s = 0) {
    return find_thermal_delay(points_, pictures_, thermal_, trajectory_, {reach_s, middle_s}, pool_);
  }

  const BoxWorld world_{{{{-1.4, -1, 2}, {1.4, 1, 2.5}, [](const Eigen::Vector3d& p) {
                            return 20 + 6 * std::exp(-8 * (p.x() * p.x() + p.y() * p.y())) + std::sin(5 * p.x());
                          }}}};
  ThermalCalibration thermal_ = *small_cameras().thermal;
  SurfacePoints points_;
  ThermalPictures pictures_;
  Trajectory trajectory_;
  jobs::WorkerPool pool_{1};
};

TEST_F(ThermalDelayTest, IsFoundWithin3Milliseconds) {
  drive(moving);
  const auto found = find();
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_NEAR(found.value().delay_s, -kLate, 0.003);
  EXPECT_LT(found.value().sigma_s, 0.003);
  EXPECT_LT(found.value().residual_kelvin, found.value().typical_residual_kelvin);
}

TEST_F(ThermalDelayTest, IsTheSameForEveryNumberOfThreads) {
  drive(moving, 30);
  const auto found = find(0.1);
  ASSERT_TRUE(found) << found.error().message;
  jobs::WorkerPool more(3);
  const auto again = find_thermal_delay(points_, pictures_, thermal_, trajectory_, {0.1, 0}, more);
  ASSERT_TRUE(again);
  EXPECT_EQ(found.value().delay_s, again.value().delay_s);
  EXPECT_EQ(found.value().sigma_s, again.value().sigma_s);
}

TEST_F(ThermalDelayTest, IsRefusedOfACameraThatStandsStill) {
  drive(standing, 30);
  const auto found = find();
  ASSERT_FALSE(found);
  EXPECT_NE(found.error().message.find("drive or turn"), std::string::npos) << found.error().message;
}

TEST_F(ThermalDelayTest, IsRefusedWhereItLiesBeyondWhatIsTried) {
  drive(moving, 30);
  const auto found = find(0.05, 0.1);
  ASSERT_FALSE(found);
  EXPECT_NE(found.error().message.find("search farther"), std::string::npos) << found.error().message;
}

TEST_F(ThermalDelayTest, IsRefusedOfStills) {
  drive(moving, 40);
  Trajectory stills;
  for (const double stamp : pictures_.stamps_s) stills.add(stamp * 10, moving(stamp));
  for (double& stamp : pictures_.stamps_s) stamp *= 10;
  trajectory_ = stills;
  const auto found = find();
  ASSERT_FALSE(found);
  EXPECT_NE(found.error().message.find("0 of 40"), std::string::npos) << found.error().message;
}

}  // namespace
}  // namespace spectra::mapping
