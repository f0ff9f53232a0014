#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <map>
#include <optional>
#include <random>
#include <semaphore>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "server/store/block_store.hpp"
#include "tests/unit/store/store_fixture.hpp"

namespace spectra::store {
namespace {

constexpr std::uint64_t kIds = 20;

/// What the writing process says of a change that was acknowledged.
struct Acknowledged {
  Revision revision = 0;
  std::uint64_t number = 0;  ///< Of the change; everything about it follows from that.
};

std::string id_of(std::uint64_t number) {
  return "block-" + std::to_string(number % kIds);
}

bool is_removal(std::uint64_t number) {
  return number % 7 == 3;
}

std::size_t size_of(std::uint64_t number) {
  constexpr std::size_t kSizes[] = {0, 300, 5'000, 60'000, 200'000};
  return kSizes[number / 3 % 5];
}

/// Puts and removes blocks until it is killed; every acknowledgement goes into the pipe.
[[noreturn]] void write_for_ever(const std::string& file, int pipe, std::uint64_t number) {
  auto opening = BlockStore::open(file, {.history_bytes = 50'000'000});
  if (!opening) {
    const Acknowledged refused{0, 0};
    (void)!::write(pipe, &refused, sizeof refused);
    ::_exit(1);
  }
  BlockStore& store = *opening.value();
  constexpr int kInFlight = 8;
  std::counting_semaphore<kInFlight> room(kInFlight);
  for (;; ++number) {
    room.acquire();
    const auto on_done = [pipe, number, &room](StoreResult<Revision> revision) {
      const Acknowledged acknowledged{revision ? revision.value() : 0, number};
      if (revision) (void)!::write(pipe, &acknowledged, sizeof acknowledged);
      room.release();
    };
    if (is_removal(number)) {
      store.remove(id_of(number), on_done);
    } else {
      store.put(made_block(id_of(number), number, size_of(number)), on_done);
    }
  }
}

/// How many times a writing process is killed: some in every run, SPECTRA_KILL_ROUNDS for more.
int round_count() {
  const char* text = std::getenv("SPECTRA_KILL_ROUNDS");
  return text == nullptr ? 12 : std::atoi(text);
}

TEST(StoreKill, KeepsEveryAcknowledgedBlockByteForByte) {
  std::optional<StoreFixture> here;
  std::random_device seed;
  std::mt19937_64 random(seed());
  std::uint64_t number = 1;
  std::uint64_t acknowledged_count = 0, kept_unacknowledged = 0;
  std::map<std::string, Acknowledged> newest;
  const int rounds = round_count();
  for (int round = 0; round < rounds; ++round) {
    // Now and then a new store, so that some are killed while they are made.
    if (round % 5 == 0) {
      here.emplace();
      newest.clear();
    }
    int ends[2];
    ASSERT_EQ(::pipe(ends), 0);
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      ::close(ends[0]);
      write_for_ever(here->file(), ends[1], number);
    }
    ::close(ends[1]);
    std::this_thread::sleep_for(std::chrono::microseconds(random() % (round % 5 == 0 ? 20'000 : 200'000)));
    ::kill(child, SIGKILL);
    std::vector<Acknowledged> acknowledged;
    for (Acknowledged next; ::read(ends[0], &next, sizeof next) == ssize_t{sizeof next};) acknowledged.push_back(next);
    ::close(ends[0]);
    ::waitpid(child, nullptr, 0);

    const auto store = opened(here->file());
    ASSERT_NE(store, nullptr);
    for (const auto& [revision, of] : acknowledged) {
      ASSERT_GT(revision, 0U) << "the process was refused the store";
      newest[id_of(of)] = {revision, of};
      number = std::max(number, of + 1);
      if (is_removal(of)) continue;
      const auto block = read(*store, revision);
      if (block) {
        ASSERT_EQ(block.value().facts.description.id, id_of(of));
        ASSERT_TRUE(*block.value().ply == made_bytes(of, size_of(of)));
      } else {
        ASSERT_EQ(block.error().code, StoreErrorCode::NotFound) << block.error().message;
        const auto now = store->find(id_of(of));
        ASSERT_TRUE(!now || now->revision > revision) << "a current block is gone";
      }
    }
    acknowledged_count += acknowledged.size();
    for (const auto& [id, change] : newest) {
      const auto now = store->find(id);
      const Revision revision = now ? now->revision : 0;
      if (is_removal(change.number)) {
        ASSERT_TRUE(!now || revision > change.revision) << id << " is back";
      } else {
        ASSERT_TRUE(!now || revision >= change.revision) << id << " is older than what was acknowledged";
        ASSERT_TRUE(now || store->status().last_revision > change.revision) << id << " is gone";
      }
    }
    // What was not acknowledged in time is there whole or not at all.
    const auto visited = store->visit(std::nullopt, [&](const StoredBlock& block) {
      const std::uint64_t of = block.facts.description.vertex_count;
      EXPECT_EQ(block.facts.description.id, id_of(of));
      EXPECT_TRUE(*block.ply == made_bytes(of, size_of(of)));
      kept_unacknowledged += std::uint64_t{newest[id_of(of)].number < of};
      number = std::max(number, of + 1);
      return true;
    });
    ASSERT_TRUE(visited) << visited.error().message;
    number += kIds;
  }
  EXPECT_GT(acknowledged_count, 0U);
  std::printf("%d kills, %llu acknowledged changes, all there; %llu that were not acknowledged any more, whole\n",
              rounds, static_cast<unsigned long long>(acknowledged_count),
              static_cast<unsigned long long>(kept_unacknowledged));
}

}  // namespace
}  // namespace spectra::store
