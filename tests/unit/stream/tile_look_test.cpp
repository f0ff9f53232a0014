#include "server/stream/tile_look.hpp"

#include <gtest/gtest.h>

#include "fake_scene.hpp"
#include "stream_with_viewers.hpp"
#include "test_viewer.hpp"

namespace spectra::stream {
namespace {

using protocol::FrameKind;
using testing::TestViewer;

constexpr double kHalfLife_s = 100;

LookRules fading_at(double now_s) {
  return {.age = fusion::AgeSteps(kHalfLife_s), .now_s = now_s, .compares_with_baseline = false, .baseline_mark = {}};
}

TEST(TileLook, IsOfAgeOnlyWhereSomethingHasAged) {
  map::Tile tile;
  tile.seen_at.distinct = {1000, 1100, map::kUnknownTime};
  EXPECT_EQ(look_of(tile, {}), "");
  EXPECT_EQ(look_of(tile, fading_at(1000)), "") << "all is as it would be without fading";
  const TileLook aged = look_of(tile, fading_at(1100));
  EXPECT_EQ(aged, "-488") << "half of the first, all of the second and of what has no time";
  const double next_s = next_look_s(tile, fading_at(1100));
  EXPECT_EQ(look_of(tile, fading_at(next_s - 1e-6)), aged);
  EXPECT_NE(look_of(tile, fading_at(next_s + 1e-6)), aged);
  EXPECT_EQ(look_of(tile, fading_at(1e6)), "-008");
  EXPECT_EQ(next_look_s(tile, fading_at(1e6)), std::numeric_limits<double>::infinity());
}

TEST(TileLook, IsOfTheBaselineOnlyWhereAMethodAsksForIt) {
  map::Tile tile;
  tile.temperature_celsius = {20};
  LookRules rules;
  rules.baseline_mark = 3;
  EXPECT_EQ(look_of(tile, rules), "");
  rules.compares_with_baseline = true;
  const TileLook themselves = look_of(tile, rules);
  tile.baseline_celsius = {18};
  tile.baseline_mark = 3;
  const TileLook kept = look_of(tile, rules);
  EXPECT_NE(kept, themselves);
  rules.baseline_mark = 4;
  EXPECT_EQ(look_of(tile, rules), themselves) << "a mark makes all of it the baseline";
  rules.baseline_mark.reset();
  EXPECT_NE(look_of(tile, rules), themselves)
      << "nothing to compare with is another thing than nothing that has changed";
}

/// A root over six leaves, the first seen long before the others.
class StreamOfAges : public testing::StreamWithViewers {
 protected:
  StreamOfAges() {
    std::vector<std::shared_ptr<const map::Tile>> tiles;
    for (const auto& tile : testing::tiles_of_tree(6)) {
      const auto copy = std::make_shared<map::Tile>(*tile);
      copy->seen_at.distinct = {tiles.size() == 1 ? 1000.0 : 2000.0};
      tiles.push_back(copy);
    }
    scene_ = testing::scene_of(std::move(tiles));
  }

  fusion::FusionPlan plan_with(const fusion::FusionChange& change) const {
    const auto settings = fusion::with_change(fusion::default_settings(), change).value();
    return fusion::FusionPlan::prepare(settings, scene_->temperature()).value();
  }
  fusion::FusionPlan fading_plan() const {
    fusion::FusionChange change;
    change.age = {fusion::AgeMode::Fade, kHalfLife_s};
    return plan_with(change);
  }
};

TEST_F(StreamOfAges, OnlyTheTilesThatHaveAgedByAStepAreSentAnew) {
  TestViewer viewer(scene_, cache_, pool_);
  viewer.stream().subscribe({});
  viewer.stream().set_time(2000);
  viewer.stream().set_plan(fading_plan());
  viewer.complete();
  const auto is_grey = [&](std::size_t tile) {
    const auto& colours = viewer.tiles.at(scene_->tiles()[tile]->id).colours;
    return std::all_of(colours.begin(), colours.end(), [](const auto& c) { return c[0] == c[1] && c[1] == c[2]; });
  };
  EXPECT_TRUE(is_grey(1));
  EXPECT_FALSE(is_grey(2));
  const std::size_t before = viewer.frames.size();
  viewer.stream().set_time(2001);
  EXPECT_EQ(viewer.take(), 0U) << "no step has passed";
  viewer.stream().set_time(2010);
  EXPECT_EQ(viewer.complete().generation, 1U);
  EXPECT_EQ(viewer.frames.size(), before + 6) << "the root and the five that are not grey yet";
  viewer.stream().set_time(2500);
  viewer.complete();
  EXPECT_TRUE(is_grey(2));
  viewer.stream().set_time(9000);
  EXPECT_EQ(viewer.take(), 0U) << "grey stays grey";
  EXPECT_EQ(viewer.count(FrameKind::Geometry), scene_->tiles().size());
}

TEST_F(StreamOfAges, ViewersShareWhatLooksTheSame) {
  TestViewer one(scene_, cache_, pool_), other(scene_, cache_, pool_);
  for (TestViewer* viewer : {&one, &other}) viewer->stream().subscribe({});
  one.stream().set_time(2010.1);
  one.stream().set_plan(fading_plan());
  one.complete();
  const auto made = cache_.miss_count();
  other.stream().set_time(2011.9);
  other.stream().set_plan(fading_plan());
  other.complete();
  EXPECT_EQ(cache_.miss_count(), made);
  // Without fading, at the same settings, the fresh ones are the same again.
  other.stream().set_time(2000);
  other.stream().set_plan(plan_with({}));
  other.complete();
  const auto plain = cache_.miss_count();
  one.stream().set_time(2000);
  one.stream().set_plan(fading_plan());
  one.complete();
  EXPECT_EQ(cache_.miss_count(), plain) << "the one that is grey was made before";
}

}  // namespace
}  // namespace spectra::stream
