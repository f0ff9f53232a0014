#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "fusion/mesh/nearest_vertex.hpp"
#include "fusion/mesh/ply_reader.hpp"
#include "loaded.hpp"

namespace spectra::fusion {
namespace {

using test::note_count;

std::string visible_file(const std::string& positions, int count) {
  return "ply\nformat ascii 1.0\nelement vertex " + std::to_string(count) + "\n" + std::string(test::kXyz) +
         "end_header\n" + positions;
}

std::string thermal_file(const std::string& lines, int count) {
  return "ply\nformat ascii 1.0\nelement vertex " + std::to_string(count) + "\n" + std::string(test::kXyz) +
         "property float temperature\nend_header\n" + lines;
}

Result<LoadedScene> joined(const std::string& visible, const std::string& thermal, double distance = 0) {
  const test::TemporaryFolder folder;
  return read_ply_with_thermal(folder.write("v.ply", visible), folder.write("t.ply", thermal), {}, distance);
}

TEST(ThermalJoin, TakesTheSameNumberInOrder) {
  const auto scene =
      joined(visible_file("0 0 0\n1 0 0\n2 0 0\n", 3), thermal_file("0 0 0 20\n1 0 0 nan\n2 0 0 22\n", 3));
  ASSERT_TRUE(scene);
  EXPECT_TRUE(scene.value().mesh.has_temperature);
  EXPECT_EQ(scene.value().mesh.temperature_celsius()[0], 20);
  EXPECT_TRUE(std::isnan(scene.value().mesh.temperature_celsius()[1]));
  EXPECT_EQ(scene.value().mesh.temperature_celsius()[2], 22);
  EXPECT_EQ(note_count(scene.value(), "thermal_joined_in_order"), 3U);
  EXPECT_EQ(note_count(scene.value(), "missing_temperatures"), 1U);
  EXPECT_EQ(note_count(scene.value(), "thermal_positions_differ"), 0U);
}

TEST(ThermalJoin, SaysWhenTheSameNumberIsElsewhere) {
  const auto scene = joined(visible_file("0 0 0\n1 0 0\n", 2), thermal_file("1 0 0 20\n0 0 0 21\n", 2));
  ASSERT_TRUE(scene);
  EXPECT_EQ(scene.value().mesh.temperature_celsius()[0], 20);
  EXPECT_EQ(note_count(scene.value(), "thermal_positions_differ"), 2U);
}

TEST(ThermalJoin, TakesTheNearestWithinTheDistance) {
  const std::string visible = visible_file("1000.1 0 0\n1001.2 0 0\n1009 0 0\n", 3);
  const std::string thermal = thermal_file("1000 0 0 20\n1001 0 0 21\n1002 0 0 22\n1003 0 0 nan\n", 4);
  const auto automatic = joined(visible, thermal);
  ASSERT_TRUE(automatic);
  EXPECT_EQ(automatic.value().mesh.temperature_celsius()[0], 20);
  EXPECT_EQ(automatic.value().mesh.temperature_celsius()[1], 21);
  EXPECT_TRUE(std::isnan(automatic.value().mesh.temperature_celsius()[2]));
  EXPECT_EQ(note_count(automatic.value(), "thermal_joined_nearest"), 2U);
  EXPECT_EQ(note_count(automatic.value(), "thermal_not_reached"), 1U);
  EXPECT_EQ(note_count(automatic.value(), "missing_temperatures"), 1U);

  const auto near = joined(visible, thermal, 0.15);
  ASSERT_TRUE(near);
  EXPECT_EQ(note_count(near.value(), "thermal_joined_nearest"), 1U);
  const auto far = joined(visible, thermal, 100);
  ASSERT_TRUE(far);
  EXPECT_EQ(note_count(far.value(), "thermal_joined_nearest"), 3U);
  EXPECT_TRUE(std::isnan(far.value().mesh.temperature_celsius()[2])) << "the nearest has none, which is an answer";
}

TEST(ThermalJoin, ReplacesTheTemperaturesOfTheFirstFile) {
  const auto scene = joined(thermal_file("0 0 0 5\n", 1), thermal_file("0 0 0 20\n", 1));
  ASSERT_TRUE(scene);
  EXPECT_EQ(scene.value().mesh.temperature_celsius()[0], 20);
  EXPECT_EQ(note_count(scene.value(), "replaced_temperatures"), 1U);
}

TEST(ThermalJoin, RefusesWhatCannotBeJoined) {
  const std::string good = visible_file("0 0 0\n", 1);
  const auto no_temperature = joined(good, good);
  ASSERT_FALSE(no_temperature);
  EXPECT_EQ(no_temperature.error().code, ErrorCode::Unsupported);
  EXPECT_NE(no_temperature.error().message.find("t.ply"), std::string::npos);
  for (const double distance :
       {-1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    const auto bad = joined(good, thermal_file("0 0 0 1\n", 1), distance);
    ASSERT_FALSE(bad);
    EXPECT_EQ(bad.error().code, ErrorCode::OutOfRange);
  }
  const test::TemporaryFolder folder;
  const auto missing = read_ply_with_thermal(folder.write("v.ply", good), folder.path() / "t.ply");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::FileNotFound);
}

TEST(NearestVertex, AgreesWithLookingAtAll) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> coordinate(-10, 10);
  const auto random_point = [&] { return Vec3d{coordinate(random), coordinate(random), coordinate(random)}; };
  for (const std::size_t count : {1U, 2U, 7U, 8U, 9U, 17U, 500U}) {
    std::vector<Vec3d> points(count);
    for (Vec3d& point : points) point = random_point();
    const NearestVertex nearest(points);
    for (int query = 0; query < 200; ++query) {
      const Vec3d position = random_point();
      const double limit = query % 2 == 0 ? 1e9 : 3;
      double best = std::numeric_limits<double>::infinity();
      for (const Vec3d& p : points) {
        best = std::min(best, std::hypot(p.x - position.x, p.y - position.y, p.z - position.z));
      }
      const auto hit = nearest.find(position, limit);
      ASSERT_EQ(hit.has_value(), best <= limit);
      if (hit) {
        EXPECT_NEAR(hit->distance, best, 1e-12);
      }
    }
  }
}

TEST(NearestVertex, BearsManyPointsAtOnePlace) {
  std::vector<Vec3d> points(20'000, Vec3d{1, 2, 3});
  EXPECT_EQ(NearestVertex(points).median_spacing(), 0);
  points.push_back({2, 2, 3});
  const NearestVertex nearest(points);
  EXPECT_EQ(nearest.find({1, 2, 3}, 0)->distance, 0);
  EXPECT_EQ(nearest.find({2.25, 2, 3}, 1)->index, 20'000U);
  EXPECT_FALSE(nearest.find({5, 2, 3}, 1));
}

TEST(NearestVertex, KnowsTheSpacingOfAGrid) {
  std::vector<Vec3d> points;
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 60; ++x) points.push_back({x * 0.5, y * 0.5, 0});
  }
  EXPECT_NEAR(NearestVertex(points).median_spacing(), 0.5, 1e-12);
}

}  // namespace
}  // namespace spectra::fusion
