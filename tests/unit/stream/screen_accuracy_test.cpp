#include "server/stream/screen_accuracy.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>

#include "fake_scene.hpp"

namespace spectra::stream {
namespace {

/// Twenty-one tiles with errors of 0.4, 0.2 and 0 m; the root is node 0, its first child node 1.
class ScreenAccuracyTest : public ::testing::Test {
 protected:
  ScreenAccuracy of(const std::vector<int>& colour_bits, const std::optional<Camera>& camera = std::nullopt) const {
    return screen_accuracy(tree_, held(colour_bits), camera);
  }
  static std::vector<HeldQuality> held(const std::vector<int>& colour_bits) {
    std::vector<HeldQuality> result;
    for (const int bits : colour_bits) result.push_back({bits, kStep});
    return result;
  }
  std::vector<int> none() const { return std::vector<int>(tree_.nodes().size()); }

  static constexpr float kStep = 0.001953125F;
  static inline const double kRoundingMm = 1e3 * static_cast<double>(kStep) / 2 * std::sqrt(3.0);
  const ViewTree tree_{*testing::scene_of(testing::quadtree_tiles(3, 6))};
};

TEST_F(ScreenAccuracyTest, IsThatOfTheCoarsestTileThatIsDrawn) {
  auto colour_bits = none();
  EXPECT_EQ(of(colour_bits).position_mm, 0) << "nothing can be drawn";
  colour_bits[0] = 8;
  EXPECT_NEAR(of(colour_bits).position_mm, 400 + kRoundingMm, 1e-4);
  const auto& quarters = tree_.nodes()[0].children;
  for (const std::size_t quarter : quarters) colour_bits[quarter] = 8;
  EXPECT_NEAR(of(colour_bits).position_mm, 200 + kRoundingMm, 1e-4);
  colour_bits[quarters.back()] = 0;
  EXPECT_NEAR(of(colour_bits).position_mm, 400 + kRoundingMm, 1e-4) << "one child is missing";
  for (const std::size_t leaf : tree_.nodes()[quarters.back()].children) colour_bits[leaf] = 8;
  EXPECT_NEAR(of(colour_bits).position_mm, 200 + kRoundingMm, 1e-4) << "its own children stand in for it";
}

TEST_F(ScreenAccuracyTest, ColoursAreThoseOfWhatIsDrawn) {
  auto colour_bits = none();
  EXPECT_EQ(of(colour_bits).colour_bits, 8);
  colour_bits[0] = 6;
  EXPECT_EQ(of(colour_bits).colour_bits, 6);
  for (const std::size_t quarter : tree_.nodes()[0].children) colour_bits[quarter] = 8;
  EXPECT_EQ(of(colour_bits).colour_bits, 8) << "the root is not drawn any more";
}

TEST_F(ScreenAccuracyTest, CountsColourAndTemperatureOfCoarseTiles) {
  std::vector<std::shared_ptr<const map::Tile>> tiles = testing::quadtree_tiles(2, 6);
  auto root = std::make_shared<map::Tile>(*tiles[0]);
  root->colour_error_levels = 9;
  root->temperature_error_celsius = 0.5F;
  tiles[0] = root;
  for (std::size_t i = 1; i < tiles.size(); ++i) {
    auto leaf = std::make_shared<map::Tile>(*tiles[i]);
    leaf->temperature_error_celsius = i == 1 ? 0 : std::numeric_limits<float>::quiet_NaN();
    tiles[i] = leaf;
  }
  const ViewTree tree(*testing::scene_of(tiles));
  std::vector<int> colour_bits(tree.nodes().size());
  const auto accuracy = [&] { return screen_accuracy(tree, held(colour_bits), std::nullopt); };
  EXPECT_FALSE(accuracy().temperature_celsius);
  colour_bits[0] = 8;
  EXPECT_EQ(accuracy().colour_error_levels, 9);
  EXPECT_EQ(accuracy().temperature_celsius, 0.5);
  colour_bits.assign(tree.nodes().size(), 8);
  EXPECT_EQ(accuracy().colour_error_levels, 0);
  EXPECT_EQ(accuracy().temperature_celsius, 0);
}

TEST_F(ScreenAccuracyTest, CountsWhatIsInView) {
  auto colour_bits = none();
  colour_bits[0] = 8;
  for (const std::size_t quarter : tree_.nodes()[0].children) colour_bits[quarter] = 8;
  for (const std::size_t leaf : tree_.nodes()[tree_.nodes()[0].children[0]].children) colour_bits[leaf] = 8;
  const base::Bounds& fine = tree_.nodes()[tree_.nodes()[0].children[0]].bounds;
  const base::Vec3f eye{(fine.min.x + fine.max.x) / 2, (fine.min.y + fine.max.y) / 2, fine.max.z + 0.3F};
  const Camera close{.eye = eye, .target = {eye.x, eye.y, 0}, .up = {0, 1, 0}, .fov_y_deg = 50, .viewport = {800, 800}};
  EXPECT_NEAR(of(colour_bits, close).position_mm, kRoundingMm, 1e-4);
  EXPECT_EQ(of(colour_bits, close).pixel_error, 0);
  Camera far = close;
  far.eye.z = 40;
  EXPECT_NEAR(of(colour_bits, far).position_mm, 200 + kRoundingMm, 1e-4);
  EXPECT_GT(of(colour_bits, far).pixel_error, 1);
}

}  // namespace
}  // namespace spectra::stream
