#include "server/session/session_memories.hpp"

#include <gtest/gtest.h>

#include <string>
#include <utility>

namespace spectra::session {
namespace {

stream::ViewerMemory memory_of(std::uint32_t tile_count, std::uint32_t revision = 1) {
  stream::ViewerMemory memory;
  for (std::uint32_t i = 0; i < tile_count; ++i) memory[{9, i, 0, 0}].wire_revision = revision;
  return memory;
}

TEST(SessionMemories, LastAMinute) {
  SessionMemories memories;
  memories.ended("one", memory_of(3), 1000);
  EXPECT_EQ(memories.of("one", 1000).size(), 3U);
  EXPECT_EQ(memories.of("one", 1010).size(), 3U) << "who comes back twice is known twice";
  EXPECT_EQ(memories.of("two", 1010).size(), 0U);
  EXPECT_EQ(memories.of("one", 1000 + SessionMemories::kKept_s + 1).size(), 0U);
  EXPECT_EQ(memories.of("one", 1000).size(), 0U) << "it is forgotten, not only hidden";
}

TEST(SessionMemories, AreOfTheNewestEndThatSaysAnything) {
  SessionMemories memories;
  memories.ended("one", memory_of(3, 1), 1000);
  memories.ended("one", memory_of(2, 7), 1001);
  memories.ended("one", {}, 1002);
  ASSERT_EQ(memories.of("one", 1003).size(), 2U);
  EXPECT_EQ(memories.of("one", 1003).begin()->second.wire_revision, 7U);
}

TEST(SessionMemories, TakeBoundedSpace) {
  SessionMemories memories;
  constexpr std::uint32_t kTiles = 1500;
  const auto most = static_cast<int>(SessionMemories::kMostTiles / kTiles);
  for (int i = 0; i < most + 5; ++i) memories.ended(std::to_string(i), memory_of(kTiles), i * 1e-3);
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(memories.of(std::to_string(i), 1).empty()) << i;
  for (int i = 5; i < most + 5; ++i) EXPECT_EQ(memories.of(std::to_string(i), 1).size(), kTiles) << i;
}

}  // namespace
}  // namespace spectra::session
