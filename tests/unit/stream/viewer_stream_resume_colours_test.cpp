#include <gtest/gtest.h>

#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "fake_scene.hpp"
#include "stream_with_viewers.hpp"
#include "test_viewer.hpp"

namespace spectra::stream {
namespace {

using protocol::FrameKind;
using testing::FakeScene;
using testing::TestViewer;

/// It comes back with what it knows of the colours it has.
class ViewerStreamResumeColours : public testing::StreamAfterAViewer {
 protected:
  /// In the scene and under the settings of now.
  std::unique_ptr<TestViewer> came_back(double alpha, const Subscription& subscription = {}) {
    return came_back(before_, before_.claims_with_colours(), alpha, subscription);
  }

  /// The same of any viewer, with these claims of what it holds.
  std::unique_ptr<TestViewer> came_back(TestViewer& earlier, const std::vector<ResumedTile>& claims, double alpha,
                                        const Subscription& subscription = {}) {
    auto viewer = std::make_unique<TestViewer>(scene_, cache_, pool_);
    show(*viewer, alpha);
    resumed_count_ = viewer->resume(earlier, claims, earlier.stream().memory());
    viewer->stream().subscribe(subscription);
    viewer->complete();
    return viewer;
  }

  std::vector<std::shared_ptr<const map::Tile>> tiles() const {
    return {scene_->tiles().begin(), scene_->tiles().end()};
  }

  /// The map goes on with these tiles.
  void change_to(std::vector<std::shared_ptr<const map::Tile>> tiles) {
    scene_ = std::make_shared<FakeScene>(std::move(tiles), scene_->revision() + 1, *scene_);
  }

  static void repaint(map::Tile& tile) {
    for (auto& colour : tile.visible) colour.g = static_cast<std::uint8_t>(255 - colour.g);
  }

  /// Everything that is drawn shows the scene of now under `alpha`, whichever connection it came over.
  void expect_right(const TestViewer& viewer, double alpha) {
    const auto plan = testing::plan_with_alpha(*scene_, alpha);
    std::size_t count = 0;
    for (const auto& tile : scene_->tiles()) {
      if (!drawn(viewer).contains(tile->id)) continue;
      ++count;
      EXPECT_EQ(viewer.tiles.at(tile->id).generation, viewer.last_generation());
      expect_tile(viewer.tiles.at(tile->id), *tile, plan, 8);
    }
    EXPECT_EQ(count, 16U);
  }

  std::uint32_t resumed_count_ = 0;  ///< Of who came back last.
};

TEST_F(ViewerStreamResumeColours, NothingIsSentWhereNothingHasChanged) {
  const auto viewer = came_back(0.3);
  EXPECT_TRUE(viewer->frames.empty());
  EXPECT_EQ(viewer->completes.back().tile_count, 21U);
  expect_right(*viewer, 0.3);
}

TEST_F(ViewerStreamResumeColours, AChangedTileAloneIsSentWhereItIsDrawn) {
  auto tiles = this->tiles();
  const protocol::TileId leaf = testing::change_leaf_and_above(tiles, repaint);
  ASSERT_EQ(leaf, (protocol::TileId{2, 0, 0, 0}));
  change_to(tiles);
  const auto viewer = came_back(0.3);
  ASSERT_EQ(viewer->frames.size(), 2U) << "what its children replace does not come";
  for (const auto& frame : viewer->frames) EXPECT_EQ(frame.tile, leaf);
  expect_right(*viewer, 0.3);
}

TEST_F(ViewerStreamResumeColours, AfterAnotherSettingAllComesInNewColours) {
  const auto viewer = came_back(0.6);
  EXPECT_EQ(viewer->count(FrameKind::Colours), 17U);
  EXPECT_EQ(viewer->frames.size(), 17U);
  expect_right(*viewer, 0.6);
}

TEST_F(ViewerStreamResumeColours, ASettingAndBackIsNoChange) {
  TestViewer viewer(scene_, cache_, pool_);
  show(viewer, 0.6);
  show(viewer, 0.3);
  viewer.resume(before_, before_.claims_with_colours(), before_.stream().memory());
  viewer.stream().subscribe({.colour_transform = protocol::ColourTransform::SubtractGreen});
  viewer.complete();
  EXPECT_TRUE(viewer.frames.empty()) << "however colours would be written";
  expect_right(viewer, 0.3);
}

TEST_F(ViewerStreamResumeColours, WhatWasGivenOutAndNeverCameIsSentAgain) {
  // Frames of another picture are on their way when the link breaks; whether they came is not known here.
  const auto came = before_.claims_with_colours();
  show(before_, 0.6);
  before_.complete();
  auto claims = before_.claims_with_colours();
  for (std::size_t i = 0; i < claims.size(); i += 2) claims[i] = came[i];
  const auto viewer = came_back(before_, claims, 0.6);
  std::set<protocol::TileId> sent;
  for (const auto& frame : viewer->frames) sent.insert(frame.tile);
  std::set<protocol::TileId> unknown;
  for (std::size_t i = 0; i < claims.size(); i += 2) unknown.insert(claims[i].tile);
  for (const auto& tile : scene_->tiles()) {
    if (tile->child_mask != 0) continue;
    EXPECT_EQ(sent.contains(tile->id), unknown.contains(tile->id));
  }
  expect_right(*viewer, 0.6);
}

TEST_F(ViewerStreamResumeColours, ColoursThatTheViewerDoesNotSpeakOfComeAnew) {
  const auto viewer = came_back(before_, before_.claims(), 0.3);
  EXPECT_EQ(resumed_count_, 21U);
  EXPECT_EQ(viewer->count(FrameKind::Colours), 17U);
  EXPECT_EQ(viewer->frames.size(), 17U);
}

TEST_F(ViewerStreamResumeColours, IsRememberedOverSeveralCuts) {
  auto first = came_back(0.3);
  const auto claims = first->claims_with_colours();
  for (const ResumedTile& claim : claims) EXPECT_EQ(claim.colour_sequence, 0U);
  const auto second = came_back(*first, claims, 0.3);
  EXPECT_EQ(resumed_count_, 21U);
  EXPECT_TRUE(second->frames.empty());
  // What an earlier connection never confirmed is not known to the next one either.
  TestViewer unknown(scene_, cache_, pool_);
  show(unknown, 0.3);
  EXPECT_EQ(unknown.resume(before_, before_.claims()), 21U);
  auto named = before_.claims();
  for (ResumedTile& claim : named) claim.colour_sequence = 0;
  TestViewer third(scene_, cache_, pool_);
  show(third, 0.3);
  EXPECT_EQ(third.resume(before_, named, unknown.stream().memory()), 21U);
  third.stream().subscribe({});
  third.complete();
  EXPECT_EQ(third.count(FrameKind::Colours), 17U);
}

TEST_F(ViewerStreamResumeColours, RoundedColoursAreReplacedByWholeOnes) {
  TestViewer rounded(scene_, cache_, pool_);
  StreamQuality quality = rounded.stream().quality();
  quality.colour_bits = 5;
  rounded.stream().set_quality(quality);
  rounded.stream().subscribe({});
  show(rounded, 0.3);
  rounded.complete();
  TestViewer viewer(scene_, cache_, pool_);
  show(viewer, 0.3);
  EXPECT_EQ(viewer.resume(rounded, rounded.claims_with_colours(), rounded.stream().memory()), 21U);
  for (const auto& [id, tile] : viewer.tiles) EXPECT_EQ(tile.generation, 0U) << "it is not named as current";
  viewer.stream().subscribe({});
  viewer.complete();
  EXPECT_EQ(viewer.count(FrameKind::Geometry), 0U);
  expect_right(viewer, 0.3);
}

TEST_F(ViewerStreamResumeColours, WhatHasFadedMeanwhileComesAlone) {
  auto tiles = this->tiles();
  auto old = std::make_shared<map::Tile>(*tiles[9]);
  old->seen_at.distinct = {1000};
  old->seen_at.of_vertex.assign(old->positions.size(), 0);
  tiles[9] = old;
  change_to(tiles);
  fusion::FusionChange change;
  change.params["alpha"] = 0.3;
  change.age = fusion::AgeChange{.mode = fusion::AgeMode::Fade, .half_life_s = 100};
  const auto plan = [&] {
    return fusion::FusionPlan::prepare(fusion::with_change(fusion::default_settings(), change).value(),
                                       scene_->temperature())
        .value();
  };
  TestViewer before(scene_, cache_, pool_);
  before.stream().set_time(1000);
  before.stream().subscribe({});
  before.stream().set_plan(plan());
  before.complete();
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().set_time(1100);
  viewer.stream().set_plan(plan());
  EXPECT_EQ(viewer.resume(before, before.claims_with_colours(), before.stream().memory()), 21U);
  viewer.stream().subscribe({});
  viewer.complete();
  ASSERT_EQ(viewer.frames.size(), 1U);
  EXPECT_EQ(viewer.frames.front().tile, old->id);
}

TEST_F(ViewerStreamResumeColours, HowSureTemperaturesAreIsNotSentAgain) {
  const Subscription everything{.temperature = true, .visible = true, .temperature_sigma = true};
  before_.stream().subscribe(everything);
  settle(before_);
  ASSERT_EQ(before_.count(FrameKind::TemperatureSigma), 17U) << "of the top and the leaves";
  const auto viewer = came_back(0.3, everything);
  EXPECT_EQ(resumed_count_, 21U);
  settle(*viewer);
  EXPECT_TRUE(viewer->frames.empty());
}

}  // namespace
}  // namespace spectra::stream
