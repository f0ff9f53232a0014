#include "server/mapping/cube_cases.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <map>
#include <set>
#include <utility>

namespace spectra::mapping {
namespace {

Eigen::Vector3d corner(int index) {
  return Eigen::Vector3d(index & 1, index >> 1 & 1, index >> 2);
}
Eigen::Vector3d middle(std::uint8_t edge) {
  const CubeEdge& e = cube_edges()[edge];
  return 0.5 * (corner(e.from) + corner(e.to));
}

/// Directed sides of triangles that no other triangle of the case has in the other direction.
std::set<std::pair<std::uint8_t, std::uint8_t>> open_sides(std::uint8_t inside) {
  std::set<std::pair<std::uint8_t, std::uint8_t>> sides;
  for (const auto& t : cube_cases()[inside]) {
    for (std::size_t i = 0; i < 3; ++i) {
      if (sides.erase({t[(i + 1) % 3], t[i]}) == 0) sides.insert({t[i], t[(i + 1) % 3]});
    }
  }
  return sides;
}

TEST(CubeCases, CutExactlyTheEdgesThatCross) {
  for (int inside = 0; inside < 256; ++inside) {
    std::set<std::uint8_t> used, crossing;
    for (const auto& t : cube_cases()[static_cast<std::uint8_t>(inside)]) used.insert(t.begin(), t.end());
    for (std::uint8_t e = 0; e < 12; ++e) {
      if ((inside >> cube_edges()[e].from & 1) != (inside >> cube_edges()[e].to & 1)) crossing.insert(e);
    }
    EXPECT_EQ(used, crossing) << inside;
  }
}

TEST(CubeCases, MeetTheirNeighboursOnEveryFace) {
  // The open sides in the face x = 1 of a cube are those in the face x = 0 of any cube beside it, the other way round; so for y and z.
  for (int axis = 0; axis < 3; ++axis) {
    std::map<int, std::set<std::pair<std::uint8_t, std::uint8_t>>> by_face;
    const auto lies = [axis](std::uint8_t edge, double where) { return middle(edge)[axis] == where; };
    const auto moved = [axis](std::uint8_t edge) {
      const Eigen::Vector3d wanted = middle(edge) - Eigen::Vector3d::Unit(axis);
      for (std::uint8_t e = 0; e < 12; ++e) {
        if (middle(e) == wanted) return e;
      }
      return std::uint8_t{99};
    };
    for (int inside = 0; inside < 256; ++inside) {
      int face = 0;  // the four corners, as bits of the corner at 0
      std::set<std::pair<std::uint8_t, std::uint8_t>> sides;
      for (int c = 0; c < 8; ++c) {
        if ((c >> axis & 1) != 0 && (inside >> c & 1) != 0) face |= 1 << (c & ~(1 << axis));
      }
      for (const auto& [a, b] : open_sides(static_cast<std::uint8_t>(inside))) {
        if (lies(a, 1) && lies(b, 1)) sides.insert({moved(b), moved(a)});
      }
      const auto [known, is_new] = by_face.emplace(face, sides);
      EXPECT_EQ(known->second, sides) << axis << " " << inside;
    }
    for (int inside = 0; inside < 256; ++inside) {
      int face = 0;
      std::set<std::pair<std::uint8_t, std::uint8_t>> sides;
      for (int c = 0; c < 8; ++c) {
        if ((c >> axis & 1) == 0 && (inside >> c & 1) != 0) face |= 1 << c;
      }
      for (const auto& [a, b] : open_sides(static_cast<std::uint8_t>(inside))) {
        if (lies(a, 0) && lies(b, 0)) sides.insert({a, b});
      }
      EXPECT_EQ(by_face[face], sides) << axis << " " << inside;
    }
  }
}

TEST(CubeCases, LookOutwards) {
  for (int c = 0; c < 8; ++c) {
    const auto& triangles = cube_cases()[static_cast<std::uint8_t>(1 << c)];
    ASSERT_EQ(triangles.size(), 1U);
    const Eigen::Vector3d a = middle(triangles[0][0]), b = middle(triangles[0][1]), d = middle(triangles[0][2]);
    EXPECT_GT((b - a).cross(d - a).dot((a + b + d) / 3 - corner(c)), 0) << c;
  }
}

}  // namespace
}  // namespace spectra::mapping
