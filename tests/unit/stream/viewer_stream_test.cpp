#include "server/stream/viewer_stream.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numeric>
#include <set>
#include <thread>

#include "fake_scene.hpp"
#include "server/stream/sending_window.hpp"
#include "server/stream/view_selection.hpp"
#include "test_viewer.hpp"

namespace spectra::server {
namespace {

using protocol::FrameKind;
using testing::HeldTile;
using testing::HeldWorkers;
using testing::patch_tile;
using testing::plan_with_alpha;
using testing::scene_of;
using testing::TestViewer;
using testing::tiles_of_tree;
using testing::wait_until_idle;

constexpr std::size_t kRoomyCache = 64u << 20;

class ViewerStreamTest : public ::testing::Test {
 protected:
  void show(TestViewer& viewer, double alpha) { viewer.stream().set_plan(plan_with_alpha(*scene_, alpha)); }

  /// Expects that the viewer holds exactly the scene's tiles, in the colours of `alpha` at `colour_bits`.
  void expect_picture(const TestViewer& viewer, const SceneSnapshot& scene, double alpha, int colour_bits = 8) {
    const auto plan = plan_with_alpha(scene, alpha);
    ASSERT_EQ(viewer.tiles.size(), scene.tiles().size());
    for (const auto& tile : scene.tiles()) {
      const auto held = viewer.tiles.find(tile->id);
      ASSERT_NE(held, viewer.tiles.end());
      EXPECT_EQ(held->second.geometry.child_mask, tile->child_mask);
      EXPECT_EQ(held->second.geometry.geometric_error_m, tile->geometric_error_m);
      expect_tile(held->second, *tile, plan, colour_bits);
    }
  }

  static void expect_tile(const HeldTile& held, const Tile& tile, const fusion::FusionPlan& plan, int colour_bits) {
    std::vector<fusion::Rgb8> fused(tile.positions.size());
    plan.fuse(tile.temperature_celsius, tile.visible, fused);
    const float half_step = held.geometry.position_step_m / 2 * 1.001F;
    ASSERT_EQ(held.positions_m.size(), tile.positions.size());
    ASSERT_EQ(held.colours.size(), held.positions_m.size());
    std::vector<std::size_t> by_x(tile.positions.size());
    std::iota(by_x.begin(), by_x.end(), 0);
    std::sort(by_x.begin(), by_x.end(),
              [&](std::size_t a, std::size_t b) { return tile.positions[a].x < tile.positions[b].x; });
    for (std::size_t i = 0; i < held.positions_m.size(); ++i) {
      const auto& p = held.positions_m[i];
      auto source = std::lower_bound(by_x.begin(), by_x.end(), p[0] - half_step,
                                     [&](std::size_t index, float x) { return tile.positions[index].x < x; });
      while (source != by_x.end() && (std::abs(p[1] - tile.positions[*source].y) > half_step ||
                                      std::abs(p[2] - tile.positions[*source].z) > half_step)) {
        ++source;
      }
      ASSERT_NE(source, by_x.end());
      ASSERT_LE(std::abs(p[0] - tile.positions[*source].x), half_step);
      const fusion::Rgb8 colour = fused[*source];
      const protocol::ColourBytes expected{protocol::rounded_channel(colour.r, colour_bits),
                                           protocol::rounded_channel(colour.g, colour_bits),
                                           protocol::rounded_channel(colour.b, colour_bits)};
      ASSERT_EQ(held.colours[i], expected);
    }
  }

  std::shared_ptr<const SceneSnapshot> scene_ = scene_of(tiles_of_tree(6));
  FrameCache cache_{kRoomyCache};
  WorkerPool pool_{2};
};

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

TEST_F(ViewerStreamTest, AChangeOfSettingsSendsColoursOnly) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  viewer.complete();
  show(viewer, 0.8);
  EXPECT_EQ(viewer.complete().generation, 2U);
  EXPECT_EQ(viewer.count(FrameKind::Geometry), 7U);
  EXPECT_EQ(viewer.count(FrameKind::Colours), 14U);
  expect_picture(viewer, *scene_, 0.8);
}

TEST_F(ViewerStreamTest, TheNewestSettingsOvertake) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0);
  viewer.complete();
  const auto misses_before = cache_.miss_count();
  {
    const HeldWorkers held(pool_);
    for (int i = 1; i <= 60; ++i) show(viewer, i / 100.0);
    EXPECT_EQ(viewer.take(), 0U);
  }
  EXPECT_EQ(viewer.complete().generation, 61U);
  expect_picture(viewer, *scene_, 0.6);
  // Nothing was made for the sixty that were overtaken while they waited.
  EXPECT_EQ(cache_.miss_count() - misses_before, scene_->tiles().size());
  EXPECT_EQ(viewer.completes.size(), 2U);
}

TEST_F(ViewerStreamTest, PreparedColoursOfOldSettingsAreDropped) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0);
  viewer.complete();
  show(viewer, 0.5);
  wait_until_idle(pool_);  // Everything is encoded, nothing taken.
  show(viewer, 0.9);
  viewer.complete();
  EXPECT_EQ(viewer.stream().stats().skipped_frames, scene_->tiles().size());
  EXPECT_EQ(viewer.count(FrameKind::Colours), 2 * scene_->tiles().size());
  expect_picture(viewer, *scene_, 0.9);
}

TEST_F(ViewerStreamTest, ManyChangesWhileFramesFlowEndInTheNewest) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  for (int i = 1; i <= 100; ++i) {
    show(viewer, i / 200.0);
    viewer.take();
  }
  EXPECT_EQ(viewer.complete().generation, 100U);
  expect_picture(viewer, *scene_, 0.5);
  EXPECT_EQ(viewer.count(FrameKind::Geometry), scene_->tiles().size());
  wait_until_idle(pool_);
  EXPECT_EQ(viewer.take(), 0U);
  EXPECT_FALSE(viewer.stream().take_complete().has_value());
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
  scene_ = scene_of(tiles_of_tree(30, 100));
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  wait_until_idle(pool_);
  const auto held_at_rest = viewer.stream().stats().queued_bytes;
  EXPECT_GT(held_at_rest, 0U);
  EXPECT_LE(held_at_rest, 2u << 20);
  for (int i = 0; i < 10; ++i) {
    show(viewer, i / 100.0);
    wait_until_idle(pool_);
    EXPECT_LE(viewer.stream().stats().queued_bytes, 2u << 20);
  }
}

TEST_F(ViewerStreamTest, ViewersWithTheSameSettingsCostOneEncoding) {
  std::vector<std::unique_ptr<TestViewer>> viewers;
  {
    const HeldWorkers held(pool_);
    for (int i = 0; i < 16; ++i) {
      viewers.push_back(std::make_unique<TestViewer>(scene_, cache_, pool_));
      viewers.back()->stream().subscribe({});
      show(*viewers.back(), 0.3);
    }
  }
  for (const auto& viewer : viewers) {
    viewer->complete();
    expect_picture(*viewer, *scene_, 0.3);
  }
  EXPECT_EQ(cache_.miss_count(), 2 * scene_->tiles().size());
  EXPECT_EQ(cache_.hit_count(), 15 * scene_->tiles().size());
}

TEST_F(ViewerStreamTest, ViewersWithDifferentSettingsShareGeometry) {
  TestViewer one(scene_, cache_, pool_);
  TestViewer two(scene_, cache_, pool_);
  one.stream().subscribe({});
  two.stream().subscribe({});
  show(one, 0.3);
  show(two, 0.6);
  one.complete();
  two.complete();
  expect_picture(one, *scene_, 0.3);
  expect_picture(two, *scene_, 0.6);
  EXPECT_EQ(cache_.miss_count(), 3 * scene_->tiles().size());
}

TEST_F(ViewerStreamTest, ViewersWithDifferentSettingsTakeTurns) {
  constexpr std::size_t kViewers = 16;
  scene_ = scene_of(tiles_of_tree(20, 40));
  std::vector<std::unique_ptr<TestViewer>> viewers;
  for (std::size_t i = 0; i < kViewers; ++i) {
    viewers.push_back(std::make_unique<TestViewer>(scene_, cache_, pool_));
    viewers.back()->stream().subscribe({});
  }
  {
    const HeldWorkers held(pool_);
    for (std::size_t i = 0; i < kViewers; ++i) show(*viewers[i], 0.05 * static_cast<double>(i));
  }
  // How much had been encoded for everybody when a viewer had its picture.
  std::vector<std::uint64_t> encoded_at_completion;
  while (encoded_at_completion.size() < kViewers) {
    for (const auto& viewer : viewers) {
      viewer->take();
      if (viewer->stream().take_complete()) encoded_at_completion.push_back(cache_.miss_count());
    }
  }
  EXPECT_LE(encoded_at_completion.back(), 2 * encoded_at_completion.front());
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

TEST_F(ViewerStreamTest, FewerColourBitsSendColoursOnly) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  viewer.complete();
  StreamQuality quality = viewer.stream().quality();
  quality.colour_bits = 5;
  viewer.stream().set_quality(quality);
  EXPECT_EQ(viewer.complete().generation, 1U);
  EXPECT_EQ(viewer.count(FrameKind::Geometry), scene_->tiles().size());
  expect_picture(viewer, *scene_, 0.3, 5);
  EXPECT_EQ(viewer.stream().stats().colour_levels, 32);
}

TEST_F(ViewerStreamTest, SubtractGreenShowsTheSameColours) {
  TestViewer plain(scene_, cache_, pool_);
  TestViewer transformed(scene_, cache_, pool_);
  transformed.colour_transform = protocol::ColourTransform::SubtractGreen;
  for (TestViewer* viewer : {&plain, &transformed}) {
    StreamQuality quality = viewer->stream().quality();
    quality.colour_bits = 6;
    viewer->stream().set_quality(quality);
    viewer->stream().subscribe({.colour_transform = viewer->colour_transform});
    show(*viewer, 0.3);
    viewer->complete();
    expect_picture(*viewer, *scene_, 0.3, 6);
  }
  EXPECT_EQ(plain.count(FrameKind::Colours), scene_->tiles().size());
  EXPECT_EQ(transformed.count(FrameKind::ColoursSubtractGreen), scene_->tiles().size());
  EXPECT_EQ(cache_.miss_count(), 3 * scene_->tiles().size()) << "one geometry, two ways to write colours";
}

TEST_F(ViewerStreamTest, AnotherTransformWhileFramesFlowSendsColoursAnew) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  viewer.complete();
  show(viewer, 0.6);
  wait_until_idle(pool_);  // Prepared, not taken: written the old way.
  viewer.colour_transform = protocol::ColourTransform::SubtractGreen;
  viewer.stream().subscribe({.colour_transform = viewer.colour_transform});
  viewer.complete();
  EXPECT_EQ(viewer.count(FrameKind::Geometry), scene_->tiles().size());
  expect_picture(viewer, *scene_, 0.6);
}

TEST_F(ViewerStreamTest, AnotherPositionStepSendsGeometryUnderANewRevision) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  viewer.complete();
  StreamQuality quality = viewer.stream().quality();
  EXPECT_EQ(quality.position_step_m, lattice_step(static_cast<double>(scene_->suggested_position_step_m())));
  quality.position_step_m = lattice_step(0.01);
  viewer.stream().set_quality(quality);
  viewer.complete();
  EXPECT_EQ(viewer.count(FrameKind::Geometry), 2 * scene_->tiles().size());
  EXPECT_EQ(viewer.count(FrameKind::Colours), 2 * scene_->tiles().size());
  for (const auto& [id, tile] : viewer.tiles) EXPECT_EQ(tile.geometry.position_step_m, lattice_step(0.01));
  expect_picture(viewer, *scene_, 0.3);
}

TEST_F(ViewerStreamTest, QualityThatIsTheSameSendsNothing) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  viewer.complete();
  viewer.stream().set_quality(viewer.stream().quality());
  wait_until_idle(pool_);
  EXPECT_EQ(viewer.take(), 0U);
}

TEST_F(ViewerStreamTest, ANewSceneSendsWhatChangedAndRemovesWhatIsGone) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  viewer.complete();

  auto tiles = tiles_of_tree(6);
  const std::vector<std::shared_ptr<const Tile>> old(scene_->tiles().begin(), scene_->tiles().end());
  tiles = old;
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
  std::vector<std::shared_ptr<const Tile>> tiles(scene_->tiles().begin(), scene_->tiles().end());
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

TEST_F(ViewerStreamTest, AnEncodingThatComesBackHasANewRevisionOnTheWire) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  viewer.complete();
  const auto first = viewer.tiles.at({0, 0, 0, 0}).geometry.revision;
  const StreamQuality quality = viewer.stream().quality();
  StreamQuality coarser = quality;
  coarser.position_step_m = lattice_step(0.01);
  viewer.stream().set_quality(coarser);
  viewer.complete();
  const auto second = viewer.tiles.at({0, 0, 0, 0}).geometry.revision;
  viewer.stream().set_quality(quality);
  const auto misses = cache_.miss_count();
  viewer.complete();
  EXPECT_EQ(cache_.miss_count(), misses);
  EXPECT_GT(second, first);
  EXPECT_GT(viewer.tiles.at({0, 0, 0, 0}).geometry.revision, second);
  show(viewer, 0.6);
  viewer.complete();
  EXPECT_EQ(viewer.count(FrameKind::Geometry), 3 * scene_->tiles().size());
  expect_picture(viewer, *scene_, 0.6);
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
    FrameCache cache(kRoomyCache);
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

/// Sixteen leaves under four quarters under a root, over the square (0,0)-(4,4).
class ViewerStreamOfATree : public ViewerStreamTest {
 protected:
  ViewerStreamOfATree() { scene_ = scene_of(testing::quadtree_tiles(3, 40)); }

  static Camera camera_over(float x, float y, float height) {
    return {.eye = {x, y, height}, .target = {x, y, 0}, .up = {0, 1, 0}, .fov_y_deg = 50, .viewport = {800, 800}};
  }

  /// What a client draws by the protocol's rule, whatever the colours are.
  static std::set<protocol::TileId> drawn(const TestViewer& viewer) {
    std::set<protocol::TileId> result;
    const std::function<bool(protocol::TileId, std::set<protocol::TileId>&)> draw =
        [&](protocol::TileId id, std::set<protocol::TileId>& into) {
          const auto held = viewer.tiles.find(id);
          if (held == viewer.tiles.end() || held->second.colours.empty()) return false;
          std::set<protocol::TileId> beneath;
          const auto mask = held->second.geometry.child_mask;
          bool is_replaced = mask != 0;
          for (std::uint32_t i = 0; i < 8 && is_replaced; ++i) {
            if ((mask >> i & 1) == 0) continue;
            is_replaced = draw({static_cast<std::uint8_t>(id.level + 1), 2 * id.x + (i & 1), 2 * id.y + (i >> 1 & 1),
                                2 * id.z + (i >> 2)},
                               beneath);
          }
          if (is_replaced) {
            into.merge(beneath);
          } else {
            into.insert(id);
          }
          return true;
        };
    draw({0, 0, 0, 0}, result);
    return result;
  }

  /// Everything that is drawn and within a tenth beyond the view shows the newest colours of `alpha`.
  void expect_view(const TestViewer& viewer, const Camera& camera, double alpha) {
    const auto plan = plan_with_alpha(*scene_, alpha);
    std::size_t visible_count = 0;
    for (const auto& tile : scene_->tiles()) {
      if (!drawn(viewer).contains(tile->id) || !may_be_in_view(camera, tile->bounds)) continue;
      ++visible_count;
      const HeldTile& held = viewer.tiles.at(tile->id);
      EXPECT_EQ(held.generation, viewer.last_generation());
      expect_tile(held, *tile, plan, 8);
    }
    EXPECT_GT(visible_count, 0U);
  }
};

TEST_F(ViewerStreamOfATree, WhatIsNotLookedAtIsNeitherSentNorEncoded) {
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

TEST_F(ViewerStreamOfATree, AMovingCameraRefinesWhatItLooksAt) {
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

TEST_F(ViewerStreamOfATree, ACameraThatMakesNoSenseIsIgnored) {
  TestViewer viewer(scene_, cache_, pool_);
  Camera nowhere = camera_over(0.5F, 0.5F, 0.5F);
  nowhere.target = nowhere.eye;
  viewer.stream().set_camera(nowhere);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  EXPECT_EQ(viewer.complete().tile_count, 21U);
}

TEST_F(ViewerStreamOfATree, TilesWhosePlaceIsTakenAreNotColouredAgain) {
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

TEST_F(ViewerStreamOfATree, OutdatedTilesDoNotStayInFrontOfNewerOnes) {
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
  expect_view(viewer, afar, 0.6);
  const Camera near = camera_over(0.5F, 0.5F, 0.5F);
  viewer.stream().set_camera(near);
  viewer.complete();
  expect_view(viewer, near, 0.6);
}

TEST_F(ViewerStreamOfATree, TilesLeftLongestAreRemovedBeyondTheLimit) {
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

TEST_F(ViewerStreamOfATree, ASmallCacheGetsTheWholeSceneCoarser) {
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

/// A viewer who had everything, and one who comes after it on the same server.
class ResumedStream : public ViewerStreamOfATree {
 protected:
  ResumedStream() {
    before_.stream().subscribe({});
    show(before_, 0.3);
    before_.complete();
  }

  void subscribe_and_complete() {
    after_.stream().subscribe({});
    show(after_, 0.6);
    after_.complete();
  }

  TestViewer before_{scene_, cache_, pool_};
  TestViewer after_{scene_, cache_, pool_};
};

TEST_F(ResumedStream, CostsWhatAChangeOfSettingsCosts) {
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

TEST_F(ResumedStream, ReplacesWhatIsNotCurrentAndRemovesWhatIsGone) {
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

TEST_F(ResumedStream, SendsEverythingWhenNothingIsCurrent) {
  StreamQuality quality = after_.stream().quality();
  quality.position_step_m = lattice_step(0.01);
  after_.stream().set_quality(quality);
  EXPECT_EQ(after_.resume(before_, before_.claims()), 0U) << "on another lattice";
  subscribe_and_complete();
  EXPECT_EQ(after_.count(FrameKind::Geometry), 21U);
  EXPECT_EQ(after_.count(FrameKind::Remove), 0U);
  expect_picture(after_, *scene_, 0.6);
}

TEST_F(ResumedStream, DoesNotTakeTilesOfAnotherSceneForItsOwn) {
  const auto next = scene_of(testing::quadtree_tiles(3, 40), 2);
  TestViewer viewer(next, cache_, pool_);
  EXPECT_EQ(viewer.resume(before_, before_.claims()), 0U);
  viewer.stream().subscribe({});
  viewer.stream().set_plan(plan_with_alpha(*next, 0.6));
  viewer.complete();
  expect_picture(viewer, *next, 0.6);
}

TEST_F(ResumedStream, IsTakenUpByACacheThatKeptNothing) {
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

TEST_F(ResumedStream, KeepsToTheBytesOfTheNewViewer) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().set_camera(camera_over(0.5F, 0.5F, 0.5F));
  EXPECT_EQ(viewer.resume(before_, before_.claims()), 21U);
  viewer.stream().subscribe({.cache_bytes = 14 * decoded_bytes(*scene_->tiles().front())});
  show(viewer, 0.6);
  viewer.complete();
  EXPECT_LE(viewer.tiles.size(), 14U);
  EXPECT_EQ(viewer.count(FrameKind::Geometry), 0U);
}

TEST_F(ResumedStream, WhileFramesFlowNothingIsTakenUp) {
  after_.stream().subscribe({});
  EXPECT_EQ(after_.stream().resume(before_.claims()), 0U);
  show(after_, 0.6);
  after_.complete();
  expect_picture(after_, *scene_, 0.6);
}

TEST_F(ViewerStreamOfATree, TellsTheAccuracyOnTheScreen) {
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
}  // namespace spectra::server
