#include "server/tradeoff/surface_index.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace spectra::tradeoff {
namespace {

using base::Vec3f;

double distance_to(base::Vec3f p, const std::array<base::Vec3f, 3>& corner, const std::array<double, 3>& weights) {
  double x = 0, y = 0, z = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    x += weights[i] * static_cast<double>(corner[i].x);
    y += weights[i] * static_cast<double>(corner[i].y);
    z += weights[i] * static_cast<double>(corner[i].z);
  }
  return std::hypot(x - static_cast<double>(p.x), y - static_cast<double>(p.y), z - static_cast<double>(p.z));
}

TEST(NearestOnTriangle, FindsInsideEdgeAndCorner) {
  const base::Vec3f a{0, 0, 0}, b{2, 0, 0}, c{0, 2, 0};
  EXPECT_NEAR(distance_to({0.5F, 0.5F, 3}, {a, b, c}, mesh::nearest_on_triangle({0.5F, 0.5F, 3}, a, b, c)), 3, 1e-12);
  EXPECT_NEAR(distance_to({1, -1, 0}, {a, b, c}, mesh::nearest_on_triangle({1, -1, 0}, a, b, c)), 1, 1e-12);
  EXPECT_NEAR(distance_to({2, 2, 0}, {a, b, c}, mesh::nearest_on_triangle({2, 2, 0}, a, b, c)), std::sqrt(2.0), 1e-12);
  EXPECT_NEAR(distance_to({-3, -4, 0}, {a, b, c}, mesh::nearest_on_triangle({-3, -4, 0}, a, b, c)), 5, 1e-12);
}

TEST(NearestOnTriangle, IsTotalForDegenerateTriangles) {
  const base::Vec3f a{1, 1, 1};
  const auto weights = mesh::nearest_on_triangle({4, 5, 1}, a, a, a);
  EXPECT_NEAR(distance_to({4, 5, 1}, {a, a, a}, weights), 5, 1e-12);
  const base::Vec3f b{3, 1, 1}, c{5, 1, 1};
  EXPECT_NEAR(distance_to({4, 2, 1}, {a, b, c}, mesh::nearest_on_triangle({4, 2, 1}, a, b, c)), 1, 1e-12);
}

TEST(SurfaceIndex, AgreesWithLookingAtEveryTriangle) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> coordinate(-1, 1), nudge(-0.1F, 0.1F);
  std::vector<base::Vec3f> positions;
  std::vector<base::Triangle> triangles;
  for (std::uint32_t i = 0; i < 400; ++i) {
    const base::Vec3f centre{coordinate(random), coordinate(random), coordinate(random)};
    for (int corner = 0; corner < 3; ++corner) {
      positions.push_back({centre.x + nudge(random), centre.y + nudge(random), centre.z + nudge(random)});
    }
    triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  const SurfaceIndex index(positions, triangles);
  for (int sample = 0; sample < 200; ++sample) {
    const base::Vec3f place{2 * coordinate(random), 2 * coordinate(random), 2 * coordinate(random)};
    double best = std::numeric_limits<double>::infinity();
    for (const auto& t : triangles) {
      const std::array<base::Vec3f, 3> corners{positions[t[0]], positions[t[1]], positions[t[2]]};
      best = std::min(
          best, distance_to(place, corners, mesh::nearest_on_triangle(place, corners[0], corners[1], corners[2])));
    }
    EXPECT_NEAR(index.nearest(place).distance_m, best, 1e-9);
  }
}

TEST(SurfaceIndex, FindsTheNearestPointOfACloud) {
  const SurfaceIndex index({{0, 0, 0}, {1, 0, 0}, {0, 3, 0}}, {});
  const SurfacePoint found = index.nearest({0.9F, 0.1F, 0});
  EXPECT_EQ(found.triangle, 1U);
  EXPECT_NEAR(found.distance_m, std::sqrt(0.02), 1e-6);
}

}  // namespace
}  // namespace spectra::tradeoff
