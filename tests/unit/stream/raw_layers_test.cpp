#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "fusion/temperature_codes.hpp"
#include "server/stream/frame_cache_state.hpp"
#include "stream_with_viewers.hpp"

namespace spectra::stream {
namespace {

using protocol::FrameKind;
using testing::HeldTile;
using testing::patch_tile;
using testing::plan_with_alpha;
using testing::quadtree_tiles;
using testing::scene_of;
using testing::TestViewer;
using testing::tiles_of_tree;
using testing::wait_until_idle;

constexpr Subscription kEverything{.temperature = true, .visible = true};
constexpr Subscription kRawAlone{.fused = false, .temperature = true, .visible = true};

class RawLayers : public testing::StreamWithViewers {
 protected:
  std::vector<base::Rgb8> fused_by_viewer(const HeldTile& held, const fusion::FusionPlan& plan) {
    const fusion::TemperatureCodes codes{held.temperature.table.scale, held.temperature.table.offset};
    std::vector<float> celsius(held.temperature.codes.size());
    codes.decode(held.temperature.codes, celsius);
    std::vector<base::Rgb8> visible;
    for (const auto& [r, g, b] : held.visible) visible.push_back({r, g, b});
    std::vector<base::Rgb8> fused(celsius.size());
    plan.fuse(celsius, visible, fused);
    return fused;
  }

  /// Every tile with raw layers, fused by the viewer, is within the step of what the server fuses.
  void expect_same_picture(const TestViewer& viewer, double alpha, int most_levels) {
    const auto plan = plan_with_alpha(*scene_, alpha);
    for (const auto& [id, held] : viewer.tiles) {
      ASSERT_EQ(held.temperature.codes.size(), held.colours.size());
      ASSERT_EQ(held.visible.size(), held.colours.size());
      const auto fused = fused_by_viewer(held, plan);
      for (std::size_t i = 0; i < fused.size(); ++i) {
        const auto& colour = held.colours[i];
        ASSERT_NEAR(int{fused[i].r}, int{colour[0]}, most_levels);
        ASSERT_NEAR(int{fused[i].g}, int{colour[1]}, most_levels);
        ASSERT_NEAR(int{fused[i].b}, int{colour[2]}, most_levels);
      }
    }
  }
};

TEST_F(RawLayers, FollowTheFusedPictureOfEveryTile) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe(kEverything);
  show(viewer, 0.3);
  viewer.complete();
  settle(viewer);
  EXPECT_EQ(viewer.count(FrameKind::Temperature), scene_->tiles().size());
  EXPECT_EQ(viewer.count(FrameKind::Visible), scene_->tiles().size());
  EXPECT_EQ(viewer.count(FrameKind::Geometry), scene_->tiles().size());
  const auto first_raw = std::find_if(viewer.frames.begin(), viewer.frames.end(),
                                      [](const auto& frame) { return frame.kind == FrameKind::Temperature; });
  EXPECT_EQ(first_raw - viewer.frames.begin(), static_cast<std::ptrdiff_t>(2 * scene_->tiles().size()))
      << "raw layers wait for the picture";
  expect_same_picture(viewer, 0.3, 1);
}

TEST_F(RawLayers, AreThoseOfTheTile) {
  auto tile = patch_tile({0, 0, 0, 0}, 20, 0, 30);
  tile->temperature_celsius[3] = std::numeric_limits<float>::quiet_NaN();
  tile->temperature_celsius[4] = std::numeric_limits<float>::infinity();
  tile->temperature_celsius[5] = -std::numeric_limits<float>::infinity();
  scene_ = scene_of({tile});
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({.temperature = true, .visible = true, .temperature_step_celsius = 0.5});
  show(viewer, 0.3);
  settle(viewer);
  const HeldTile& held = viewer.tiles.at(tile->id);
  EXPECT_FLOAT_EQ(held.temperature.table.scale, 0.5F);
  std::multiset<std::uint16_t> codes(held.temperature.codes.begin(), held.temperature.codes.end());
  EXPECT_EQ(codes.count(fusion::TemperatureCodes::kMissing), 1U);
  EXPECT_EQ(codes.count(fusion::TemperatureCodes::kOverRange), 1U);
  EXPECT_EQ(codes.count(fusion::TemperatureCodes::kUnderRange), 1U);
  const auto plan = [&] {
    fusion::FusionChange change;
    change.method = "visible_only";
    const auto settings = fusion::with_change(fusion::default_settings(), change).value();
    return fusion::FusionPlan::prepare(settings, scene_->temperature()).value();
  }();
  expect_tile(
      [&] {
        HeldTile shown = held;
        shown.colours = held.visible;
        return shown;
      }(),
      *tile, plan, 8);
}

TEST_F(RawLayers, TakeTheColourTransform) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.colour_transform = protocol::ColourTransform::SubtractGreen;
  viewer.stream().subscribe(
      {.colour_transform = protocol::ColourTransform::SubtractGreen, .temperature = true, .visible = true});
  show(viewer, 0.3);
  settle(viewer);
  EXPECT_EQ(viewer.count(FrameKind::VisibleSubtractGreen), scene_->tiles().size());
  expect_same_picture(viewer, 0.3, 1);
}

TEST_F(RawLayers, WithoutFusedColoursASettingSendsNothing) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe(kEverything);
  show(viewer, 0.3);
  settle(viewer);
  const std::size_t frames = viewer.frames.size();
  viewer.stream().subscribe(kRawAlone);
  for (int i = 0; i < 20; ++i) show(viewer, 0.05 * i);
  settle(viewer);
  EXPECT_EQ(viewer.frames.size(), frames);
  // And colours of the newest settings, no geometry and no raw layer again, when they are wanted again.
  viewer.stream().subscribe(kEverything);
  settle(viewer);
  EXPECT_EQ(viewer.frames.size(), frames + scene_->tiles().size());
  EXPECT_EQ(viewer.count(FrameKind::Geometry), scene_->tiles().size());
  expect_picture(viewer, *scene_, 0.95);
}

TEST_F(RawLayers, ComeWithGeometryAlone) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe(kRawAlone);
  show(viewer, 0.3);
  viewer.complete();
  EXPECT_EQ(viewer.count(FrameKind::Geometry), scene_->tiles().size());
  EXPECT_EQ(viewer.count(FrameKind::Colours), 0U);
  EXPECT_EQ(viewer.count(FrameKind::Temperature), scene_->tiles().size()) << "complete with all layers";
  EXPECT_EQ(viewer.count(FrameKind::Visible), scene_->tiles().size());
}

TEST_F(RawLayers, AreEncodedOnceForAllViewers) {
  TestViewer first(scene_, cache_, pool_);
  first.stream().subscribe(kEverything);
  show(first, 0.3);
  settle(first);
  const auto made = cache_.miss_count();
  TestViewer second(scene_, cache_, pool_);
  second.stream().subscribe(kEverything);
  show(second, 0.3);
  settle(second);
  EXPECT_EQ(cache_.miss_count(), made);
  EXPECT_EQ(second.count(FrameKind::Temperature), scene_->tiles().size());
}

TEST_F(RawLayers, OfOneStepAreNotThoseOfAnother) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe(kEverything);
  show(viewer, 0.3);
  settle(viewer);
  viewer.stream().subscribe({.temperature = true, .visible = true, .temperature_step_celsius = 0.25});
  settle(viewer);
  EXPECT_EQ(viewer.count(FrameKind::Temperature), 2 * scene_->tiles().size());
  EXPECT_EQ(viewer.count(FrameKind::Visible), scene_->tiles().size()) << "only what has changed";
  for (const auto& [id, held] : viewer.tiles) EXPECT_FLOAT_EQ(held.temperature.table.scale, 0.25F);
}

TEST_F(RawLayers, ThatWereReadyInOneStepAreNotSentInAnother) {
  scene_ = scene_of(tiles_of_tree(30, 40));
  TestViewer viewer(scene_, cache_, pool_);
  Subscription subscription{.in_flight_bytes = 40'000, .temperature = true, .visible = true};
  viewer.stream().subscribe(subscription);
  show(viewer, 0.3);
  viewer.complete();
  wait_until_idle(pool_);
  viewer.take(4);
  wait_until_idle(pool_);
  ASSERT_GT(viewer.count(FrameKind::Temperature), 0U);
  ASSERT_LT(viewer.count(FrameKind::Temperature), scene_->tiles().size());
  subscription.temperature_step_celsius = 0.25;
  viewer.stream().subscribe(subscription);
  settle(viewer);
  for (const auto& [id, held] : viewer.tiles) EXPECT_FLOAT_EQ(held.temperature.table.scale, 0.25F);
}

TEST_F(RawLayers, OfAChangedTileComeAgain) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe(kEverything);
  show(viewer, 0.3);
  settle(viewer);
  auto tiles = tiles_of_tree(6);
  std::vector<std::shared_ptr<const map::Tile>> changed(scene_->tiles().begin(), scene_->tiles().end());
  changed[3] = tiles[3];
  scene_ = scene_of(changed, 2);
  viewer.stream().set_scene(scene_);
  show(viewer, 0.3);
  settle(viewer);
  EXPECT_EQ(viewer.count(FrameKind::Temperature), scene_->tiles().size() + 1);
  EXPECT_EQ(viewer.count(FrameKind::Visible), scene_->tiles().size() + 1);
  expect_same_picture(viewer, 0.3, 1);
}

TEST_F(RawLayers, AreResumed) {
  TestViewer earlier(scene_, cache_, pool_);
  earlier.stream().subscribe(kEverything);
  show(earlier, 0.3);
  settle(earlier);
  TestViewer viewer(scene_, cache_, pool_);
  auto claims = earlier.claims();
  claims[2].has_raw_layers = false;
  EXPECT_EQ(viewer.resume(earlier, claims), scene_->tiles().size());
  viewer.stream().subscribe(kEverything);
  show(viewer, 0.3);
  settle(viewer);
  EXPECT_EQ(viewer.count(FrameKind::Geometry), 0U);
  EXPECT_EQ(viewer.count(FrameKind::Temperature), 1U);
  EXPECT_EQ(viewer.count(FrameKind::Visible), 1U);
}

TEST_F(RawLayers, GiveWayToAnAnswer) {
  scene_ = scene_of(tiles_of_tree(30, 40));
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({.in_flight_bytes = 40'000, .temperature = true, .visible = true});
  show(viewer, 0.3);
  viewer.complete();
  EXPECT_EQ(viewer.count(FrameKind::Temperature), 0U) << "complete is said first";
  wait_until_idle(pool_);
  viewer.take(4);
  EXPECT_GT(viewer.count(FrameKind::Temperature), 0U);
  EXPECT_LT(viewer.count(FrameKind::Temperature), scene_->tiles().size());
  show(viewer, 0.6);
  const std::size_t before = viewer.frames.size();
  viewer.complete();
  for (std::size_t i = before; i < viewer.frames.size(); ++i) {
    EXPECT_EQ(viewer.frames[i].kind, FrameKind::Colours) << "no raw layer before the answer is there";
  }
}

TEST_F(RawLayers, SigmaComesAfterThePictureAndIsThatOfTheTile) {
  auto tile = patch_tile({0, 0, 0, 0}, 20, 0, 30);
  tile->sigma_kelvin.assign(tile->positions.size(), 0.25F);
  for (std::size_t v = 0; v < 100; ++v) tile->sigma_kelvin[v] = 1.5F;
  tile->sigma_kelvin[100] = std::numeric_limits<float>::quiet_NaN();
  scene_ = scene_of({tile});
  EXPECT_TRUE(scene_->has_temperature_sigma());
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({.temperature_sigma = true});
  show(viewer, 0.3);
  viewer.complete();
  EXPECT_EQ(viewer.count(FrameKind::TemperatureSigma), 0U) << "complete is said first";
  settle(viewer);
  EXPECT_EQ(viewer.frames.size(), 3U) << "geometry, colours, sigma";
  const auto& [table, codes] = viewer.tiles.at(tile->id).sigma;
  std::map<int, int> hundredths;
  for (const std::uint16_t code : codes) {
    ++hundredths[code == fusion::TemperatureCodes::kMissing
                     ? -1
                     : static_cast<int>(std::lround((code * table.scale + table.offset) * 100))];
  }
  EXPECT_EQ(hundredths, (std::map<int, int>{{-1, 1}, {25, 299}, {150, 100}}));
  // Another setting, or going without it and back, does not send it again.
  show(viewer, 0.6);
  viewer.stream().subscribe({});
  viewer.stream().subscribe({.temperature_sigma = true});
  settle(viewer);
  EXPECT_EQ(viewer.count(FrameKind::TemperatureSigma), 1U);
}

TEST_F(RawLayers, SigmaIsNoPartOfWhatIsFused) {
  EXPECT_FALSE(scene_->has_temperature_sigma());
  TestViewer earlier(scene_, cache_, pool_);
  earlier.stream().subscribe({.temperature = true, .visible = true, .temperature_sigma = true});
  show(earlier, 0.3);
  settle(earlier);
  EXPECT_EQ(earlier.count(FrameKind::TemperatureSigma), scene_->tiles().size());
  TestViewer viewer(scene_, cache_, pool_);
  EXPECT_EQ(viewer.resume(earlier, earlier.claims()), scene_->tiles().size());
  viewer.stream().subscribe({.temperature = true, .visible = true, .temperature_sigma = true});
  show(viewer, 0.3);
  settle(viewer);
  EXPECT_EQ(viewer.count(FrameKind::Geometry) + viewer.count(FrameKind::Temperature), 0U);
  EXPECT_EQ(viewer.count(FrameKind::TemperatureSigma), scene_->tiles().size()) << "it is not claimed";
}

class RawLayersInView : public testing::StreamOfATree {};

TEST_F(RawLayersInView, OfAChangedTileAndAllAboveItOnlyWhatIsDrawnIsSent) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe(kRawAlone);
  show(viewer, 0.3);
  viewer.complete();
  settle(viewer);
  const std::size_t before = viewer.frames.size();
  std::vector<std::shared_ptr<const map::Tile>> tiles(scene_->tiles().begin(), scene_->tiles().end());
  const protocol::TileId leaf = testing::change_leaf_and_above(tiles);
  viewer.stream().set_scene(scene_of(tiles, 2));
  viewer.complete();
  settle(viewer);
  ASSERT_EQ(viewer.frames.size(), before + 3) << "geometry, temperatures and visible colours";
  for (std::size_t i = before; i < viewer.frames.size(); ++i) EXPECT_EQ(viewer.frames[i].tile, leaf);

  // From far away it is the top that is drawn.
  viewer.stream().set_camera(camera_over(2, 2, 5000));
  viewer.complete();
  settle(viewer);
  EXPECT_EQ(viewer.frames.size(), before + 6);
  EXPECT_EQ(viewer.frames.back().tile, tiles[0]->id);
}

TEST_F(RawLayersInView, ComeOfWhatIsDrawnAndOfTheTopHotAndNearFirst) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().set_camera(camera_over(0.5F, 0.5F, 1.5F));
  viewer.stream().subscribe(kEverything);
  show(viewer, 0.3);
  viewer.complete();
  settle(viewer);
  std::vector<protocol::TileFrameHeader> raw;
  for (const auto& frame : viewer.frames) {
    if (frame.kind == FrameKind::Temperature) raw.push_back(frame);
  }
  const auto shown = drawn(viewer);
  ASSERT_GT(raw.size(), 2U);
  EXPECT_EQ(raw.front().tile, (protocol::TileId{0, 0, 0, 0})) << "the top stands in for everything";
  for (std::size_t i = 1; i < raw.size(); ++i) EXPECT_TRUE(shown.contains(raw[i].tile));
}

}  // namespace
}  // namespace spectra::stream
