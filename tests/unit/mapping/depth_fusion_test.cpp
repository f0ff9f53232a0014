#include "server/mapping/depth_fusion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "box_world.hpp"
#include "server/mapping/surface_mesh.hpp"

namespace spectra::mapping {
namespace {

constexpr double kVoxel = 0.02;

class DepthFusion : public testing::Test {
 protected:
  void look(VoxelMap& map, const BoxWorld& world, const Eigen::Isometry3d& pose, jobs::WorkerPool& pool) {
    const DepthFrame frame =
        prepared_depth(world.depth(camera_, pose), calibration_, rays_, kTruncationVoxels * kVoxel, pool);
    fuse_depth(map, {frame, camera_, rays_, calibration_.noise, pose}, nullptr, pool);
  }
  static UnitMesh mesh_of(const VoxelMap& map) {
    std::vector<UnitMesh> units;
    for (std::size_t i = 0; i < map.units().size(); ++i)
      units.push_back(mesh_of_unit(map, static_cast<std::int32_t>(i), {}));
    return joined(units);
  }

  const DepthCalibration calibration_{small_camera(), 0.001, 0, 0, {}};
  const CameraModel camera_ = small_camera();
  const RayTable rays_{camera_};
  jobs::WorkerPool pool_{2};
};

TEST_F(DepthFusion, PutsAWallWhereItIs) {
  VoxelMap map(kVoxel);
  const BoxWorld world{{wall()}};
  for (int i = 0; i < 5; ++i) look(map, world, looking_ahead(0.05 * i, 0.01 * i, 0.02 * i, 0.03 * i), pool_);
  const UnitMesh mesh = mesh_of(map);
  ASSERT_GT(mesh.positions.size(), 2000U);
  for (const base::Vec3f& p : mesh.positions) EXPECT_NEAR(p.z, 2, 0.0015);
  for (const base::Triangle& t : mesh.triangles) {
    const auto at = [&](std::size_t i) {
      return Eigen::Vector3f(mesh.positions[t[i]].x, mesh.positions[t[i]].y, mesh.positions[t[i]].z);
    };
    EXPECT_LE((at(1) - at(0)).cross(at(2) - at(0)).z(), 0) << "it looks at the camera";
  }
}

TEST_F(DepthFusion, ClearsWhatIsGone) {
  VoxelMap map(kVoxel);
  const BoxWorld with{{wall(), {{-0.2, -0.2, 1.2}, {0.2, 0.2, 1.3}, {}}}}, without{{wall()}};
  look(map, with, looking_ahead(), pool_);
  const auto is_before_wall = [](const UnitMesh& mesh) {
    return std::any_of(mesh.positions.begin(), mesh.positions.end(), [](const auto& p) { return p.z < 1.8F; });
  };
  EXPECT_TRUE(is_before_wall(mesh_of(map)));
  for (int i = 0; i < 60; ++i) look(map, without, looking_ahead(), pool_);
  EXPECT_FALSE(is_before_wall(mesh_of(map)));
  VoxelMap never(kVoxel);
  for (int i = 0; i < 61; ++i) look(never, without, looking_ahead(), pool_);
  EXPECT_EQ(map.block_count(), never.block_count()) << "no room is kept for what is gone";
}

TEST_F(DepthFusion, LeavesOutWhatLiesAtAnEdge) {
  const BoxWorld world{{wall(), {{-0.2, -0.2, 1.2}, {0.2, 0.2, 1.3}, {}}}};
  Picture16 picture = world.depth(camera_, looking_ahead());
  const DepthFrame frame = prepared_depth(picture, calibration_, rays_, 0.08, pool_);
  const int row = camera_.height / 2;
  int last = 0;
  for (int x = 1; x < camera_.width; ++x) {
    const int here = picture.at(x, row), before = picture.at(x - 1, row);
    if (here == 0 || before == 0 || std::abs(here - before) < 300) continue;
    last = x;
    for (int beside = -2; beside < 2; ++beside) {
      EXPECT_EQ(frame.weight[static_cast<std::size_t>(row * camera_.width + x + beside)], 0) << x + beside;
    }
  }
  EXPECT_GT(last, 0);
  EXPECT_GT(frame.weight[static_cast<std::size_t>(row * camera_.width + camera_.width / 2)], 0);
}

TEST_F(DepthFusion, TheSameBytesForAnyNumberOfThreads) {
  const BoxWorld world{{wall(), {{-0.3, -0.2, 1.4}, {0.1, 0.2, 1.6}, {}}}};
  jobs::WorkerPool many(5);
  VoxelMap a(kVoxel), b(kVoxel);
  for (int i = 0; i < 4; ++i) {
    look(a, world, looking_ahead(0.03 * i, 0, 0, 0.05 * i), pool_);
    look(b, world, looking_ahead(0.03 * i, 0, 0, 0.05 * i), many);
  }
  ASSERT_EQ(a.block_end(), b.block_end());
  for (std::int32_t i = 0; i < a.block_end(); ++i) {
    EXPECT_EQ(a.head(i).at, b.head(i).at);
    EXPECT_EQ(std::memcmp(&a.voxels(i).distance, &b.voxels(i).distance, sizeof a.voxels(i).distance), 0);
    EXPECT_EQ(std::memcmp(&a.voxels(i).weight, &b.voxels(i).weight, sizeof a.voxels(i).weight), 0);
  }
}

TEST_F(DepthFusion, MeansDoNotStallHoweverHeavyTheyAre) {
  VoxelMap map(kVoxel);
  const CameraModel narrow = small_camera(24, 18, 140);
  const RayTable rays(narrow);
  BoxWorld world{{wall()}};
  const auto look_often = [&](int times) {
    const DepthFrame frame =
        prepared_depth(world.depth(narrow, looking_ahead()), calibration_, rays, kTruncationVoxels * kVoxel, pool_);
    for (int i = 0; i < times; ++i)
      fuse_depth(map, {frame, narrow, rays, calibration_.noise, looking_ahead()}, nullptr, pool_);
  };
  look_often(400);
  // The wall moves by a millimetre: at the largest weight one look moves a voxel by less than one step.
  world.boxes[0].low.z() = 2.001;
  look_often(1600);
  double sum = 0;
  const UnitMesh mesh = mesh_of(map);
  ASSERT_GT(mesh.positions.size(), 20U);
  for (const base::Vec3f& p : mesh.positions) sum += static_cast<double>(p.z);
  EXPECT_NEAR(sum / static_cast<double>(mesh.positions.size()), 2.001, 1e-4);
}

TEST_F(DepthFusion, TellsAPoseThatDoesNotFit) {
  VoxelMap map(kVoxel);
  const BoxWorld world{{wall()}};
  const auto fit_at = [&](const Eigen::Isometry3d& taken, const Eigen::Isometry3d& said) {
    const DepthFrame frame =
        prepared_depth(world.depth(camera_, taken), calibration_, rays_, kTruncationVoxels * kVoxel, pool_);
    return fit_of(map, {frame, camera_, rays_, calibration_.noise, said}, pool_);
  };
  for (int i = 0; i < 3; ++i) look(map, world, looking_ahead(), pool_);
  const FitOfDepth good = fit_at(looking_ahead(0.1), looking_ahead(0.1));
  const FitOfDepth bad = fit_at(looking_ahead(0.1), looking_ahead(0.1, 0, -0.12));
  EXPECT_GT(good.matching, 10 * good.other + 200);
  EXPECT_GT(bad.other, bad.matching);
}

TEST(VoxelMap, GivesRoomBack) {
  VoxelMap map(0.01);
  for (int i = 0; i < 100; ++i) map.add_heat(map.ensure({i, -i, 3}));
  std::size_t size = 0;
  for (int round = 0; round < 5; ++round) {
    for (int i = 0; i < 100; ++i) map.remove(map.find({i, -i, 3}));
    EXPECT_EQ(map.block_count(), 0U);
    for (int i = 0; i < 100; ++i) map.add_heat(map.ensure({i, -i, 3}));
    if (round == 0) size = map.size_bytes();
  }
  EXPECT_EQ(map.size_bytes(), size);
  EXPECT_EQ(map.find({5, -5, 4}), -1);
  EXPECT_EQ(map.head(map.find({-0, 0, 3})).at, (GridPlace{0, 0, 3}));
}

TEST(VoxelMap, TakesAtMost24BytesAVoxel) {
  EXPECT_LE(sizeof(VoxelBlock), 16 * kBlockVoxels);
  EXPECT_LE(sizeof(VoxelBlock) + sizeof(HeatBlock) + sizeof(BlockHead) + sizeof(MapUnit) / 4, 24 * kBlockVoxels);
}

}  // namespace
}  // namespace spectra::mapping
