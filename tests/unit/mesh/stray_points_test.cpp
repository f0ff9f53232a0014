#include "fusion/mesh/stray_points.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "fusion/files/scene_survey.hpp"
#include "tests/unit/files/loaded.hpp"

namespace spectra::mesh {
namespace {

struct Shape {
  std::vector<base::Vec3f> positions;
  std::vector<base::Triangle> triangles;

  /// A bumpy square of `side` x `side` vertices.
  void add_patch(base::Vec3f corner, float size_m, unsigned side, bool has_triangles = true) {
    const auto first = static_cast<std::uint32_t>(positions.size());
    const float step = size_m / static_cast<float>(side - 1);
    for (unsigned y = 0; y < side; ++y) {
      for (unsigned x = 0; x < side; ++x) {
        const float height = 0.06F * size_m * std::sin(static_cast<float>(x) * 0.7F) * std::cos(static_cast<float>(y));
        positions.push_back(
            {corner.x + static_cast<float>(x) * step, corner.y + static_cast<float>(y) * step, corner.z + height});
      }
    }
    for (unsigned y = 0; has_triangles && y + 1 < side; ++y) {
      for (unsigned x = 0; x + 1 < side; ++x) {
        const std::uint32_t a = first + y * side + x;
        triangles.push_back({a, a + 1, a + side});
        triangles.push_back({a + 1, a + side + 1, a + side});
      }
    }
  }

  /// A box of eight vertices and twelve triangles.
  void add_box(base::Vec3f low, base::Vec3f high) {
    const auto first = static_cast<std::uint32_t>(positions.size());
    for (unsigned i = 0; i < 8; ++i) {
      positions.push_back(
          {(i & 1) != 0 ? high.x : low.x, (i & 2) != 0 ? high.y : low.y, (i & 4) != 0 ? high.z : low.z});
    }
    for (const auto& [a, b, c, d] :
         {std::array{0U, 1U, 3U, 2U}, std::array{4U, 6U, 7U, 5U}, std::array{0U, 4U, 5U, 1U},
          std::array{2U, 3U, 7U, 6U}, std::array{0U, 2U, 6U, 4U}, std::array{1U, 5U, 7U, 3U}}) {
      triangles.push_back({first + a, first + b, first + c});
      triangles.push_back({first + a, first + c, first + d});
    }
  }

  StrayPoints strays() const { return stray_points(positions, triangles); }
};

Shape square(bool has_triangles = true) {
  Shape shape;
  shape.add_patch({0, 0, 0}, 3, 12, has_triangles);
  return shape;
}

void expect_core_of_square(const Shape& shape, std::uint64_t stray_count, const char* what) {
  const StrayPoints strays = shape.strays();
  EXPECT_EQ(strays.count, stray_count) << what;
  EXPECT_EQ(strays.core.min.x, 0) << what;
  EXPECT_EQ(strays.core.max.x, 3) << what;
  EXPECT_EQ(strays.core.max.y, 3) << what;
  EXPECT_LT(strays.core.max.z, 0.3F) << what;
}

/// As many as make a part elsewhere, but it has no size.
TEST(StrayPoints, AreAllThatIsInOnePlace) {
  for (const float spread : {0.0F, 0.01F}) {
    Shape shape;
    shape.add_patch({0, 0, 0}, 3, 100, true);
    for (int i = 0; i < 55; ++i) shape.positions.push_back({-9999, -9999 + spread * static_cast<float>(i), -9999});
    EXPECT_EQ(shape.strays().count, spread == 0 ? 55U : 0U);
  }
}

TEST(StrayPoints, AreFoundWhereverTheyAre) {
  for (const bool has_triangles : {true, false}) {
    Shape shape = square(has_triangles);
    expect_core_of_square(shape, 0, "none");
    shape.positions.push_back({31000, -25000, 900});
    expect_core_of_square(shape, 1, "one");
    EXPECT_NEAR(shape.strays().farthest_m, std::hypot(30997.0, 25000.0, 899.8), 1);
    shape.positions.push_back({-8, 1, 0});
    shape.positions.push_back({1, 1, 1e6F});
    shape.positions.push_back({2, -500, 0});
    shape.positions.push_back({3e37F, 3e37F, -3e37F});
    expect_core_of_square(shape, 5, "in several directions, at every distance");
    shape.positions.insert(shape.positions.end(), 5, base::Vec3f{1, 60, 1});
    expect_core_of_square(shape, 10, "several in one place");
  }
}

TEST(StrayPoints, MayBeTinyPiecesOfSurface) {
  Shape shape = square();
  shape.add_patch({40, 0, 0}, 0.1F, 3);
  expect_core_of_square(shape, 9, "a patch");
  const auto first = static_cast<std::uint32_t>(shape.positions.size());
  for (const base::Vec3f corner : {base::Vec3f{0, 900, 0}, base::Vec3f{0.3F, 900, 0}, base::Vec3f{0, 900.2F, 0}}) {
    shape.positions.push_back(corner);
  }
  shape.triangles.push_back({first, first + 1, first + 2});
  expect_core_of_square(shape, 12, "a triangle");
}

TEST(StrayPoints, MayHangOnTheSceneByTheirTriangles) {
  Shape shape = square();
  shape.positions[40] = {-2000, 100, 5e5F};
  expect_core_of_square(shape, 1, "a vertex of six triangles");
}

TEST(StrayPoints, AreNotWhatIsOnlyAwayFromTheMiddle) {
  Shape shape = square(false);
  for (const base::Vec3f near : {base::Vec3f{5, 1, 0}, base::Vec3f{1, -3, 1}, base::Vec3f{1, 1, 4}})
    shape.positions.push_back(near);
  EXPECT_EQ(shape.strays().count, 0U);
}

TEST(StrayPoints, AreNotASecondPartOfTheScene) {
  Shape far_patch = square();
  far_patch.add_patch({5000, 0, 0}, 3, 12);
  EXPECT_EQ(far_patch.strays().count, 0U);
  EXPECT_EQ(far_patch.strays().core.max.x, 5003);

  Shape small_part;
  small_part.add_patch({0, 0, 0}, 50, 300);
  small_part.add_patch({2000, 0, 0}, 8, 8);
  EXPECT_EQ(small_part.strays().count, 0U) << "64 vertices beside 90,000";

  Shape crate;
  crate.add_patch({0, 0, 0}, 10, 40);
  crate.add_box({300, 0, 0}, {304, 4, 4});
  EXPECT_EQ(crate.strays().count, 0U) << "eight vertices, but a third as large as the rest";

  // Behind a real stray the second part must not be lost either.
  far_patch.positions.push_back({0, 0, 4e6F});
  EXPECT_EQ(far_patch.strays().count, 1U);
  EXPECT_EQ(far_patch.strays().core.max.x, 5003);
}

TEST(StrayPoints, AreNotInScenesOfFewOrUnevenVertices) {
  Shape pipe;
  for (unsigned i = 0; i < 24; ++i) {
    const float angle = static_cast<float>(i / 2) * 0.5236F;
    pipe.positions.push_back({i % 2 == 0 ? 0.0F : 60.0F, 0.1F * std::cos(angle), 0.1F * std::sin(angle)});
  }
  EXPECT_EQ(pipe.strays().count, 0U) << "its two ends alone";
  for (std::uint32_t i = 0; i < 24; i += 2) {
    pipe.triangles.push_back({i, i + 1, (i + 2) % 24});
    pipe.triangles.push_back({i + 1, (i + 3) % 24, (i + 2) % 24});
  }
  EXPECT_EQ(pipe.strays().count, 0U);

  for (const unsigned map_side : {2U, 5U, 60U}) {
    Shape map;
    map.add_patch({1200, 1700, 0}, 0.05F, 40);
    map.add_patch({0, 0, 0}, 4000, map_side);
    EXPECT_EQ(map.strays().count, 0U) << "a label in a map of " << map_side << " x " << map_side;
    EXPECT_NEAR(map.strays().core.max.x, 4000, 0.01F);
  }

  Shape room;
  room.add_box({0, 0, 0}, {8, 6, 3});
  room.add_box({4, 0, 0}, {4.1F, 6, 3});
  room.add_box({1, 1, 0}, {1.3F, 1.3F, 0.3F});
  EXPECT_EQ(room.strays().count, 0U);
  Shape lit = room;
  for (const base::Vec3f corner : {base::Vec3f{2e6F, 0, 0}, {2e6F + 1, 0, 0}, {2e6F, 1, 0}})
    lit.positions.push_back(corner);
  lit.triangles.push_back({24, 25, 26});
  EXPECT_EQ(lit.strays().count, 3U) << "a triangle far away";
  EXPECT_EQ(lit.strays().core.max.x, 8);
  room.add_patch({5, 2, 0}, 1, 40);
  EXPECT_EQ(room.strays().count, 0U) << "one detailed thing in a room of few vertices";

  Shape terrain;  // ever coarser from its middle on
  for (int ring = 0; ring < 30; ++ring) {
    for (int i = 0; i < 12; ++i) {
      const double radius = 0.01 * std::pow(1.7, ring);
      terrain.positions.push_back(
          {static_cast<float>(radius * std::cos(i * 0.5236)), static_cast<float>(radius * std::sin(i * 0.5236)), 0});
    }
  }
  EXPECT_EQ(terrain.strays().count, 0U);
}

TEST(StrayPoints, AreNotTheTipsOfConesAndSpires) {
  // The tip has all triangles of it; another far point is still one.
  for (const float height : {8.0F, 40.0F}) {
    Shape cone;
    constexpr std::uint32_t kRim = 32;
    cone.positions.push_back({0, 0, height});
    for (std::uint32_t i = 0; i < kRim; ++i) {
      const float angle = 6.2831853F * static_cast<float>(i) / kRim;
      cone.positions.push_back({2 * std::cos(angle), 2 * std::sin(angle), 0});
      cone.triangles.push_back({0, 1 + i, 1 + (i + 1) % kRim});
    }
    EXPECT_EQ(cone.strays().count, 0u);
    EXPECT_EQ(cone.strays().core.max.z, height);
    cone.positions.push_back({0, 1e6F, 0});
    EXPECT_EQ(cone.strays().count, 1u);
    EXPECT_EQ(cone.strays().core.max.z, height);
  }
  Shape church;
  church.add_box({0, 0, 0}, {20, 10, 10});
  church.add_box({0, 0, 10}, {5, 10, 15});
  church.positions.push_back({2.5F, 5, 60});
  for (const auto& [a, b] : {std::array{12U, 13U}, std::array{13U, 15U}, std::array{15U, 14U}, std::array{14U, 12U}})
    church.triangles.push_back({a, b, 16});
  EXPECT_EQ(church.strays().count, 0u);
}

TEST(StrayPoints, AreNotInDegenerateScenes) {
  EXPECT_EQ(stray_points({}, {}).count, 0U);
  for (const std::size_t count : {1U, 2U, 3U, 9U, 144U}) {
    const std::vector<base::Vec3f> one_place(count, base::Vec3f{1.5F, 2.5F, 0.5F});
    const StrayPoints strays = stray_points(one_place, {});
    EXPECT_EQ(strays.count, 0U);
    EXPECT_EQ(strays.core, (base::Bounds{one_place[0], one_place[0]}));
    std::vector<base::Vec3f> line;
    for (std::size_t i = 0; i < count; ++i) line.push_back({0.01F * static_cast<float>(i), 0, 0});
    EXPECT_EQ(stray_points(line, {}).count, 0U) << count;
    line.back() = {-3e38F, 3e38F, 3e38F};
    EXPECT_EQ(stray_points(line, {}).count, count >= 10 ? 1U : 0U) << count;
  }
  const std::vector<base::Vec3f> two{{0, 0, 0}, {5e5F, 0, 0}};
  EXPECT_EQ(stray_points(two, {}).count, 0U);
}

TEST(StrayPoints, AreFewOrNone) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> coordinate(-1000, 1000);
  const auto scatter = [&](Shape& shape, int count) {
    for (int i = 0; i < count; ++i) {
      shape.positions.push_back({coordinate(random), coordinate(random), 5000 + coordinate(random)});
    }
  };
  Shape shape;
  shape.add_patch({0, 0, 0}, 3, 100);
  scatter(shape, 40);
  EXPECT_EQ(shape.strays().count, 40U);
  scatter(shape, 400);
  EXPECT_EQ(shape.strays().count, 0U) << "so many are a part of the scene";
}

TEST(SceneSurvey, TellsOfStrays) {
  const auto with_strays = [](const char* strays, int count) {
    std::string text = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(100 + count) + "\n" +
                       std::string(test::kXyz) + "end_header\n";
    for (int i = 0; i < 100; ++i) text += std::to_string(i % 10) + " " + std::to_string(i / 10) + " 0\n";
    files::LoadedScene scene = test::loaded(text + strays);
    files::survey(scene);
    return scene;
  };
  const files::LoadedScene none = with_strays("", 0);
  EXPECT_EQ(test::note_count(none, "stray_points"), 0U);
  EXPECT_EQ(none.core_bounds, (base::Bounds{{0, 0, 0}, {9, 9, 0}}));

  const files::LoadedScene one = with_strays("31000 -25000 900\n", 1);
  EXPECT_EQ(one.core_bounds->min.x - one.core_bounds->max.x, -9);
  ASSERT_EQ(test::note_count(one, "stray_points"), 1U);
  EXPECT_EQ(one.notes.back().message,
            "1 stray vertex lies far from everything else, up to 39.8 km away: it stays in the scene, and views are "
            "fitted to the rest");
  const files::LoadedScene two = with_strays("0 0 400\n0 0 -50\n", 2);
  EXPECT_EQ(two.notes.back().message,
            "2 stray vertices lie far from everything else, up to 400 m away: they stay in the scene, and views are "
            "fitted to the rest");
}

}  // namespace
}  // namespace spectra::mesh
