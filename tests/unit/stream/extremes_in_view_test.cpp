#include "server/stream/extremes_in_view.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "fake_scene.hpp"

namespace spectra::stream {
namespace {

using testing::scene_of;

constexpr float kInfinite = std::numeric_limits<float>::infinity();

/// A board of `side` x `side` vertices across the line of sight along z, one metre wide, all of 20 degC.
std::shared_ptr<map::Tile> board(std::uint32_t number, float x, float y, float z, std::uint32_t side = 21) {
  auto tile = std::make_shared<map::Tile>();
  tile->id = {1, number, 0, 0};
  for (std::uint32_t row = 0; row < side; ++row) {
    for (std::uint32_t column = 0; column < side; ++column) {
      const auto share = [side](std::uint32_t i) {
        return static_cast<float>(i) / static_cast<float>(side - 1) - 0.5F;
      };
      tile->positions.push_back({x + share(column), y + share(row), z});
      tile->temperature_celsius.push_back(20);
      tile->source_vertex.push_back(number * 10'000 + row * side + column);
      const std::uint32_t corner = row * side + column;
      if (row + 1 == side || column + 1 == side) continue;
      tile->triangles.push_back({corner, corner + 1, corner + side});
      tile->triangles.push_back({corner + 1, corner + side + 1, corner + side});
    }
  }
  tile->owned_count = static_cast<std::uint32_t>(tile->positions.size());
  tile->visible.resize(tile->positions.size());
  tile->bounds = {{x - 0.5F, y - 0.5F, z}, {x + 0.5F, y + 0.5F, z}};
  return tile;
}

/// The vertex in the middle of a board.
std::size_t middle(const map::Tile& tile) {
  return tile.positions.size() / 2;
}

/// From 4 m before the origin.
Camera camera() {
  return {.eye = {0, 0, 4}, .target = {0, 0, 0}, .up = {0, 1, 0}, .fov_y_deg = 45, .viewport = {900, 600}};
}

ExtremesInView in_view(const std::vector<std::shared_ptr<map::Tile>>& tiles,
                       const PictureWindow& window = kWholePicture, const Camera& from = camera()) {
  return extremes_in_view(*scene_of({tiles.begin(), tiles.end()}), from, window);
}

TEST(ExtremesInView, AreOfWhatStandsInFront) {
  const auto wall = board(0, 0, 0, 0);
  const auto before = board(1, 0, 0, 0.026F);
  wall->temperature_celsius[middle(*wall)] = 90;
  before->temperature_celsius[3] = 41;
  before->temperature_celsius[5] = -7;
  EXPECT_FLOAT_EQ(in_view({wall}).hottest->temperature_celsius, 90);
  const auto seen = in_view({wall, before});
  EXPECT_FLOAT_EQ(seen.hottest->temperature_celsius, 41);
  EXPECT_EQ(seen.hottest->position.z, 0.026F);
  EXPECT_FLOAT_EQ(seen.coldest->temperature_celsius, -7);
  Camera behind = camera();
  behind.eye.z = -4;
  EXPECT_FLOAT_EQ(in_view({wall, before}, kWholePicture, behind).hottest->temperature_celsius, 90);
}

TEST(ExtremesInView, AreSeenOnASlopeAndAtItsEdges) {
  // Turned until it is seen at four degrees only.
  const auto slope = board(0, 0, 0, 0);
  for (auto& position : slope->positions) position = {position.x * 0.07F, position.y, position.x};
  slope->bounds = {{-0.5F, -0.5F, -0.5F}, {0.5F, 0.5F, 0.5F}};
  for (std::size_t i = 0; i < slope->positions.size(); ++i) {
    slope->temperature_celsius[i] = 90;
    EXPECT_FLOAT_EQ(in_view({slope}).hottest->temperature_celsius, 90) << i;
    slope->temperature_celsius[i] = 20;
  }
}

TEST(ExtremesInView, AreOfTheWindowAlone) {
  const auto left = board(0, -1, 0, 0);
  const auto right = board(1, 1, 0, 0);
  left->temperature_celsius[middle(*left)] = 60;
  right->temperature_celsius[middle(*right)] = 50;
  EXPECT_FLOAT_EQ(in_view({left, right}).hottest->temperature_celsius, 60);
  EXPECT_FLOAT_EQ(in_view({left, right}, {0.5, 0, 1, 1}).hottest->temperature_celsius, 50);
  EXPECT_FALSE(in_view({left, right}, {0, 0, 1, 0.2}).hottest.has_value());
  EXPECT_FALSE(in_view({board(0, 0, 0, 9)}).hottest.has_value()) << "behind the eye";
}

TEST(ExtremesInView, AreHiddenByASurfaceThatReachesBehindTheEye) {
  const auto wall = board(0, 0, 0.1F, 0);
  wall->temperature_celsius[middle(*wall)] = 90;
  // From behind the eye to beyond the wall, and between the eye and the middle of it.
  auto ceiling = std::make_shared<map::Tile>();
  ceiling->id = {1, 1, 0, 0};
  ceiling->positions = {{-9, 0.05F, 20}, {9, 0.05F, 20}, {9, 0.05F, -20}, {-9, 0.05F, -20}};
  ceiling->temperature_celsius = {15, 15, 15, 15};
  ceiling->source_vertex = {10'000, 10'001, 10'002, 10'003};
  ceiling->visible.resize(4);
  ceiling->triangles = {{0, 1, 2}, {0, 2, 3}};
  ceiling->owned_count = 4;
  ceiling->bounds = {{-9, 0.05F, -20}, {9, 0.05F, 20}};
  EXPECT_FLOAT_EQ(in_view({wall}).hottest->temperature_celsius, 90);
  EXPECT_FLOAT_EQ(in_view({wall, ceiling}).hottest->temperature_celsius, 20);
}

TEST(ExtremesInView, TellReadingsBeyondTheSensorApart) {
  const auto wall = board(0, 0, 0, 0);
  wall->temperature_celsius[7] = kInfinite;
  wall->temperature_celsius[8] = -kInfinite;
  wall->temperature_celsius[9] = std::numeric_limits<float>::quiet_NaN();
  const auto seen = in_view({wall});
  EXPECT_FLOAT_EQ(seen.hottest->temperature_celsius, 20);
  EXPECT_EQ(seen.hottest->position.x, wall->positions[0].x) << "of several the first of the input";
  EXPECT_EQ(seen.over_range->position.x, wall->positions[7].x);
  EXPECT_EQ(seen.under_range->position.x, wall->positions[8].x);
  for (float& celsius : wall->temperature_celsius) celsius = std::numeric_limits<float>::quiet_NaN();
  EXPECT_FALSE(in_view({wall}).hottest.has_value());
}

TEST(ExtremesInView, LeaveOutVerticesOfNoTriangle) {
  const auto wall = board(0, 0, 0, 0);
  wall->positions.push_back({0, 0, 1});
  wall->temperature_celsius.push_back(99);
  wall->source_vertex.push_back(9'999);
  EXPECT_FLOAT_EQ(in_view({wall}).hottest->temperature_celsius, 20);
}

TEST(ExtremesInView, NeedACameraThatCanSee) {
  Camera blind = camera();
  blind.target = blind.eye;
  EXPECT_FALSE(in_view({board(0, 0, 0, 0)}, kWholePicture, blind).hottest.has_value());
}

}  // namespace
}  // namespace spectra::stream
