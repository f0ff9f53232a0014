#include "server/stream/frame_cache_state.hpp"

#include <gtest/gtest.h>

#include "fake_scene.hpp"

namespace spectra::stream {
namespace {

using testing::patch_tile;
using testing::plan_with_alpha;
using testing::scene_of;
using testing::tiles_of_tree;

EncodedTile encoding(std::size_t payload_bytes, int content = 0) {
  EncodedTile tile;
  tile.payload = std::make_shared<const std::vector<std::byte>>(payload_bytes, static_cast<std::byte>(content));
  return tile;
}

Payload colours(std::size_t size_bytes) {
  return std::make_shared<const std::vector<std::byte>>(size_bytes);
}

class Waiter final : public CacheWaiter {
 public:
  void cache_changed() override { ++told; }
  int told = 0;
};

TEST(FrameCache, GivesAClaimToOneAndTellsTheOthers) {
  FrameCache cache(1 << 20);
  auto& state = *cache.state();
  const std::shared_ptr<const map::Tile> tile = patch_tile({}, 3, 0, 20);
  const GeometryKey key{Identity(tile), 0.5F, 7};
  const auto waiter = std::make_shared<Waiter>();
  EXPECT_EQ(state.claim_geometry(key, {}).kind, Claim<EncodedTile>::Kind::Yours);
  EXPECT_EQ(state.claim_geometry(key, waiter).kind, Claim<EncodedTile>::Kind::Busy);
  EXPECT_EQ(state.find_geometry(key), nullptr);
  EXPECT_EQ(waiter->told, 0);
  state.store_geometry(key, encoding(100));
  EXPECT_EQ(waiter->told, 1);
  EXPECT_EQ(state.claim_geometry(key, {}).kind, Claim<EncodedTile>::Kind::Ready);
  EXPECT_EQ(cache.miss_count(), 1U);
}

TEST(FrameCache, AnAbandonedClaimIsFreeAgain) {
  FrameCache cache(1 << 20);
  auto& state = *cache.state();
  const auto waiter = std::make_shared<Waiter>();
  const ColourKey key{1, std::make_shared<const PlanIdentity>(), 8};
  ASSERT_EQ(state.claim_colours(key, {}).kind, Claim<std::vector<std::byte>>::Kind::Yours);
  ASSERT_EQ(state.claim_colours(key, waiter).kind, Claim<std::vector<std::byte>>::Kind::Busy);
  state.abandon_colours(key);
  EXPECT_EQ(waiter->told, 1);
  EXPECT_EQ(state.claim_colours(key, {}).kind, Claim<std::vector<std::byte>>::Kind::Yours);
}

TEST(FrameCache, StaysWithinItsCapacityAndEvictsTheLeastRecentlyUsed) {
  constexpr std::size_t kCapacity = 100'000;
  FrameCache cache(kCapacity);
  auto& state = *cache.state();
  const auto plan = std::make_shared<const PlanIdentity>();
  const auto key = [&](std::uint32_t revision) { return ColourKey{revision, plan, 8}; };
  for (std::uint32_t i = 1; i <= 50; ++i) {
    state.claim_colours(key(i), {});
    state.store_colours(key(i), colours(9'000));
    EXPECT_LE(cache.size_bytes(), kCapacity);
    EXPECT_NE(state.find_colours(key(1)), nullptr) << "used all the time, yet evicted";
  }
  EXPECT_GT(cache.size_bytes(), kCapacity / 2);
  EXPECT_NE(state.find_colours(key(50)), nullptr);
  EXPECT_EQ(state.find_colours(key(2)), nullptr);
}

TEST(FrameCache, EvictsColoursBeforeGeometry) {
  FrameCache cache(100'000);
  auto& state = *cache.state();
  const std::shared_ptr<const map::Tile> tile = patch_tile({}, 3, 0, 20);
  const GeometryKey geometry_key{Identity(tile), 0.5F, 7};
  state.claim_geometry(geometry_key, {});
  state.store_geometry(geometry_key, encoding(50'000));
  const auto plan = std::make_shared<const PlanIdentity>();
  for (std::uint32_t i = 1; i <= 50; ++i) {
    state.claim_colours({i, plan, 8}, {});
    state.store_colours({i, plan, 8}, colours(9'000));
  }
  EXPECT_NE(state.find_geometry(geometry_key), nullptr);
  EXPECT_LE(cache.size_bytes(), 100'000U);
}

TEST(FrameCache, ForgetsTilesThatAreGone) {
  FrameCache cache(std::size_t{1} << 30);
  auto& state = *cache.state();
  const auto plan = std::make_shared<const PlanIdentity>();
  const auto put = [&](const std::shared_ptr<const map::Tile>& tile) {
    const GeometryKey key{Identity(tile), 0.5F, 7};
    state.claim_geometry(key, {});
    const std::uint32_t revision = state.store_geometry(key, encoding(1'000))->revision;
    state.claim_colours({revision, plan, 8}, {});
    state.store_colours({revision, plan, 8}, colours(1'000));
    return key;
  };
  const std::shared_ptr<const map::Tile> kept = patch_tile({}, 3, 0, 20);
  const GeometryKey key = put(kept);
  std::size_t after_100 = 0;
  for (int i = 0; i < 1000; ++i) {
    put(patch_tile({}, 3, i, 20));  // A map that lives: the next version has another in its place.
    if (i == 100) after_100 = cache.size_bytes();
  }
  EXPECT_LT(cache.size_bytes(), 2 * after_100);
  const auto still = state.find_geometry(key);
  ASSERT_NE(still, nullptr);
  EXPECT_NE(state.find_colours({still->revision, plan, 8}), nullptr);
}

TEST(FrameCache, AGeometryThatComesBackTheSameKeepsItsRevision) {
  FrameCache cache(0);  // Nothing is ever kept.
  auto& state = *cache.state();
  const std::shared_ptr<const map::Tile> tile = patch_tile({}, 3, 0, 20);
  const GeometryKey key{Identity(tile), 0.5F, 7};
  const auto made = [&](const GeometryKey& which, int content) {
    EXPECT_EQ(state.claim_geometry(which, {}).kind, Claim<EncodedTile>::Kind::Yours);
    return state.store_geometry(which, encoding(100, content))->revision;
  };
  const auto first = made(key, 1);
  EXPECT_EQ(made(key, 1), first);
  EXPECT_NE(made(key, 2), first);
  const auto second = made(key, 2);
  const GeometryKey finer{Identity(tile), 0.25F, 7};
  EXPECT_FALSE(state.issued(finer));
  const auto other = made(finer, 1);
  EXPECT_NE(other, first);
  ASSERT_TRUE(state.issued(key) && state.issued(finer));
  EXPECT_EQ(state.issued(key)->revision, second);
  EXPECT_EQ(state.issued(finer)->revision, other);
  EXPECT_EQ(cache.size_bytes(), 0U);
}

TEST(FrameCache, KeepsColoursApartThatAreWrittenOtherwise) {
  FrameCache cache(1 << 20);
  auto& state = *cache.state();
  const ColourKey plain{1, std::make_shared<const PlanIdentity>(), 8, protocol::ColourTransform::None};
  ColourKey transformed = plain;
  transformed.transform = protocol::ColourTransform::SubtractGreen;
  state.claim_colours(plain, {});
  state.store_colours(plain, colours(10));
  EXPECT_EQ(state.find_colours(transformed), nullptr);
  EXPECT_EQ(state.claim_colours(transformed, {}).kind, Claim<std::vector<std::byte>>::Kind::Yours);
  ColourKey marked = plain;
  marked.has_marks = true;
  EXPECT_EQ(state.find_colours(marked), nullptr);
  EXPECT_EQ(state.claim_colours(marked, {}).kind, Claim<std::vector<std::byte>>::Kind::Yours);
}

TEST(FrameCache, IdentityOutlivesItsObject) {
  // Not make_shared, so that the memory of the dead tile is free for the next one.
  auto tile = std::shared_ptr<const map::Tile>(new map::Tile());
  const Identity dead(tile);
  tile.reset();
  tile = std::shared_ptr<const map::Tile>(new map::Tile());
  const Identity alive(tile);
  EXPECT_TRUE(dead < alive || alive < dead);
  EXPECT_TRUE(dead.expired());
}

TEST(FrameCache, PlansAreOneWhereTheyShowTheSame) {
  FrameCache cache(1 << 20);
  auto& state = *cache.state();
  const auto scene = scene_of(tiles_of_tree(2));
  const auto other = scene_of(tiles_of_tree(2));
  const auto half = state.plan_identity(plan_with_alpha(*scene, 0.5), scene->reference_temperature());
  EXPECT_EQ(state.plan_identity(plan_with_alpha(*scene, 0.5), scene->reference_temperature()), half);
  EXPECT_NE(state.plan_identity(plan_with_alpha(*scene, 0.25), scene->reference_temperature()), half);
  EXPECT_NE(state.plan_identity(plan_with_alpha(*other, 0.5), other->reference_temperature()), half);
}

}  // namespace
}  // namespace spectra::stream
