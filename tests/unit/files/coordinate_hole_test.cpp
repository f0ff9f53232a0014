// Which numbers of one coordinate stand for "not measured", and which are true form.
#include "fusion/files/coordinate_hole.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "fusion/files/ply_reader.hpp"
#include "loaded.hpp"

namespace spectra::files {
namespace {

std::vector<SampledVertex> numbered(const std::vector<base::Vec3d>& positions) {
  std::vector<SampledVertex> vertices;
  vertices.reserve(positions.size());
  for (const base::Vec3d& position : positions) vertices.push_back({vertices.size(), position});
  return vertices;
}

CoordinateHoles holes_of(const std::vector<base::Vec3d>& positions, bool is_used) {
  return find_coordinate_holes(numbered(positions), 1, [is_used](std::uint64_t) { return is_used; });
}

/// Rings of `facets` vertices around z; `is_alternating`: the rings take turns.
std::vector<base::Vec3d> rings(double radius, const std::vector<double>& heights, int facets, bool is_alternating) {
  std::vector<base::Vec3d> positions;
  const int ring_count = static_cast<int>(heights.size());
  for (int i = 0; i < facets * ring_count; ++i) {
    const double angle = (is_alternating ? i / ring_count : i % facets) * 2 * std::numbers::pi / facets;
    const double z = heights[static_cast<std::size_t>(is_alternating ? i % ring_count : i / facets)];
    positions.push_back({radius * std::cos(angle), radius * std::sin(angle), z});
  }
  return positions;
}

/// 300 x 225 x 12 m; one cell in four is not measured.
std::vector<base::Vec3d> terrain(double none) {
  std::vector<base::Vec3d> positions;
  for (int i = 0; i < 4800; ++i) {
    const double height = 250 + 12 * std::sin(0.013 * i);
    const int row = i / 80;
    positions.push_back({i % 80 * 3.75, row * 3.75, (i * 7 + row) % 16 < 4 ? none : height});
  }
  return positions;
}

TEST(CoordinateHole, EndsOfPipesAndTanksAreForm) {
  for (const bool is_used : {false, true}) {
    for (const bool is_alternating : {false, true}) {
      for (const int facets : {12, 24, 500}) {
        for (const std::vector<double>& heights : std::vector<std::vector<double>>{{0, 60},
                                                                                   {0, -1000},
                                                                                   {0, -1001},
                                                                                   {0, 10'000},
                                                                                   {0, -100'000},
                                                                                   {0, -1e6},
                                                                                   {0, 0.1, 0.2, 60},
                                                                                   {-1000, 0, 1, 2, 3, 4, 5, 6, 7}}) {
          const CoordinateHoles holes = holes_of(rings(0.1, heights, facets, is_alternating), is_used);
          EXPECT_FALSE(holes.certain) << heights.back() << ' ' << facets;
          EXPECT_TRUE(holes.possible.empty()) << heights.back() << ' ' << facets;
        }
      }
    }
  }
  EXPECT_FALSE(holes_of(rings(0, {0, 1000}, 24, true), false).certain) << "two places";
  // A length of nines and an end of 16 bits need as much where triangles use them.
  for (const double end : {-999.0, 9999.0, -32'768.0}) {
    EXPECT_FALSE(holes_of(rings(300, {0, end}, 24, true), true).certain) << end;
  }
}

/// A base of very many vertices at one height and a head on a pole of which nothing is between.
std::vector<base::Vec3d> lamp(double base_width, double base_height, bool is_shuffled) {
  std::vector<base::Vec3d> positions;
  for (int i = 0; i < 800; ++i) {
    const bool is_base = is_shuffled ? i % 2 == 0 : i < 400;
    const int own = is_shuffled ? i / 2 : i % 400;
    const double width = is_base ? base_width : 100;
    const int row = own / 20;
    positions.push_back({own % 20 * width / 19, row * width / 19, is_base ? base_height : 5 * std::sin(1.7 * i)});
  }
  return positions;
}

TEST(CoordinateHole, ABaseFarBelowIsForm) {
  for (const bool is_shuffled : {false, true}) {
    for (const double base_width : {60.0, 300.0}) {
      for (const double height : {-1000.0, -1234.5}) {
        const CoordinateHoles holes = holes_of(lamp(base_width, height, is_shuffled), true);
        EXPECT_FALSE(holes.certain) << is_shuffled << ' ' << base_width << ' ' << height;
        EXPECT_FALSE(holes.possible.empty()) << is_shuffled << ' ' << base_width << ' ' << height;
      }
    }
  }
  // Also of points alone, where the base comes first in the file or is wider than the rest.
  for (const double height : {-1000.0, -1234.5}) {
    EXPECT_FALSE(holes_of(lamp(60, height, false), false).certain) << height;
    EXPECT_FALSE(holes_of(lamp(300, height, true), false).certain) << height;
    EXPECT_FALSE(holes_of(lamp(300, height, true), false).possible.empty()) << height;
  }
}

/// One cell in eight of a terrain each.
std::vector<base::Vec3d> terrain_of_two(double none, double other) {
  std::vector<base::Vec3d> positions = terrain(none);
  bool is_other = false;
  for (base::Vec3d& p : positions) {
    if (p.z == none && (is_other = !is_other)) p.z = other;
  }
  return positions;
}

TEST(CoordinateHole, TwoNumbersForNoneAreFoundOneAfterTheOther) {
  for (const auto& [none, other] :
       {std::pair(-9999.0, 9999.0), {-32'768.0, 32'767.0}, {-9999.0, -999.0}, {-1e5, 1e5}, {-9999.0, 1e20}}) {
    for (const bool is_used : {false, true}) {
      std::vector<base::Vec3d> positions = terrain_of_two(none, other);
      std::vector<double> found;
      for (int i = 0; i < 2; ++i) {
        const CoordinateHoles holes = holes_of(positions, is_used);
        ASSERT_TRUE(holes.certain) << none << ' ' << other << ' ' << i;
        found.push_back(holes.certain->place.z);
        std::erase_if(positions, [&](const base::Vec3d& p) { return holes.certain->has(p); });
      }
      std::sort(found.begin(), found.end());
      EXPECT_EQ(found, (std::vector<double>{std::min(none, other), std::max(none, other)}));
      EXPECT_EQ(positions.size(), 3600U);
    }
  }
  // As certain as each alone.
  const CoordinateHoles holes = holes_of(terrain_of_two(-12'345.5, 12'345.5), true);
  EXPECT_FALSE(holes.certain);
  EXPECT_EQ(holes.possible.size(), 2U);
}

TEST(CoordinateHole, HeightsThatNobodyMeasuredAreHolesAlsoWhereTrianglesUseThem) {
  for (const double none : {-9999.0, -10'000.0, 10'000.0, -999'999.0, -2'147'483'648.0, 1e20, -1e10, -32'767.5 - 0.5}) {
    for (const bool is_used : {false, true}) {
      const CoordinateHoles holes = holes_of(terrain(none), is_used);
      ASSERT_TRUE(holes.certain) << none << ' ' << is_used;
      EXPECT_EQ(holes.certain->place.z, none);
      EXPECT_EQ(holes.certain->axes, (std::array{false, false, true}));
      EXPECT_TRUE(holes.possible.empty());
    }
  }
  // Any other number is certain only where no triangle uses it, or where no form is.
  EXPECT_TRUE(holes_of(terrain(-12'345.5), false).certain);
  EXPECT_FALSE(holes_of(terrain(-12'345.5), true).certain);
  EXPECT_FALSE(holes_of(terrain(-12'345.5), true).possible.empty());
  EXPECT_TRUE(holes_of(terrain(-3.4e25), true).certain);
  EXPECT_FALSE(holes_of(terrain(0), false).possible.empty());
}

TEST(CoordinateHole, HeightsThatAreMeasuredMayBeEqual) {
  // A sea, which has half of the cells, and whole metres.
  for (const bool is_sea : {false, true}) {
    for (const double none : {-10'000.0, -12'345.5, 1e20}) {
      std::vector<base::Vec3d> positions = terrain(none);
      for (std::size_t i = 0; i < positions.size(); ++i) {
        double& z = positions[i].z;
        if (z != none) z = is_sea ? (i % 2 == 0 ? 0 : z - 238) : std::round(20 * z);
      }
      EXPECT_TRUE(holes_of(positions, false).certain) << none << ' ' << is_sea;
    }
  }
}

TEST(CoordinateHole, WhatNoFormReachesIsAHoleHoweverFewHeightsThereAre) {
  std::vector<base::Vec3d> grid;
  grid.reserve(400);
  for (int i = 0; i < 400; ++i) {
    const int row = i / 20;
    grid.push_back({i % 20 * 1.0, row * 1.0, i % 20 < 3 ? -1e20 : i % 4 * 0.2});
  }
  EXPECT_TRUE(holes_of(grid, true).certain);
  for (base::Vec3d& p : grid) p.z = std::max(p.z, -1e7);
  EXPECT_FALSE(holes_of(grid, true).certain);
}

TEST(CoordinateHole, TheEndOf16BitsInMillimetresIsAHole) {
  // A depth camera 2 m before a wall of 4 m.
  for (const double none : {65.535, static_cast<double>(65.535F), 32.767}) {
    std::vector<base::Vec3d> wall = terrain(none);
    for (base::Vec3d& p : wall) p = {p.x / 75, p.y / 75, p.z == none ? none : p.z / 125};
    EXPECT_TRUE(holes_of(wall, true).certain) << none;
    for (base::Vec3d& p : wall) p.z = p.z == none ? 61.125 : p.z;
    EXPECT_FALSE(holes_of(wall, true).certain);
    EXPECT_FALSE(holes_of(wall, true).possible.empty());
  }
}

TEST(CoordinateHole, EveryAxisAndBothEndsAreLookedAt) {
  for (const double none : {-9999.0, 99'999.0}) {
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<base::Vec3d> positions = terrain(none);
      for (base::Vec3d& p : positions) {
        if (axis == 0) p = {p.z, p.x, p.y};
        if (axis == 1) p = {p.y, p.z, p.x};
      }
      const CoordinateHoles holes = holes_of(positions, false);
      ASSERT_TRUE(holes.certain) << axis;
      EXPECT_TRUE(holes.certain->axes[static_cast<std::size_t>(axis)]);
      EXPECT_TRUE(holes.certain->has(positions[0]));
    }
  }
  EXPECT_FALSE(find_coordinate_holes({}, 1, [](std::uint64_t) { return false; }).certain);
}

/// Two rings of 24 vertices, which take turns in the file.
std::string tank(const std::string& end) {
  std::string vertices;
  std::string faces;
  for (int i = 0; i < 48; ++i) {
    const int facet = i / 2;
    const double angle = facet * 2 * std::numbers::pi / 24;
    vertices += std::to_string(std::cos(angle)) + ' ' + std::to_string(std::sin(angle)) + ' ';
    vertices += (i % 2 == 0 ? "0" : end) + " 20\n";
    faces += "3 " + std::to_string(i) + ' ' + std::to_string((i + 1) % 48) + ' ' + std::to_string((i + 2) % 48) + '\n';
  }
  return "ply\nformat ascii 1.0\nelement vertex 48\n" + std::string(test::kXyz) +
         "property float temperature\nelement face 48\n" + std::string(test::kFaces) + "end_header\n" + vertices +
         faces;
}

TEST(CoordinateHole, ATankKeepsBothEndsAndAllFaces) {
  for (const std::string end : {"-1000", "-1001", "10000", "60"}) {
    const LoadedScene scene = test::loaded(tank(end));
    EXPECT_EQ(scene.mesh.vertex_count(), 48U) << end;
    EXPECT_EQ(scene.mesh.triangle_count(), 48U) << end;
    EXPECT_EQ(test::note_text(scene, "hole_vertices"), "") << end;
    EXPECT_EQ(test::note_text(scene, "shared_coordinate"), "") << end;
  }
}

}  // namespace
}  // namespace spectra::files
