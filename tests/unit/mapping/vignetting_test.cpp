#include "server/mapping/vignetting.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "box_world.hpp"

namespace spectra::mapping {
namespace {

/// A wall with a pattern of temperatures that is seen from many places, with another offset each.
class VignettingTest : public testing::Test {
 protected:
  VignettingTest() {
    points_.spacing_m = 0.03F;
    for (int y = -40; y <= 40; ++y) {
      for (int x = -50; x <= 50; ++x) {
        points_.positions.emplace_back(0.03F * static_cast<float>(x), 0.03F * static_cast<float>(y), 2.0F);
        points_.normals.emplace_back(0, 0, -1);
      }
    }
  }

  /// Too little in the corners, too much in the middle, with a mean of about 0.
  double too_much(double u, double v, double kelvin) const {
    const CameraModel& camera = thermal_.camera;
    const double x = (u - camera.cx) / camera.width, y = (v - camera.cy) / camera.width;
    return kelvin * (0.13 - x * x - y * y) * 4;
  }

  void look(int count, double kelvin) {
    for (int i = 0; i < count; ++i) {
      const double time = 0.05 * i;
      const Eigen::Isometry3d pose =
          looking_ahead(0.35 * std::sin(1.7 * i), 0.25 * std::cos(2.3 * i), -0.2 * (i % 3), 0.12 * std::sin(3.1 * i));
      trajectory_.add(time * 10, pose);
      pictures_.stamps_s.push_back(time * 10);
      Picture16 picture = world_.thermal(thermal_.camera, pose, 3 * std::sin(1.1 * i));
      for (int y = 0; y < picture.height; ++y) {
        for (int x = 0; x < picture.width; ++x) {
          picture.pixels[static_cast<std::size_t>(y * picture.width + x)] = static_cast<std::uint16_t>(
              std::lround(static_cast<double>(picture.at(x, y)) + 100 * too_much(x, y, kelvin)));
        }
      }
      pictures_.pictures.push_back(std::move(picture));
    }
  }

  base::Result<Vignetting> find() { return find_vignetting(points_, pictures_, thermal_, trajectory_, pool_); }

  const BoxWorld world_{{{{-1.6, -1.4, 2}, {1.6, 1.4, 2.5}, [](const Eigen::Vector3d& p) {
                            return 20 + 2 * std::sin(5 * p.x()) * std::cos(4 * p.y()) + p.x();
                          }}}};
  ThermalCalibration thermal_ = *small_cameras().thermal;
  SurfacePoints points_;
  ThermalPictures pictures_;
  Trajectory trajectory_;
  jobs::WorkerPool pool_{1};
};

TEST_F(VignettingTest, IsFound) {
  look(20, 0.8);
  const auto found = find();
  ASSERT_TRUE(found) << found.error().message;
  double worst = 0, mean = 0;
  const PictureFloat& picture = found.value().picture;
  ASSERT_EQ(picture.width, thermal_.camera.width);
  ASSERT_EQ(picture.height, thermal_.camera.height);
  const auto difference = [&](int x, int y) { return static_cast<double>(picture.at(x, y)) - too_much(x, y, 0.8); };
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) mean += difference(x, y) / static_cast<double>(picture.pixels.size());
  }
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) worst = std::max(worst, std::abs(difference(x, y) - mean));
  }
  EXPECT_LT(worst, 0.15);  // in the corners, which are seen least
  EXPECT_LT(found.value().sigma_kelvin, 0.05);
  EXPECT_LT(found.value().residual_after_kelvin, 0.3 * found.value().residual_before_kelvin);
  EXPECT_EQ(found.value().picture_count, 20U);
}

TEST_F(VignettingTest, IsTheSameForEveryNumberOfThreads) {
  look(8, 0.5);
  const auto found = find();
  jobs::WorkerPool more(3);
  const auto again = find_vignetting(points_, pictures_, thermal_, trajectory_, more);
  ASSERT_TRUE(found && again);
  EXPECT_EQ(found.value().picture.pixels, again.value().picture.pixels);
}

TEST_F(VignettingTest, IsRefusedOfTooFewPictures) {
  look(4, 0.8);
  const auto found = find();
  ASSERT_FALSE(found);
  EXPECT_NE(found.error().message.find("4 pictures with a pose"), std::string::npos) << found.error().message;
}

TEST_F(VignettingTest, IsRefusedOfACameraThatStandsStill) {
  look(8, 0.8);
  Trajectory still;
  for (std::size_t i = 0; i < pictures_.stamps_s.size(); ++i) {
    still.add(pictures_.stamps_s[i], looking_ahead());
    pictures_.pictures[i] = pictures_.pictures.front();
  }
  trajectory_ = still;
  const auto found = find();
  ASSERT_FALSE(found);
  EXPECT_NE(found.error().message.find("move the camera more"), std::string::npos) << found.error().message;
}

TEST_F(VignettingTest, IsRefusedWhereThereIsNone) {
  look(20, 0);
  const auto found = find();
  ASSERT_FALSE(found);
  EXPECT_NE(found.error().message.find("not more than twice its error"), std::string::npos) << found.error().message;
}

}  // namespace
}  // namespace spectra::mapping
