#include "fusion/mesh/surface.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <set>
#include <vector>

#include "fusion/mesh/point_groups.hpp"
#include "tests/unit/map/generated_scene.hpp"

namespace spectra::mesh {
namespace {

using base::Triangle;
using base::Vec3f;

float unit(std::mt19937& random) {
  return static_cast<float>(random() >> 8) * 0x1p-24f;
}
base::Vec3f point(std::mt19937& random) {
  const float x = unit(random), y = unit(random), z = unit(random);
  return {x, y, z};
}

/// The smallest over a fine grid of points of the triangle: never below the distance, and little above it.
double sampled_squared_distance(const base::Vec3f& p, const base::Vec3f& a, const base::Vec3f& b,
                                const base::Vec3f& c) {
  double best = std::numeric_limits<double>::infinity();
  constexpr int kSteps = 100;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; i + j <= kSteps; ++j) {
      const float u = static_cast<float>(i) / kSteps, v = static_cast<float>(j) / kSteps, w = 1 - u - v;
      best = std::min(best, squared_distance(p, {w * a.x + u * b.x + v * c.x, w * a.y + u * b.y + v * c.y,
                                                 w * a.z + u * b.z + v * c.z}));
    }
  }
  return best;
}

TEST(TriangleDistance, EqualsTheSampledOne) {
  std::mt19937 random(1);
  for (int i = 0; i < 300; ++i) {
    const base::Vec3f p = point(random), a = point(random), b = point(random);
    // Among them triangles that are segments and points.
    const base::Vec3f c = i % 5 == 0 ? a : point(random);
    const base::Vec3f d = i % 10 == 0 ? a : b;
    const double exact = std::sqrt(squared_distance_to_triangle(p, a, d, c));
    const double sampled = std::sqrt(sampled_squared_distance(p, a, d, c));
    EXPECT_LE(exact, sampled + 1e-6);
    EXPECT_GE(exact, sampled - 0.02);
  }
}

TEST(TriangleDistance, HoldsForHugeAndTinyTriangles) {
  for (const float s : {1e-40f, 1e-20f, 1e20f, 1e38f}) {
    const double squared = squared_distance_to_triangle({s, s, s}, {0, 0, 0}, {3 * s, 0, 0}, {0, 3 * s, 0});
    EXPECT_NEAR(std::sqrt(squared) / double{s}, 1, 1e-4) << s;
  }
}

TEST(Surface, FindsOpenEdges) {
  const mesh::MultispectralMesh terrain = testing::terrain({.columns = 30, .rows = 20});
  const std::vector<bool> is_open = Surface(terrain.positions(), terrain.triangles()).open_vertices();
  for (std::size_t v = 0; v < terrain.vertex_count(); ++v) {
    const base::Vec3f& p = terrain.positions()[v];
    EXPECT_EQ(is_open[v], p.x == 0 || p.x == 29 || p.y == 0 || p.y == 19);
  }
  const mesh::MultispectralMesh torus = testing::torus(30, 20, 1);
  for (const bool open : Surface(torus.positions(), torus.triangles()).open_vertices()) EXPECT_FALSE(open);
}

TEST(Surface, NearestSeedsAreFewestEdgesAway) {
  const std::vector<base::Vec3f> positions{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}, {4.4f, 0, 0}, {9, 9, 9}};
  const std::vector<base::Triangle> strip{{0, 1, 1}, {1, 2, 2}, {2, 3, 3}, {3, 4, 4}};
  const Surface surface(positions, strip);
  EXPECT_EQ(surface.nearest_seeds({true, false, false, false, true, false}),
            (std::vector<std::uint32_t>{0, 0, 0, 4, 4, Surface::kNone}))
      << "vertex 2 is two edges from both and nearer to the first; nothing leads to vertex 5";
}

TEST(Surface, DistanceAnywhereIsTheSmallest) {
  const mesh::MultispectralMesh torus = testing::torus(60, 40, 1);
  const Surface surface(torus.positions(), torus.triangles());
  std::mt19937 random(2);
  for (int i = 0; i < 50; ++i) {
    const base::Vec3f u = point(random);
    const base::Vec3f p{30 * u.x - 15, 30 * u.y - 15, 10 * u.z - 5};
    double smallest = std::numeric_limits<double>::infinity();
    for (const base::Triangle& t : torus.triangles()) {
      smallest = std::min(smallest, squared_distance_to_triangle(p, torus.positions()[t[0]], torus.positions()[t[1]],
                                                                 torus.positions()[t[2]]));
    }
    const double infinity = std::numeric_limits<double>::infinity();
    EXPECT_EQ(surface.squared_distance_anywhere(p, 0, infinity), smallest);
    EXPECT_LE(surface.squared_distance_anywhere(p, smallest * 2, infinity), smallest * 2);
    EXPECT_GE(surface.squared_distance_near(p, 17, 0), smallest);
  }
}

TEST(Surface, TwoSidedDistanceSeesBothSides) {
  // A flat square of two triangles, and the same with a spike in the middle.
  const std::vector<base::Vec3f> flat{{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}};
  const std::vector<base::Triangle> two{{0, 1, 2}, {0, 2, 3}};
  std::vector<base::Vec3f> spiked = flat;
  spiked.push_back({1, 1, 0.5f});
  const std::vector<base::Triangle> four{{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}};
  const Surface fine(spiked, four), coarse(flat, two);
  const std::vector<std::uint32_t> coarse_of_fine{0, 1, 2, 3, 0}, fine_of_coarse{0, 1, 2, 3};
  EXPECT_FLOAT_EQ(static_cast<float>(two_sided_distance(fine, coarse, coarse_of_fine, fine_of_coarse)), 0.5f);
  // One triangle of the square is gone: only the fine side notices.
  std::vector<base::Vec3f> level = spiked;
  level[4].z = 0;
  const std::vector<base::Triangle> half{{0, 1, 2}};
  EXPECT_EQ(two_sided_distance(Surface(level, four), coarse, coarse_of_fine, fine_of_coarse), 0);
  EXPECT_GE(two_sided_distance(Surface(level, four), Surface(flat, half), coarse_of_fine, fine_of_coarse), 0.4);
  // A triangle stands up where the fine surface has none: only the coarse side notices.
  const std::vector<base::Vec3f> raised{{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}, {1, 1, 9}};
  const std::vector<base::Triangle> roof{{0, 1, 2}, {0, 2, 3}, {0, 2, 4}};
  EXPECT_GE(two_sided_distance(Surface(raised, two), Surface(raised, roof), std::vector<std::uint32_t>{0, 1, 2, 3, 4},
                               std::vector<std::uint32_t>{0, 1, 2, 3, 4}),
            4);
}

TEST(PointGroups, LeaveNoPointFarFromItsRepresentative) {
  std::mt19937 random(5);
  std::vector<base::Vec3f> points(4000);
  for (base::Vec3f& p : points) p = point(random);
  points[100] = {50, 0, 0};
  std::vector<std::uint32_t> members;
  for (std::uint32_t v = 10; v < points.size(); ++v) members.push_back(v);
  const std::vector<std::uint32_t> standing = group_representatives(points, members, 500);
  std::set<std::uint32_t> representatives;
  for (std::uint32_t v = 0; v < points.size(); ++v) {
    if (v < 10) {
      EXPECT_EQ(standing[v], v) << "not a member";
    } else {
      representatives.insert(standing[v]);
      EXPECT_GE(standing[v], 10u);
      EXPECT_EQ(standing[standing[v]], standing[v]);
      EXPECT_LT(squared_distance(points[v], points[standing[v]]), 3 * 0.2 * 0.2);
    }
  }
  EXPECT_EQ(representatives.size(), 500u);
}

TEST(PointGroups, CoincidentPointsAreOneGroup) {
  const std::vector<base::Vec3f> points(20, base::Vec3f{1, 2, 3});
  std::vector<std::uint32_t> members(20);
  for (std::uint32_t v = 0; v < 20; ++v) members[v] = v;
  for (const std::uint32_t standing : group_representatives(points, members, 5)) EXPECT_EQ(standing, 0u);
}

}  // namespace
}  // namespace spectra::mesh
