#include "server/map/living_map.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "tests/unit/map/generated_scene.hpp"

namespace spectra::map {
namespace {

using mesh::MultispectralMesh;

constexpr LivingMap::Options kOptions{.leaf_vertex_count = 1000, .first_level = 6};

BlockPut put(const std::string& id, mesh::MultispectralMesh mesh, std::vector<files::Note> notes = {}) {
  files::LoadedScene scene;
  scene.mesh = std::move(mesh);
  scene.mesh.name = id + ".ply";
  scene.notes = std::move(notes);
  return {.id = id, .scene = std::move(scene), .observed_at = {}};
}

/// A terrain that lies `x` metres along.
mesh::MultispectralMesh terrain(std::uint32_t seed, float x, float warmer = 0) {
  mesh::MultispectralMesh mesh = testing::terrain({.columns = 40, .rows = 40, .seed = seed});
  for (base::Vec3f& p : mesh.positions()) p.x += x;
  for (float& t : mesh.temperature_celsius()) t += warmer;
  return mesh;
}

class LivingMapTest : public ::testing::Test {
 protected:
  std::shared_ptr<const SceneSnapshot> apply(std::vector<BlockPut> blocks, std::vector<std::string> removed = {}) {
    return map_.apply({.put = std::move(blocks), .removed = std::move(removed)}, ++revision_, pool_);
  }
  std::shared_ptr<const SceneSnapshot> apply(BlockPut block) {
    std::vector<BlockPut> blocks;
    blocks.push_back(std::move(block));
    return apply(std::move(blocks));
  }

  /// With all coarse tiles; there are some to be made.
  std::shared_ptr<const SceneSnapshot> completed() {
    std::shared_ptr<const SceneSnapshot> scene;
    while (auto work = map_.next_coarse()) {
      work->run();
      scene = map_.take_coarse(*work, ++revision_);
    }
    return scene;
  }

  jobs::WorkerPool pool_{2};
  LivingMap map_{kOptions};
  std::uint32_t revision_ = 0;
};

TEST_F(LivingMapTest, BeginsEmptyAndMayBecomeEmptyAgain) {
  EXPECT_TRUE(apply(std::vector<BlockPut>{})->tiles().empty());
  EXPECT_GT(apply(std::vector<BlockPut>{})->suggested_position_step_m(), 0);
  EXPECT_FALSE(apply(put("a", terrain(1, 0)))->tiles().empty());
  const auto empty = apply(std::vector<BlockPut>{}, {"a", "nobody"});
  EXPECT_TRUE(empty->tiles().empty());
  EXPECT_EQ(empty->vertex_count(), 0U);
  EXPECT_FALSE(empty->temperature().summary.has_temperature());
}

TEST_F(LivingMapTest, SharesTilesThatAreTheSameWithTheVersionBefore) {
  std::vector<BlockPut> blocks;
  for (std::uint32_t i = 0; i < 12; ++i) {
    blocks.push_back(put("b" + std::to_string(i), terrain(i, 39.0F * static_cast<float>(i))));
  }
  const auto before = apply(std::move(blocks));
  const auto after = apply(put("b0", terrain(77, 0)));
  std::size_t same = 0;
  for (const auto& tile : after->tiles()) {
    same += static_cast<std::size_t>(std::ranges::count(before->tiles(), tile));
  }
  EXPECT_GT(same, after->tiles().size() / 2);
  EXPECT_LT(same, after->tiles().size());
}

TEST_F(LivingMapTest, ABlockThatIsPutAgainAsItIsLeavesAllTilesAsTheyAre) {
  apply(put("a", terrain(1, 0)));
  apply(put("b", terrain(2, 39)));
  const auto before = completed();
  const auto again = apply(put("b", terrain(2, 39)));
  EXPECT_TRUE(std::ranges::equal(again->tiles(), before->tiles()));
  EXPECT_FALSE(map_.is_behind());
  mesh::MultispectralMesh warmer = terrain(2, 39);
  warmer.temperature_celsius()[5] += 1;
  EXPECT_FALSE(std::ranges::equal(apply(put("b", std::move(warmer)))->tiles(), before->tiles()));
  BlockPut later = put("a", terrain(1, 0));
  later.observed_at = 17;
  EXPECT_EQ(apply(std::move(later))->observed(), std::pair(17.0, 17.0));
}

TEST_F(LivingMapTest, TakesWhatIsEmptiedToAnotherPlace) {
  MultispectralMesh far = terrain(2, 0);
  far.origin = {691'000, 5'334'000, 0};
  apply(put("a", terrain(1, 0)));
  const auto first = *map_.constants();
  apply(std::vector<BlockPut>{}, {"a"});
  EXPECT_FALSE(map_.constants());
  const std::vector<base::Vec3f> positions(far.positions().begin(), far.positions().end());
  const auto scene = apply(put("b", std::move(far)));
  EXPECT_EQ(scene->origin(), (base::Vec3d{691'000, 5'334'000, 0}));
  EXPECT_NE(map_.constants()->grid.corner_m(), first.grid.corner_m());
  EXPECT_TRUE(std::ranges::equal(scene->block_mesh("b")->positions(), positions));
}

// What is far away has tiles of its own, however little it is, and leaves all others as they are.
TEST(LivingMapWithRoom, HasNoTileOfTheFullMeshThatReachesFromNearToFar) {
  jobs::WorkerPool pool(2);
  for (const std::uint32_t leaf_size : {400U, 32'000U}) {
    LivingMap map({.leaf_vertex_count = leaf_size, .first_level = 12});
    std::uint32_t revision = 0;
    const auto with = [&](BlockPut block) {
      MapChange change;
      change.put.push_back(std::move(block));
      return map.apply(std::move(change), ++revision, pool);
    };
    const auto before = with(put("near", terrain(1, 0)));
    const auto after = with(put("stray", terrain(2, 60'000)));
    std::size_t far_count = 0;
    for (const auto& tile : after->tiles()) {
      if (tile->child_mask != 0) continue;
      EXPECT_LT(tile->bounds.max.x - tile->bounds.min.x, 100);
      if (tile->bounds.min.x > 1000) ++far_count;
    }
    EXPECT_GT(far_count, 0U);
    for (const auto& tile : before->tiles()) {
      if (tile->child_mask != 0) continue;
      EXPECT_EQ(std::ranges::count(after->tiles(), tile), 1) << "the same, not made again";
    }
  }
}

TEST_F(LivingMapTest, CoreIsWithoutTheFewBlocksThatLieFarAway) {
  const auto surveyed = [](const std::string& id, std::uint32_t side, float x) {
    MultispectralMesh mesh = testing::terrain({.columns = side, .rows = side, .seed = 3});
    for (base::Vec3f& p : mesh.positions()) p.x += x;
    BlockPut block = put(id, std::move(mesh));
    block.scene.core_bounds = base::bounds_of(block.scene.mesh.positions());
    return block;
  };
  const auto note = [](const SceneSnapshot& scene) {
    const auto found = std::ranges::find(scene.notes(), "stray_blocks", &files::Note::id);
    return found == scene.notes().end() ? std::string() : found->message;
  };
  apply(surveyed("a", 60, 0));
  auto scene = apply(surveyed("b", 10, 100));
  EXPECT_GT(scene->core_bounds().max.x, 100) << "it is near";
  EXPECT_EQ(note(*scene), "");
  scene = apply(surveyed("c", 10, 9000));
  EXPECT_LT(scene->core_bounds().max.x, 200);
  EXPECT_GT(scene->core_bounds().max.x, 100);
  EXPECT_GT(scene->bounds().max.x, 9000);
  EXPECT_TRUE(note(*scene).starts_with("Block c lies far from everything else, up to 8.8")) << note(*scene);
  scene = apply(surveyed("d", 60, 9000));
  EXPECT_GT(scene->core_bounds().max.x, 9000) << "half of the map is no stray";
  EXPECT_EQ(note(*scene), "");
  // Whichever of them came first, and however heavy: the others are the map.
  std::vector<BlockPut> many;
  for (int i = 0; i < 40; ++i) many.push_back(surveyed("m" + std::to_string(i), 30, static_cast<float>(30 * i)));
  scene = apply(std::move(many), {"a", "b", "c"});
  EXPECT_LT(scene->core_bounds().max.x, 1500);
  EXPECT_TRUE(note(*scene).starts_with("Block d lies")) << note(*scene);
}

TEST_F(LivingMapTest, KeepsHowSureTemperaturesAreWhereThatIsKnown) {
  const auto sure = [](std::uint32_t seed, float x, float sigma, double at) {
    mesh::MultispectralMesh mesh = terrain(seed, x);
    mesh.confidence.sigma_kelvin.assign(mesh.vertex_count(), sigma);
    mesh.confidence.looked_at.assign(mesh.vertex_count(), at);
    return mesh;
  };
  std::vector<BlockPut> blocks;
  for (std::uint32_t i = 0; i < 12; ++i) {
    const float x = 39.0F * static_cast<float>(i);
    const std::string id = "b" + std::to_string(i);
    blocks.push_back(i < 6 ? put(id, sure(i, x, 0.25F, 1.7e9 + i)) : put(id, terrain(i, x)));
  }
  const base::Vec3f there = terrain(2, 78).positions()[700], unknown = terrain(9, 351).positions()[700];
  apply(std::move(blocks));
  auto scene = completed();
  const auto probe = scene->probe(there);
  EXPECT_EQ(probe->sigma_kelvin, 0.25F);
  EXPECT_EQ(probe->looked_at, 1.7e9 + 2);
  EXPECT_EQ(scene->probe(unknown)->sigma_kelvin, std::nullopt);
  std::size_t sure_coarse = 0;
  for (const auto& tile : scene->tiles()) {
    const bool has_any = std::ranges::any_of(tile->sigma_kelvin, [](float s) { return s == 0.25F; });
    EXPECT_EQ(has_any, !tile->sigma_kelvin.empty()) << "costs something only where it is known";
    EXPECT_EQ(has_any, tile->bounds.min.x < 6 * 39 - 0.1F);
    if (has_any && tile->child_mask != 0) ++sure_coarse;
  }
  EXPECT_GT(sure_coarse, 0U);
  const mesh::MultispectralMesh whole = scene->whole_mesh();
  ASSERT_EQ(whole.confidence.sigma_kelvin.size(), whole.vertex_count());
  EXPECT_EQ(std::ranges::count(whole.confidence.sigma_kelvin, 0.25F), 6 * 40 * 40);
  EXPECT_EQ(scene->block_mesh("b3")->confidence.looked_at[5], 1.7e9 + 3);
  EXPECT_TRUE(scene->block_mesh("b7")->confidence.empty());

  // A block that comes in the place of another brings its own; a clock that does not count from 1970 tells no time.
  apply(put("b2", sure(2, 78, 0.5F, 17)));
  scene = apply(put("b3", terrain(3, 117)));
  EXPECT_EQ(scene->probe(there)->sigma_kelvin, 0.5F);
  EXPECT_EQ(scene->probe(there)->looked_at, std::nullopt);
  EXPECT_EQ(scene->probe(terrain(3, 117).positions()[700])->sigma_kelvin, std::nullopt);
}

TEST_F(LivingMapTest, CoarseTilesFollowAfterTheLeaves) {
  LivingMap other(kOptions);
  std::vector<BlockPut> only;
  only.push_back(put("whole", terrain(1, 0)));
  other.apply({.put = std::move(only), .removed = {}}, 1, pool_);
  EXPECT_FALSE(other.is_behind()) << "what is built at once is complete";
  std::vector<BlockPut> blocks;
  for (std::uint32_t i = 0; i < 12; ++i) {
    blocks.push_back(put("b" + std::to_string(i), terrain(i, 39.0F * static_cast<float>(i))));
  }
  apply(std::move(blocks));
  const auto before = completed();
  const auto at_once = apply(put("b0", terrain(0, 0, 0.5F)));
  EXPECT_TRUE(map_.is_behind());
  std::size_t changed_leaves = 0;
  for (const auto& tile : at_once->tiles()) {
    const bool is_same = std::ranges::count(before->tiles(), tile) > 0;
    EXPECT_TRUE(is_same || tile->child_mask == 0) << "a coarse tile takes time";
    if (!is_same) ++changed_leaves;
  }
  EXPECT_GT(changed_leaves, 0U);

  // What changes while a tile is being made is shown in the next round.
  auto work = map_.next_coarse();
  ASSERT_TRUE(work);
  EXPECT_GT(work->from()->id.level, before->tiles().front()->id.level) << "fine before coarse";
  apply(put("b0", terrain(0, 0, 1)));
  work->run();
  map_.take_coarse(*work, ++revision_);
  EXPECT_TRUE(map_.is_behind());
  const auto complete = completed();
  EXPECT_FALSE(map_.is_behind());
  for (const auto& tile : complete->tiles()) {
    EXPECT_EQ(tile->child_mask == 0, tile->geometric_error_m == 0);
  }
  EXPECT_NE(complete->tiles()[0], before->tiles()[0]);
}

TEST_F(LivingMapTest, ALeafThatHasGrownSaysThatAnythingMayBeBesideIt) {
  std::vector<BlockPut> blocks;
  for (std::uint32_t i = 1; i < 12; ++i) {
    blocks.push_back(put("b" + std::to_string(i), terrain(i, 39.0F * static_cast<float>(i))));
  }
  blocks.push_back(put("small", testing::terrain({.columns = 20, .rows = 20, .seed = 50})));
  apply(std::move(blocks));
  const auto before = completed();
  const auto at_once = apply(put("small", terrain(50, 0)));
  std::size_t grown = 0;
  for (const auto& tile : at_once->tiles()) {
    const auto old = std::ranges::find(before->tiles(), tile->id, [](const auto& t) { return t->id; });
    if (old == before->tiles().end() || (*old)->child_mask != 0 || tile->child_mask == 0) continue;
    ++grown;
    EXPECT_EQ(tile->colour_error_levels, 255) << "nothing is exact about it";
    EXPECT_GE(tile->temperature_error_celsius, (*old)->highest_celsius - (*old)->lowest_celsius);
    EXPECT_GT(tile->geometric_error_m, 0);
  }
  EXPECT_GT(grown, 0U);
  // Also of what comes before it is made anew.
  const auto hot = apply(put("small", terrain(50, 0, 500)));
  std::size_t placeholders = 0;
  for (const auto& tile : hot->tiles()) {
    if (tile->colour_error_levels < 255) continue;
    ++placeholders;
    EXPECT_GE(tile->temperature_error_celsius, 400);
  }
  EXPECT_GT(placeholders, 0U);
  const auto complete = completed();
  for (const auto& tile : complete->tiles()) EXPECT_LT(tile->colour_error_levels, 255);
}

TEST_F(LivingMapTest, GivesABlockBackAsItWasPut) {
  const mesh::MultispectralMesh one = terrain(1, 0), other = terrain(2, 39);
  std::vector<BlockPut> blocks;
  blocks.push_back(put("z", terrain(1, 0)));
  blocks.push_back(put("a", terrain(2, 39)));
  const auto scene = apply(std::move(blocks));
  const auto back = scene->block_mesh("z");
  ASSERT_TRUE(back);
  EXPECT_TRUE(std::ranges::equal(back->positions(), one.positions()));
  EXPECT_TRUE(std::ranges::equal(back->visible(), one.visible()));
  EXPECT_EQ(back->triangles(), one.triangles());
  EXPECT_EQ(back->name, "z.ply");
  EXPECT_FALSE(scene->block_mesh("y"));
  // In the whole mesh blocks stand in the order of their names, and every vertex of a leaf says where.
  const mesh::MultispectralMesh whole = scene->whole_mesh();
  EXPECT_EQ(whole.positions()[0], other.positions()[0]);
  EXPECT_EQ(whole.positions()[other.vertex_count()], one.positions()[0]);
  for (const auto& tile : scene->tiles()) {
    for (std::size_t v = 0; tile->child_mask == 0 && v < tile->positions.size(); ++v) {
      ASSERT_EQ(whole.positions()[scene->vertex_index(*tile, v)], tile->positions[v]);
    }
  }
}

TEST_F(LivingMapTest, IsNamedByTheBlockThatCameFirst) {
  mesh::MultispectralMesh mesh = terrain(1, 0);
  mesh.up = base::UpAxis::MinusY;
  mesh.told = {mesh.up, "feet"};
  apply(put("m", std::move(mesh)));
  const auto scene = apply(put("a", terrain(2, 39)));
  EXPECT_EQ(scene->name(), "m.ply");
  EXPECT_EQ(scene->up(), base::UpAxis::MinusY);
  EXPECT_EQ(scene->whole_mesh().told.up, base::UpAxis::MinusY);
  EXPECT_EQ(scene->whole_mesh().told.unit, "feet");
}

TEST_F(LivingMapTest, SaysANoteOfAKindOnceHoweverManyBlocksHaveIt) {
  const files::Note holes{"holes", 3, "3 vertices have no position", false};
  const files::Note urgent{"unit_told", 1, "this is in feet", true};
  EXPECT_EQ(apply(put("a", terrain(1, 0), {holes}))->notes()[0].message, holes.message);
  apply(put("b", terrain(2, 39), {holes, urgent}));
  const auto scene = apply(put("c", terrain(3, 78), {holes}));
  ASSERT_EQ(scene->notes().size(), 2U);
  EXPECT_EQ(scene->notes()[0].count, 9U);
  EXPECT_EQ(scene->notes()[0].message, "block c: 3 vertices have no position (and 2 more blocks)");
  EXPECT_TRUE(scene->notes()[1].needs_attention);
}

TEST_F(LivingMapTest, AutomaticValuesFollowWhenTheyHaveMovedFarEnough) {
  std::vector<BlockPut> blocks;
  for (std::uint32_t i = 0; i < 10; ++i) {
    blocks.push_back(put("b" + std::to_string(i), terrain(i, 39.0F * static_cast<float>(i))));
  }
  const auto first = apply(std::move(blocks));
  EXPECT_EQ(first->reference_temperature()->summary.mean, first->temperature().summary.mean);
  const auto like_before = apply(put("b3", terrain(3, 39 * 3, 0.01F)));
  EXPECT_EQ(like_before->reference_temperature(), first->reference_temperature());
  EXPECT_NE(like_before->temperature().summary.mean, first->temperature().summary.mean) << "what is told is exact";
  const auto hotter = apply(put("b3", terrain(3, 39 * 3, 20)));
  EXPECT_NE(hotter->reference_temperature(), first->reference_temperature());
  EXPECT_EQ(hotter->reference_temperature()->summary.maximum, hotter->temperature().summary.maximum);
  // What is put again nearly as it was moves nothing, until all of it was.
  auto last = hotter;
  float warmer = 0;
  const auto put_again = [&](std::uint32_t i) {
    warmer += 0.001F;
    last = apply(put("b" + std::to_string(i), terrain(i, 39.0F * static_cast<float>(i), warmer + (i == 3 ? 20 : 0))));
  };
  for (std::uint32_t i = 0; i < 5; ++i) put_again(i);
  EXPECT_EQ(last->reference_temperature(), hotter->reference_temperature());
  for (std::uint32_t i = 0; i < 10; ++i) put_again(i);
  EXPECT_NE(last->reference_temperature(), hotter->reference_temperature());
  // Where most lie moves while mean and extremes hardly do.
  const auto before = last;
  const auto squeezed = [](std::uint32_t i) {
    mesh::MultispectralMesh mesh = terrain(i, 39.0F * static_cast<float>(i));
    for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
      mesh.temperature_celsius()[v] = v % 2 == 0 ? 18.0F : 22.0F;
    }
    return mesh;
  };
  for (std::uint32_t i = 0; i < 3; ++i) last = apply(put("b" + std::to_string(i), squeezed(i)));
  EXPECT_NE(last->reference_temperature(), before->reference_temperature());
}

TEST_F(LivingMapTest, HistogramsAreThoseOfTheVersionWhateverItsExtremes) {
  const auto counted = [](const SceneSnapshot& scene) {
    const fusion::TemperatureSummary& summary = scene.temperature().summary;
    fusion::Histogram all{summary.minimum, summary.maximum, std::vector<std::uint64_t>(fusion::kPercentileBins)};
    for (const auto& tile : scene.tiles()) {
      if (tile->child_mask == 0) {
        fusion::add_to_histogram(std::span(tile->temperature_celsius).first(tile->owned_count), all);
      }
    }
    return all;
  };
  const auto expect_counted = [&](const SceneSnapshot& scene) {
    const fusion::Histogram told = scene.temperature().histogram(fusion::kPercentileBins), all = counted(scene);
    EXPECT_EQ(told.minimum, all.minimum);
    EXPECT_EQ(told.maximum, all.maximum);
    EXPECT_EQ(told.counts, all.counts);
  };
  const auto block = [](std::uint32_t i, float warmer) {
    return put("b" + std::to_string(i), terrain(i, 39.0F * static_cast<float>(i), warmer));
  };
  std::vector<BlockPut> blocks;
  for (std::uint32_t i = 0; i < 10; ++i) blocks.push_back(block(i, 0));
  expect_counted(*apply(std::move(blocks)));
  // Extremes that move so little that automatic values stay, and come back; then what leaves them; then what moves all.
  for (const float warmer : {0.01F, 0.02F, 0.01F, 0.0F, 20.0F, 0.0F}) expect_counted(*apply(block(9, warmer)));
  for (std::uint32_t i = 0; i < 9; ++i) expect_counted(*apply(block(i, 0.001F)));
}

TEST_F(LivingMapTest, RefusesWhatCannotBeOneMap) {
  apply(put("mesh", terrain(1, 0)));
  const auto code = [&](const BlockShape& shape, const std::vector<std::string>& removed = {}) {
    const auto refused = map_.refusal_of({&shape, 1}, removed);
    return refused ? static_cast<int>(refused->code) : 0;
  };
  EXPECT_EQ(code({"more", 10, true}), 0);
  EXPECT_EQ(code({"points", 10, false}), static_cast<int>(base::ErrorCode::Unsupported));
  EXPECT_EQ(code({"points", 10, false}, {"mesh"}), 0);
  EXPECT_EQ(code({"mesh", 10, false}), 0) << "it takes the place of the only other one";
  EXPECT_EQ(code({"nothing", 0, true}), static_cast<int>(base::ErrorCode::Unsupported));
  EXPECT_EQ(code({"large", 0xffffffff, true}), static_cast<int>(base::ErrorCode::TooLarge));
}

TEST(LivingMapOfAFile, HasSmallerLeavesWhereBlocksComeAndGo) {
  jobs::WorkerPool pool{2};
  LivingMap map({.leaf_vertex_count = 2000, .settled_block = "file", .first_level = 6});
  auto change = [&, revision = 0u](BlockPut block, std::vector<std::string> removed = {}) mutable {
    MapChange of{.put = {}, .removed = std::move(removed)};
    if (!block.id.empty()) of.put.push_back(std::move(block));
    return map.apply(std::move(of), ++revision, pool);
  };
  const auto leaves = [](const SceneSnapshot& scene) {
    std::vector<std::shared_ptr<const Tile>> found;
    for (const auto& tile : scene.tiles())
      if (tile->child_mask == 0) found.push_back(tile);
    return found;
  };
  // 6,400 vertices in a square of which the block covers a corner.
  const auto before = leaves(*change(put("file", testing::terrain({.columns = 80, .rows = 80, .seed = 1}))));
  const auto after = leaves(*change(put("new", testing::terrain({.columns = 10, .rows = 10, .seed = 2}))));
  std::size_t kept = 0, smaller = 0;
  for (const auto& leaf : after) {
    kept += static_cast<std::size_t>(std::count(before.begin(), before.end(), leaf));
    if (!leaf->vertex_block.empty()) {
      ++smaller;
      EXPECT_LE(leaf->owned_count, 2000u / kSmallerWhereChanging * 5 / 4);
    }
  }
  EXPECT_GE(smaller, 1u);
  EXPECT_GE(kept, before.size() - 1) << "leaves elsewhere stay as they are";
  EXPECT_GT(after.size(), before.size());
  const auto again = leaves(*change({}, {"new"}));
  EXPECT_EQ(again.size(), before.size()) << "without the block they are as they were";
}

}  // namespace
}  // namespace spectra::map
