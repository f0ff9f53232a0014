#include "server/stream/viewer_stream.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include "fake_scene.hpp"
#include "server/stream/sending_window.hpp"
#include "stream_with_viewers.hpp"
#include "test_viewer.hpp"

namespace spectra::stream {
namespace {

using protocol::FrameKind;
using testing::patch_tile;
using testing::plan_with_alpha;
using testing::scene_of;
using testing::TestViewer;
using testing::tiles_of_tree;
using testing::wait_until_idle;

using ViewerStreamTest = testing::StreamWithViewers;

TEST_F(ViewerStreamTest, SendsTheWholeSceneAndThenCompletesOnce) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  const auto complete = viewer.complete();
  EXPECT_EQ(complete.generation, 1U);
  EXPECT_EQ(complete.scene_revision, 1U);
  EXPECT_EQ(complete.tile_count, 7U);
  EXPECT_EQ(complete.vertex_count, scene_->vertex_count());
  expect_picture(viewer, *scene_, 0.3);
  wait_until_idle(pool_);
  EXPECT_EQ(viewer.take(), 0U);
  EXPECT_FALSE(viewer.stream().take_complete().has_value());
}

TEST_F(ViewerStreamTest, SendsNothingBeforeItIsSubscribedAndHasSettings) {
  TestViewer viewer(scene_, cache_, pool_);
  show(viewer, 0.3);
  wait_until_idle(pool_);
  EXPECT_EQ(viewer.take(), 0U);
  EXPECT_EQ(cache_.miss_count(), 0U);
  EXPECT_FALSE(viewer.stream().take_complete().has_value());

  TestViewer without_settings(scene_, cache_, pool_);
  without_settings.stream().subscribe({});
  wait_until_idle(pool_);
  EXPECT_EQ(without_settings.take(), 0U);
  EXPECT_FALSE(without_settings.stream().take_complete().has_value());
}

TEST_F(ViewerStreamTest, OrdersCoarseBeforeFineAndGeometryBeforeColours) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  viewer.complete();
  ASSERT_EQ(viewer.frames.size(), 14U);
  for (std::size_t i = 0; i < viewer.frames.size(); i += 2) {
    EXPECT_EQ(viewer.frames[i].kind, FrameKind::Geometry);
    EXPECT_EQ(viewer.frames[i].generation, 0U);
    EXPECT_EQ(viewer.frames[i + 1].kind, FrameKind::Colours);
    EXPECT_EQ(viewer.frames[i + 1].tile, viewer.frames[i].tile);
    if (i == 0) continue;
    EXPECT_GE(viewer.frames[i].tile.level, viewer.frames[i - 1].tile.level);
    if (i > 2) {
      EXPECT_LE(viewer.frames[i].highest_celsius, viewer.frames[i - 1].highest_celsius) << "hot ones first";
    }
  }
}

TEST_F(ViewerStreamTest, KeepsToTheWindow) {
  constexpr std::size_t kWindow = 20'000;
  scene_ = scene_of(tiles_of_tree(40, 30));
  TestViewer viewer(scene_, cache_, pool_);
  viewer.acknowledges = false;
  viewer.stream().subscribe({.in_flight_bytes = kWindow});
  show(viewer, 0.3);
  wait_until_idle(pool_);
  std::size_t stops = 0;
  std::size_t acknowledged_bytes = 0;
  while (!viewer.stream().take_complete()) {
    viewer.take();
    EXPECT_LE(viewer.taken_bytes - acknowledged_bytes, kWindow);
    wait_until_idle(pool_);
    if (viewer.take() == 0 && !viewer.frames.empty()) {
      viewer.acknowledge();
      acknowledged_bytes = viewer.taken_bytes;
      ++stops;
    }
    ASSERT_LT(stops, 1'000U);
  }
  EXPECT_GE(stops, viewer.taken_bytes / kWindow);
  expect_picture(viewer, *scene_, 0.3);
}

TEST_F(ViewerStreamTest, AFrameLargerThanTheWindowGoesAlone) {
  scene_ = scene_of(tiles_of_tree(2, 150));
  TestViewer viewer(scene_, cache_, pool_);
  viewer.acknowledges = false;
  viewer.stream().subscribe({.in_flight_bytes = 1});
  show(viewer, 0.3);
  for (std::size_t i = 1; i <= 6; ++i) {
    wait_until_idle(pool_);
    EXPECT_EQ(viewer.take(), 1U);
    wait_until_idle(pool_);
    EXPECT_EQ(viewer.take(), 0U);
    viewer.acknowledge();
  }
  expect_picture(viewer, *scene_, 0.3);
}

TEST_F(ViewerStreamTest, TheFirstPictureGoesInOnePiece) {
  scene_ = scene_of(tiles_of_tree(8, 200));
  TestViewer viewer(scene_, cache_, pool_);
  viewer.acknowledges = false;
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  wait_until_idle(pool_);
  viewer.take();
  const protocol::TileId root{};
  EXPECT_EQ(viewer.count(FrameKind::Colours), 1U);
  EXPECT_EQ(viewer.count(FrameKind::Geometry), 1U);
  EXPECT_GT(viewer.taken_bytes, SendingWindow::kInitialBytes) << "else this shows nothing";
  EXPECT_EQ(viewer.tiles.at(root).generation, 1U);
}

TEST_F(ViewerStreamTest, IgnoresAcknowledgementsThatMakeNoSense) {
  scene_ = scene_of(tiles_of_tree(2, 150));
  TestViewer viewer(scene_, cache_, pool_);
  viewer.acknowledges = false;
  viewer.stream().subscribe({.in_flight_bytes = 1});
  show(viewer, 0.3);
  wait_until_idle(pool_);
  ASSERT_EQ(viewer.take(), 1U);
  wait_until_idle(pool_);
  viewer.stream().acknowledge(4'000'000'000U, 0);
  viewer.stream().acknowledge(2, 0);
  viewer.stream().acknowledge(0, 0);
  EXPECT_EQ(viewer.take(), 0U);
  viewer.stream().acknowledge(1, 0);
  EXPECT_EQ(viewer.take(), 1U);
  viewer.stream().acknowledge(1, 0);
  EXPECT_EQ(viewer.take(), 0U);
}

TEST_F(ViewerStreamTest, AViewerThatDoesNotReadHoldsLittle) {
  // Colours that no predictor sees through: about 50 kB a tile.
  std::vector<std::shared_ptr<const map::Tile>> tiles;
  std::uint32_t state = 1;
  for (const auto& plain : tiles_of_tree(60, 120)) {
    auto noisy = std::make_shared<map::Tile>(*plain);
    for (auto& colour : noisy->visible) {
      state = state * 1'664'525 + 1'013'904'223;
      colour = {static_cast<std::uint8_t>(state >> 24), static_cast<std::uint8_t>(state >> 16),
                static_cast<std::uint8_t>(state >> 8)};
    }
    tiles.push_back(std::move(noisy));
  }
  scene_ = scene_of(std::move(tiles));
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  // A megabyte, and what was begun before it was reached: the next tile, and one on each worker.
  constexpr std::size_t kMost = 3u << 19;
  for (int i = 0; i < 4; ++i) {
    show(viewer, i / 10.0);
    wait_until_idle(pool_);
    EXPECT_GT(viewer.stream().stats().queued_bytes, kMost / 2);
    EXPECT_LE(viewer.stream().stats().queued_bytes, kMost);
  }
  viewer.complete();
  EXPECT_GT(viewer.taken_bytes, 2 * kMost) << "else this shows nothing";
}

TEST_F(ViewerStreamTest, WorksWithACacheThatKeepsNothing) {
  FrameCache tiny(0);
  TestViewer one(scene_, tiny, pool_);
  TestViewer two(scene_, tiny, pool_);
  for (TestViewer* viewer : {&one, &two}) {
    viewer->stream().subscribe({});
    show(*viewer, 0.3);
  }
  one.complete();
  two.complete();
  show(one, 0.7);
  one.complete();
  expect_picture(one, *scene_, 0.7);
  expect_picture(two, *scene_, 0.3);
  EXPECT_EQ(one.count(FrameKind::Geometry), scene_->tiles().size());
  EXPECT_EQ(tiny.size_bytes(), 0U);
}

TEST_F(ViewerStreamTest, ANewSceneSendsWhatChangedAndRemovesWhatIsGone) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  viewer.complete();

  std::vector<std::shared_ptr<const map::Tile>> tiles(scene_->tiles().begin(), scene_->tiles().end());
  const auto gone = tiles[2]->id;
  tiles[1] = patch_tile(tiles[1]->id, 14, 0, 30);
  tiles.erase(tiles.begin() + 2);
  tiles.push_back(patch_tile({6, 50, 0, 0}, 12, 9, 40));
  const auto next = scene_of(tiles, 2);
  viewer.stream().set_scene(next);
  viewer.complete();
  EXPECT_FALSE(viewer.tiles.contains(gone));
  EXPECT_EQ(viewer.count(FrameKind::Remove), 1U);
  EXPECT_EQ(viewer.count(FrameKind::Geometry), 7U + 2U);
  EXPECT_EQ(viewer.count(FrameKind::Colours), 7U + 2U);

  viewer.stream().set_plan(plan_with_alpha(*next, 0.3));
  EXPECT_EQ(viewer.complete().scene_revision, 2U);
  EXPECT_EQ(viewer.count(FrameKind::Geometry), 7U + 2U);
  expect_picture(viewer, *next, 0.3);
}

TEST_F(ViewerStreamTest, OfAChangedTileAndAllAboveItOnlyWhatIsDrawnIsSent) {
  auto tiles = testing::quadtree_tiles(3, 12);
  scene_ = scene_of(tiles);
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  viewer.complete();
  const std::size_t before = viewer.frames.size();
  const protocol::TileId leaf = testing::change_leaf_and_above(tiles);
  const auto changed = scene_of(tiles, 2);
  viewer.stream().set_scene(changed);
  viewer.complete();
  ASSERT_EQ(viewer.frames.size(), before + 2);
  EXPECT_EQ(viewer.frames.back().tile, leaf);

  // Another setting is answered by the top first, as it is now.
  show(viewer, 0.6);
  viewer.complete();
  EXPECT_EQ(viewer.frames[before + 2].tile, tiles[0]->id);
  EXPECT_EQ(viewer.frames[before + 2].kind, FrameKind::Geometry);
  expect_tile(viewer.tiles.at(tiles[0]->id), *tiles[0], plan_with_alpha(*changed, 0.6), 8);
}

TEST_F(ViewerStreamTest, WhatIsAboveATileThatChangesTwiceStaysHidden) {
  auto tiles = testing::quadtree_tiles(3, 12);
  scene_ = scene_of(tiles);
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  viewer.complete();
  // Changed twice, the second time before anything of the first has come: what stands there is still of before.
  const std::size_t before = viewer.frames.size();
  testing::HeldWorkers held(pool_);
  protocol::TileId leaf;
  for (int round = 0; round < 2; ++round) {
    leaf = testing::change_leaf_and_above(tiles);
    viewer.stream().set_scene(scene_of(tiles, static_cast<std::uint32_t>(2 + round)));
  }
  held.release();
  viewer.complete();
  ASSERT_EQ(viewer.frames.size(), before + 2);
  EXPECT_EQ(viewer.frames.back().tile, leaf);
}

TEST_F(ViewerStreamTest, ATileThatGoesWhileItsColoursAreReadyLeavesNothingQueued) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  viewer.complete();
  show(viewer, 0.6);
  wait_until_idle(pool_);
  ASSERT_GT(viewer.stream().stats().queued_bytes, 0U) << "else this shows nothing";

  std::vector<std::shared_ptr<const map::Tile>> tiles(scene_->tiles().begin(), scene_->tiles().end());
  tiles.erase(tiles.begin() + 2);
  viewer.stream().set_scene(scene_of(tiles, 2));
  viewer.complete();
  viewer.acknowledge();
  EXPECT_EQ(viewer.stream().stats().queued_bytes, 0U);
}

TEST_F(ViewerStreamTest, ACoarseTileThatNobodySeesIsNotSentAgain) {
  std::vector<std::shared_ptr<const map::Tile>> tiles = testing::quadtree_tiles(3, 12);
  const auto first = scene_of(tiles);
  TestViewer viewer(first, cache_, pool_);
  viewer.stream().subscribe({});
  viewer.stream().set_plan(plan_with_alpha(*first, 0.3));
  viewer.complete();
  const std::size_t frame_count = viewer.frames.size();

  const auto another = [&](auto change) {
    auto tile = std::make_shared<map::Tile>(*tiles[0]);
    change(*tile);
    tiles[0] = tile;
    return scene_of(tiles, first->revision() + 1);
  };
  viewer.stream().set_scene(another([](map::Tile& tile) { tile.positions[0].z += 1; }));
  EXPECT_EQ(viewer.complete().scene_revision, 2U);
  EXPECT_EQ(viewer.frames.size(), frame_count) << "its children are drawn in its place";

  // From far away it is what is drawn.
  viewer.stream().set_camera({.eye = {2, 2, 5000}, .target = {2, 2, 0}, .up = {0, 1, 0}});
  viewer.complete();
  ASSERT_EQ(viewer.frames.size(), frame_count + 2);
  EXPECT_EQ(viewer.frames.back().tile, tiles[0]->id);

  // A viewer has to know which children take its place.
  viewer.stream().set_camera({.eye = {2, 2, 1}, .target = {2, 2, 0}, .up = {0, 1, 0}});
  viewer.stream().set_scene(another([](map::Tile& tile) { tile.child_mask ^= 0x80; }));
  viewer.complete();
  EXPECT_EQ(viewer.frames.size(), frame_count + 4);
}

TEST_F(ViewerStreamTest, AnEmptySceneIsComplete) {
  const auto empty = scene_of({});
  TestViewer viewer(empty, cache_, pool_);
  viewer.stream().subscribe({});
  viewer.stream().set_plan(plan_with_alpha(*empty, 0.3));
  EXPECT_EQ(viewer.complete().tile_count, 0U);
}

TEST_F(ViewerStreamTest, ATileWithoutTemperatureShowsItsVisibleColour) {
  auto tile = patch_tile({}, 8, 0, 20);
  tile->temperature_celsius.clear();
  scene_ = scene_of({tile});
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 1);
  viewer.complete();
  tile->temperature_celsius.assign(tile->positions.size(), std::numeric_limits<float>::quiet_NaN());
  expect_picture(viewer, *scene_, 0);
}

TEST_F(ViewerStreamTest, ATileThatCannotBeEncodedIsLeftOutAndCounted) {
  std::vector<std::shared_ptr<const map::Tile>> tiles(scene_->tiles().begin(), scene_->tiles().end());
  auto broken = patch_tile(tiles[3]->id, 12, 2, 20);
  broken->positions[5].x = std::numeric_limits<float>::infinity();
  tiles[3] = broken;
  scene_ = scene_of(tiles);
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  EXPECT_EQ(viewer.complete().tile_count, 6U);
  EXPECT_EQ(viewer.stream().stats().failed_tiles, 1U);
  show(viewer, 0.4);
  EXPECT_EQ(viewer.complete().tile_count, 6U);
  EXPECT_EQ(viewer.stream().stats().failed_tiles, 1U) << "tried again for every change of settings";
}

TEST_F(ViewerStreamTest, UnsubscribeStopsAndSubscribeStartsFromNothing) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  viewer.complete();
  viewer.stream().unsubscribe();
  show(viewer, 0.4);
  wait_until_idle(pool_);
  EXPECT_EQ(viewer.take(), 0U);
  const auto frames_before = viewer.frames.size();
  viewer.stream().subscribe({});
  while (!viewer.stream().take_complete()) {
    const auto frame = viewer.stream().next_frame(0);
    if (!frame) {
      wait_until_idle(pool_);
      continue;
    }
    const auto header = protocol::decoded_frame([&] {
                          std::vector<std::byte> message(frame->header.begin(), frame->header.end());
                          message.insert(message.end(), frame->payload->begin(), frame->payload->end());
                          return message;
                        }())
                            .value()
                            .header;
    viewer.frames.push_back(header);
  }
  EXPECT_EQ(viewer.frames.size() - frames_before, 2 * scene_->tiles().size());
}

TEST_F(ViewerStreamTest, IsNeverWokenAfterClose) {
  for (int round = 0; round < 50; ++round) {
    FrameCache cache(1u << 20);
    TestViewer viewer(scene_, cache, pool_);
    viewer.stream().subscribe({});
    show(viewer, 0.3);
    if (round % 2 == 1) viewer.wait_and_take();
    viewer.stream().close();
    const auto wakes = viewer.wake_count();
    wait_until_idle(pool_);
    EXPECT_EQ(viewer.wake_count(), wakes);
    EXPECT_EQ(viewer.take(), 0U);
    EXPECT_FALSE(viewer.stream().take_complete().has_value());
  }
}

TEST_F(ViewerStreamTest, CloseLetsGoOfTheSceneAndTheCallback) {
  const auto token = std::make_shared<int>(0);
  auto stream = ViewerStream::create(scene_, cache_, pool_, [token] {});
  EXPECT_EQ(token.use_count(), 2);
  stream->close();
  EXPECT_EQ(token.use_count(), 1);
}

TEST_F(ViewerStreamTest, ViewersOnManyThreadsAllGetTheirPicture) {
  std::vector<std::thread> threads;
  for (int i = 0; i < 6; ++i) {
    threads.emplace_back([this, i] {
      TestViewer viewer(scene_, cache_, pool_);
      viewer.stream().subscribe({.in_flight_bytes = i % 2 == 0 ? std::size_t{0} : 10'000});
      for (int step = 0; step <= 20; ++step) {
        viewer.stream().set_plan(plan_with_alpha(*scene_, step / 40.0 + (i % 3) * 0.1));
        if (step % 5 == 0) viewer.complete();
        viewer.take();
        if (step == 7) {
          StreamQuality quality = viewer.stream().quality();
          quality.colour_bits = 6;
          viewer.stream().set_quality(quality);
        }
      }
      expect_picture(viewer, *scene_, 0.5 + (i % 3) * 0.1, 6);
    });
  }
  for (auto& thread : threads) thread.join();
}

TEST_F(ViewerStreamTest, SurvivesViewersThatLeaveInTheMiddle) {
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([this, i] {
      for (int round = 0; round < 20; ++round) {
        TestViewer viewer(scene_, cache_, pool_);
        viewer.stream().subscribe({});
        show(viewer, (i * 20 + round) / 100.0);
        for (int frame = 0; frame < round % 5; ++frame) viewer.take();
      }
    });
  }
  for (auto& thread : threads) thread.join();
  TestViewer last(scene_, cache_, pool_);
  last.stream().subscribe({});
  show(last, 0.79);
  last.complete();
  expect_picture(last, *scene_, 0.79);
}

}  // namespace
}  // namespace spectra::stream
