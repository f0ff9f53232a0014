#include "server/store/block_store.hpp"

#include <gtest/gtest.h>
#include <sqlite3.h>
#include <sys/stat.h>

#include <atomic>
#include <cmath>
#include <fstream>
#include <latch>
#include <limits>
#include <thread>
#include <vector>

#include "server/store/salvage.hpp"
#include "tests/unit/store/store_fixture.hpp"

namespace spectra::store {
namespace {

using std::chrono::microseconds;

StoreTime at_second(std::int64_t second) {
  return StoreTime(std::chrono::seconds(second));
}

void run_sql(const std::string& file, const char* sql) {
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(file.c_str(), &database), SQLITE_OK);
  EXPECT_EQ(sqlite3_exec(database, sql, nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(database);
  sqlite3_close(database);
}

std::uint64_t number_in(const std::string& file, const char* sql) {
  sqlite3* database = nullptr;
  sqlite3_stmt* statement = nullptr;
  EXPECT_EQ(sqlite3_open(file.c_str(), &database), SQLITE_OK);
  EXPECT_EQ(sqlite3_prepare_v2(database, sql, -1, &statement, nullptr), SQLITE_OK) << sqlite3_errmsg(database);
  EXPECT_EQ(sqlite3_step(statement), SQLITE_ROW);
  const auto number = static_cast<std::uint64_t>(sqlite3_column_int64(statement, 0));
  sqlite3_finalize(statement);
  sqlite3_close(database);
  return number;
}

std::vector<std::string> ids_of(const BlockPage& page) {
  std::vector<std::string> ids;
  for (const auto& block : page.blocks) ids.push_back(block.description.id);
  return ids;
}

TEST(BlockStore, GivesBackWhatWasPutAfterBeingOpenedAgain) {
  const StoreFixture here;
  BlockRecord block = made_block("wall.1_a-B", 7, 30'000);
  block.description.observed_at = 1.5e9 + 0.25;
  block.description.sensor = base::Vec3d{-0.0, 1e-300, 6'378'137.125};
  block.description.read_options = "scale=0.001&up=y";
  block.description.triangle_count = std::uint64_t{1} << 40U;
  block.description.bounds = {{-1, -2, -3}, {1.5, 2.5, 1e300}};
  Revision revision = 0;
  {
    const auto store = opened(here.file());
    const auto done = put(*store, block);
    ASSERT_TRUE(done) << done.error().message;
    revision = done.value();
    EXPECT_TRUE(set_constant(*store, "origin", "500000 0 12.5"));
  }
  const auto store = opened(here.file());
  const auto read_back = read(*store, revision);
  ASSERT_TRUE(read_back) << read_back.error().message;
  EXPECT_EQ(*read_back.value().ply, *block.ply);
  EXPECT_EQ(read_back.value().facts.description, block.description);
  EXPECT_TRUE(std::signbit(read_back.value().facts.description.sensor->x));
  EXPECT_EQ(read_back.value().facts.sha256, sha256(*block.ply));
  EXPECT_EQ(store->find("wall.1_a-B"), read_back.value().facts);
  EXPECT_EQ(store->constant("origin"), "500000 0 12.5");
  EXPECT_EQ(store->constant("edge"), std::nullopt);
}

TEST(BlockStore, KnowsSha256) {
  EXPECT_EQ(to_hex(sha256("abc")), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

TEST(BlockStore, CountsRevisionsOverAllBlocksAndDeletions) {
  const StoreFixture here;
  {
    const auto store = opened(here.file());
    EXPECT_EQ(put(*store, made_block("a", 1, 10)).value(), 1U);
    EXPECT_EQ(put(*store, made_block("b", 2, 0)).value(), 2U);
    EXPECT_EQ(remove(*store, "a").value(), 3U);
    EXPECT_EQ(remove(*store, "a").error().code, StoreErrorCode::NotFound);
    EXPECT_EQ(put(*store, made_block("a", 3, 10)).value(), 4U);
    EXPECT_EQ(remove(*store, "a").value(), 5U);
  }
  const auto store = opened(here.file(), {.history_bytes = 0});
  EXPECT_EQ(store->status().last_revision, 5U);
  EXPECT_EQ(put(*store, made_block("c", 3, 10)).value(), 6U) << "also when the deletion itself is dropped";
  EXPECT_EQ(ids_of(store->page("", 10)), (std::vector<std::string>{"b", "c"}));
}

TEST(BlockStore, PagesInOrderOfId) {
  const StoreFixture here;
  const auto store = opened(here.file());
  for (const char* id : {"b", "A", "z", "a", "a.1"}) ASSERT_TRUE(put(*store, made_block(id, 1, 5)));
  EXPECT_TRUE(remove(*store, "z"));
  const auto first = store->page("", 3);
  EXPECT_EQ(ids_of(first), (std::vector<std::string>{"A", "a", "a.1"}));
  EXPECT_EQ(first.next, "a.1");
  const auto second = store->page(*first.next, 3);
  EXPECT_EQ(ids_of(second), (std::vector<std::string>{"b"}));
  EXPECT_EQ(second.next, std::nullopt) << "what is deleted makes no page";
}

TEST(BlockStore, ShowsTheMapAsItWas) {
  const StoreFixture here;
  std::atomic<std::int64_t> second{100};
  const auto now = [&second] { return at_second(second); };
  const auto store = opened(here.file(), {.history_bytes = 1'000'000, .now = now});
  ASSERT_TRUE(put(*store, made_block("a", 1, 10)));
  second = 200;
  ASSERT_TRUE(put(*store, made_block("a", 2, 10)));
  ASSERT_TRUE(put(*store, made_block("b", 3, 10)));
  second = 300;
  ASSERT_TRUE(remove(*store, "a"));
  const auto seeds_at = [&store](std::int64_t time) {
    std::vector<std::uint64_t> seeds;
    const auto done = store->visit(at_second(time), [&seeds](const StoredBlock& block) {
      EXPECT_EQ(*block.ply, made_bytes(block.facts.description.vertex_count, 10));
      seeds.push_back(block.facts.description.vertex_count);
      return true;
    });
    EXPECT_TRUE(done) << done.error().message;
    return seeds;
  };
  EXPECT_EQ(seeds_at(99), (std::vector<std::uint64_t>{}));
  EXPECT_EQ(seeds_at(100), (std::vector<std::uint64_t>{1}));
  EXPECT_EQ(seeds_at(299), (std::vector<std::uint64_t>{2, 3}));
  EXPECT_EQ(seeds_at(1'000), (std::vector<std::uint64_t>{3}));
}

TEST(BlockStore, RefusesATimeBeforeItsHistoryAndSaysHowFarItGoes) {
  const StoreFixture here;
  std::atomic<std::int64_t> second{1'000'000'000};
  const StoreOptions options{.history_bytes = 2 * (10 + Catalogue::kRowCostBytes),
                             .now = [&second] { return at_second(second); }};
  const auto open_and_check = [&] {
    const auto store = opened(here.file(), options);
    const auto before = store->page_at(at_second(1'000'000'002), "", 10);
    ASSERT_FALSE(before);
    EXPECT_EQ(before.error().code, StoreErrorCode::HistoryGone);
    EXPECT_NE(before.error().message.find("2001-09-09T01:46:43Z"), std::string::npos) << before.error().message;
    EXPECT_EQ(store->page_at(at_second(1'000'000'003), "", 10).value().blocks.at(0).description.vertex_count, 3U);
    EXPECT_EQ(store->status().history_bytes, options.history_bytes);
    EXPECT_EQ(read(*store, 2).error().code, StoreErrorCode::NotFound);
  };
  {
    const auto store = opened(here.file(), options);
    for (std::uint64_t seed = 0; seed < 6; ++seed, ++second) ASSERT_TRUE(put(*store, made_block("a", seed, 10)));
  }
  open_and_check();
  open_and_check();
}

TEST(BlockStore, TellsTheStateBehindAClockThatWasSetBack) {
  const StoreFixture here;
  std::atomic<std::int64_t> second{500};
  const auto store = opened(here.file(), {.now = [&second] { return at_second(second); }});
  ASSERT_TRUE(put(*store, made_block("a", 1, 10)));
  second = 100;
  ASSERT_TRUE(put(*store, made_block("b", 2, 10)));
  EXPECT_EQ(ids_of(store->page_at(at_second(100), "", 10).value()), (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(ids_of(store->page_at(at_second(600), "", 10).value()), (std::vector<std::string>{"a", "b"}));
}

TEST(BlockStore, WritesWhatWaitsTogetherAndAnswersInOrder) {
  const StoreFixture here;
  const auto store = opened(here.file());
  constexpr int kCount = 500;
  std::vector<Revision> revisions;
  std::latch done(kCount);
  for (int i = 0; i < kCount; ++i) {
    store->put(made_block("b" + std::to_string(i % 50), std::uint64_t(i), 1'000), [&](StoreResult<Revision> revision) {
      revisions.push_back(revision.value());
      done.count_down();
    });
  }
  done.wait();
  for (std::size_t i = 0; i < kCount; ++i) EXPECT_EQ(revisions[i], i + 1);
  EXPECT_EQ(store->status().waiting_bytes, 0U);
  EXPECT_EQ(store->status().block_count, 50U);
  // Alone in a transaction each, they would have made the log at least three pages longer each.
  EXPECT_LT(store->status().log_bytes, kCount * 3 * 8192U);
}

TEST(BlockStore, WritesWhatWaitsBeforeItCloses) {
  const StoreFixture here;
  int acknowledged = 0;
  {
    const auto store = opened(here.file());
    for (int i = 0; i < 100; ++i) {
      store->put(made_block("b" + std::to_string(i), std::uint64_t(i), 100),
                 [&acknowledged](StoreResult<Revision> result) { acknowledged += result ? 1 : 0; });
    }
    store->close();
    EXPECT_EQ(acknowledged, 100);
    EXPECT_EQ(put(*store, made_block("late", 1, 1)).error().code, StoreErrorCode::Closed);
    EXPECT_EQ(read(*store, 1).error().code, StoreErrorCode::Closed);
  }
  EXPECT_FALSE(std::filesystem::exists(here.file() + "-wal"));
  EXPECT_EQ(opened(here.file())->status().block_count, 100U);
}

TEST(BlockStore, RefusesMoreThanMayWait) {
  const StoreFixture here;
  std::promise<void> go_on;
  const auto store = opened(here.file(), {.waiting_bytes = 1'000});
  std::promise<void> is_held_up;
  store->put(made_block("first", 1, 600), [&](const StoreResult<Revision>&) {
    is_held_up.set_value();
    go_on.get_future().wait();
  });
  is_held_up.get_future().wait();
  std::promise<StoreResult<Revision>> second;
  store->put(made_block("second", 2, 600), [&second](StoreResult<Revision> r) { second.set_value(std::move(r)); });
  EXPECT_EQ(put(*store, made_block("third", 3, 600)).error().code, StoreErrorCode::Busy);
  EXPECT_EQ(store->status().waiting_bytes, 600U);
  go_on.set_value();
  EXPECT_TRUE(second.get_future().get());
  EXPECT_TRUE(put(*store, made_block("larger than all that may wait", 3, 1)).error().code ==
              StoreErrorCode::InvalidRecord);
  EXPECT_TRUE(put(*store, made_block("large", 3, 5'000))) << "one by itself is taken, whatever its size";
}

TEST(BlockStore, RefusesRecordsThatCannotBeMeant) {
  const StoreFixture here;
  const auto store = opened(here.file());
  for (const std::string id : {"", "a b", "a/b", "\xc3\xa4", "a\n"}) {
    EXPECT_EQ(put(*store, made_block(id, 1, 1)).error().code, StoreErrorCode::InvalidRecord) << id;
  }
  EXPECT_EQ(put(*store, made_block(std::string(65, 'a'), 1, 1)).error().code, StoreErrorCode::InvalidRecord);
  EXPECT_TRUE(put(*store, made_block(std::string(64, 'a'), 1, 1)));
  auto block = made_block("a", 1, 1);
  block.description.observed_at = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(put(*store, block).error().code, StoreErrorCode::InvalidRecord);
  block = made_block("a", 1, 1);
  block.description.bounds.max.z = std::numeric_limits<double>::infinity();
  EXPECT_EQ(put(*store, block).error().code, StoreErrorCode::InvalidRecord);
  block = made_block("a", 1, 1);
  block.ply = nullptr;
  EXPECT_EQ(put(*store, block).error().code, StoreErrorCode::InvalidRecord);
  EXPECT_EQ(store->status().last_revision, 1U);
}

TEST(BlockStore, KeepsItsFileSmallWhileBlocksComeAndGo) {
  const StoreFixture here;
  constexpr std::size_t kSize = 200'000;
  std::uintmax_t size_early = 0;
  {
    const auto store = opened(here.file(), {.history_bytes = 10 * kSize});
    for (std::uint64_t i = 0; i < 600; ++i) {
      ASSERT_TRUE(put(*store, made_block("b" + std::to_string(i % 5), i, kSize)));
      if (i == 150)
        size_early = std::filesystem::file_size(here.file()) + std::filesystem::file_size(here.file() + "-wal");
    }
  }
  EXPECT_LE(std::filesystem::file_size(here.file()), size_early);
  EXPECT_LE(std::filesystem::file_size(here.file()), 22 * kSize);
}

TEST(BlockStore, GivesRoomBackToTheDisk) {
  const StoreFixture here;
  {
    const auto store = opened(here.file(), {.history_bytes = 0});
    for (int i = 0; i < 40; ++i) ASSERT_TRUE(put(*store, made_block("b" + std::to_string(i), 1, 1'000'000)));
    for (int i = 0; i < 40; ++i) ASSERT_TRUE(remove(*store, "b" + std::to_string(i)));
    const auto is_small = [&here] { return std::filesystem::file_size(here.file()) < 20'000'000; };
    for (int i = 0; i < 300 && !is_small(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(100));
    EXPECT_TRUE(is_small());
  }
  EXPECT_EQ(opened(here.file())->status().last_revision, 80U);
}

TEST(BlockStore, IsOpenedByOneAtATime) {
  const StoreFixture here;
  const auto store = opened(here.file());
  const auto second = BlockStore::open(here.file(), {});
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, StoreErrorCode::Locked) << second.error().message;
  EXPECT_TRUE(put(*store, made_block("a", 1, 10))) << "the refusal did not harm the first";
}

TEST(BlockStore, RefusesWhatIsNoStoreAndLeavesItAlone) {
  const StoreFixture here;
  const auto refusal = [&here](StoreOptions options = {}) {
    const auto store = BlockStore::open(here.file(), std::move(options));
    return store ? StoreErrorCode{} : store.error().code;
  };
  EXPECT_EQ(refusal({.is_read_only = true}), StoreErrorCode::NotFound);
  EXPECT_FALSE(std::filesystem::exists(here.file()));
  for (const std::string content : {"", "ply\nformat ascii 1.0\n", "SQLite format 3"}) {
    std::ofstream(here.file(), std::ios::binary) << content;
    EXPECT_EQ(refusal(), StoreErrorCode::Foreign) << content;
    EXPECT_EQ(std::filesystem::file_size(here.file()), content.size());
  }
  std::filesystem::remove(here.file());
  run_sql(here.file(), "CREATE TABLE photos (name TEXT)");
  EXPECT_EQ(refusal(), StoreErrorCode::Foreign);
  std::filesystem::remove(here.file());
  std::filesystem::create_directory(here.file());
  EXPECT_EQ(refusal(), StoreErrorCode::Foreign);
  std::filesystem::remove(here.file());
  opened(here.file());
  run_sql(here.file(), "PRAGMA user_version=3");
  EXPECT_EQ(refusal(), StoreErrorCode::NewerVersion);
  run_sql(here.file(), "PRAGMA user_version=1; CREATE INDEX i ON change(facts)");
  EXPECT_EQ(refusal(), StoreErrorCode::Damaged);
}

TEST(BlockStore, KeepsWhatBelongsToARevisionBesideItsBytes) {
  const StoreFixture here;
  const std::string told = "what was before";
  {
    const auto store = opened(here.file());
    auto block = made_block("a", 1, 5000);
    block.baseline = std::make_shared<const std::string>(told);
    ASSERT_TRUE(put(*store, std::move(block)));
    ASSERT_TRUE(put(*store, made_block("b", 2, 5000)));
  }
  const auto expect_both = [&](const std::string& file) {
    const auto store = opened(file);
    const auto with = read(*store, 1), without = read(*store, 2);
    ASSERT_TRUE(with && without);
    ASSERT_TRUE(with.value().baseline);
    EXPECT_EQ(*with.value().baseline, told);
    EXPECT_EQ(*with.value().ply, made_bytes(1, 5000));
    EXPECT_EQ(with.value().facts.sha256, sha256(made_bytes(1, 5000)));
    EXPECT_EQ(with.value().facts.size_bytes, 5000U);
    EXPECT_FALSE(without.value().baseline);
    EXPECT_EQ(*without.value().ply, made_bytes(2, 5000));
  };
  expect_both(here.file());
  const std::string rescued = (here.folder() / "rescued").string();
  ASSERT_TRUE(salvage(here.file(), rescued, [](double) {}));
  expect_both(rescued);
}

TEST(BlockStore, OneOfVersion1IsReadAndBecomesVersion2WhenSomethingIsWritten) {
  const StoreFixture here;
  ASSERT_TRUE(put(*opened(here.file()), made_block("a", 1, 100)));
  run_sql(here.file(), "PRAGMA user_version=1");
  ASSERT_TRUE(read(*opened(here.file(), {.is_read_only = true}), 1));
  const auto version = [&] { return number_in(here.file(), "PRAGMA user_version"); };
  EXPECT_EQ(version(), 1U);
  {
    const auto store = opened(here.file());
    auto block = made_block("a", 2, 100);
    block.baseline = std::make_shared<const std::string>("before");
    ASSERT_TRUE(put(*store, std::move(block)));
  }
  EXPECT_EQ(version(), 2U);
  EXPECT_EQ(*read(*opened(here.file()), 2).value().baseline, "before");
}

TEST(BlockStore, MissesRowsThatAreGoneOrExchanged) {
  const StoreFixture here;
  {
    const auto store = opened(here.file());
    for (std::uint64_t i = 0; i < 3; ++i) ASSERT_TRUE(put(*store, made_block("b" + std::to_string(i), i, 100)));
    ASSERT_TRUE(set_constant(*store, "step", "0.001"));
  }
  const auto copy = here.folder() / "copy";
  std::filesystem::copy_file(here.file(), copy);
  for (const char* sql :
       {"DELETE FROM change WHERE revision=2; DELETE FROM body WHERE revision=2", "DELETE FROM body WHERE revision=3",
        "UPDATE change SET revision=9 WHERE revision=3; UPDATE body SET revision=9 WHERE revision=3",
        "DELETE FROM state", "DELETE FROM constant", "INSERT INTO body VALUES (77, x'00')",
        "UPDATE change SET facts=(SELECT facts FROM change WHERE revision=1) WHERE revision=2",
        "UPDATE change SET (facts, checksum)=(SELECT facts, checksum FROM constant) WHERE revision=2"}) {
    std::filesystem::copy_file(copy, here.file(), std::filesystem::copy_options::overwrite_existing);
    run_sql(here.file(), sql);
    const auto store = BlockStore::open(here.file(), {});
    ASSERT_FALSE(store) << sql;
    EXPECT_EQ(store.error().code, StoreErrorCode::Damaged) << sql;
    EXPECT_NE(store.error().message.find("spectra store salvage"), std::string::npos) << store.error().message;
  }
  // Bytes that were exchanged are found when they are read.
  std::filesystem::copy_file(copy, here.file(), std::filesystem::copy_options::overwrite_existing);
  run_sql(here.file(), "UPDATE body SET bytes=(SELECT bytes FROM body WHERE revision=1) WHERE revision=2");
  const auto store = opened(here.file());
  EXPECT_TRUE(read(*store, 1));
  EXPECT_EQ(read(*store, 2).error().code, StoreErrorCode::Damaged);
  EXPECT_FALSE(store->visit(std::nullopt, [](const StoredBlock&) { return true; }));
}

TEST(BlockStore, ReadsWithoutWriting) {
  const StoreFixture here;
  {
    const auto store = opened(here.file());
    ASSERT_TRUE(put(*store, made_block("a", 1, 100)));
  }
  const auto written = std::filesystem::last_write_time(here.file());
  const auto store = opened(here.file(), {.is_read_only = true});
  EXPECT_TRUE(read(*store, 1));
  EXPECT_EQ(put(*store, made_block("a", 1, 100)).error().code, StoreErrorCode::ReadOnly);
  EXPECT_EQ(remove(*store, "a").error().code, StoreErrorCode::ReadOnly);
  EXPECT_EQ(std::filesystem::last_write_time(here.file()), written);
}

}  // namespace
}  // namespace spectra::store
