#include "server/stream/view_selection.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "fake_scene.hpp"

namespace spectra::stream {
namespace {

using protocol::TileId;
using testing::quadtree_tiles;
using testing::scene_of;

/// Above the middle of the square (0,0)-(4,4), looking down at a place.
Camera camera_over(float x, float y, float height) {
  return {.eye = {x, y, height}, .target = {x, y, 0}, .up = {0, 1, 0}, .fov_y_deg = 50, .viewport = {800, 800}};
}

std::vector<TileId> ids(const ViewTree& tree, const std::vector<SelectedTile>& selected) {
  std::vector<TileId> result;
  for (const SelectedTile& tile : selected) result.push_back(tree.nodes()[tile.node].tile->id);
  return result;
}

TEST(ViewTree, KnowsParentsAndCoversWhatIsBeneath) {
  auto tiles = quadtree_tiles(3, 4);
  const ViewTree tree(*scene_of(tiles));
  ASSERT_EQ(tree.nodes().size(), 21U);
  EXPECT_FALSE(tree.nodes()[0].parent.has_value());
  EXPECT_EQ(tree.nodes()[0].children.size(), 4U);
  EXPECT_EQ(tree.nodes()[0].bounds.max.x, 4);
  for (std::size_t i = 1; i < tree.nodes().size(); ++i) {
    const TileId id = tree.nodes()[i].tile->id;
    const TileId parent = tree.nodes()[tree.nodes()[i].parent.value()].tile->id;
    EXPECT_EQ(parent, (TileId{static_cast<std::uint8_t>(id.level - 1), id.x / 2, id.y / 2, id.z / 2}));
  }
}

TEST(ViewTree, LinksOverMissingLevels) {
  auto tiles = quadtree_tiles(3, 4);
  std::erase_if(tiles, [](const auto& tile) { return tile->id.level == 1; });
  const ViewTree tree(*scene_of(tiles));
  EXPECT_EQ(tree.nodes()[0].children.size(), 16U);
}

TEST(SelectedTiles, AreAllCoarseToFineWithoutACamera) {
  const ViewTree tree(*scene_of(quadtree_tiles(3, 4)));
  const auto selected = selected_tiles(tree, std::nullopt, 1);
  ASSERT_EQ(selected.size(), 21U);
  for (std::size_t i = 0; i < selected.size(); ++i) {
    const auto level = tree.nodes()[selected[i].node].tile->id.level;
    EXPECT_EQ(selected[i].is_target, level == 2);
    if (i > 0) {
      EXPECT_GE(level, tree.nodes()[selected[i - 1].node].tile->id.level);
    }
  }
}

TEST(SelectedTiles, FromAfarOnlyTheRootIsNeeded) {
  const ViewTree tree(*scene_of(quadtree_tiles(3, 4)));
  const auto selected = selected_tiles(tree, camera_over(2, 2, 5000), 1);
  ASSERT_EQ(selected.size(), 1U);
  EXPECT_TRUE(selected[0].is_target);
}

TEST(SelectedTiles, ATightPixelErrorAsksForMore) {
  const ViewTree tree(*scene_of(quadtree_tiles(3, 4)));
  std::size_t last = 0;
  for (const double pixel_error : {1000.0, 30.0, 5.0, 1.0}) {
    const auto count = selected_tiles(tree, camera_over(2, 2, 12), pixel_error).size();
    EXPECT_GE(count, last);
    last = count;
  }
  EXPECT_EQ(last, 21U);
}

TEST(SelectedTiles, WhatIsOutOfViewIsNotRefined) {
  const ViewTree tree(*scene_of(quadtree_tiles(3, 4)));
  const auto selected = selected_tiles(tree, camera_over(0.5F, 0.5F, 0.5F), 0.5);
  const auto found = ids(tree, selected);
  const std::set<TileId> unique(found.begin(), found.end());
  EXPECT_EQ(unique.size(), found.size());
  // The root, its children, and the children of the one quarter that is looked at.
  EXPECT_EQ(found.size(), 1U + 4 + 4);
  EXPECT_TRUE(unique.contains({2, 0, 0, 0}));
  EXPECT_FALSE(unique.contains({2, 3, 3, 0}));
  for (const SelectedTile& tile : selected) {
    const auto& node = tree.nodes()[tile.node];
    if (node.tile->id.level > 0) {
      EXPECT_EQ(tile.is_in_view, node.bounds.min.x < 1 && node.bounds.min.y < 1);
    }
  }
  // Of each level those in view come first.
  EXPECT_EQ(found[1], (TileId{1, 0, 0, 0}));
  EXPECT_EQ(found[5], (TileId{2, 0, 0, 0}));
}

TEST(SelectedTiles, ReplaceableTilesHaveAllTheirChildren) {
  const ViewTree tree(*scene_of(quadtree_tiles(4, 3)));
  for (const float height : {0.2F, 1.0F, 3.0F, 20.0F}) {
    const auto selected = selected_tiles(tree, camera_over(1.3F, 2.7F, height), 2);
    std::set<std::size_t> nodes;
    for (const SelectedTile& tile : selected) nodes.insert(tile.node);
    for (const SelectedTile& tile : selected) {
      const auto& node = tree.nodes()[tile.node];
      if (node.parent) {
        EXPECT_TRUE(nodes.contains(*node.parent));
      }
      for (const std::size_t child : node.children) EXPECT_EQ(nodes.contains(child), !tile.is_target);
    }
  }
}

TEST(SelectedTiles, KeepToTheBytesWhereTheErrorIsSeenMost) {
  const ViewTree tree(*scene_of(quadtree_tiles(4, 3)));
  const Camera camera = camera_over(0.5F, 0.5F, 1.5F);
  const auto all = selected_tiles(tree, camera, 0.01);
  const std::uint64_t tile_bytes = decoded_bytes(*tree.nodes()[0].tile);
  EXPECT_EQ(tile_bytes, 16U * 9 + 12 * 8);
  std::size_t last = 0;
  for (std::uint64_t most = 0; most <= all.size(); ++most) {
    const auto selected = selected_tiles(tree, camera, 0.01, most * tile_bytes);
    EXPECT_LE(selected.size(), std::max<std::uint64_t>(most, 1));
    EXPECT_GT(selected.size() + 4, std::min<std::uint64_t>(most, all.size())) << "four more would have fitted";
    EXPECT_GE(selected.size(), last);
    last = selected.size();
    // Nothing that was left coarse is seen with a larger error than what was refined.
    double least_refined = std::numeric_limits<double>::infinity();
    double most_left = 0;
    for (const SelectedTile& tile : selected) {
      const auto& node = tree.nodes()[tile.node];
      const double error = screen_error(camera, node.bounds, static_cast<double>(node.tile->geometric_error_m));
      if (!tile.is_target) {
        least_refined = std::min(least_refined, error);
      } else if (tile.is_in_view) {
        most_left = std::max(most_left, error);
      }
    }
    EXPECT_LE(most_left, least_refined);
  }
  EXPECT_EQ(last, all.size());
}

TEST(SelectedTiles, WrongColoursAreRefinedLikeWrongForm) {
  auto tiles = quadtree_tiles(2, 4);
  auto root = std::make_shared<map::Tile>(*tiles[0]);
  root->geometric_error_m = 1e-4F;
  tiles[0] = root;
  const Camera camera = camera_over(0.5F, 0.5F, 1.5F);
  EXPECT_EQ(selected_tiles(ViewTree(*scene_of(tiles)), camera, 1).size(), 1U);
  auto blurred = std::make_shared<map::Tile>(*root);
  blurred->lost_detail_m = 0.02F;
  tiles[0] = blurred;
  const ViewTree tree(*scene_of(tiles));
  EXPECT_EQ(selected_tiles(tree, camera, 1).size(), 5U);
  const double pixels = screen_error(camera, tree.nodes()[0].bounds, 0.01);
  EXPECT_EQ(selected_tiles(tree, camera, 1.01 * pixels).size(), 1U) << "a patch of two pixels is one pixel off";
  EXPECT_EQ(selected_tiles(tree, camera, 0.99 * pixels).size(), 5U);
}

TEST(SelectedTiles, HotOnesComeFirstAmongEquals) {
  auto tiles = quadtree_tiles(2, 4);
  auto hot = std::make_shared<map::Tile>(*tiles[3]);
  hot->highest_celsius = 90;
  auto unknown = std::make_shared<map::Tile>(*tiles[1]);
  unknown->highest_celsius = std::numeric_limits<float>::quiet_NaN();
  tiles[3] = hot;
  tiles[1] = unknown;
  const ViewTree tree(*scene_of(tiles));
  const auto found = ids(tree, selected_tiles(tree, camera_over(2, 2, 12), 1));
  ASSERT_EQ(found.size(), 5U);
  EXPECT_EQ(found[1], hot->id);
  EXPECT_EQ(found[4], unknown->id);
}

TEST(ScreenError, IsTheProjectedSize) {
  const Camera camera = camera_over(0, 0, 10);
  const base::Bounds floor{{-1, -1, 0}, {1, 1, 0}};
  // 800 pixels show 2 * 10 * tan(25 deg) metres at ten metres.
  EXPECT_NEAR(screen_error(camera, floor, 0.1), 0.1 * 800 / (20 * std::tan(25 * 3.14159265358979 / 180)), 1e-9);
  EXPECT_EQ(screen_error(camera, floor, 0), 0);
  EXPECT_EQ(screen_error(camera, {{-1, -1, 0}, {1, 1, 20}}, 0.1), std::numeric_limits<double>::infinity());
}

TEST(MayBeInView, KeepsWhatIsSeenAndDropsWhatIsBehindOrBeside) {
  const Camera camera{.eye = {0, 0, 0}, .target = {1, 0, 0}, .up = {0, 0, 1}, .fov_y_deg = 60, .viewport = {1600, 800}};
  const auto box = [](float x, float y, float z) {
    return base::Bounds{{x - 0.1F, y - 0.1F, z - 0.1F}, {x + 0.1F, y + 0.1F, z + 0.1F}};
  };
  EXPECT_TRUE(may_be_in_view(camera, box(5, 0, 0)));
  EXPECT_FALSE(may_be_in_view(camera, box(-5, 0, 0)));
  EXPECT_TRUE(may_be_in_view(camera, box(5, 5.5F, 0))) << "wide pictures show more at the sides";
  EXPECT_FALSE(may_be_in_view(camera, box(5, 8, 0)));
  EXPECT_FALSE(may_be_in_view(camera, box(5, -8, 0)));
  EXPECT_TRUE(may_be_in_view(camera, box(5, 0, 2.7F)));
  EXPECT_FALSE(may_be_in_view(camera, box(5, 0, 4)));
  EXPECT_FALSE(may_be_in_view(camera, box(5, 0, -4)));
  EXPECT_TRUE(may_be_in_view(camera, {{-100, -100, -100}, {100, 100, 100}}));
  Camera looking_along_up = camera;
  looking_along_up.up = {1, 0, 0};
  EXPECT_TRUE(may_be_in_view(looking_along_up, box(5, 0, 0)));
}

TEST(MayBeInView, ReachesATenthBeyondThePicture) {
  // Ten metres ahead the picture ends 10 m above and below the middle and 20 m beside it.
  const Camera camera{.eye = {0, 0, 0}, .target = {1, 0, 0}, .up = {0, 0, 1}, .fov_y_deg = 90, .viewport = {1600, 800}};
  for (const auto& [share, is_in_view] : {std::pair(1.05F, true), std::pair(1.15F, false)}) {
    for (const float side : {-1.0F, 1.0F}) {
      const base::Vec3f beside{10, 20 * share * side, 0}, above{10, 0, 10 * share * side};
      EXPECT_EQ(may_be_in_view(camera, {beside, beside}), is_in_view) << share * side;
      EXPECT_EQ(may_be_in_view(camera, {above, above}), is_in_view) << share * side;
    }
  }
}

TEST(CameraIsUsable, OnlyWhenItMakesSense) {
  const Camera good = camera_over(0, 0, 10);
  EXPECT_TRUE(is_usable(good));
  Camera bad = good;
  bad.target = bad.eye;
  EXPECT_FALSE(is_usable(bad));
  bad = good;
  bad.eye.x = std::numeric_limits<float>::quiet_NaN();
  EXPECT_FALSE(is_usable(bad));
  bad = good;
  bad.fov_y_deg = 180;
  EXPECT_FALSE(is_usable(bad));
  bad = good;
  bad.viewport = {0, 100};
  EXPECT_FALSE(is_usable(bad));
}

}  // namespace
}  // namespace spectra::stream
