#include "fusion/mesh/nearest_surface.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <span>
#include <vector>

namespace spectra::mesh {
namespace {

TEST(NearestSurface, AgreesWithLookingAtAll) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> coordinate(-10, 10);
  const auto random_point = [&] { return base::Vec3f{coordinate(random), coordinate(random), coordinate(random)}; };
  for (const std::uint32_t count : {1U, 2U, 7U, 8U, 9U, 17U, 500U}) {
    std::vector<base::Vec3f> points(count);
    for (base::Vec3f& point : points) point = random_point();
    std::vector<base::Triangle> triangles;
    for (std::uint32_t i = 0; i + 5 < count; i += 3) triangles.push_back({i, i + 1, i + 4});
    for (const bool has_triangles : {false, true}) {
      const NearestSurface nearest(points, has_triangles ? std::span(triangles) : std::span<base::Triangle>());
      std::vector<base::Triangle> elements;
      std::vector<bool> is_used(count);
      for (const base::Triangle& t : triangles) {
        if (!has_triangles) break;
        elements.push_back(t);
        for (const std::uint32_t corner : t) is_used[corner] = true;
      }
      for (std::uint32_t v = 0; v < count; ++v) {
        if (!is_used[v]) elements.push_back({v, v, v});
      }
      for (int query = 0; query < 100; ++query) {
        const base::Vec3f position = random_point();
        const double limit = query % 2 == 0 ? 1e9 : 3;
        const auto distance = [&](const base::Triangle& t, const std::array<double, 3>& weights) {
          std::array<double, 3> foot{};
          for (std::size_t i = 0; i < 3; ++i) {
            foot[0] += weights[i] * double{points[t[i]].x};
            foot[1] += weights[i] * double{points[t[i]].y};
            foot[2] += weights[i] * double{points[t[i]].z};
          }
          return std::hypot(foot[0] - double{position.x}, foot[1] - double{position.y}, foot[2] - double{position.z});
        };
        double best = std::numeric_limits<double>::infinity();
        for (const base::Triangle& t : elements) {
          best = std::min(best, distance(t, nearest_on_triangle(position, points[t[0]], points[t[1]], points[t[2]])));
        }
        const auto hit = nearest.find(position, limit);
        ASSERT_EQ(hit.has_value(), best <= limit);
        if (!hit) continue;
        EXPECT_NEAR(hit->distance, best, 1e-9);
        EXPECT_NEAR(distance(hit->corners, hit->weights), best, 1e-9);
      }
    }
  }
}

/// find() looks at all where boxes tell nothing, and is right there (above).
void expect_all_as_one_by_one(std::span<const base::Vec3f> points, std::span<const base::Triangle> triangles,
                              std::span<const base::Vec3f> from, double most) {
  const NearestSurface nearest(points, triangles);
  std::vector<std::optional<NearestSurface::Hit>> hits(from.size());
  std::atomic<std::size_t> twice_count = 0, done_count = 0;
  nearest.find_all(
      from, most,
      [&](std::size_t i, const NearestSurface::Hit& hit) {
        twice_count += hits[i] ? 1U : 0U;
        hits[i] = hit;
      },
      [&](std::size_t count) { done_count += count; });
  EXPECT_EQ(twice_count, 0U);
  EXPECT_LE(done_count, from.size());
  for (std::size_t i = 0; i < from.size(); ++i) {
    const auto hit = nearest.find(from[i], most);
    ASSERT_EQ(hits[i].has_value(), hit.has_value()) << i;
    if (!hit) continue;
    ASSERT_NEAR(hits[i]->distance, hit->distance, 1e-12 * (1 + hit->distance)) << i;
    std::array<double, 3> away = {-double{from[i].x}, -double{from[i].y}, -double{from[i].z}};
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const base::Vec3f& p = points[hits[i]->corners[corner]];
      away[0] += hits[i]->weights[corner] * double{p.x};
      away[1] += hits[i]->weights[corner] * double{p.y};
      away[2] += hits[i]->weights[corner] * double{p.z};
    }
    ASSERT_NEAR(std::hypot(away[0], away[1], away[2]), hit->distance, 1e-9 * (1 + hit->distance)) << i;
  }
}

TEST(NearestSurface, FindsAllAmongLongTriangles) {
  std::mt19937 random(3);
  for (const float thickness : {1.0F, 0.05F, 0.0F}) {
    for (const float offset : {0.0F, 1000.0F}) {
      std::uniform_real_distribution<float> coordinate(0, 1);
      std::vector<base::Vec3f> points(3000);
      for (base::Vec3f& p : points) {
        p = {offset + coordinate(random), coordinate(random), thickness * coordinate(random)};
      }
      std::vector<base::Triangle> triangles;
      for (std::uint32_t i = 0; i + 3 < points.size(); i += 3) triangles.push_back({i, i + 1, i + 2});
      for (std::uint32_t i = 0; i < 300; ++i) triangles.push_back({i, i + 1, i});  // lines
      for (const float shift : {0.0F, 0.01F, 1.5F}) {
        std::vector<base::Vec3f> from(points.rbegin(), points.rend());
        from.resize(700);
        for (base::Vec3f& p : from) p.z += shift;
        for (const double most : {0.004, 0.5, 1e9}) expect_all_as_one_by_one(points, triangles, from, most);
      }
    }
  }
}

TEST(NearestSurface, FindsAllWhereMostIsShort) {
  std::mt19937 random(4);
  std::uniform_real_distribution<float> coordinate(0, 1);
  std::vector<base::Vec3f> points, from;
  for (int i = 0; i < 2500; ++i) {
    const int row = i / 50;
    points.push_back({static_cast<float>(i % 50), static_cast<float>(row), coordinate(random)});
  }
  for (int i = 0; i < 2000; ++i)
    from.push_back({50 * coordinate(random), 50 * coordinate(random), 20 * coordinate(random)});
  from.push_back(points[77]);
  from.resize(from.size() + 500, points[78]);
  std::vector<base::Triangle> triangles;
  for (std::uint32_t v = 0; v + 51 < points.size(); ++v) {
    if (v % 50 != 49) triangles.push_back({v, v + 1, v + 50});
  }
  expect_all_as_one_by_one(points, triangles, from, 3);
  expect_all_as_one_by_one(points, {}, from, 3);
  // A heap of long triangles in a corner: most positions are found one by one, the others in groups.
  for (std::uint32_t i = 0; i < 3000; ++i) {
    points.push_back({4 * coordinate(random), 4 * coordinate(random), 5 + 10 * coordinate(random)});
    if (i % 3 == 2) triangles.push_back({2500 + i, 2500 + i - 1, 2500 + i - 2});
  }
  for (int i = 0; i < 300; ++i) {
    from.push_back({4 * coordinate(random), 4 * coordinate(random), 5 + 10 * coordinate(random)});
  }
  for (const double most : {0.02, 3.0}) expect_all_as_one_by_one(points, triangles, from, most);
  // As far away as floats go.
  const std::vector<base::Vec3f> far(300, base::Vec3f{3e38F, -3e38F, 3e38F});
  for (const double most : {1.0, 1e39, std::numeric_limits<double>::infinity()}) {
    expect_all_as_one_by_one(points, triangles, far, most);
  }
  const std::vector<base::Vec3f> one(500, base::Vec3f{1, 2, 3});
  expect_all_as_one_by_one(one, {}, from, 100);
  expect_all_as_one_by_one(one, {}, {}, 100);
  expect_all_as_one_by_one({}, {}, from, 100);
}

TEST(NearestSurface, FindsThePointOfATriangle) {
  const base::Vec3f a{0, 0, 0}, b{4, 0, 0}, c{0, 4, 0};
  const auto expect = [&](base::Vec3f place, std::array<double, 3> weights) {
    const auto found = nearest_on_triangle(place, a, b, c);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(found[i], weights[i], 1e-12);
  };
  expect({1, 1, 5}, {0.5, 0.25, 0.25});
  expect({2, -3, 1}, {0.5, 0.5, 0});
  expect({-1, -2, 0}, {1, 0, 0});
  expect({9, -1, 0}, {0, 1, 0});
  expect({3, 3, 0}, {0, 0.5, 0.5});
  EXPECT_EQ(nearest_on_triangle({1, 2, 3}, b, b, b), (std::array<double, 3>{1, 0, 0}));
  const auto thin = nearest_on_triangle({3, 1, 0}, a, b, {2, 0, 0});
  EXPECT_NEAR(thin[1] * 4 + thin[2] * 2, 3, 1e-12) << "all three on a line";
}

TEST(NearestSurface, BearsManyPointsAtOnePlace) {
  std::vector<base::Vec3f> points(20'000, base::Vec3f{1, 2, 3});
  EXPECT_EQ(NearestSurface(points, {}).median_spacing(), 0);
  points.push_back({2, 2, 3});
  const NearestSurface nearest(points, {});
  EXPECT_EQ(nearest.find({1, 2, 3}, 0)->distance, 0);
  EXPECT_EQ(nearest.find({2.25F, 2, 3}, 1)->corners[0], 20'000U);
  EXPECT_FALSE(nearest.find({5, 2, 3}, 1));
  EXPECT_FALSE(NearestSurface({}, {}).find({5, 2, 3}, 1));
}

TEST(NearestSurface, KnowsTheSpacingOfAGrid) {
  std::vector<base::Vec3f> points;
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 60; ++x) points.push_back({static_cast<float>(x) * 0.5F, static_cast<float>(y) * 0.5F, 0});
  }
  EXPECT_NEAR(NearestSurface(points, {}).median_spacing(), 0.5, 1e-12);
  const std::vector<base::Triangle> triangles{{0, 1, 60}, {1, 61, 60}};
  EXPECT_NEAR(NearestSurface(points, triangles).median_spacing(), 0.5, 1e-12);
}

}  // namespace
}  // namespace spectra::mesh
