#include "server/mapping/mapper.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "box_world.hpp"

namespace spectra::mapping {
namespace {

class MapperTest : public testing::Test {
 protected:
  MapperTest() {
    settings_.voxel_m = 0.02;
    for (int i = 0; i <= 40; ++i) trajectory_.add(0.05 * i, pose_at(0.05 * i));
  }
  static Eigen::Isometry3d pose_at(double time_s) { return looking_ahead(0.1 * time_s, 0, 0, 0.05 * time_s); }

  Frame frame_at(double time_s) const {
    Frame frame;
    frame.time_s = time_s;
    frame.depth = world_.depth(calibration_.depth.camera, pose_at(time_s));
    frame.thermal = world_.thermal(calibration_.thermal->camera, pose_at(time_s), 0.1 * time_s);
    return frame;
  }

  const BoxWorld world_{{{{-1.5, -1, 2}, {1.5, 1, 2.5}, [](const Eigen::Vector3d& p) { return 20 + 2 * p.x(); }},
                         {{-0.3, -0.2, 1.4}, {0, 0.2, 1.6}, [](const Eigen::Vector3d&) { return 34.0; }}}};
  Calibration calibration_ = small_cameras();
  MapperSettings settings_;
  Trajectory trajectory_;
  jobs::WorkerPool pool_{1};
  FaultLog faults_;
};

TEST_F(MapperTest, MakesAMeshWithTemperatures) {
  Mapper mapper(calibration_, settings_, pool_);
  for (int i = 0; i < 10; ++i) mapper.fuse(frame_at(0.11 * i), trajectory_, faults_);
  const UnitMesh mesh = mapper.whole_mesh();
  EXPECT_EQ(mapper.figures().depth_frames, 10U);
  EXPECT_EQ(mapper.figures().thermal_frames, 10U);
  std::size_t known = 0, warm = 0;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    if (std::isnan(mesh.celsius[i])) continue;
    ++known;
    const base::Vec3f& p = mesh.positions[i];
    if (p.z < 1.5F && p.z > 1.35F) {
      EXPECT_NEAR(mesh.celsius[i], 34, 0.5);
      ++warm;
    } else if (p.z > 1.9F) {
      EXPECT_NEAR(mesh.celsius[i], 20 + 2 * p.x, 0.3);
    }
  }
  EXPECT_GT(known, mesh.positions.size() * 3 / 4);
  EXPECT_GT(warm, 50U);
}

TEST_F(MapperTest, BeginsWithTheFirstFrameThatHasAPose) {
  Mapper mapper(calibration_, settings_, pool_);
  Frame stray = frame_at(0);
  stray.time_s = 1e9;
  mapper.fuse(stray, trajectory_, faults_);
  EXPECT_EQ(faults_.of(FaultKind::NoPose).count, 1U);
  mapper.fuse(frame_at(0.11), trajectory_, faults_);
  mapper.fuse(frame_at(0.22), trajectory_, faults_);
  EXPECT_EQ(mapper.begin_s(), 0.11);
  EXPECT_EQ(mapper.newest_s(), 0.22);
}

TEST_F(MapperTest, DoesNotWaitForAMissingModality) {
  Mapper mapper(calibration_, settings_, pool_);
  Frame frame = frame_at(0.1);
  frame.thermal = {};
  mapper.fuse(frame, trajectory_, faults_);
  frame = frame_at(0.15);
  frame.depth = {};
  mapper.fuse(frame, trajectory_, faults_);
  EXPECT_EQ(mapper.figures().depth_frames, 1U);
  EXPECT_EQ(mapper.figures().thermal_frames, 1U);
  EXPECT_FALSE(mapper.whole_mesh().positions.empty());
}

TEST_F(MapperTest, MapsNothingNewBeyondItsMemoryAndSaysSo) {
  Mapper free(calibration_, settings_, pool_);
  free.fuse(frame_at(0), trajectory_, faults_);
  const std::size_t blocks = free.map().block_count();
  settings_.most_bytes = blocks * (sizeof(VoxelBlock) + sizeof(HeatBlock) + sizeof(BlockHead)) / 2;
  Mapper mapper(calibration_, settings_, pool_);
  for (int i = 0; i < 6; ++i) mapper.fuse(frame_at(0.3 * i), trajectory_, faults_);
  EXPECT_NEAR(static_cast<double>(mapper.map().block_count()), static_cast<double>(blocks) / 2, 1);
  EXPECT_EQ(mapper.figures().depth_frames, 6U) << "what is known goes on";
  EXPECT_EQ(faults_.of(FaultKind::MapFull).count, 6U);
  EXPECT_NE(faults_.of(FaultKind::MapFull).what.find("--limit scene-bytes"), std::string::npos);
}

TEST_F(MapperTest, SaysThatAPoseIsFartherThanItCounts) {
  Trajectory far;
  for (int i = 0; i <= 10; ++i) {
    Eigen::Isometry3d pose = pose_at(0.05 * i);
    pose.translation().y() -= 1e9;
    far.add(0.05 * i, pose);
  }
  Mapper mapper(calibration_, settings_, pool_);
  mapper.fuse(frame_at(0.1), far, faults_);
  mapper.fuse(frame_at(0.2), far, faults_);
  EXPECT_EQ(mapper.figures().depth_frames, 0U);
  EXPECT_EQ(mapper.map().block_count(), 0U);
  EXPECT_EQ(faults_.all()[static_cast<std::size_t>(FaultKind::NoPose)].count, 2U);
}

TEST_F(MapperTest, HoldsSoManyThermalPicturesAndSaysWhatItLeavesOut) {
  settings_.is_tracking = true;
  Mapper mapper(calibration_, settings_, pool_);
  Frame thermal = frame_at(0);
  thermal.depth = {};
  FaultLog faults_of_earlier;
  for (std::size_t i = 0; i < Mapper::kMostHeld + 5; ++i) {
    thermal.time_s = 0.001 * static_cast<double>(i);
    mapper.fuse(thermal, {}, faults_, &faults_of_earlier);
  }
  EXPECT_EQ(faults_.of(FaultKind::NoPose).count, 0U) << "of the picture that has come nothing is wrong";
  const FrameFault& fault = faults_of_earlier.of(FaultKind::NoPose);
  EXPECT_EQ(fault.count, 5U);
  EXPECT_NE(fault.what.find("at 0.000 s more than 64 thermal pictures wait"), std::string::npos) << fault.what;
}

TEST_F(MapperTest, FusesNothingWithoutAPose) {
  Mapper mapper(calibration_, settings_, pool_);
  mapper.fuse(frame_at(7), trajectory_, faults_);
  mapper.fuse(frame_at(8), trajectory_, faults_);
  EXPECT_EQ(faults_.of(FaultKind::NoPose).count, 2U);
  EXPECT_EQ(mapper.map().block_count(), 0U);
}

TEST_F(MapperTest, StaysCleanWhenPosesJump) {
  Trajectory jumping;
  for (int i = 0; i <= 40; ++i) {
    Eigen::Isometry3d pose = pose_at(0.05 * i);
    if (i >= 20 && i < 30) pose.translation() += Eigen::Vector3d(0.4, 0.1, -0.5);  // lost, then found again
    jumping.add(0.05 * i, pose);
  }
  Mapper clean(calibration_, settings_, pool_), mapper(calibration_, settings_, pool_);
  for (int i = 0; i <= 40; ++i) {
    const Frame frame = frame_at(0.05 * i);
    mapper.fuse(frame, jumping, faults_);
    if (i < 20 || i >= 30) clean.fuse(frame, trajectory_, faults_);
  }
  EXPECT_GE(faults_.of(FaultKind::JumpingPose).count, 1U);
  EXPECT_GE(faults_.of(FaultKind::UnfittingPose).count, 8U);
  for (const base::Vec3f& p : mapper.whole_mesh().positions) {
    EXPECT_TRUE(p.z > 1.97F || (p.z > 1.36F && p.z < 1.7F && p.x < 0.05F)) << p.x << " " << p.z;
  }
  EXPECT_GE(mapper.figures().depth_frames + 2, clean.figures().depth_frames);
}

TEST_F(MapperTest, TakesEachSensorAtItsOwnTime) {
  calibration_.thermal->delay_s = 0.2;
  Mapper mapper(calibration_, settings_, pool_);
  for (int i = 0; i < 8; ++i) {
    Frame frame = frame_at(0.05 + 0.2 * i);
    // The stamp is early by the delay.
    frame.thermal = world_.thermal(calibration_.thermal->camera, pose_at(frame.time_s + 0.2));
    mapper.fuse(frame, trajectory_, faults_);
  }
  const UnitMesh mesh = mapper.whole_mesh();
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    if (mesh.positions[i].z < 1.9F || std::isnan(mesh.celsius[i])) continue;
    sum += std::abs(static_cast<double>(mesh.celsius[i] - (20 + 2 * mesh.positions[i].x)));
    ++count;
  }
  EXPECT_LT(sum / static_cast<double>(count), 0.02);
}

TEST_F(MapperTest, AVignettingPictureOfNothingChangesNothing) {
  // What is reflected is the middle of each picture, found in another way where one is subtracted.
  calibration_.thermal->reflected_celsius.reset();
  calibration_.thermal->emissivity = 0.9;
  Mapper plain(calibration_, settings_, pool_), mapper(calibration_, settings_, pool_);
  PictureFloat nothing;
  nothing.width = calibration_.thermal->camera.width;
  nothing.height = calibration_.thermal->camera.height;
  nothing.pixels.assign(static_cast<std::size_t>(nothing.width * nothing.height), 0);
  ASSERT_TRUE(mapper.set_vignetting(nothing));
  for (int i = 0; i < 3; ++i) {
    for (Mapper* one : {&plain, &mapper}) one->fuse(frame_at(0.1 * i), trajectory_, faults_);
  }
  const UnitMesh a = plain.whole_mesh(), b = mapper.whole_mesh();
  ASSERT_EQ(a.celsius.size(), b.celsius.size());
  std::size_t known = 0;
  for (std::size_t i = 0; i < a.celsius.size(); ++i) {
    if (std::isnan(a.celsius[i]) && std::isnan(b.celsius[i])) continue;
    ASSERT_EQ(a.celsius[i], b.celsius[i]) << i;
    ASSERT_EQ(a.sigma_kelvin[i], b.sigma_kelvin[i]) << i;
    ++known;
  }
  EXPECT_GT(known, a.celsius.size() / 2);
}

TEST_F(MapperTest, RefusesAVignettingPictureOfAnotherSize) {
  Mapper mapper(calibration_, settings_, pool_);
  EXPECT_FALSE(mapper.set_vignetting({10, 10, std::vector<float>(100, 0)}));
  EXPECT_TRUE(mapper.set_vignetting({120, 90, std::vector<float>(120 * 90, 0)}));
}

}  // namespace
}  // namespace spectra::mapping
