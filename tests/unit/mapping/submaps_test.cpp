#include "server/mapping/submaps.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "box_world.hpp"
#include "server/mapping/mapper.hpp"
#include "server/mapping/voxel_sums.hpp"

namespace spectra::mapping {
namespace {

/// A camera that goes once around in a room of 5 x 5 m, looking out; the loop closes where it began.
class SubmapsTest : public testing::Test {
 protected:
  static constexpr int kFrames = 72;
  static constexpr double kSeconds = 7.2;

  SubmapsTest() {
    settings_.voxel_m = 0.03;
    settings_.submaps.emplace();
    for (int i = 0; i <= 10 * kFrames / 2; ++i) {
      const double time_s = 0.02 * i;
      true_poses_.add(time_s, true_pose(time_s));
      drifted_poses_.add(time_s, drifted_pose(time_s));
    }
  }

  static Eigen::Isometry3d true_pose(double time_s) {
    const double angle = 2 * std::numbers::pi * time_s / kSeconds;
    return looking_ahead(0.8 * std::sin(angle), 0, 0.8 * std::cos(angle), angle);
  }
  /// After the loop 20 cm and 3 degrees off.
  static Eigen::Isometry3d drifted_pose(double time_s) {
    const double share = time_s / kSeconds;
    Eigen::Isometry3d drift = Eigen::Isometry3d::Identity();
    drift.linear() = Eigen::AngleAxisd(0.052 * share, Eigen::Vector3d::UnitY()).toRotationMatrix();
    drift.translation() = share * Eigen::Vector3d(0.2, 0.05, 0);
    return drift * true_pose(time_s);
  }

  void fuse_all(Mapper& mapper, const Trajectory& poses) {
    for (int i = 0; i < kFrames; ++i) {
      Frame frame;
      frame.time_s = 0.1 * i;
      frame.depth = world_.depth(calibration_.depth.camera, true_pose(frame.time_s));
      if (i % 2 == 0) frame.thermal = world_.thermal(calibration_.thermal->camera, true_pose(frame.time_s));
      mapper.fuse(frame, poses, faults_);
    }
  }

  /// How far vertices are from the nearest wall: root mean square, and the largest of 99 %.
  struct Error {
    double rms = 0, largest = 0;
    std::size_t count = 0;
  };
  static Error error_of(const UnitMesh& mesh) {
    std::vector<double> off;
    double squares = 0;
    for (const base::Vec3f& p : mesh.positions) {
      const double x = std::abs(std::abs(static_cast<double>(p.x)) - 2.5);
      const double z = std::abs(std::abs(static_cast<double>(p.z)) - 2.5);
      off.push_back(std::min(x, z));
      squares += off.back() * off.back();
    }
    std::sort(off.begin(), off.end());
    return {std::sqrt(squares / static_cast<double>(off.size())), off[off.size() * 99 / 100], off.size()};
  }

  static WarmBox box(Eigen::Vector3d low, Eigen::Vector3d high, double celsius) {
    return {low, high, [celsius](const Eigen::Vector3d&) { return celsius; }};
  }
  const BoxWorld world_{{box({-2.7, -2, 2.5}, {2.7, 2, 2.7}, 20), box({-2.7, -2, -2.7}, {2.7, 2, -2.5}, 22),
                         box({2.5, -2, -2.7}, {2.7, 2, 2.7}, 24), box({-2.7, -2, -2.7}, {-2.5, 2, 2.7}, 26)}};
  Calibration calibration_ = small_cameras();
  MapperSettings settings_;
  Trajectory true_poses_, drifted_poses_;
  jobs::WorkerPool pool_{1};
  FaultLog faults_;
};

TEST_F(SubmapsTest, ALoopWithDriftEndsNearTheMapOfTruePosesWithoutASecondLook) {
  Mapper mapper(calibration_, settings_, pool_);
  fuse_all(mapper, drifted_poses_);
  EXPECT_GE(mapper.submap_count(), 5U) << "one every 60 degrees";
  const Error before = error_of(mapper.whole_mesh());
  const CorrectionReport report = mapper.correct(true_poses_.stamped());
  EXPECT_GE(report.moved, 5U);
  const UnitMesh corrected = mapper.whole_mesh();
  const Error after = error_of(corrected);

  MapperSettings one = settings_;
  one.submaps.reset();
  Mapper best(calibration_, one, pool_);
  fuse_all(best, true_poses_);
  const Error bar = error_of(best.whole_mesh());
  // A submap of 60 degrees holds a sixth of the drift: 33 mm and half a degree, half of it on either side of its middle.
  EXPECT_GT(before.rms, 0.03);
  EXPECT_LT(after.rms, bar.rms + 0.01);
  EXPECT_LT(after.largest, bar.largest + 0.035);
  EXPECT_NEAR(static_cast<double>(after.count), static_cast<double>(bar.count), 0.1 * static_cast<double>(bar.count))
      << "one surface, not one of each submap";
  std::size_t warm = 0, wrong = 0;
  for (std::size_t i = 0; i < corrected.positions.size(); ++i) {
    if (std::isnan(corrected.celsius[i])) continue;
    ++warm;
    const base::Vec3f& p = corrected.positions[i];
    if (std::abs(std::abs(p.x) - std::abs(p.z)) < 0.3F) continue;  // Beside a corner.
    const float celsius = std::abs(p.x) > std::abs(p.z) ? (p.x > 0 ? 24.0F : 26.0F) : (p.z > 0 ? 20.0F : 22.0F);
    wrong += std::abs(corrected.celsius[i] - celsius) > 0.3F ? 1U : 0U;
  }
  EXPECT_GT(warm, corrected.positions.size() / 2);
  EXPECT_LT(wrong, warm / 50);
}

TEST_F(SubmapsTest, ASubmapAloneIsTheMapAsItWas) {
  settings_.submaps->radians = 7;
  Mapper mapper(calibration_, settings_, pool_);
  fuse_all(mapper, true_poses_);
  EXPECT_EQ(mapper.submap_count(), 1U);
  settings_.submaps.reset();
  Mapper plain(calibration_, settings_, pool_);
  fuse_all(plain, true_poses_);
  const UnitMesh one = mapper.whole_mesh(), other = plain.whole_mesh();
  EXPECT_EQ(one.positions, other.positions);
  EXPECT_EQ(one.triangles, other.triangles);
  ASSERT_EQ(one.celsius.size(), other.celsius.size());
  const auto is_same = [](float a, float b) { return a == b || (std::isnan(a) && std::isnan(b)); };
  for (std::size_t i = 0; i < one.celsius.size(); ++i) {
    ASSERT_TRUE(is_same(one.celsius[i], other.celsius[i]));
    ASSERT_TRUE(is_same(one.sigma_kelvin[i], other.sigma_kelvin[i]));
    ASSERT_TRUE(one.colours[i] == other.colours[i]);
  }
}

TEST_F(SubmapsTest, WhatChangesByLittleIsNotMeshedAgain) {
  settings_.submaps->radians = 7;
  Mapper mapper(calibration_, settings_, pool_);
  settings_.submaps.reset();
  Mapper plain(calibration_, settings_, pool_);
  UnitPublisher publisher, plain_publisher;
  const auto see = [&](double time_s) {
    Frame frame;
    frame.time_s = time_s;
    frame.depth = world_.depth(calibration_.depth.camera, true_pose(0));
    frame.thermal = world_.thermal(calibration_.thermal->camera, true_pose(0));
    Trajectory poses;
    poses.add(time_s, true_pose(0));
    for (Mapper* one : {&mapper, &plain}) one->fuse(frame, poses, faults_);
  };
  const auto told = [&](Mapper& of, UnitPublisher& by) {
    return of.changed_units(by, Eigen::Vector3d::Zero(), pool_).size();
  };
  for (int i = 0; i < 10; ++i) see(0.1 * i);
  EXPECT_GT(told(mapper, publisher), 3U);
  EXPECT_GT(told(plain, plain_publisher), 3U);
  // Weights grow, means stay.
  see(1);
  mapper.changed_units(publisher, Eigen::Vector3d::Zero(), pool_, 0);
  plain.changed_units(plain_publisher, Eigen::Vector3d::Zero(), pool_, 0);
  EXPECT_EQ(plain_publisher.waiting_count(), 0U);
  EXPECT_EQ(publisher.waiting_count(), 0U);
}

TEST(BakedBlocks, NoteByHowMuchTheyDifferFromWhatWasThere) {
  constexpr float kStepsAVoxel = kDistanceOne / 4;
  VoxelMap map(0.01);
  BakedBlock block;
  block.is_empty = false;
  block.head.has_surface = true;
  block.voxels = {};
  block.voxels.distance.fill(1000);
  block.voxels.weight.fill(50);
  block.voxels.colour_weight.fill(20);
  block.heat.emplace();
  block.heat->celsius.fill(20);
  block.heat->variance.fill(0.01F);
  block.heat->celsius[5] = 40;
  const GridPlace at{1, 2, 3};
  put(map, at, block);
  BlockHead& head = map.head(map.find(at));
  EXPECT_GT(head.moved, 1);
  EXPECT_GT(head.warmed, 1);
  EXPECT_EQ(head.hottest, 40);
  const auto take_back = [&] {
    head.moved = head.warmed = head.recoloured = 0;
    head.hottest = -1000;
  };
  take_back();
  put(map, at, block);
  block.voxels.weight.fill(60);
  put(map, at, block);
  EXPECT_EQ(map.voxels(map.find(at)).weight[0], 60);
  EXPECT_EQ(std::max({head.moved, head.warmed, head.recoloured}), 0) << "surer, and not another";
  for (int i = 1; i <= 2; ++i) {
    block.voxels.distance[7] = static_cast<std::int16_t>(1000 + 0.05F * kStepsAVoxel * static_cast<float>(i));
    block.voxels.green[8] = static_cast<std::uint16_t>(256 * i);
    block.heat->celsius[9] += 0.25F;
    put(map, at, block);
    EXPECT_NEAR(head.moved, 0.05 * i, 1e-3);
    EXPECT_EQ(head.recoloured, static_cast<float>(i));
    EXPECT_EQ(head.warmed, 0.25F * static_cast<float>(i));
    EXPECT_EQ(head.hottest, 20 + 0.25F * static_cast<float>(i)) << "of what has changed";
  }
  take_back();
  block.voxels.weight[3] = 0;
  put(map, at, block);
  EXPECT_GT(head.moved, 1) << "no longer seen";
  put(map, at, BakedBlock{});
  EXPECT_EQ(map.find(at), -1);
  EXPECT_GT(map.units()[0].moved, 1);
}

TEST_F(SubmapsTest, SubmapsThatStayWhereTheyAreMakeTheSameSurface) {
  Mapper mapper(calibration_, settings_, pool_);
  fuse_all(mapper, true_poses_);
  const UnitMesh before = mapper.whole_mesh();
  EXPECT_EQ(mapper.correct(true_poses_.stamped()).moved, 0U);
  EXPECT_EQ(mapper.whole_mesh().positions, before.positions);
  settings_.submaps.reset();
  Mapper plain(calibration_, settings_, pool_);
  fuse_all(plain, true_poses_);
  EXPECT_LT(error_of(before).rms, error_of(plain.whole_mesh()).rms + 0.002);
}

TEST_F(SubmapsTest, WhatIsToldAfterACorrectionIsWhereItIsNow) {
  Mapper mapper(calibration_, settings_, pool_);
  UnitPublisher publisher;
  fuse_all(mapper, drifted_poses_);
  std::size_t first = 0;
  for (const PublishedUnit& unit : mapper.changed_units(publisher, Eigen::Vector3d::Zero(), pool_))
    first += unit.mesh.positions.empty() ? 0U : 1U;
  EXPECT_GT(first, 20U);
  EXPECT_TRUE(mapper.changed_units(publisher, Eigen::Vector3d::Zero(), pool_).empty());
  mapper.correct(true_poses_.stamped());
  std::vector<UnitMesh> told;
  for (PublishedUnit& unit : mapper.changed_units(publisher, Eigen::Vector3d::Zero(), pool_))
    told.push_back(std::move(unit.mesh));
  EXPECT_GT(told.size(), 20U);
  EXPECT_TRUE(mapper.changed_units(publisher, Eigen::Vector3d::Zero(), pool_).empty());

  // The robot goes on in the corrected world, without a word of poses that jump.
  Frame frame;
  frame.time_s = 0.1 * kFrames;
  frame.depth = world_.depth(calibration_.depth.camera, true_pose(frame.time_s));
  const std::size_t submaps = mapper.submap_count();
  Trajectory after;
  for (int i = -5; i <= 5; ++i) after.add(frame.time_s + 0.02 * i, true_pose(frame.time_s + 0.02 * i));
  mapper.fuse(frame, after, faults_);
  EXPECT_EQ(mapper.submap_count(), submaps + 1);
  EXPECT_LT(error_of(mapper.whole_mesh()).largest, 0.08);
}

TEST_F(SubmapsTest, WithoutAPoseOfTheirOwnTheyGoWithTheOneBefore) {
  Mapper mapper(calibration_, settings_, pool_);
  fuse_all(mapper, drifted_poses_);
  Eigen::Isometry3d away = Eigen::Isometry3d::Identity();
  away.translation() = Eigen::Vector3d(0, 1, 0);
  // Of the second submap alone; the first one stays.
  const CorrectionReport report = mapper.correct({{1.8, away * drifted_pose(1.8)}});
  EXPECT_EQ(report.moved + 1, mapper.submap_count());
  EXPECT_TRUE(report.newest.isApprox(away, 1e-9));
  EXPECT_EQ(mapper.correct({{100, away}}).moved, 0U);
}

TEST_F(SubmapsTest, AllOfThemHaveOneBound) {
  UnitPublisher publisher;
  const auto map_all = [&](Mapper& mapper) {
    for (int i = 0; i < kFrames; ++i) {
      Frame frame;
      frame.time_s = 0.1 * i;
      frame.depth = world_.depth(calibration_.depth.camera, true_pose(frame.time_s));
      frame.thermal = world_.thermal(calibration_.thermal->camera, true_pose(frame.time_s));
      mapper.fuse(frame, true_poses_, faults_);
      if (i % 3 == 0) mapper.changed_units(publisher, Eigen::Vector3d::Zero(), pool_, 1);
    }
    mapper.changed_units(publisher, Eigen::Vector3d::Zero(), pool_, 1);
  };
  Mapper free(calibration_, settings_, pool_);
  map_all(free);
  EXPECT_EQ(faults_.of(FaultKind::MapFull).count, 0U);
  settings_.most_bytes = free.size_bytes() / 2;
  publisher = {};
  Mapper mapper(calibration_, settings_, pool_);
  map_all(mapper);
  // Room comes in chunks of 64 blocks.
  EXPECT_LT(static_cast<double>(mapper.size_bytes()), 1.1 * static_cast<double>(settings_.most_bytes));
  EXPECT_GT(static_cast<double>(mapper.size_bytes()), 0.7 * static_cast<double>(settings_.most_bytes));
  EXPECT_LT(mapper.submap_count(), free.submap_count()) << "none begins that has no room";
  EXPECT_GT(faults_.of(FaultKind::MapFull).count, 10U);
  EXPECT_EQ(mapper.figures().depth_frames, static_cast<std::size_t>(kFrames)) << "what is known goes on";

  // After a correction nothing fits to be fused any more, and that is said.
  Eigen::Isometry3d away = Eigen::Isometry3d::Identity();
  away.translation() = Eigen::Vector3d(0, 1, 0);
  EXPECT_EQ(mapper.correct({{0.3, away * true_pose(0.3)}}).moved, mapper.submap_count());
  const std::size_t said = faults_.of(FaultKind::MapFull).count, submaps = mapper.submap_count();
  Frame frame;
  frame.time_s = 0.1 * kFrames;
  frame.depth = world_.depth(calibration_.depth.camera, true_pose(frame.time_s));
  Trajectory after;
  for (int i = -5; i <= 5; ++i) after.add(frame.time_s + 0.02 * i, true_pose(frame.time_s + 0.02 * i));
  mapper.fuse(frame, after, faults_);
  EXPECT_EQ(faults_.of(FaultKind::MapFull).count, said + 1);
  EXPECT_EQ(mapper.submap_count(), submaps);
  EXPECT_EQ(mapper.figures().depth_frames, static_cast<std::size_t>(kFrames));
}

TEST_F(SubmapsTest, OnlyTheLastOfManyCorrectionsCounts) {
  const auto map_of = [&](int corrections, std::vector<base::Vec3f>& positions) {
    Mapper mapper(calibration_, settings_, pool_);
    UnitPublisher publisher;
    fuse_all(mapper, drifted_poses_);
    mapper.changed_units(publisher, Eigen::Vector3d::Zero(), pool_);
    for (int i = 1; i < corrections; ++i) {
      StampedPoses away = true_poses_.stamped();
      for (auto& [time_s, pose] : away) pose.translation().x() += i;
      mapper.correct(away);
    }
    mapper.correct(true_poses_.stamped());
    mapper.changed_units(publisher, Eigen::Vector3d::Zero(), pool_);
    const std::size_t blocks = mapper.map().block_count();
    positions = mapper.whole_mesh().positions;
    EXPECT_EQ(mapper.map().block_count(), blocks) << "nothing was left where it was";
    return blocks;
  };
  std::vector<base::Vec3f> once, often;
  EXPECT_EQ(map_of(1, once), map_of(50, often));
  EXPECT_EQ(once, often);
}

TEST_F(SubmapsTest, NothingMovesToWhereVoxelsAreNotCounted) {
  Mapper mapper(calibration_, settings_, pool_);
  fuse_all(mapper, drifted_poses_);
  const UnitMesh before = mapper.whole_mesh();
  for (const double far : {1e8, 1e308, std::nan("")}) {
    Eigen::Isometry3d away = drifted_pose(1.8);
    away.translation().y() = far;
    EXPECT_EQ(mapper.correct({{1.8, away}}).moved, 0U) << far;
  }
  // The second in range, and the third half the world away from it beyond.
  Eigen::Isometry3d edge = drifted_pose(1.8);
  edge.translation().x() = 0.9999999 * kFarthestPoseM;
  EXPECT_EQ(mapper.correct({{1.8, edge}}).moved + 1, mapper.submap_count());
  Eigen::Isometry3d turned = edge;
  turned.translation().x() *= -1;
  turned.linear() = Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitY()).toRotationMatrix() * edge.linear();
  mapper.correct({{0.3, turned}});
  EXPECT_EQ(mapper.correct(drifted_poses_.stamped()).moved, mapper.submap_count());
  EXPECT_NEAR(static_cast<double>(mapper.whole_mesh().positions.size()), static_cast<double>(before.positions.size()),
              0.1 * static_cast<double>(before.positions.size()));
}

}  // namespace
}  // namespace spectra::mapping
