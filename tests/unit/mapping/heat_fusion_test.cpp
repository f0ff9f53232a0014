#include "server/mapping/heat_fusion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "box_world.hpp"
#include "server/mapping/depth_fusion.hpp"

namespace spectra::mapping {
namespace {

constexpr double kVoxel = 0.02;

/// A map of a world as it is, and one thermal camera.
class HeatFusionTest : public testing::Test {
 protected:
  void build(const BoxWorld& world) {
    for (int i = -1; i <= 1; ++i) {
      const Eigen::Isometry3d pose = looking_ahead(0.2 * i, 0, 0, 0.1 * i);
      const DepthFrame frame = prepared_depth(world.depth(calibration_.depth.camera, pose), calibration_.depth, rays_,
                                              kTruncationVoxels * kVoxel, pool_);
      fuse_depth(map_, {frame, calibration_.depth.camera, rays_, calibration_.depth.noise, pose}, nullptr, pool_);
    }
  }
  static PoseAnswer at(const Eigen::Isometry3d& pose) {
    PoseAnswer answer;
    answer.state = PoseState::Known;
    answer.pose = pose;
    return answer;
  }
  /// Temperature and variance at the voxel nearest to a point; variance infinite: unseen.
  std::pair<float, float> known_at(double x, double y, double z) const {
    const auto nearest = [](double metres) { return static_cast<std::int32_t>(std::lround(metres / kVoxel)); };
    const GridPlace voxel{nearest(x), nearest(y), nearest(z)};
    const std::int32_t block = map_.find(coarser(voxel, 3));
    if (block < 0 || map_.head(block).heat < 0) return {0, std::numeric_limits<float>::infinity()};
    return {map_.heat(block).celsius[index_within(voxel, 3)], map_.heat(block).variance[index_within(voxel, 3)]};
  }
  Picture16 picture(const BoxWorld& world, const Eigen::Isometry3d& pose, double offset = 0) const {
    return world.thermal(calibration_.thermal->camera, pose, offset);
  }

  const Calibration calibration_ = small_cameras();
  const RayTable rays_{calibration_.depth.camera};
  jobs::WorkerPool pool_{2};
  VoxelMap map_{kVoxel};
};

TEST_F(HeatFusionTest, FirstLookGivesTheFormulaOfTheWeight) {
  const BoxWorld world{{wall(25)}};
  build(world);
  HeatFusion heat(*calibration_.thermal, {});
  const HeatReport report = heat.fuse(map_, picture(world, looking_ahead()), at(looking_ahead()), 0, pool_);
  EXPECT_GT(report.observed, 3000U);
  const auto [celsius, variance] = known_at(0, 0, 2);
  EXPECT_NEAR(celsius, 25, 0.02);
  // z^2 / cos (NETD^2), without gradient, motion or reflection.
  EXPECT_NEAR(variance, 4 * 0.05 * 0.05, 1e-4);
}

TEST_F(HeatFusionTest, FollowsKalman) {
  BoxWorld world{{wall(25)}};
  build(world);
  HeatRules rules;
  rules.frame_offset = false;
  HeatFusion heat(*calibration_.thermal, rules);
  heat.fuse(map_, picture(world, looking_ahead()), at(looking_ahead()), 0, pool_);
  world = {{wall(26)}};
  heat.fuse(map_, picture(world, looking_ahead()), at(looking_ahead()), 4, pool_);
  const double r = 4 * 0.05 * 0.05, predicted = r + 4 * 0.05 * 0.05, gain = predicted / (predicted + r);
  const auto [celsius, variance] = known_at(0, 0, 2);
  EXPECT_NEAR(celsius, 25 + gain, 0.02);
  EXPECT_NEAR(variance, (1 - gain) * predicted, 1e-4);
}

TEST_F(HeatFusionTest, GivesNothingToWhatIsHidden) {
  const WarmBox before{{-0.2, -0.2, 1.2}, {0.2, 0.2, 1.3}, [](const Eigen::Vector3d&) { return 60.0; }};
  const BoxWorld world{{wall(20), before}};
  build(BoxWorld{{wall(20)}});
  build(world);
  // From far to the left the box hides another part of the wall than from where its depth was seen.
  const Eigen::Isometry3d left = looking_ahead(-0.5, 0, 0, 0.2);
  HeatFusion heat(*calibration_.thermal, {});
  heat.fuse(map_, picture(world, left), at(left), 0, pool_);
  std::size_t seen = 0;
  for (std::int32_t block = 0; block < map_.block_end(); ++block) {
    if (map_.head(block).heat < 0) continue;
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      if (std::isinf(map_.heat(block).variance[i])) continue;
      const double z = kVoxel * (8 * map_.head(block).at.z + static_cast<int>(i / 64));
      EXPECT_NEAR(map_.heat(block).celsius[i], z > 1.6 ? 20 : 60, 0.1);
      ++seen;
    }
  }
  EXPECT_GT(seen, 2000U);
}

TEST_F(HeatFusionTest, WithoutOcclusionTheHiddenIsPainted) {
  const WarmBox before{{-0.2, -0.2, 1.2}, {0.2, 0.2, 1.3}, [](const Eigen::Vector3d&) { return 60.0; }};
  build(BoxWorld{{wall(20)}});
  build(BoxWorld{{wall(20), before}});
  HeatRules rules;
  rules.occlusion = false;
  HeatFusion heat(*calibration_.thermal, rules);
  const Eigen::Isometry3d left = looking_ahead(-0.5, 0, 0, 0.2);
  heat.fuse(map_, picture(BoxWorld{{wall(20), before}}, left), at(left), 0, pool_);
  bool is_painted = false;
  for (double x = -0.8; x < 0.8; x += 0.02) {
    const auto [celsius, variance] = known_at(x, 0, 2);
    is_painted = is_painted || (!std::isinf(variance) && celsius > 50);
  }
  EXPECT_TRUE(is_painted);
}

TEST_F(HeatFusionTest, TakesTheDriftOfTheCameraOut) {
  const BoxWorld world{{{{-1, -1, 2}, {1, 1, 2.5}, [](const Eigen::Vector3d& p) { return 20 + 3 * p.x(); }}}};
  build(world);
  HeatFusion heat(*calibration_.thermal, {});
  heat.fuse(map_, picture(world, looking_ahead()), at(looking_ahead()), 0, pool_);
  const Eigen::Isometry3d right = looking_ahead(0.2);
  const HeatReport report = heat.fuse(map_, picture(world, right, 4.5), at(right), 10, pool_);
  EXPECT_GT(report.compared, 1000U);
  EXPECT_NEAR(report.offset_kelvin, 4.5, 0.03);
  EXPECT_NEAR(known_at(0.1, 0, 2).first, 20.3, 0.06);
}

TEST_F(HeatFusionTest, AFrozenPictureIsNoLookAndTheNextWeighsATenth) {
  const BoxWorld world{{wall(25)}};
  build(world);
  HeatRules rules;
  rules.frame_offset = false;
  HeatFusion heat(*calibration_.thermal, rules);
  heat.fuse(map_, picture(world, looking_ahead()), at(looking_ahead()), 0, pool_);
  const auto before = known_at(0, 0, 2);
  EXPECT_TRUE(heat.fuse(map_, picture(world, looking_ahead()), at(looking_ahead(0.1)), 0.04, pool_).is_frozen);
  EXPECT_EQ(known_at(0, 0, 2), before);
  EXPECT_FALSE(heat.fuse(map_, picture({{wall(26)}}, looking_ahead()), at(looking_ahead()), 0.1, pool_).is_frozen);
  const double r = 4 * 0.05 * 0.05, predicted = r + 0.1 * 0.05 * 0.05;
  EXPECT_NEAR(known_at(0, 0, 2).first, 25 + predicted / (predicted + 10 * r), 0.02);
}

TEST_F(HeatFusionTest, ALookThatKnowsLittleSaysNothing) {
  // A border between cold and hot: the point may fall on either side.
  const BoxWorld world{
      {{{-1, -1, 2}, {1, 1, 2.5}, [](const Eigen::Vector3d& p) { return p.x() < 0.001 ? 20.0 : 60.0; }}}};
  build(world);
  HeatFusion heat(*calibration_.thermal, {});
  heat.fuse(map_, picture(world, looking_ahead()), at(looking_ahead()), 0, pool_);
  EXPECT_TRUE(std::isinf(known_at(0, 0, 2).second));
  EXPECT_NEAR(known_at(-0.2, 0, 2).first, 20, 0.05);
  EXPECT_NEAR(known_at(0.2, 0, 2).first, 60, 0.05);
}

TEST_F(HeatFusionTest, NothingFromAskew) {
  const BoxWorld world{{wall(25)}};
  build(world);
  const Eigen::Isometry3d askew = looking_ahead(-2.2, 0, 1.7, 1.40);
  HeatFusion heat(*calibration_.thermal, {});
  EXPECT_EQ(heat.fuse(map_, picture(world, askew), at(askew), 0, pool_).observed, 0U);
  HeatRules rules;
  rules.angle = rules.weights = false;
  HeatFusion lax(*calibration_.thermal, rules);
  EXPECT_GT(lax.fuse(map_, picture(world, askew), at(askew), 0, pool_).observed, 0U);
}

TEST_F(HeatFusionTest, AMovingCameraWeighsLess) {
  const BoxWorld world{{wall(25)}};
  build(world);
  PoseAnswer moving = at(looking_ahead());
  moving.linear_m_per_s = {1, 0, 0};
  HeatFusion heat(*calibration_.thermal, {});
  heat.fuse(map_, picture(world, looking_ahead()), moving, 0, pool_);
  const double pixels = 110.0 * 1 / 2 * 0.010;
  EXPECT_NEAR(known_at(0, 0, 2).second, 4 * 0.05 * 0.05 * (1 + pixels * pixels), 1e-4);
}

TEST_F(HeatFusionTest, EmissivityIsTakenOut) {
  ThermalCalibration calibration = *calibration_.thermal;
  calibration.emissivity = 0.9;
  calibration.reflected_celsius = 20;
  const auto fourth = [](double celsius) { return std::pow(celsius + 273.15, 4); };
  const double apparent = std::pow(0.9 * fourth(60) + 0.1 * fourth(20), 0.25) - 273.15;
  const BoxWorld world{{wall(apparent)}};
  build(world);
  HeatFusion heat(calibration, {});
  heat.fuse(map_, picture(world, looking_ahead()), at(looking_ahead()), 0, pool_);
  EXPECT_NEAR(known_at(0, 0, 2).first, 60, 0.05);
}

TEST_F(HeatFusionTest, TheSameBytesForAnyNumberOfThreads) {
  const BoxWorld world{{{{-1, -1, 2}, {1, 1, 2.5}, [](const Eigen::Vector3d& p) { return 20 + 3 * p.x(); }}}};
  jobs::WorkerPool many(5);
  std::vector<HeatBlock> first;
  for (jobs::WorkerPool* pool : {&pool_, &many}) {
    map_ = VoxelMap(kVoxel);
    build(world);
    HeatFusion heat(*calibration_.thermal, {});
    for (int i = 0; i < 3; ++i) {
      const Eigen::Isometry3d pose = looking_ahead(0.05 * i);
      heat.fuse(map_, picture(world, pose, 0.3 * i), at(pose), i, *pool);
    }
    for (std::int32_t block = 0, seen = 0; block < map_.block_end(); ++block) {
      if (map_.head(block).heat < 0) continue;
      if (pool == &pool_) {
        first.push_back(map_.heat(block));
      } else {
        EXPECT_EQ(std::memcmp(&first.at(static_cast<std::size_t>(seen++)), &map_.heat(block), sizeof(HeatBlock)), 0);
      }
    }
  }
  EXPECT_GT(first.size(), 10U);
}

}  // namespace
}  // namespace spectra::mapping
