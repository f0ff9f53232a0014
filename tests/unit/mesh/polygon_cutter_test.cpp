#include "fusion/mesh/polygon_cutter.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

namespace spectra::mesh {
namespace {

using Points = std::vector<std::pair<double, double>>;
using Result = PolygonCutter::Result;

/// In a plane that no axis lies in, so that nothing is plane by chance.
std::vector<base::Vec3f> in_space(const Points& points, double away = 0) {
  std::vector<base::Vec3f> corners;
  for (const auto& [u, v] : points) {
    corners.push_back({static_cast<float>(away + 0.48 * u - 0.64 * v), static_cast<float>(0.6 * u + 0.48 * v - away),
                       static_cast<float>(0.64 * u + 0.6 * v)});
  }
  return corners;
}

double area(const std::pair<double, double>& a, const std::pair<double, double>& b,
            const std::pair<double, double>& c) {
  return ((b.first - a.first) * (c.second - a.second) - (b.second - a.second) * (c.first - a.first)) / 2;
}

double area_of(const Points& points) {
  double sum = 0;
  for (std::size_t i = 2; i < points.size(); ++i) sum += area(points[0], points[i - 1], points[i]);
  return sum;
}

bool is_inside(const Points& points, double u, double v) {
  bool inside = false;
  for (std::size_t i = 0, j = points.size() - 1; i < points.size(); j = i++) {
    const auto& [a, b] = points[i];
    const auto& [c, d] = points[j];
    if ((b > v) != (d > v) && u < (c - a) * (v - b) / (d - b) + a) inside = !inside;
  }
  return inside;
}

/// Every triangle is turned as the polygon is, its middle lies inside, and together they have its area.
void expect_cut(const Points& points, double tolerance = 1e-5) {
  PolygonCutter cutter;
  ASSERT_EQ(cutter.cut(in_space(points)), Result::Ears);
  const auto triangles = cutter.triangles();
  ASSERT_EQ(triangles.size(), points.size() - 2);
  const double whole = area_of(points);
  double sum = 0;
  for (const base::Triangle& t : triangles) {
    const double part = area(points[t[0]], points[t[1]], points[t[2]]);
    EXPECT_GE(part * whole, -tolerance) << t[0] << " " << t[1] << " " << t[2];
    sum += std::abs(part);
    if (std::abs(part) < tolerance) continue;
    const double u = (points[t[0]].first + points[t[1]].first + points[t[2]].first) / 3;
    const double v = (points[t[0]].second + points[t[1]].second + points[t[2]].second) / 3;
    EXPECT_TRUE(is_inside(points, u, v)) << t[0] << " " << t[1] << " " << t[2];
  }
  EXPECT_NEAR(sum, std::abs(whole), tolerance * static_cast<double>(points.size()));
}

/// From every corner as the first, and both ways round. Where the first corner sees everything the fan stands.
std::size_t expect_cut_from_everywhere(Points points) {
  std::size_t ear_count = 0;
  PolygonCutter cutter;
  for (const bool is_turned : {false, true}) {
    if (is_turned) std::reverse(points.begin(), points.end());
    for (std::size_t i = 0; i < points.size(); ++i) {
      std::rotate(points.begin(), points.begin() + 1, points.end());
      if (cutter.cut(in_space(points)) == Result::Fan) {
        for (std::size_t v = 2; v < points.size(); ++v) {
          EXPECT_GE(area(points[0], points[v - 1], points[v]) * area_of(points), -1e-5);
        }
      } else {
        expect_cut(points);
        ++ear_count;
      }
    }
  }
  return ear_count;
}

Points star(int spikes, double inner) {
  Points points;
  for (int i = 0; i < 2 * spikes; ++i) {
    const double angle = std::numbers::pi * i / spikes;
    const double radius = i % 2 == 0 ? 1 : inner;
    points.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
  }
  return points;
}

TEST(PolygonCutter, LeavesTheFanToConvexPolygons) {
  PolygonCutter cutter;
  for (int corners = 4; corners < 40; ++corners) {
    Points points;
    for (int i = 0; i < corners; ++i) {
      points.emplace_back(std::cos(2 * std::numbers::pi * i / corners),
                          0.1 * std::sin(2 * std::numbers::pi * i / corners));
    }
    EXPECT_EQ(cutter.cut(in_space(points)), Result::Fan) << corners;
    EXPECT_EQ(cutter.cut(in_space(points, 5000)), Result::Fan) << "far from 0, where floats are coarse: " << corners;
  }
  EXPECT_EQ(cutter.cut(in_space({{0, 0}, {1, 0}, {2, 0}, {2, 2}, {1, 2}, {0, 2}})), Result::Fan) << "with flat corners";
  Points large;
  for (int i = 0; i < 5000; ++i) {
    large.emplace_back(std::cos(2 * std::numbers::pi * i / 5000), std::sin(2 * std::numbers::pi * i / 5000));
  }
  EXPECT_EQ(cutter.cut(in_space(large)), Result::Fan) << "of any number of corners";
}

TEST(PolygonCutter, CutsConcavePolygons) {
  EXPECT_EQ(expect_cut_from_everywhere({{0, 0}, {2, 0.8}, {4, 0}, {2, 4}}), 4U) << "an arrow";
  EXPECT_GT(expect_cut_from_everywhere({{0, 0}, {3, 0}, {3, 1}, {1, 1}, {1, 3}, {0, 3}}), 0U) << "an L";
  EXPECT_GT(expect_cut_from_everywhere({{0, 0}, {3, 0}, {3, 3}, {2, 3}, {2, 1}, {1, 1}, {1, 3}, {0, 3}}), 0U) << "a U";
  EXPECT_EQ(expect_cut_from_everywhere(star(5, 0.3)), 20U);
  EXPECT_EQ(expect_cut_from_everywhere(star(9, 0.6)), 36U);
  EXPECT_GT(expect_cut_from_everywhere({{0, 0},
                                        {1, 0},
                                        {2, 0},
                                        {3, 0},
                                        {3, 0.5},
                                        {3, 1},
                                        {2, 1},
                                        {1, 1},
                                        {1, 2},
                                        {1, 3},
                                        {0.5, 3},
                                        {0, 3},
                                        {0, 2},
                                        {0, 1}}),
            0U)
      << "an L with flat corners";
  EXPECT_GT(expect_cut_from_everywhere({{0, 0},
                                        {8, 0},
                                        {8, 6},
                                        {1, 6},
                                        {1, 2},
                                        {6, 2},
                                        {6, 4},
                                        {3, 4},
                                        {3, 3},
                                        {5, 3},
                                        {5, 2.5},
                                        {2, 2.5},
                                        {2, 5},
                                        {7, 5},
                                        {7, 1},
                                        {0, 1}}),
            0U)
      << "a spiral";
}

TEST(PolygonCutter, CutsCombsAndRandomOutlines) {
  Points comb;
  for (int i = 0; i < 100; ++i) {
    comb.emplace_back(2 * i, 0);
    comb.emplace_back(2 * i + 1, 10);
  }
  comb.emplace_back(200, 0);
  comb.emplace_back(200, -1);
  comb.emplace_back(0, -1);
  expect_cut(comb, 1e-3);
  std::mt19937 random(7);
  for (int round = 0; round < 200; ++round) {
    Points points;
    const int corners = 5 + static_cast<int>(random() % 60);
    for (int i = 0; i < corners; ++i) {
      const double radius = 0.1 + static_cast<double>(random() % 1000) * 1e-3;
      const double angle = 2 * std::numbers::pi * i / corners;
      points.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
    }
    PolygonCutter cutter;
    if (cutter.cut(in_space(points)) != Result::Fan) expect_cut(points);
  }
}

/// A frame is written as one polygon whose outline goes in to the hole, round it, and out the same way.
TEST(PolygonCutter, CutsAroundAHoleThatASlitLeadsTo) {
  expect_cut({{0, 0}, {4, 0}, {4, 4}, {0, 4}, {0, 0}, {1, 1}, {1, 3}, {3, 3}, {3, 1}, {1, 1}});
}

TEST(PolygonCutter, DoesNotPretendForPolygonsThatCrossThemselves) {
  PolygonCutter cutter;
  EXPECT_EQ(cutter.cut(in_space({{0, 0}, {2, 2}, {2, 0}, {0, 2}})), Result::Failed) << "a bow tie of no area";
  EXPECT_EQ(cutter.cut(in_space({{0, 0}, {2, 2}, {2, 0}, {0, 1}})), Result::Failed) << "a bow tie";
  Points pentagram;
  for (int i = 0; i < 5; ++i) {
    pentagram.emplace_back(std::cos(4 * std::numbers::pi * i / 5), std::sin(4 * std::numbers::pi * i / 5));
  }
  EXPECT_EQ(cutter.cut(in_space(pentagram)), Result::Failed) << "a pentagram, all of whose corners are convex";
  Points twice;
  for (int i = 0; i < 12; ++i)
    twice.emplace_back((1 + 0.05 * i) * std::cos(1.1 * i), (1 + 0.05 * i) * std::sin(1.1 * i));
  EXPECT_EQ(cutter.cut(in_space(twice)), Result::Failed) << "round twice";
  EXPECT_EQ(cutter.cut(in_space(star(501, 0.5))), Result::Failed) << "too many corners";
}

TEST(PolygonCutter, StandsWhatIsNoPolygon) {
  PolygonCutter cutter;
  EXPECT_EQ(cutter.cut(in_space({{0, 0}, {1, 1}, {3, 3}, {2, 2}})), Result::Fan) << "a line";
  EXPECT_EQ(cutter.cut(in_space({{1, 1}, {1, 1}, {1, 1}, {1, 1}, {1, 1}})), Result::Fan) << "one place";
  EXPECT_EQ(cutter.cut(in_space({{0, 0}, {1, 0}, {1, 0}, {0, 1}})), Result::Fan) << "a corner twice";
  const float huge = 1e30F;
  EXPECT_EQ(cutter.cut(std::vector<base::Vec3f>{{-huge, 0, 0}, {0, huge / 4, 0}, {huge, 0, 0}, {0, huge, 0}}),
            Result::Ears);
  const float tiny = 1e-30F;
  EXPECT_EQ(cutter.cut(std::vector<base::Vec3f>{{-tiny, 0, 0}, {0, tiny / 4, 0}, {tiny, 0, 0}, {0, tiny, 0}}),
            Result::Ears);
  std::mt19937 random(3);
  for (int round = 0; round < 3000; ++round) {
    std::vector<base::Vec3f> corners(4 + random() % 12);
    for (base::Vec3f& corner : corners) {
      corner = {static_cast<float>(random() % 4), static_cast<float>(random() % 4), static_cast<float>(random() % 2)};
    }
    if (cutter.cut(corners) != Result::Ears) continue;
    ASSERT_EQ(cutter.triangles().size(), corners.size() - 2);
    for (const base::Triangle& triangle : cutter.triangles()) {
      for (const std::uint32_t corner : triangle) ASSERT_LT(corner, corners.size());
    }
  }
}

}  // namespace
}  // namespace spectra::mesh
