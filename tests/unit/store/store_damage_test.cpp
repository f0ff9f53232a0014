#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/store/block_store.hpp"
#include "server/store/salvage.hpp"
#include "tests/unit/store/store_fixture.hpp"

namespace spectra::store {
namespace {

void no_progress(double /*share*/) {}

std::string content_of(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void write_content(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

/// id -> seed
using Blocks = std::map<std::string, std::uint64_t>;

/// A store with history, deletions and a log that was not moved into the file, as after kill -9.
struct KilledStore {
  std::string file, log;
  Blocks blocks;                    ///< In the map.
  std::map<Revision, Blocks> maps;  ///< As it was.
  std::map<Revision, std::uint64_t> seeds;
};

KilledStore killed_store() {
  const StoreFixture here;
  KilledStore killed;
  constexpr std::size_t kSizes[] = {0, 150, 3'000, 9'000, 60'000};
  const auto change = [&](BlockStore& store, std::uint64_t i) {
    // Some stand in the file alone, others in the log as well.
    const std::string id = (i < 40 && i % 2 == 1 ? "file-" : "log-") + std::to_string(i % 9);
    if (i % 6 == 5) {
      const auto removed = remove(store, id);
      killed.blocks.erase(id);
      if (removed) killed.maps[removed.value()] = killed.blocks;
      return;
    }
    const Revision revision = put(store, made_block(id, i, kSizes[i % 5])).value();
    killed.seeds[revision] = i;
    killed.blocks[id] = i;
    killed.maps[revision] = killed.blocks;
  };
  {
    const auto store = opened(here.file(), {.history_bytes = 150'000});
    for (std::uint64_t i = 0; i < 40; ++i) change(*store, i);
    EXPECT_TRUE(set_constant(*store, "origin", "1 2 3"));
  }
  const auto store = opened(here.file(), {.history_bytes = 150'000});
  for (std::uint64_t i = 40; i < 53; ++i) change(*store, i);
  killed.file = content_of(here.file());
  killed.log = content_of(here.file() + "-wal");
  EXPECT_GT(killed.log.size(), 100'000U);
  return killed;
}

/// The blocks of a store that opens, none of which may be wrong; `is_whole` is false when some cannot be read.
Blocks blocks_of(BlockStore& store, bool& is_whole) {
  Blocks blocks;
  is_whole = true;
  for (const auto& facts : store.page("", 1'000).blocks) {
    const auto block = read(store, facts.revision);
    if (!block) {
      EXPECT_EQ(block.error().code, StoreErrorCode::Damaged) << block.error().message;
      is_whole = false;
    } else {
      EXPECT_TRUE(*block.value().ply == made_bytes(facts.description.vertex_count, facts.size_bytes));
    }
    blocks[facts.description.id] = facts.description.vertex_count;
  }
  return blocks;
}

std::string damaged(std::string bytes, std::mt19937_64& random) {
  const std::size_t at = random() % bytes.size();
  const std::size_t end = std::min(bytes.size(), at + 1 + random() % 3'000);
  switch (random() % 5) {
    case 0:
      bytes[at] = static_cast<char>(bytes[at] ^ (1 << random() % 8));
      break;
    case 1:
      for (std::size_t i = at; i < end; ++i) bytes[i] = static_cast<char>(random());
      break;
    case 2:
      for (std::size_t i = at; i < end; ++i) bytes[i] = 0;
      break;
    case 3:
      bytes.resize(at);
      break;
    default: {
      // A page that went to another place.
      constexpr std::size_t kPage = 8192;
      const std::size_t from = random() % (bytes.size() / kPage) * kPage,
                        to = random() % (bytes.size() / kPage) * kPage;
      const std::string page = bytes.substr(from, kPage);
      bytes.replace(to, page.size(), page);
      break;
    }
  }
  return bytes;
}

int damage_count() {
  const char* text = std::getenv("SPECTRA_DAMAGE_ROUNDS");
  return text == nullptr ? 150 : std::atoi(text);
}

TEST(StoreDamage, IsRefusedOrHarmlessAndSalvagedWithoutAWrongBlock) {
  const KilledStore killed = killed_store();
  const std::uint64_t seed = std::random_device{}();
  std::mt19937_64 random(seed);
  int refused = 0, found_later = 0, whole_salvages = 0;
  for (int round = 0; round < damage_count(); ++round) {
    const StoreFixture here;
    const bool is_file = random() % 3 != 0;
    const std::string file = is_file ? damaged(killed.file, random) : killed.file;
    const std::string log = is_file ? killed.log : damaged(killed.log, random);
    write_content(here.file(), file);
    write_content(here.file() + "-wal", log);
    SCOPED_TRACE("seed " + std::to_string(seed) + ", round " + std::to_string(round) + (is_file ? ", file" : ", log"));

    const std::string rescued = here.file() + ".rescued";
    const auto report = salvage(here.file(), rescued, no_progress);
    EXPECT_EQ(content_of(here.file()), file);
    EXPECT_EQ(content_of(here.file() + "-wal"), log);
    Blocks found;
    if (report) {
      const auto store = opened(rescued);
      ASSERT_NE(store, nullptr);
      bool is_whole = false;
      found = blocks_of(*store, is_whole);
      EXPECT_TRUE(is_whole);
      EXPECT_EQ(report.value().block_count, found.size());
      for (const auto& [revision, of] : killed.seeds) {
        const auto block = read(*store, revision);
        EXPECT_TRUE(!block || block.value().facts.description.vertex_count == of);
      }
    }
    const auto opening = BlockStore::open(here.file(), {});
    if (!opening) {
      ++refused;
      EXPECT_FALSE(opening.error().message.empty());
      EXPECT_TRUE(content_of(here.file()) == file && content_of(here.file() + "-wal") == log)
          << "a refusal changes nothing";
      EXPECT_NE(opening.error().code, StoreErrorCode::IoError) << opening.error().message;
      if (report && report.value().lost.empty()) {
        EXPECT_EQ(found, killed.blocks) << opening.error().message;
        ++whole_salvages;
      }
      continue;
    }
    bool is_whole = false;
    const Blocks blocks = blocks_of(*opening.value(), is_whole);
    // A log that ends in bad bytes, or too early, looks like one that was cut while it was written: then the map is as it was before,
    // by no more than the two changes that one bad place can touch unless the log lost its end.
    const Revision revision = opening.value()->status().last_revision;
    const Revision newest = killed.maps.rbegin()->first;
    if (is_file) {
      EXPECT_EQ(revision, newest);
    } else if (log.size() == killed.log.size()) {
      EXPECT_GE(revision + 2, newest);
    }
    const Blocks& expected = killed.maps.at(revision);
    EXPECT_EQ(blocks, expected);
    found_later += is_whole ? 0 : 1;
    ASSERT_TRUE(report) << report.error().message;
    EXPECT_TRUE(!report.value().lost.empty() || !is_file || found == killed.blocks);
  }
  EXPECT_GT(refused, damage_count() / 8);
  EXPECT_GT(found_later, 0);
  std::printf(
      "%d damages: %d refused at the start, %d found when a block was read, the rest harmless; of those refused %d "
      "salvaged without a loss\n",
      damage_count(), refused, found_later, whole_salvages);
}

TEST(StoreDamage, OfALogThatIsMissingIsSaid) {
  const KilledStore killed = killed_store();
  const StoreFixture here;
  write_content(here.file(), killed.file);
  const auto alone = BlockStore::open(here.file(), {});
  ASSERT_FALSE(alone);
  EXPECT_EQ(alone.error().code, StoreErrorCode::Damaged);
  EXPECT_NE(alone.error().message.find("-wal is missing"), std::string::npos) << alone.error().message;
  write_content(here.file() + "-wal", killed.log);
  EXPECT_EQ(opened(here.file())->status().last_revision, killed.maps.rbegin()->first);
  EXPECT_FALSE(std::filesystem::exists(here.file() + "-wal"));
  EXPECT_EQ(opened(here.file())->status().last_revision, killed.maps.rbegin()->first) << "closed in order now";
}

TEST(StoreSalvage, OfAHealthyStoreLosesNothing) {
  const StoreFixture here;
  const KilledStore killed = killed_store();
  write_content(here.file(), killed.file);
  write_content(here.file() + "-wal", killed.log);
  const std::string rescued = here.file() + ".rescued";
  const auto report = salvage(here.file(), rescued, no_progress);
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_TRUE(report.value().lost.empty()) << report.value().lost.front();
  EXPECT_EQ(report.value().constant_count, 1U);
  const auto before = opened(here.file());
  const auto after = opened(rescued);
  EXPECT_EQ(after->page("", 100).blocks, before->page("", 100).blocks);
  EXPECT_EQ(after->status().last_revision, before->status().last_revision);
  EXPECT_EQ(after->status().history_bytes, before->status().history_bytes);
  EXPECT_GT(before->status().history_bytes, 50'000U);
  EXPECT_EQ(after->constant("origin"), "1 2 3");
  for (const auto& [revision, seed] : killed.seeds) {
    EXPECT_EQ(read(*after, revision).has_value(), read(*before, revision).has_value())
        << "what the history let go stays gone, what it kept is kept";
  }
}

TEST(StoreSalvage, SaysThatTheLogIsMissing) {
  const StoreFixture here;
  const KilledStore killed = killed_store();
  write_content(here.file(), killed.file);
  const auto report = salvage(here.file(), here.file() + ".rescued", no_progress);
  ASSERT_TRUE(report) << report.error().message;
  ASSERT_FALSE(report.value().lost.empty());
  EXPECT_NE(report.value().lost.front().find("-wal is missing"), std::string::npos) << report.value().lost.front();
}

TEST(StoreSalvage, SaysWhichBlockIsLostAndWhatStandsInItsPlace) {
  const StoreFixture here;
  {
    const auto store = opened(here.file());
    ASSERT_TRUE(put(*store, made_block("a", 1, 50'000)));
    ASSERT_TRUE(put(*store, made_block("b", 2, 50'000)));
    ASSERT_TRUE(put(*store, made_block("a", 3, 50'000)));
  }
  std::string bytes = content_of(here.file());
  for (const std::uint64_t seed : {std::uint64_t{2}, std::uint64_t{3}}) {
    const auto at = bytes.find(made_bytes(seed, 50'000).substr(20'000, 100));
    ASSERT_NE(at, std::string::npos);
    bytes[at] = static_cast<char>(bytes[at] ^ 1);
  }
  write_content(here.file(), bytes);
  const std::string rescued = here.file() + ".rescued";
  const auto report = salvage(here.file(), rescued, no_progress).value();
  ASSERT_EQ(report.lost.size(), 2U);
  EXPECT_NE(report.lost[0].find("block b of revision 2"), std::string::npos);
  EXPECT_NE(report.lost[0].find("the map is without it"), std::string::npos) << report.lost[0];
  EXPECT_NE(report.lost[1].find("block a of revision 3"), std::string::npos);
  EXPECT_NE(report.lost[1].find("its revision 1 stands in its place"), std::string::npos) << report.lost[1];
  EXPECT_EQ(put(*opened(rescued), made_block("c", 4, 10)).value(), 4U) << "revisions go on where they were";
}

TEST(StoreSalvage, NeedsNoneOfThePagesThatOnlyPointToOthers) {
  const StoreFixture here;
  constexpr std::size_t kPage = 8192;
  {
    const auto store = opened(here.file());
    for (std::uint64_t i = 0; i < 300; ++i) ASSERT_TRUE(put(*store, made_block("b" + std::to_string(i), i, 3'000)));
  }
  std::string bytes = content_of(here.file());
  constexpr char kInterior = 5;
  int wiped = 0;
  for (std::size_t at = 0; at < bytes.size(); at += kPage) {
    if (at != 0 && bytes[at] != kInterior) continue;
    bytes.replace(at, kPage, kPage, '\xff');
    ++wiped;
  }
  ASSERT_GT(wiped, 2);
  write_content(here.file(), bytes);
  EXPECT_FALSE(BlockStore::open(here.file(), {}));
  const std::string rescued = here.file() + ".rescued";
  const auto report = salvage(here.file(), rescued, no_progress);
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_TRUE(report.value().lost.empty()) << report.value().lost.front();
  EXPECT_EQ(report.value().block_count, 300U);
}

TEST(StoreSalvage, FindsNothingWhereNothingIs) {
  const StoreFixture here;
  const std::string rescued = here.file() + ".rescued";
  EXPECT_EQ(salvage(here.file(), rescued, no_progress).error().code, StoreErrorCode::NotFound);
  write_content(here.file(), "ply\n" + std::string(100'000, 'x'));
  EXPECT_EQ(salvage(here.file(), rescued, no_progress).error().code, StoreErrorCode::Damaged);
}

}  // namespace
}  // namespace spectra::store
