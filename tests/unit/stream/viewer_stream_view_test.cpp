#include "server/stream/viewer_stream.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "stream_with_viewers.hpp"
#include "test_viewer.hpp"

namespace spectra::stream {
namespace {

using protocol::FrameKind;
using testing::TestViewer;
using testing::wait_until_idle;

using ViewerStreamView = testing::StreamOfATree;

TEST_F(ViewerStreamView, WhatIsNotLookedAtIsNeitherSentNorEncoded) {
  TestViewer viewer(scene_, cache_, pool_);
  const Camera corner = camera_over(0.5F, 0.5F, 0.5F);
  viewer.stream().set_camera(corner);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  const auto complete = viewer.complete();
  EXPECT_EQ(viewer.tiles.size(), 9U);
  EXPECT_EQ(complete.tile_count, 9U);
  EXPECT_EQ(cache_.miss_count(), 18U);
  EXPECT_EQ(drawn(viewer).size(), 3U + 4U);
  expect_view(viewer, corner, 0.3);
}

TEST_F(ViewerStreamView, AMovingCameraRefinesWhatItLooksAt) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().set_camera(camera_over(2, 2, 5000));
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  EXPECT_EQ(viewer.complete().tile_count, 1U);
  const Camera far_corner = camera_over(3.5F, 3.5F, 0.5F);
  viewer.stream().set_camera(far_corner);
  viewer.complete();
  EXPECT_TRUE(viewer.tiles.contains({2, 3, 3, 0}));
  EXPECT_FALSE(viewer.tiles.contains({2, 0, 0, 0}));
  expect_view(viewer, far_corner, 0.3);
  const auto frames = viewer.frames.size();
  viewer.stream().set_camera(camera_over(3.4F, 3.5F, 0.5F));
  wait_until_idle(pool_);
  EXPECT_EQ(viewer.take(), 0U);
  EXPECT_EQ(viewer.frames.size(), frames);
}

TEST_F(ViewerStreamView, WhatItsFinerTilesReplaceIsNotSentBecauseOneOfThemIsOnItsWay) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  viewer.complete();
  StreamQuality quality = viewer.stream().quality();
  quality.position_step_m = lattice_step(0.01);
  viewer.stream().set_quality(quality);
  // Geometry is acknowledged before its colours follow.
  viewer.complete();
  EXPECT_EQ(viewer.count(FrameKind::Geometry), 21U + 16U) << "the leaves";
  expect_view(viewer, camera_over(2, 2, 12), 0.3);
}

TEST_F(ViewerStreamView, ACameraThatMakesNoSenseIsIgnored) {
  TestViewer viewer(scene_, cache_, pool_);
  Camera nowhere = camera_over(0.5F, 0.5F, 0.5F);
  nowhere.target = nowhere.eye;
  viewer.stream().set_camera(nowhere);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  EXPECT_EQ(viewer.complete().tile_count, 21U);
}

TEST_F(ViewerStreamView, TilesWhosePlaceIsTakenAreNotColouredAgain) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  viewer.complete();
  const auto frames_before = viewer.frames.size();
  show(viewer, 0.6);
  const auto complete = viewer.complete();
  // The root for a quick answer and the sixteen leaves; the quarters would add a quarter to the bytes.
  EXPECT_EQ(viewer.frames.size() - frames_before, 17U);
  EXPECT_EQ(complete.tile_count, 17U);
  EXPECT_EQ(viewer.frames[frames_before].tile, (protocol::TileId{0, 0, 0, 0}));
  for (const auto& id : drawn(viewer)) EXPECT_EQ(viewer.tiles.at(id).generation, 2U);

  // From further away a quarter is to be drawn itself: now it needs the colours it was spared.
  viewer.stream().set_camera(camera_over(2, 2, 60));
  StreamQuality quality = viewer.stream().quality();
  quality.pixel_error = 4;
  viewer.stream().set_quality(quality);
  viewer.complete();
  EXPECT_EQ(viewer.tiles.at({1, 1, 1, 0}).generation, 2U);
}

TEST_F(ViewerStreamView, OutdatedTilesDoNotStayInFrontOfNewerOnes) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  viewer.complete();
  const Camera afar = camera_over(2, 2, 5000);
  viewer.stream().set_camera(afar);
  wait_until_idle(pool_);
  viewer.take();
  EXPECT_EQ(drawn(viewer).size(), 16U) << "what is there and not outdated may stay";
  show(viewer, 0.6);
  viewer.complete();
  EXPECT_EQ(drawn(viewer).size(), 1U);
  EXPECT_EQ(viewer.tiles.size(), 1U) << "at every depth";
  expect_view(viewer, afar, 0.6);
  const Camera near = camera_over(0.5F, 0.5F, 0.5F);
  viewer.stream().set_camera(near);
  viewer.complete();
  expect_view(viewer, near, 0.6);
}

TEST_F(ViewerStreamView, OutdatedTilesStayBetweenTilesThatAreNot) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  viewer.complete();
  show(viewer, 0.6);
  viewer.complete();
  ASSERT_EQ(viewer.tiles.at({1, 0, 0, 0}).generation, 1U) << "its children take its place";
  viewer.stream().set_camera(camera_over(2, 2, 5000));
  wait_until_idle(pool_);
  viewer.take();
  EXPECT_TRUE(viewer.tiles.contains({1, 0, 0, 0}));
  EXPECT_EQ(drawn(viewer).size(), 16U) << "the finest, in the newest colours";
}

TEST_F(ViewerStreamView, OutdatedTilesGoWhenACoarserOneThatIsNewerBecomesFineEnough) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  viewer.complete();
  show(viewer, 0.6);
  while (viewer.tiles.at({0, 0, 0, 0}).generation < 2) {
    if (viewer.take(1) == 0) viewer.wait_and_take(1);
  }
  ASSERT_EQ(viewer.tiles.at({2, 3, 3, 0}).generation, 1U) << "the root alone has the new colours";
  const Camera afar = camera_over(2, 2, 5000);
  viewer.stream().set_camera(afar);
  viewer.complete();
  expect_view(viewer, afar, 0.6);
}

TEST_F(ViewerStreamView, TilesLeftLongestAreRemovedBeyondTheLimit) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({.cache_bytes = 14 * decoded_bytes(*scene_->tiles().front())});
  viewer.stream().set_camera(camera_over(0.5F, 0.5F, 0.5F));
  show(viewer, 0.3);
  viewer.complete();
  EXPECT_EQ(viewer.tiles.size(), 9U);
  viewer.stream().set_camera(camera_over(3.5F, 0.5F, 0.5F));
  viewer.complete();
  EXPECT_EQ(viewer.tiles.size(), 13U);
  EXPECT_EQ(viewer.count(FrameKind::Remove), 0U);
  viewer.stream().set_camera(camera_over(3.5F, 3.5F, 0.5F));
  viewer.complete();
  viewer.stream().set_camera(camera_over(0.5F, 3.5F, 0.5F));
  viewer.complete();
  EXPECT_FALSE(viewer.tiles.contains({2, 0, 0, 0}));
  EXPECT_TRUE(viewer.tiles.contains({2, 3, 3, 0}));
  EXPECT_LE(viewer.tiles.size(), 14U);
  // Back again: what was removed is sent again, geometry and all.
  const Camera first_corner = camera_over(0.5F, 0.5F, 0.5F);
  viewer.stream().set_camera(first_corner);
  viewer.complete();
  expect_view(viewer, first_corner, 0.3);
}

TEST_F(ViewerStreamView, ASmallCacheGetsTheWholeSceneCoarser) {
  const std::uint64_t tile_bytes = decoded_bytes(*scene_->tiles().front());
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({.cache_bytes = 14 * tile_bytes});
  viewer.stream().set_camera(camera_over(2, 2, 12));
  show(viewer, 0.3);
  viewer.complete();
  EXPECT_EQ(viewer.tiles.size(), 1U + 4 + 4 + 4) << "two quarters are refined; a third does not fit";
  EXPECT_GT(viewer.stream().stats().position_mm, 200) << "as coarse as the quarters that are not refined";
  // Smaller, then without a bound.
  viewer.stream().subscribe({.cache_bytes = tile_bytes / 2});
  viewer.complete();
  EXPECT_EQ(viewer.tiles.size(), 1U);
  viewer.stream().subscribe({});
  viewer.complete();
  EXPECT_EQ(viewer.tiles.size(), 21U);
}

TEST_F(ViewerStreamView, TellsTheAccuracyOnTheScreen) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.acknowledges = false;
  const Camera camera = camera_over(2, 2, 12);
  viewer.stream().set_camera(camera);
  viewer.stream().subscribe({.in_flight_bytes = 1});
  show(viewer, 0.3);
  const double rounding_mm = static_cast<double>(viewer.stream().quality().position_step_m) / 2 * std::sqrt(3.0) * 1e3;
  wait_until_idle(pool_);
  for (int frame = 0; frame < 2; ++frame) {
    EXPECT_EQ(viewer.stream().stats().position_mm, 0) << "nothing can be drawn yet";
    viewer.take();
    viewer.acknowledge();
    wait_until_idle(pool_);
  }
  const StreamStats coarse = viewer.stream().stats();
  EXPECT_NEAR(coarse.position_mm, 400 + rounding_mm, 1e-3);
  EXPECT_GT(coarse.pixel_error, 20);
  viewer.acknowledges = true;
  viewer.complete();
  const StreamStats fine = viewer.stream().stats();
  EXPECT_NEAR(fine.position_mm, rounding_mm, 1e-6);
  EXPECT_EQ(fine.pixel_error, 0);
  EXPECT_EQ(fine.colour_levels, 256);
}

}  // namespace
}  // namespace spectra::stream
