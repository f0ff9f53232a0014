#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>

#include <algorithm>
#include <fstream>
#include <future>
#include <iterator>
#include <latch>
#include <map>
#include <mutex>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include "server/store/block_store.hpp"
#include "tests/unit/store/fault_file_system.hpp"
#include "tests/unit/store/store_fixture.hpp"

namespace spectra::store {
namespace {

using fault_file_system::Fault;
using fault_file_system::Operation;

struct FaultCase {
  Fault fault;
  StoreErrorCode expected;
};

class StoreFaults : public ::testing::TestWithParam<FaultCase> {};

TEST_P(StoreFaults, LoseNothingThatWasAcknowledgedAndEnd) {
  const auto [fault, expected] = GetParam();
  int times_failed = 0;
  for (int calls = 0; calls < 60; ++calls) {
    const StoreFixture here;
    std::map<std::string, std::uint64_t> acknowledged, refused;  // id -> seed
    const auto count_answer = [&](const std::string& id, std::uint64_t seed, const StoreResult<Revision>& result) {
      if (result) {
        acknowledged[id] = seed;
      } else {
        EXPECT_EQ(result.error().code, expected) << result.error().message;
        refused[id] = seed;
      }
    };
    {
      const auto store = opened(here.file(), {.history_bytes = 0, .vfs = fault_file_system::name()});
      for (const char* id : {"a", "b", "c"}) count_answer(id, 1, put(*store, made_block(id, 1, 10'000)));
      ASSERT_EQ(acknowledged.size(), 3U);
      fault_file_system::arm(fault, calls);
      // Together, or each in a transaction of its own.
      const bool is_together = calls % 2 == 0;
      std::latch done(10);
      for (std::uint64_t i = 0; i < 10; ++i) {
        const std::string id = i == 4 ? "b" : "failing-" + std::to_string(i);
        auto block = made_block(id, 2 + i, 30'000);
        if (!is_together) {
          count_answer(id, 2 + i, put(*store, std::move(block)));
          done.count_down();
          continue;
        }
        store->put(std::move(block), [&, id, i](const StoreResult<Revision>& result) {
          count_answer(id, 2 + i, result);
          done.count_down();
        });
      }
      done.wait();
      // Reading goes on.
      EXPECT_TRUE(store->visit(std::nullopt, [](const StoredBlock&) { return true; }));
      if (!refused.empty()) {
        ++times_failed;
        ASSERT_TRUE(store->status().trouble);
        EXPECT_EQ(store->status().trouble->code, expected);
      }
      EXPECT_EQ(store->status().waiting_bytes, 0U);
      EXPECT_EQ(store->status().block_count, acknowledged.size());
      fault_file_system::arm(Fault::None, 0);
      const auto after = put(*store, made_block("after", 99, 40'000));
      ASSERT_TRUE(after) << after.error().message;
      acknowledged["after"] = 99;
      EXPECT_FALSE(store->status().trouble);
    }
    const auto store = opened(here.file());
    ASSERT_NE(store, nullptr);
    EXPECT_EQ(store->status().block_count, acknowledged.size());
    std::map<std::string, std::uint64_t> found;
    const auto visited = store->visit(std::nullopt, [&found](const StoredBlock& block) {
      const std::uint64_t seed = block.facts.description.vertex_count;
      EXPECT_TRUE(*block.ply == made_bytes(seed, block.ply->size()));
      found[block.facts.description.id] = seed;
      return true;
    });
    EXPECT_TRUE(visited);
    EXPECT_EQ(found, acknowledged);
  }
  EXPECT_GT(times_failed, 2) << "the fault was not met";
}

std::string name_of(const ::testing::TestParamInfo<FaultCase>& fault_case) {
  constexpr const char* kNames[] = {"None", "DiskFull", "NoQuota", "ReadOnly", "WriteError", "SyncError"};
  return kNames[static_cast<int>(fault_case.param.fault)];
}

INSTANTIATE_TEST_SUITE_P(EveryKind, StoreFaults,
                         ::testing::Values(FaultCase{Fault::DiskFull, StoreErrorCode::DiskFull},
                                           FaultCase{Fault::NoQuota, StoreErrorCode::DiskFull},
                                           FaultCase{Fault::ReadOnly, StoreErrorCode::ReadOnly},
                                           FaultCase{Fault::WriteError, StoreErrorCode::IoError},
                                           FaultCase{Fault::SyncError, StoreErrorCode::IoError}),
                         name_of);

TEST(StoreFault, TakesALimitOfTheProcessForAFullDisk) {
  const StoreFixture here;
  const auto before = ::signal(SIGXFSZ, SIG_IGN);
  rlimit usual{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &usual), 0);
  {
    const auto store = opened(here.file());
    ASSERT_TRUE(put(*store, made_block("a", 1, 1'000)));
    const rlimit small{200'000, usual.rlim_max};
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
    for (const std::size_t size : {std::size_t{300'000}, std::size_t{3'000'000}}) {
      const auto result = put(*store, made_block("b", 2, size));
      ASSERT_FALSE(result);
      EXPECT_EQ(result.error().code, StoreErrorCode::DiskFull) << result.error().message;
    }
    EXPECT_TRUE(read(*store, 1));
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &usual), 0);
    EXPECT_TRUE(put(*store, made_block("c", 3, 300'000)));
  }
  ::signal(SIGXFSZ, before);
  EXPECT_EQ(opened(here.file())->status().block_count, 2U);
}

TEST(StoreFault, GoesOnWhileItsLogCannotBeMoved) {
  const StoreFixture here;
  {
    const auto store = opened(here.file(), {.vfs = fault_file_system::name()});
    ASSERT_TRUE(put(*store, made_block("a", 1, 1'000)));
    fault_file_system::arm(Fault::DiskFull, 0);
    for (int i = 0; i < 100 && !store->status().trouble; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    ASSERT_TRUE(store->status().trouble) << "the log was never moved";
    EXPECT_EQ(store->status().trouble->code, StoreErrorCode::DiskFull);
    EXPECT_TRUE(read(*store, 1));
    fault_file_system::arm(Fault::None, 0);
    EXPECT_TRUE(put(*store, made_block("b", 2, 1'000)));
    fault_file_system::arm(Fault::DiskFull, 0);
  }
  fault_file_system::arm(Fault::None, 0);
  const auto store = opened(here.file());
  EXPECT_TRUE(read(*store, 1));
  EXPECT_TRUE(read(*store, 2));
}

TEST(StoreFault, TakesTheSmallBlockThatFitsBesideALargeOneThatDoesNot) {
  const StoreFixture here;
  const auto store = opened(here.file(), {.vfs = fault_file_system::name()});
  std::promise<void> go_on, is_held_up;
  store->put(made_block("first", 1, 100), [&](const StoreResult<Revision>&) {
    is_held_up.set_value();
    go_on.get_future().wait();
  });
  is_held_up.get_future().wait();
  std::promise<StoreErrorCode> large;
  std::promise<bool> small;
  store->put(made_block("large", 2, 4'000'000), [&large](const StoreResult<Revision>& result) {
    large.set_value(result ? StoreErrorCode{} : result.error().code);
    fault_file_system::arm(Fault::None, 0);
  });
  store->put(made_block("small", 3, 100),
             [&small](const StoreResult<Revision>& result) { small.set_value(result.has_value()); });
  fault_file_system::arm(Fault::DiskFull, 100);
  go_on.set_value();
  EXPECT_EQ(large.get_future().get(), StoreErrorCode::DiskFull);
  EXPECT_TRUE(small.get_future().get());
}

/// What a disk may hold after a power cut: all that was synced, and of what came later any sectors.
class CutDisk {
 public:
  CutDisk(std::map<std::string, std::string> files, const std::vector<Operation>& operations, std::size_t cut,
          std::mt19937_64& random)
      : files_(std::move(files)) {
    std::map<std::string, std::size_t> synced;
    for (std::size_t i = 0; i < cut; ++i) {
      if (operations[i].kind == Operation::Kind::Sync) synced[operations[i].path] = i + 1;
    }
    for (std::size_t i = 0; i < cut; ++i) {
      apply(operations[i], i < synced[operations[i].path], random);
    }
  }

  void write_to(const std::string& from, const std::string& to) const {
    for (const char* suffix : {"", "-wal"}) {
      const auto file = files_.find(from + suffix);
      if (file != files_.end()) std::ofstream(to + suffix, std::ios::binary) << file->second;
    }
  }

 private:
  void apply(const Operation& operation, bool is_certain, std::mt19937_64& random) {
    constexpr std::size_t kSector = 512;
    const auto happens = [&] { return is_certain || random() % 2 == 0; };
    std::string& bytes = files_[operation.path];
    switch (operation.kind) {
      case Operation::Kind::Write:
        for (std::size_t at = 0; at < operation.bytes.size();) {
          const std::size_t begin = operation.offset + at;
          const std::size_t count = std::min(operation.bytes.size() - at, kSector - begin % kSector);
          if (happens()) {
            if (bytes.size() < begin + count) bytes.resize(begin + count);
            bytes.replace(begin, count, operation.bytes, at, count);
          }
          at += count;
        }
        break;
      case Operation::Kind::Truncate:
        if (happens()) bytes.resize(operation.offset);
        break;
      case Operation::Kind::Remove:
        if (happens()) files_.erase(operation.path);
        break;
      case Operation::Kind::Sync:
        break;
    }
  }

  std::map<std::string, std::string> files_;
};

std::string content_of(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

TEST(StorePowerCut, KeepsEveryAcknowledgedBlock) {
  const StoreFixture here;
  opened(here.file());
  const std::map<std::string, std::string> before{{here.file(), content_of(here.file())}};
  struct Acknowledged {
    std::size_t operation_count = 0;
    std::uint64_t seed = 0;
    std::string id;
  };
  std::vector<Acknowledged> acknowledged;
  std::mutex mutex;
  fault_file_system::start_recording();
  constexpr std::size_t kSizes[] = {100, 9'000, 100'000};
  for (int session = 0; session < 3; ++session) {
    const auto store = opened(here.file(), {.history_bytes = 100'000, .vfs = fault_file_system::name()});
    for (std::uint64_t i = 0; i < 60; ++i) {
      const std::uint64_t seed = static_cast<std::uint64_t>(session) * 1'000 + i;
      const std::string id = "b" + std::to_string(i % 7);
      const auto on_done = [&acknowledged, &mutex, seed, id](const StoreResult<Revision>& result) {
        const std::lock_guard lock(mutex);
        if (result) acknowledged.push_back({fault_file_system::recorded_count(), seed, id});
      };
      store->put(made_block(id, seed, kSizes[i % 3]), on_done);
      if (i % 4 == 0) (void)read(*store, 1);  // Waits, so that not all go together.
    }
    if (session == 1) std::this_thread::sleep_for(std::chrono::milliseconds(500));  // The log is moved meanwhile.
  }
  const auto operations = fault_file_system::stop_recording();
  ASSERT_EQ(acknowledged.size(), 180U);
  std::mt19937_64 random(std::random_device{}());
  for (int cut = 0; cut < 100; ++cut) {
    const std::size_t at = random() % (operations.size() + 1);
    const StoreFixture there;
    CutDisk(before, operations, at, random).write_to(here.file(), there.file());
    const auto store = opened(there.file());
    ASSERT_NE(store, nullptr) << "cut after " << at << " of " << operations.size() << " operations";
    std::map<std::string, std::uint64_t> wanted;
    for (const auto& change : acknowledged) {
      if (change.operation_count <= at) wanted[change.id] = change.seed;
    }
    for (const auto& [id, seed] : wanted) {
      const auto facts = store->find(id);
      ASSERT_TRUE(facts) << id;
      ASSERT_GE(facts->description.vertex_count, seed) << id << ": an acknowledged change is gone";
    }
    const auto visited = store->visit(std::nullopt, [](const StoredBlock& block) {
      EXPECT_TRUE(*block.ply == made_bytes(block.facts.description.vertex_count, block.ply->size()));
      return true;
    });
    ASSERT_TRUE(visited) << visited.error().message;
  }
}

}  // namespace
}  // namespace spectra::store
