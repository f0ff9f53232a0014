#include "server/mapping/surface_mesh.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>

#include <cmath>
#include <map>
#include <set>

namespace spectra::mapping {
namespace {

/// A ball in a map, with distances, colours and temperatures that are known everywhere.
VoxelMap ball(double voxel_m, const Eigen::Vector3d& centre, double radius) {
  VoxelMap map(voxel_m);
  const auto lowest = [&](double c) {
    return static_cast<std::int32_t>(std::floor((c - radius - 0.1) / (8 * voxel_m)));
  };
  const auto highest = [&](double c) {
    return static_cast<std::int32_t>(std::floor((c + radius + 0.1) / (8 * voxel_m)));
  };
  for (std::int32_t z = lowest(centre.z()); z <= highest(centre.z()); ++z) {
    for (std::int32_t y = lowest(centre.y()); y <= highest(centre.y()); ++y) {
      for (std::int32_t x = lowest(centre.x()); x <= highest(centre.x()); ++x) {
        const std::int32_t block = map.ensure({x, y, z});
        map.add_heat(block);
        for (std::size_t i = 0; i < kBlockVoxels; ++i) {
          const Eigen::Vector3d at =
              voxel_m * Eigen::Vector3d(8 * x + static_cast<int>(i % 8), 8 * y + static_cast<int>(i / 8 % 8),
                                        8 * z + static_cast<int>(i / 64));
          const double share = ((at - centre).norm() - radius) / (4 * voxel_m);
          map.voxels(block).distance[i] = static_cast<std::int16_t>(32767 * std::clamp(share, -1.0, 1.0));
          map.voxels(block).weight[i] = 1000;
          map.heat(block).celsius[i] = static_cast<float>(20 + at.x());
          map.heat(block).variance[i] = 0.04F;
        }
      }
    }
  }
  return map;
}

std::vector<UnitMesh> meshes(const VoxelMap& map) {
  std::vector<UnitMesh> units;
  for (std::size_t i = 0; i < map.units().size(); ++i)
    units.push_back(mesh_of_unit(map, static_cast<std::int32_t>(i), {}));
  return units;
}

TEST(SurfaceMesh, OfABallIsClosedAndRound) {
  const Eigen::Vector3d centre(0.003, -0.321, 0.017);
  const VoxelMap map = ball(0.01, centre, 0.2);
  ASSERT_GE(map.units().size(), 8U);
  const UnitMesh mesh = joined(meshes(map));
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> sides;
  for (const base::Triangle& t : mesh.triangles) {
    for (std::size_t i = 0; i < 3; ++i) ++sides[{t[i], t[(i + 1) % 3]}];
  }
  for (const auto& [side, count] : sides) {
    EXPECT_EQ(count, 1);
    EXPECT_EQ(sides.count({side.second, side.first}), 1U) << "a hole";
  }
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const base::Vec3f& p = mesh.positions[i];
    EXPECT_NEAR((Eigen::Vector3d(p.x, p.y, p.z) - centre).norm(), 0.2, 1e-4);
    EXPECT_NEAR(mesh.celsius[i], 20 + p.x, 1e-3);
    EXPECT_NEAR(mesh.sigma_kelvin[i], std::sqrt(0.04 + 0.03 * 0.03), 1e-4);
  }
}

TEST(SurfaceMesh, UnitsMeetBitForBit) {
  const VoxelMap map = ball(0.01, {0.003, -0.321, 0.017}, 0.2);
  std::map<std::uint64_t, base::Vec3f> known;
  std::size_t shared = 0;
  for (const UnitMesh& unit : meshes(map)) {
    for (std::size_t i = 0; i < unit.positions.size(); ++i) {
      const auto [entry, is_new] = known.emplace(unit.edges[i], unit.positions[i]);
      if (is_new) continue;
      ++shared;
      EXPECT_EQ(entry->second, unit.positions[i]);
    }
  }
  EXPECT_GT(shared, 100U);
}

TEST(SurfaceMesh, LeavesATemperatureToWhoKnowsIt) {
  VoxelMap map = ball(0.01, {0, 0, 0}, 0.1);
  for (std::int32_t block = 0; block < map.block_end(); ++block) {
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      if (map.voxels(block).distance[i] > 0) map.heat(block).variance[i] = std::numeric_limits<float>::infinity();
    }
  }
  for (const UnitMesh& unit : meshes(map)) {
    for (std::size_t i = 0; i < unit.positions.size(); ++i) EXPECT_NEAR(unit.celsius[i], 20, 0.12) << i;
  }
  for (std::int32_t block = 0; block < map.block_end(); ++block)
    map.heat(block).variance.fill(std::numeric_limits<float>::infinity());
  for (const UnitMesh& unit : meshes(map)) {
    for (const float celsius : unit.celsius) EXPECT_TRUE(std::isnan(celsius));
  }
}

}  // namespace
}  // namespace spectra::mapping
