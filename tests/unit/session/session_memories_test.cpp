#include "server/session/session_memories.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace spectra::session {
namespace {

stream::ViewerMemory memory_of(std::uint32_t tile_count, std::uint32_t revision = 1, const std::string& look = "") {
  std::vector<stream::RememberedTile> tiles(tile_count);
  for (std::uint32_t i = 0; i < tile_count; ++i) {
    tiles[i].tile = {9, i, 0, 0};
    tiles[i].wire_revision = revision;
    tiles[i].look = look;
  }
  return stream::ViewerMemory(std::move(tiles));
}

TEST(SessionMemories, LastAMinute) {
  SessionMemories memories;
  memories.ended("one", memory_of(3), 1000);
  EXPECT_EQ(memories.of("one", 1000)->size(), 3U);
  EXPECT_EQ(memories.of("one", 1010)->size(), 3U) << "who comes back twice is known twice";
  EXPECT_EQ(memories.of("two", 1010)->size(), 0U);
  EXPECT_EQ(memories.of("one", 1000 + SessionMemories::kKept_s + 1)->size(), 0U);
  EXPECT_EQ(memories.of("one", 1000)->size(), 0U) << "it is forgotten, not only hidden";
}

TEST(SessionMemories, AreOfTheNewestEndThatSaysAnything) {
  SessionMemories memories;
  memories.ended("one", memory_of(3, 1), 1000);
  memories.ended("one", memory_of(2, 7), 1001);
  memories.ended("one", {}, 1002);
  ASSERT_EQ(memories.of("one", 1003)->size(), 2U);
  EXPECT_EQ(memories.of("one", 1003)->find({9, 1, 0, 0})->wire_revision, 7U);
}

/// How many of these, each of another session, are remembered in the end: the newest.
std::size_t remembered_of(const stream::ViewerMemory& memory, std::size_t session_count) {
  SessionMemories memories;
  for (std::size_t i = 0; i < session_count; ++i) {
    memories.ended(std::to_string(i), memory, static_cast<double>(i) * 1e-3);
  }
  std::size_t count = 0;
  while (count < session_count && !memories.of(std::to_string(session_count - 1 - count), 1)->empty()) ++count;
  for (std::size_t i = 0; i < session_count - count; ++i) EXPECT_TRUE(memories.of(std::to_string(i), 1)->empty()) << i;
  return count;
}

TEST(SessionMemories, TakeBoundedSpace) {
  const auto plain = memory_of(1500);
  EXPECT_GE(plain.size_bytes(), 1500 * sizeof(stream::RememberedTile));
  EXPECT_LE(plain.size_bytes(), 200'000U);
  const std::size_t most_plain = remembered_of(plain, 200);
  EXPECT_GE(most_plain, 80U);
  EXPECT_LE(most_plain * plain.size_bytes(), SessionMemories::kMostBytes);
  // Where every part of a tile has a time of its own, that takes more than all else.
  const auto aged = memory_of(1500, 1, std::string(1000, '0'));
  EXPECT_GE(aged.size_bytes(), 1'500'000U);
  const std::size_t most_aged = remembered_of(aged, 200);
  EXPECT_GE(most_aged, 5U);
  EXPECT_LE(most_aged * aged.size_bytes(), SessionMemories::kMostBytes);
}

TEST(SessionMemories, OfPicturesThatAreKeptKnownTakeMore) {
  std::vector<stream::RememberedTile> tiles(2);
  tiles[1].tile.x = 1;
  const std::size_t without = stream::ViewerMemory(tiles).size_bytes();
  for (auto& tile : tiles) tile.picture.plan = std::make_shared<const stream::PlanIdentity>();
  const std::size_t with_two = stream::ViewerMemory(tiles).size_bytes();
  tiles[1].picture = tiles[0].picture;
  const std::size_t with_one = stream::ViewerMemory(tiles).size_bytes();
  EXPECT_LT(without, with_one);
  EXPECT_LT(with_one, with_two);
}

TEST(SessionMemories, AreNotCopied) {
  SessionMemories memories;
  memories.ended("one", memory_of(3), 1000);
  const auto held = memories.of("one", 1001);
  EXPECT_EQ(memories.of("one", 1002), held);
  memories.ended("one", memory_of(2), 1003);
  EXPECT_EQ(held->size(), 3U) << "who has it keeps it";
}

}  // namespace
}  // namespace spectra::session
