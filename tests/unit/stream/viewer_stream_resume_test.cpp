#include "server/stream/viewer_stream.hpp"

#include <gtest/gtest.h>

#include <set>
#include <utility>
#include <vector>

#include "fake_scene.hpp"
#include "stream_with_viewers.hpp"
#include "test_viewer.hpp"

namespace spectra::stream {
namespace {

using protocol::FrameKind;
using testing::plan_with_alpha;
using testing::scene_of;
using testing::TestViewer;

/// One comes after it on the same server.
class ViewerStreamResume : public testing::StreamAfterAViewer {
 protected:
  void subscribe_and_complete() {
    after_.stream().subscribe({});
    show(after_, 0.6);
    after_.complete();
  }

  TestViewer after_{scene_, cache_, pool_};
};

TEST_F(ViewerStreamResume, CostsWhatAChangeOfSettingsCosts) {
  const auto misses = cache_.miss_count();
  EXPECT_EQ(after_.resume(before_, before_.claims()), 21U);
  subscribe_and_complete();
  EXPECT_EQ(after_.frames.size(), 17U) << "the root for a quick answer, and the sixteen leaves";
  EXPECT_EQ(after_.count(FrameKind::Colours), 17U);
  EXPECT_EQ(cache_.miss_count() - misses, 17U) << "colours alone are made";
  show(before_, 0.6);
  before_.complete();
  EXPECT_EQ(drawn(after_), drawn(before_));
  for (const auto& id : drawn(after_)) EXPECT_EQ(after_.tiles.at(id).colours, before_.tiles.at(id).colours);
}

TEST_F(ViewerStreamResume, ColoursOfTheEarlierStreamAreReplacedWhenTheSettingsWereThereFirst) {
  show(after_, 0.6);
  EXPECT_EQ(after_.resume(before_, before_.claims()), 21U);
  after_.stream().subscribe({});
  EXPECT_EQ(after_.complete().tile_count, 17U);
  EXPECT_EQ(after_.count(FrameKind::Colours), 17U);
  expect_view(after_, camera_over(2, 2, 12), 0.6);
}

TEST_F(ViewerStreamResume, ATileThatIsClaimedTwiceCountsOnce) {
  auto claims = before_.claims();
  const auto once = claims;
  claims.insert(claims.end(), once.begin(), once.end());
  claims.push_back({once.front().tile, once.front().revision + 1'000'000});
  EXPECT_EQ(after_.resume(before_, claims), 21U);
  subscribe_and_complete();
  EXPECT_EQ(after_.count(FrameKind::Geometry), 0U) << "the first claim holds";
}

TEST_F(ViewerStreamResume, ReplacesWhatIsNotCurrentAndRemovesWhatIsGone) {
  auto claims = before_.claims();
  const protocol::TileId unknown = claims[2].tile;
  const protocol::TileId mistaken = claims[3].tile;
  claims[2].revision += 1'000'000;          // Never was.
  claims[3].revision = claims[4].revision;  // Of another tile.
  claims.push_back({{3, 7, 7, 0}, 5});
  before_.tiles[{3, 7, 7, 0}] = {};
  EXPECT_EQ(after_.resume(before_, claims), 19U);
  subscribe_and_complete();
  std::set<protocol::TileId> replaced;
  std::set<protocol::TileId> removed;
  for (const auto& frame : after_.frames) {
    if (frame.kind == FrameKind::Geometry) replaced.insert(frame.tile);
    if (frame.kind == FrameKind::Remove) removed.insert(frame.tile);
  }
  EXPECT_EQ(replaced, (std::set{unknown, mistaken}));
  // What takes the place of a revision that is newer than any cannot be newer: removed first.
  EXPECT_EQ(removed, (std::set{unknown, protocol::TileId{3, 7, 7, 0}}));
  EXPECT_EQ(drawn(after_).size(), 16U);
  for (const auto& id : drawn(after_)) EXPECT_EQ(after_.tiles.at(id).generation, 1U);
}

TEST_F(ViewerStreamResume, SendsEverythingWhenNothingIsCurrent) {
  StreamQuality quality = after_.stream().quality();
  quality.position_step_m = lattice_step(0.01);
  after_.stream().set_quality(quality);
  EXPECT_EQ(after_.resume(before_, before_.claims()), 0U) << "on another lattice";
  subscribe_and_complete();
  EXPECT_EQ(after_.count(FrameKind::Geometry), 21U);
  EXPECT_EQ(after_.count(FrameKind::Remove), 0U);
  expect_picture(after_, *scene_, 0.6);
}

TEST_F(ViewerStreamResume, DoesNotTakeTilesOfAnotherSceneForItsOwn) {
  const auto next = scene_of(testing::quadtree_tiles(3, 40), 2);
  TestViewer viewer(next, cache_, pool_);
  EXPECT_EQ(viewer.resume(before_, before_.claims()), 0U);
  viewer.stream().subscribe({});
  viewer.stream().set_plan(plan_with_alpha(*next, 0.6));
  viewer.complete();
  expect_picture(viewer, *next, 0.6);
}

TEST_F(ViewerStreamResume, IsTakenUpByACacheThatKeptNothing) {
  FrameCache tiny(0);
  TestViewer before(scene_, tiny, pool_);
  TestViewer after(scene_, tiny, pool_);
  before.stream().subscribe({});
  show(before, 0.3);
  before.complete();
  EXPECT_EQ(after.resume(before, before.claims()), 21U);
  after.stream().subscribe({});
  show(after, 0.6);
  after.complete();
  EXPECT_EQ(after.count(FrameKind::Geometry), 0U);
}

TEST_F(ViewerStreamResume, KeepsToTheBytesOfTheNewViewer) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().set_camera(camera_over(0.5F, 0.5F, 0.5F));
  EXPECT_EQ(viewer.resume(before_, before_.claims()), 21U);
  viewer.stream().subscribe({.cache_bytes = 14 * decoded_bytes(*scene_->tiles().front())});
  show(viewer, 0.6);
  viewer.complete();
  EXPECT_LE(viewer.tiles.size(), 14U);
  EXPECT_EQ(viewer.count(FrameKind::Geometry), 0U);
}

TEST_F(ViewerStreamResume, WhileFramesFlowNothingIsTakenUp) {
  after_.stream().subscribe({});
  EXPECT_EQ(after_.stream().resume(before_.claims()).tile_count, 0U);
  show(after_, 0.6);
  after_.complete();
  expect_picture(after_, *scene_, 0.6);
}

}  // namespace
}  // namespace spectra::stream
