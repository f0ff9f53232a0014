// What a viewer sees while a map changes beneath it: nothing coarser than before, and no hole, at any moment.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include "fake_scene.hpp"
#include "server/map/tile_place.hpp"
#include "stream_with_viewers.hpp"
#include "test_viewer.hpp"

namespace spectra::stream::testing {
namespace {

using protocol::FrameKind;
using protocol::TileId;

/// What a client has on its screen after each frame: a tile stays until another version of it can be drawn, and so do the children that it
/// names; it is replaced by its children when all that it names can be drawn.
class Screen {
 public:
  explicit Screen(bool is_raw) : is_raw_(is_raw) {}

  /// The scene whose tiles come from now on.
  void follow(std::shared_ptr<const map::SceneSnapshot> scene) { scene_ = std::move(scene); }

  void receive(const protocol::TileFrameHeader& frame) {
    const TileId id = frame.tile;
    if (frame.kind == FrameKind::Remove) {
      shown_.erase(id);
      mask_.erase(id);
      next_mask_.erase(id);
      layers_.erase(id);
      for (const auto& [other, next] : next_mask_) {
        if (!is_covered(other)) mask_[other] = next;
      }
      return;
    }
    if (frame.kind == FrameKind::Geometry) {
      layers_[id].clear();
      next_mask_[id] = frame.child_mask;
    } else {
      layers_[id].insert(frame.kind);
    }
    const bool is_whole = is_raw_ ? layers_[id].size() == 2 : !layers_[id].empty();
    if (is_whole || !is_covered(id)) mask_[id] = next_mask_[id];
    if (!is_whole) return;
    for (const auto& tile : scene_->tiles()) {
      if (tile->id == id) shown_[id] = tile->bounds;
    }
  }

  /// The finest level that is drawn at a place; nothing where there is a hole.
  std::optional<int> level_at(float x, float y) const {
    std::optional<int> finest;
    draw({0, 0, 0, 0}, [&](const TileId& id, const base::Bounds& bounds) {
      const bool is_inside = bounds.min.x < x && x < bounds.max.x && bounds.min.y < y && y < bounds.max.y;
      if (is_inside && finest.value_or(-1) < id.level) finest = id.level;
    });
    return finest;
  }

 private:
  static constexpr int kDeepest = 3;

  static TileId child_of(const TileId& id, std::uint32_t octant) {
    return {static_cast<std::uint8_t>(id.level + 1), 2 * id.x + (octant & 1), 2 * id.y + (octant >> 1 & 1), 2 * id.z};
  }
  bool can_be_drawn(const TileId& id) const { return shown_.contains(id) || is_covered(id); }
  bool is_covered(const TileId& id) const {
    const auto mask = mask_.find(id);
    if (mask == mask_.end() || mask->second == 0) return false;
    for (std::uint32_t octant = 0; octant < 4; ++octant) {
      if ((mask->second >> octant & 1) != 0 && !can_be_drawn(child_of(id, octant))) return false;
    }
    return true;
  }
  void draw(const TileId& id, const std::function<void(const TileId&, const base::Bounds&)>& visit) const {
    if (const auto own = shown_.find(id); own != shown_.end() && !is_covered(id)) return visit(id, own->second);
    for (std::uint32_t octant = 0; octant < 4 && id.level < kDeepest; ++octant) draw(child_of(id, octant), visit);
  }

  bool is_raw_;
  std::shared_ptr<const map::SceneSnapshot> scene_;
  std::map<TileId, base::Bounds> shown_;
  std::map<TileId, std::uint8_t> mask_, next_mask_;
  std::map<TileId, std::set<FrameKind>> layers_;
};

using Tiles = std::vector<std::shared_ptr<const map::Tile>>;

/// Of quadtree_tiles(3, ...): another version of a tile.
void change(Tiles& tiles, const TileId& id, const std::function<void(map::Tile&)>& how = lift_a_vertex) {
  for (auto& tile : tiles) {
    if (tile->id != id) continue;
    auto other = std::make_shared<map::Tile>(*tile);
    how(*other);
    tile = other;
  }
}

Tiles whole_tree() {
  return quadtree_tiles(3, 12);
}

/// The same, where the first leaf has what lies in the second, too.
Tiles with_joined_leaves(const Tiles& tiles) {
  Tiles joined = tiles;
  std::erase_if(joined, [](const auto& tile) { return tile->id == TileId{2, 1, 0, 0}; });
  change(joined, {2, 0, 0, 0}, [](map::Tile& leaf) {
    for (auto& position : leaf.positions) position.x *= 2;
    leaf.bounds.max.x *= 2;
  });
  change(joined, {1, 0, 0, 0}, [](map::Tile& quarter) { quarter.child_mask = 0x0d; });
  change(joined, {0, 0, 0, 0});
  return joined;
}

/// The same, where a quarter has not been seen.
Tiles without_a_quarter(const Tiles& tiles) {
  Tiles fewer;
  for (const auto& tile : tiles) {
    const TileId& id = tile->id;
    const bool is_of_quarter = id.level > 0 && id.x >> (id.level - 1) == 1 && id.y >> (id.level - 1) == 1;
    if (!is_of_quarter) fewer.push_back(tile);
  }
  change(fewer, {0, 0, 0, 0}, [](map::Tile& root) { root.child_mask = 0x07; });
  return fewer;
}

/// The first quarter alone, which is the top.
Tiles first_quarter(const Tiles& tiles) {
  Tiles few;
  for (const auto& tile : tiles) {
    const TileId& id = tile->id;
    if (id.level > 0 && id.x >> (id.level - 1) == 0 && id.y >> (id.level - 1) == 0) few.push_back(tile);
  }
  return few;
}

/// The first quarter is one leaf.
Tiles with_merged_quarter(const Tiles& tiles) {
  Tiles merged;
  for (const auto& tile : tiles) {
    const TileId& id = tile->id;
    if (id.level < 2 || id.x > 1 || id.y > 1) merged.push_back(tile);
  }
  change(merged, {1, 0, 0, 0}, [](map::Tile& quarter) {
    lift_a_vertex(quarter);
    quarter.child_mask = 0;
    quarter.geometric_error_m = 0;
  });
  change(merged, {0, 0, 0, 0});
  return merged;
}

struct Step {
  const char* name;
  Tiles before, after;
};

std::vector<Step> steps() {
  const Tiles whole = whole_tree();
  return {{"a leaf becomes two", with_joined_leaves(whole), whole},
          {"two leaves become one", whole, with_joined_leaves(whole)},
          {"a quarter comes", without_a_quarter(whole), whole},
          {"a quarter goes", whole, without_a_quarter(whole)},
          {"the map grows beyond its top", first_quarter(whole), whole},
          {"the map shrinks beneath its top", whole, first_quarter(whole)},
          {"a leaf becomes a quarter", with_merged_quarter(whole), whole},
          {"a quarter becomes a leaf", whole, with_merged_quarter(whole)}};
}

class ChangingMap : public StreamWithViewers, public ::testing::WithParamInterface<std::tuple<std::size_t, bool>> {};

TEST_P(ChangingMap, IsNeverSeenCoarserThanBeforeNorWithAHole) {
  const auto [number, is_raw] = GetParam();
  const Step step = steps()[number];
  SCOPED_TRACE(step.name);
  const auto before = scene_of(step.before);
  const auto after = std::make_shared<FakeScene>(step.after, 2, *before);
  TestViewer viewer(before, cache_, pool_);
  viewer.stream().subscribe({.fused = !is_raw, .temperature = is_raw, .visible = is_raw});
  viewer.stream().set_plan(plan_with_alpha(*before, 0.5));
  viewer.complete();
  Screen screen(is_raw);
  screen.follow(before);
  std::size_t seen = 0;
  for (; seen < viewer.frames.size(); ++seen) screen.receive(viewer.frames[seen]);
  std::vector<std::tuple<float, float, std::optional<int>>> places;
  for (int row = 0; row < 8; ++row) {
    for (int column = 0; column < 8; ++column) {
      const float x = 0.25F + 0.5F * static_cast<float>(column), y = 0.25F + 0.5F * static_cast<float>(row);
      places.emplace_back(x, y, screen.level_at(x, y));
    }
  }
  // What a place is to show in the end, where something is left there.
  Screen end(is_raw);
  end.follow(after);
  {
    TestViewer other(after, cache_, pool_);
    other.stream().subscribe({.fused = !is_raw, .temperature = is_raw, .visible = is_raw});
    other.stream().set_plan(plan_with_alpha(*before, 0.5));
    other.complete();
    for (const auto& frame : other.frames) end.receive(frame);
  }

  screen.follow(after);
  viewer.stream().set_scene(after);
  bool is_complete = false;
  while (!is_complete) {
    viewer.take(1);
    for (; seen < viewer.frames.size(); ++seen) {
      screen.receive(viewer.frames[seen]);
      const auto& frame = viewer.frames[seen];
      for (const auto& [x, y, was] : places) {
        const std::optional<int> in_the_end = end.level_at(x, y), is = screen.level_at(x, y);
        if (!was || !in_the_end) continue;
        ASSERT_TRUE(is) << "a hole at " << x << ", " << y << " after frame " << static_cast<int>(frame.kind) << " of "
                        << int{frame.tile.level} << "/" << frame.tile.x << "/" << frame.tile.y;
        EXPECT_GE(*is, std::min(*was, *in_the_end))
            << x << ", " << y << " after frame " << static_cast<int>(frame.kind) << " of " << int{frame.tile.level}
            << "/" << frame.tile.x << "/" << frame.tile.y;
      }
    }
    wait_until_idle(pool_);
    is_complete = viewer.stream().take_complete().has_value();
  }
  for (const auto& [x, y, was] : places) EXPECT_EQ(screen.level_at(x, y), end.level_at(x, y)) << x << ", " << y;
}

TEST_F(StreamWithViewers, WhatChangesAllTheTimeDoesNotKeepAwayWhatIsLacking) {
  Tiles now = whole_tree();
  std::uint32_t revision = 1;
  const auto first = scene_of(now, revision);
  TestViewer viewer(first, cache_, pool_);
  viewer.stream().subscribe({});
  viewer.stream().set_plan(plan_with_alpha(*first, 0.5));
  // Between two changes of the root there is time for geometry and colours of one tile.
  constexpr std::size_t kFramesBetween = 2;
  std::size_t root_count = 0;
  for (std::size_t turn = 0; turn < 2 * now.size() + 2; ++turn) {
    for (std::size_t taken = 0; taken < kFramesBetween;) {
      wait_until_idle(pool_);
      const std::size_t count = viewer.take(kFramesBetween - taken);
      if (count == 0) break;
      taken += count;
    }
    change(now, {0, 0, 0, 0});
    viewer.stream().set_scene(std::make_shared<FakeScene>(now, ++revision, *first));
  }
  for (const auto& frame : viewer.frames)
    root_count += frame.kind == FrameKind::Geometry && frame.tile.level == 0 ? 1 : 0;
  EXPECT_EQ(viewer.tiles.size(), now.size()) << "everything came in turn with the root";
  EXPECT_GE(root_count, 4U) << "in turn with its quarters, which are drawn in its place then";
}

/// A little more changes each time than comes. What is said to be shown is: of each leaf what it was by then, or newer; and that goes on.
TEST_F(StreamWithViewers, WhatIsShownOfAMapThatIsHardlyEverCompleteIsSaid) {
  Tiles now = whole_tree();
  std::vector<TileId> leaves;
  for (const auto& tile : now) {
    if (tile->child_mask == 0) leaves.push_back(tile->id);
  }
  std::uint32_t revision = 1;
  std::map<TileId, std::vector<std::uint32_t>> changes;
  for (const TileId& id : leaves) changes[id].push_back(revision);
  const auto first = scene_of(now, revision);
  TestViewer viewer(first, cache_, pool_);
  viewer.stream().subscribe({});
  EXPECT_EQ(viewer.stream().stats().shown_revision, 0U) << "without settings there is no picture";
  viewer.stream().set_plan(plan_with_alpha(*first, 0.5));
  std::map<TileId, std::uint32_t> geometry_of, shown_of;  // Revisions of the scene.
  std::size_t seen = 0, complete_count = 0;
  std::uint32_t last_shown = 0;
  std::uint32_t random = 1;
  constexpr std::size_t kTurns = 150;
  for (std::size_t turn = 0; turn < kTurns; ++turn) {
    wait_until_idle(pool_);
    viewer.take(3);
    for (; seen < viewer.frames.size(); ++seen) {
      const auto& frame = viewer.frames[seen];
      if (frame.kind == FrameKind::Geometry) geometry_of[frame.tile] = revision;
      if (frame.kind == FrameKind::Colours) shown_of[frame.tile] = geometry_of[frame.tile];
    }
    if (viewer.stream().take_complete()) ++complete_count;
    const auto stats = viewer.stream().stats();
    EXPECT_EQ(stats.generation, 1U);
    EXPECT_GE(stats.shown_revision, last_shown);
    last_shown = stats.shown_revision;
    for (const TileId& id : leaves) {
      for (const std::uint32_t changed : changes[id]) {
        if (changed > last_shown) continue;
        EXPECT_GE(shown_of[id], changed) << "turn " << turn;
      }
    }
    ++revision;
    for (int i = 0; i < 2; ++i) {
      random = random * 1664525U + 1013904223U;
      TileId id = leaves[static_cast<std::size_t>(random >> 8) % leaves.size()];
      changes[id].push_back(revision);
      change(now, id);
      while (id.level > 0) change(now, id = map::parent_of(id));
    }
    viewer.stream().set_scene(std::make_shared<FakeScene>(now, revision, *first));
  }
  EXPECT_LT(complete_count, kTurns / 10);
  EXPECT_GT(last_shown, revision / 2);
  EXPECT_LT(last_shown + 1, revision);
  // Of newer settings nothing is shown yet.
  viewer.stream().set_plan(plan_with_alpha(*first, 0.3));
  EXPECT_EQ(viewer.stream().stats().generation, 2U);
  EXPECT_LT(viewer.stream().stats().shown_revision, revision);
  viewer.complete();
  EXPECT_EQ(viewer.stream().stats().shown_revision, revision);
}

/// The tiles of a map that comes after another: what has changed is new, never one that was there before.
Tiles successors(const Tiles& before, const Tiles& next) {
  Tiles result;
  for (const auto& tile : next) {
    const auto is_same = [&](const auto& other) {
      return other->id == tile->id && other->child_mask == tile->child_mask && other->positions == tile->positions;
    };
    const auto same = std::find_if(before.begin(), before.end(), is_same);
    result.push_back(same != before.end() ? *same : std::make_shared<map::Tile>(*tile));
  }
  return result;
}

/// Any of the steps' maps after any other, while only a part of what the one before takes has come: all of the last one comes, and
/// nothing of others stays.
TEST_F(StreamWithViewers, AMapThatChangesFasterThanItComesIsTheLastOneInTheEnd) {
  std::vector<Tiles> maps;
  for (const Step& step : steps()) {
    maps.push_back(step.before);
    maps.push_back(step.after);
  }
  std::uint32_t random = 1;
  const auto any = [&random](std::size_t count) {
    random = random * 1664525U + 1013904223U;
    return static_cast<std::size_t>(random >> 8) % count;
  };
  for (int round = 0; round < 40; ++round) {
    const bool is_raw = round % 4 == 3;
    std::uint32_t revision = 1;
    Tiles now = maps[any(maps.size())];
    const auto first = scene_of(now, revision);
    TestViewer viewer(first, cache_, pool_);
    viewer.stream().subscribe({.fused = !is_raw, .temperature = is_raw, .visible = is_raw});
    viewer.stream().set_plan(plan_with_alpha(*first, 0.5));
    std::shared_ptr<const map::SceneSnapshot> last = first;
    for (int step = 0; step < 6; ++step) {
      wait_until_idle(pool_);
      viewer.take(any(12));
      now = successors(now, maps[any(maps.size())]);
      last = std::make_shared<FakeScene>(now, ++revision, *first);
      viewer.stream().set_scene(last);
    }
    EXPECT_EQ(viewer.complete().scene_revision, revision);
    std::set<TileId> wanted, held;
    for (const auto& tile : last->tiles()) wanted.insert(tile->id);
    for (const auto& [id, tile] : viewer.tiles) held.insert(id);
    EXPECT_EQ(held, wanted) << "round " << round;
    // What is drawn in the end has its raw layers.
    for (const auto& tile : last->tiles()) {
      if (!is_raw || tile->child_mask != 0) continue;
      EXPECT_EQ(viewer.tiles.at(tile->id).visible.size(), tile->positions.size()) << "round " << round;
      EXPECT_EQ(viewer.tiles.at(tile->id).temperature.codes.size(), tile->positions.size()) << "round " << round;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Steps, ChangingMap,
                         ::testing::Combine(::testing::Range(std::size_t{0}, steps().size()), ::testing::Bool()));

}  // namespace
}  // namespace spectra::stream::testing
