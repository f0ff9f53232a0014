#include "server/stream/viewer_stream.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <vector>

#include "fake_scene.hpp"
#include "stream_with_viewers.hpp"
#include "test_viewer.hpp"

namespace spectra::stream {
namespace {

using protocol::FrameKind;
using testing::HeldWorkers;
using testing::scene_of;
using testing::TestViewer;
using testing::tiles_of_tree;
using testing::wait_until_idle;

using ViewerStreamSettings = testing::StreamWithViewers;

TEST_F(ViewerStreamSettings, AChangeOfSettingsSendsColoursOnly) {
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

TEST_F(ViewerStreamSettings, TheNewestSettingsOvertake) {
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

TEST_F(ViewerStreamSettings, PreparedColoursOfOldSettingsAreDropped) {
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

TEST_F(ViewerStreamSettings, ManyChangesWhileFramesFlowEndInTheNewest) {
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

TEST_F(ViewerStreamSettings, ViewersWithTheSameSettingsCostOneEncoding) {
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

TEST_F(ViewerStreamSettings, ViewersWithDifferentSettingsShareGeometry) {
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

TEST_F(ViewerStreamSettings, ViewersWithDifferentSettingsTakeTurns) {
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

TEST_F(ViewerStreamSettings, FewerColourBitsSendColoursOnly) {
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

TEST_F(ViewerStreamSettings, SubtractGreenShowsTheSameColours) {
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

TEST_F(ViewerStreamSettings, AnotherTransformWhileFramesFlowSendsColoursAnew) {
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

TEST_F(ViewerStreamSettings, MarksComeWhereTheyAreAskedForAndSomethingIsHighlighted) {
  // A highlight of one colour, which no visible colour is.
  constexpr base::Rgb8 kHighlight{1, 2, 255};
  fusion::PaletteTable palette;
  palette.fill({kHighlight.r, kHighlight.g, kHighlight.b});
  fusion::FusionChange change;
  change.method = "colour_mapped_threshold";
  change.params = {{"threshold", 22.0}, {"alpha", 1.0}};
  const auto plan = fusion::FusionPlan::prepare(fusion::with_change(fusion::default_settings(), change).value(),
                                                scene_->temperature(), palette)
                        .value();
  TestViewer marked(scene_, cache_, pool_);
  TestViewer plain(scene_, cache_, pool_);
  StreamQuality quality = marked.stream().quality();
  quality.marks = true;
  marked.stream().set_quality(quality);
  for (TestViewer* viewer : {&marked, &plain}) {
    viewer->stream().subscribe({});
    viewer->stream().set_plan(plan);
    viewer->complete();
  }
  EXPECT_EQ(cache_.miss_count(), 3 * scene_->tiles().size()) << "one geometry, colours with and without marks";
  std::size_t highlighted = 0;
  std::size_t others = 0;
  for (const auto& tile : scene_->tiles()) {
    const testing::HeldTile& held = marked.tiles.at(tile->id);
    EXPECT_EQ(held.colours, plain.tiles.at(tile->id).colours);
    EXPECT_TRUE(plain.tiles.at(tile->id).marks.empty());
    expect_tile(held, *tile, plan, 8);
    ASSERT_EQ(held.marks.size(), held.colours.size());
    for (std::size_t i = 0; i < held.marks.size(); ++i) {
      const bool is_highlight =
          held.colours[i] == protocol::codec::ColourBytes{kHighlight.r, kHighlight.g, kHighlight.b};
      EXPECT_EQ(held.marks[i] == 1, is_highlight) << i;
      ++(held.marks[i] == 1 ? highlighted : others);
    }
  }
  EXPECT_GT(highlighted, 0U);
  EXPECT_GT(others, 0U);

  // A method that treats all temperatures alike has none, and asking for them then sends nothing.
  show(marked, 0.3);
  marked.complete();
  expect_picture(marked, *scene_, 0.3);
  for (const auto& [id, held] : marked.tiles) EXPECT_TRUE(held.marks.empty());
  show(plain, 0.3);
  plain.complete();
  plain.stream().set_quality(quality);
  wait_until_idle(pool_);
  EXPECT_EQ(plain.take(), 0U);
  // Where something is highlighted they come with colours, sent again without geometry.
  plain.stream().set_plan(plan);
  quality.marks = false;
  plain.stream().set_quality(quality);
  plain.complete();
  for (const auto& [id, held] : plain.tiles) EXPECT_TRUE(held.marks.empty());
  quality.marks = true;
  plain.stream().set_quality(quality);
  plain.complete();
  for (const auto& [id, held] : plain.tiles) EXPECT_EQ(held.marks.size(), held.colours.size());
  EXPECT_EQ(plain.count(FrameKind::Geometry), scene_->tiles().size());
}

TEST_F(ViewerStreamSettings, AnotherPositionStepSendsGeometryUnderANewRevision) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  viewer.complete();
  StreamQuality quality = viewer.stream().quality();
  EXPECT_EQ(quality.position_step_m, lattice_step(static_cast<double>(scene_->suggested_position_step_m())));
  quality.position_step_m = lattice_step(0.01);
  viewer.stream().set_quality(quality);
  viewer.complete();
  EXPECT_EQ(viewer.count(FrameKind::Geometry), 2 * scene_->tiles().size() - 1) << "of the root nothing is seen";
  EXPECT_EQ(viewer.count(FrameKind::Colours), 2 * scene_->tiles().size() - 1);
  for (const auto& [id, tile] : viewer.tiles) {
    if (id.level == 0) continue;
    EXPECT_EQ(tile.geometry.position_step_m, lattice_step(0.01));
  }
  expect_picture(viewer, *scene_, 0.3);
}

TEST_F(ViewerStreamSettings, QualityThatIsTheSameSendsNothing) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  viewer.complete();
  viewer.stream().set_quality(viewer.stream().quality());
  wait_until_idle(pool_);
  EXPECT_EQ(viewer.take(), 0U);
}

TEST_F(ViewerStreamSettings, AnEncodingThatComesBackHasANewRevisionOnTheWire) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  show(viewer, 0.3);
  viewer.complete();
  const protocol::TileId leaf = scene_->tiles().back()->id;
  const auto first = viewer.tiles.at(leaf).geometry.revision;
  const StreamQuality quality = viewer.stream().quality();
  StreamQuality coarser = quality;
  coarser.position_step_m = lattice_step(0.01);
  viewer.stream().set_quality(coarser);
  viewer.complete();
  const auto second = viewer.tiles.at(leaf).geometry.revision;
  viewer.stream().set_quality(quality);
  const auto misses = cache_.miss_count();
  viewer.complete();
  EXPECT_EQ(cache_.miss_count(), misses);
  EXPECT_GT(second, first);
  EXPECT_GT(viewer.tiles.at(leaf).geometry.revision, second);
  show(viewer, 0.6);
  viewer.complete();
  EXPECT_EQ(viewer.count(FrameKind::Geometry), 3 * scene_->tiles().size() - 2) << "of the root nothing was seen";
  expect_picture(viewer, *scene_, 0.6);
}

}  // namespace
}  // namespace spectra::stream
