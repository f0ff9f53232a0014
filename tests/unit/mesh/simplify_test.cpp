#include "fusion/mesh/simplify.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <set>
#include <tuple>
#include <vector>

#include "fusion/mesh/heat_spots.hpp"

namespace spectra::mesh {
namespace {

using base::Rgb8;
using base::Triangle;
using base::Vec3f;

/// A flat wall of columns x rows vertices, one centimetre apart.
struct Wall {
  Wall(std::uint32_t width, std::uint32_t rows)
      : columns(width), visible(width * rows, base::Rgb8{200, 200, 190}), celsius(width * rows, 20.0f) {
    std::mt19937 random(5);
    for (std::uint32_t y = 0; y < rows; ++y) {
      for (std::uint32_t x = 0; x < columns; ++x) {
        positions.push_back({0.01f * static_cast<float>(x), 0.01f * static_cast<float>(y), 0});
        celsius[y * columns + x] += 0.1f * static_cast<float>(random() % 100) * 0.01f;
        if (x == 0 || y == 0) continue;
        const std::uint32_t v = y * columns + x;
        triangles.push_back({v - columns - 1, v - columns, v});
        triangles.push_back({v - columns - 1, v, v - 1});
      }
    }
  }
  std::uint32_t at(std::uint32_t x, std::uint32_t y) const { return y * columns + x; }

  Simplified simplified_to(std::size_t count) const {
    const Surface surface(positions, triangles);
    const std::vector<bool> is_locked(positions.size());
    SimplifyMemory memory;
    return simplified({.surface = surface,
                       .visible = visible,
                       .temperature_celsius = celsius,
                       .is_locked = is_locked,
                       .span_celsius = 10},
                      count, memory);
  }

  std::uint32_t columns;
  std::vector<base::Vec3f> positions;
  std::vector<base::Triangle> triangles;
  std::vector<base::Rgb8> visible;
  std::vector<float> celsius;
};

std::set<std::uint32_t> used(const std::vector<base::Triangle>& triangles) {
  std::set<std::uint32_t> result;
  for (const base::Triangle& t : triangles) result.insert(t.begin(), t.end());
  return result;
}

double area(const Wall& wall, const std::vector<base::Triangle>& triangles) {
  double sum = 0;
  for (const base::Triangle& t : triangles)
    sum += triangle_area(wall.positions[t[0]], wall.positions[t[1]], wall.positions[t[2]]);
  return sum;
}

/// The area on which a linear field over the triangles is above a threshold.
double area_above(const Wall& wall, const std::vector<base::Triangle>& triangles,
                  const std::function<double(std::uint32_t)>& value, double threshold) {
  constexpr int kPieces = 24;
  double sum = 0;
  for (const base::Triangle& t : triangles) {
    int above = 0, count = 0;
    for (int i = 0; i < kPieces; ++i) {
      for (int j = 0; i + j < kPieces; ++j) {
        const double u = (i + 1.0 / 3) / kPieces, v = (j + 1.0 / 3) / kPieces;
        ++count;
        if ((1 - u - v) * value(t[0]) + u * value(t[1]) + v * value(t[2]) > threshold) ++above;
      }
    }
    sum += triangle_area(wall.positions[t[0]], wall.positions[t[1]], wall.positions[t[2]]) * above / count;
  }
  return sum;
}

TEST(Simplified, FlatWallKeepsItsOutline) {
  const Wall wall(101, 81);
  const Simplified simple = wall.simplified_to(200);
  EXPECT_LE(used(simple.triangles).size(), 200u);
  EXPECT_NEAR(area(wall, simple.triangles), 0.8, 1e-6);
}

TEST(Simplified, SpotsStayAndNothingElseGetsWarm) {
  Wall wall(161, 121);
  // One vertex in the middle, one in the corner, and a spot of two centimetres.
  wall.celsius[wall.at(60, 40)] = 34;
  wall.celsius[wall.at(0, 0)] = 34;
  for (std::uint32_t y = 79; y <= 81; ++y) {
    for (std::uint32_t x = 119; x <= 121; ++x) wall.celsius[wall.at(x, y)] = 36;
  }
  wall.celsius[wall.at(100, 20)] = 5;
  const auto full = [&](std::uint32_t v) { return static_cast<double>(wall.celsius[v]); };
  for (const std::size_t count : {6000u, 1000u, 250u}) {
    SCOPED_TRACE(count);
    const Simplified simple = wall.simplified_to(count);
    const auto kept = used(simple.triangles);
    EXPECT_LE(kept.size(), count);
    const auto shown = [&](std::uint32_t v) { return static_cast<double>(simple.temperature_celsius[v]); };
    for (const auto& [x, y, celsius] :
         {std::tuple(60u, 40u, 34.0f), std::tuple(0u, 0u, 34.0f), std::tuple(100u, 20u, 5.0f)}) {
      ASSERT_TRUE(kept.contains(wall.at(x, y)));
      EXPECT_EQ(simple.temperature_celsius[wall.at(x, y)], celsius);
    }
    EXPECT_TRUE(std::ranges::any_of(kept, [&](std::uint32_t v) { return shown(v) > 35.9; }));
    for (const double threshold : {22.0, 27.0, 32.0}) {
      EXPECT_LE(area_above(wall, simple.triangles, shown, threshold),
                1.5 * area_above(wall, wall.triangles, full, threshold) + 1e-4);
      EXPECT_GE(area_above(wall, simple.triangles, shown, threshold),
                0.5 * area_above(wall, wall.triangles, full, threshold));
    }
  }
}

TEST(Simplified, LetteringStaysWhereThereIsNothingElse) {
  Wall wall(201, 101);
  // Strokes of two centimetres, two apart.
  const auto is_ink = [](std::uint32_t x, std::uint32_t y) {
    return x >= 60 && x < 100 && y >= 40 && y < 60 && x % 4 < 2;
  };
  for (std::uint32_t y = 0; y < 101; ++y) {
    for (std::uint32_t x = 0; x < 201; ++x) {
      if (is_ink(x, y)) wall.visible[wall.at(x, y)] = {20, 20, 20};
    }
  }
  const Simplified simple = wall.simplified_to(1500);
  const auto full = [&](std::uint32_t v) { return 255.0 - wall.visible[v].g; };
  const auto shown = [&](std::uint32_t v) { return 255.0 - simple.visible[v].g; };
  const double ink = area_above(wall, wall.triangles, full, 150);
  EXPECT_NEAR(area_above(wall, simple.triangles, shown, 150), ink, 0.15 * ink);
  EXPECT_NEAR(area_above(wall, simple.triangles, shown, 100), area_above(wall, wall.triangles, full, 100), 0.15 * ink);
}

TEST(Simplified, NoiseOfColoursEvensOut) {
  Wall wall(101, 101);
  std::mt19937 random(9);
  for (base::Rgb8& c : wall.visible) c = {static_cast<std::uint8_t>(100 + random() % 41), 100, 100};
  const Simplified simple = wall.simplified_to(600);
  double sum = 0, squares = 0;
  const auto kept = used(simple.triangles);
  for (const std::uint32_t v : kept) {
    sum += simple.visible[v].r;
    squares += std::pow(simple.visible[v].r - 120.0, 2);
  }
  EXPECT_NEAR(sum / static_cast<double>(kept.size()), 120, 2);
  EXPECT_LT(std::sqrt(squares / static_cast<double>(kept.size())), 10) << "12 in the wall itself";
}

TEST(Simplified, LoosePiecesDoNotVanish) {
  Wall wall(9, 9);
  std::vector<base::Triangle> loose;
  for (std::size_t t = 0; t < wall.triangles.size(); t += 6) loose.push_back(wall.triangles[t]);
  wall.triangles = loose;
  EXPECT_EQ(wall.simplified_to(1).triangles, loose);
}

TEST(Simplified, LockedVerticesShowThemselves) {
  Wall wall(41, 41);
  const Surface surface(wall.positions, wall.triangles);
  std::vector<bool> is_locked(wall.positions.size());
  for (std::uint32_t v = 0; v < is_locked.size(); v += 97) {
    is_locked[v] = true;
    wall.visible[v] = {static_cast<std::uint8_t>(v % 251), 3, 7};
    wall.celsius[v] = 20 + static_cast<float>(v % 5);
  }
  SimplifyMemory memory;
  const Simplified simple = simplified({.surface = surface,
                                        .visible = wall.visible,
                                        .temperature_celsius = wall.celsius,
                                        .is_locked = is_locked,
                                        .span_celsius = 10},
                                       30, memory);
  const auto kept = used(simple.triangles);
  for (std::uint32_t v = 0; v < is_locked.size(); v += 97) {
    EXPECT_TRUE(kept.contains(v));
    EXPECT_EQ(simple.visible[v], wall.visible[v]);
    EXPECT_EQ(simple.temperature_celsius[v], wall.celsius[v]);
  }
}

TEST(Simplified, TakesTemperaturesThatAreMissingOrBeyondTheSensor) {
  Wall wall(61, 61);
  constexpr float kInfinite = std::numeric_limits<float>::infinity();
  for (std::uint32_t y = 0; y < 61; ++y) {
    for (std::uint32_t x = 0; x < 30; ++x) wall.celsius[wall.at(x, y)] = std::numeric_limits<float>::quiet_NaN();
  }
  wall.celsius[wall.at(45, 30)] = kInfinite;
  const Simplified simple = wall.simplified_to(200);
  const auto kept = used(simple.triangles);
  ASSERT_TRUE(kept.contains(wall.at(45, 30)));
  EXPECT_EQ(simple.temperature_celsius[wall.at(45, 30)], kInfinite);
  for (const std::uint32_t v : kept) {
    const auto x = v % 61;
    if (x < 27) {
      EXPECT_TRUE(std::isnan(simple.temperature_celsius[v])) << x;
    } else if (x > 32 && v != wall.at(45, 30)) {
      EXPECT_NEAR(static_cast<double>(simple.temperature_celsius[v]), 20.05, 0.1) << x;
    }
  }
}

TEST(HeatSpots, AreWhatStandsOutFromAllAroundIt) {
  Wall wall(61, 61);
  wall.celsius[wall.at(10, 10)] = 30;
  wall.celsius[wall.at(40, 40)] = 31;
  wall.celsius[wall.at(41, 40)] = 30.5f;  // Of the same spot.
  wall.celsius[wall.at(20, 50)] = 12;
  wall.celsius[wall.at(30, 10)] = 20.4f;  // Does not stand out.
  const Surface surface(wall.positions, wall.triangles);
  const auto areas = vertex_areas(surface);
  std::set<std::uint32_t> apexes;
  for (const HeatSpot& spot : heat_spots(surface, wall.celsius, areas, 2, 0.01)) apexes.insert(spot.apex);
  EXPECT_EQ(apexes, (std::set{wall.at(10, 10), wall.at(40, 40), wall.at(20, 50)}));
  EXPECT_TRUE(heat_spots(surface, wall.celsius, areas, 2, 1e-5).empty()) << "all are larger";
}

TEST(Simplify, TheSameWhateverItsMemoryWasUsedFor) {
  SimplifyMemory memory;
  const auto run = [&](const Wall& wall, std::size_t count, SimplifyMemory& its) {
    const Surface surface(wall.positions, wall.triangles);
    const std::vector<bool> is_locked(wall.positions.size());
    return simplified({.surface = surface,
                       .visible = wall.visible,
                       .temperature_celsius = wall.celsius,
                       .is_locked = is_locked,
                       .span_celsius = 10},
                      count, its);
  };
  const Wall large(60, 50), small(25, 20);
  run(large, 100, memory);
  const Simplified again = run(small, 60, memory);
  SimplifyMemory fresh;
  const Simplified alone = run(small, 60, fresh);
  EXPECT_EQ(again.triangles, alone.triangles);
  EXPECT_EQ(again.visible, alone.visible);
  EXPECT_EQ(again.temperature_celsius, alone.temperature_celsius);
}

}  // namespace
}  // namespace spectra::mesh
