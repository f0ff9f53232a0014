#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <map>
#include <optional>
#include <vector>

#include "server/store/block_store.hpp"
#include "tests/unit/store/store_fixture.hpp"

namespace spectra::store {
namespace {

StoreTime at_second(std::int64_t second) {
  return StoreTime(std::chrono::seconds(second));
}

/// The plainest thing that does what the store promises: every state that the map ever had, kept whole.
struct Model {
  struct Block {
    Revision revision = 0;
    std::uint64_t seed = 0;
    std::size_t size = 0;
    friend bool operator==(const Block&, const Block&) = default;
  };
  using Map = std::map<std::string, Block>;
  struct State {
    std::int64_t second = 0;
    Map map;
  };
  std::vector<State> states{{0, {}}};  // By revision.
  std::map<std::string, std::string> constants;

  const Map& now() const { return states.back().map; }
  Revision revision() const { return states.size() - 1; }
  /// The newest state whose time was not later.
  const Map& at(std::int64_t second) const {
    const auto found = std::find_if(states.rbegin(), states.rend(), [&](const State& s) { return s.second <= second; });
    return found->map;
  }
};

Model::Map all_of(BlockStore& store, std::optional<std::int64_t> second, std::size_t limit) {
  Model::Map map;
  std::string after;
  for (;;) {
    const auto page = second ? store.page_at(at_second(*second), after, limit).value() : store.page(after, limit);
    for (const auto& facts : page.blocks) {
      const auto block = read(store, facts.revision);
      RC_ASSERT(block.has_value());
      RC_ASSERT(block.value().facts == facts);
      RC_ASSERT(*block.value().ply == made_bytes(facts.description.vertex_count, facts.size_bytes));
      map[facts.description.id] = {facts.revision, facts.description.vertex_count, facts.size_bytes};
    }
    if (!page.next) return map;
    after = *page.next;
  }
}

/// Of 40 bursts of 5 blocks of 50,000 bytes nothing is forgotten.
constexpr std::uint64_t kMoreThanAll = 100'000'000;

RC_GTEST_PROP(StoreProperty, DoesWhatAMapThatForgetsNothingWouldDo, ()) {
  const StoreFixture here;
  const auto history_bytes = *rc::gen::element<std::uint64_t>(0, 3'000, 20'000, kMoreThanAll);
  std::int64_t second = 1'000;
  const StoreOptions options{.history_bytes = history_bytes, .now = [&second] { return at_second(second); }};
  auto store = opened(here.file(), options);
  Model model;
  const auto steps = *rc::gen::inRange(1, 40);
  for (int step = 0; step < steps; ++step) {
    second += *rc::gen::inRange(0, 3);
    const auto what = *rc::gen::inRange(0, 10);
    if (what == 0) {
      store.reset();
      store = opened(here.file(), options);
    } else if (what == 1) {
      const std::string key(1, static_cast<char>('a' + *rc::gen::inRange(0, 3)));
      const std::string value = *rc::gen::element<std::string>("", "1", "a long one");
      RC_ASSERT(set_constant(*store, key, value).has_value());
      if (value.empty()) {
        model.constants.erase(key);
      } else {
        model.constants[key] = value;
      }
    } else {
      // A burst that waits together.
      const auto count = *rc::gen::inRange(1, 6);
      std::vector<std::pair<std::promise<StoreResult<Revision>>, std::optional<Revision>>> burst(
          static_cast<std::size_t>(count));
      const std::int64_t now = second;
      for (auto& [done, expected] : burst) {
        const std::string id(1, static_cast<char>('a' + *rc::gen::inRange(0, 5)));
        Model::State next{now, model.now()};
        const auto answer = [&done = done](StoreResult<Revision> result) { done.set_value(std::move(result)); };
        if (*rc::gen::inRange(0, 3) == 0) {
          if (next.map.erase(id) > 0) expected = model.revision() + 1;
          store->remove(id, answer);
        } else {
          const Model::Block block{model.revision() + 1, *rc::gen::arbitrary<std::uint32_t>(),
                                   *rc::gen::element<std::size_t>(0, 1, 500, 9'000, 50'000)};
          next.map[id] = block;
          expected = block.revision;
          store->put(made_block(id, block.seed, block.size), answer);
        }
        if (expected) model.states.push_back(std::move(next));
      }
      for (auto& [done, expected] : burst) {
        const auto result = done.get_future().get();
        RC_ASSERT(result.has_value() == expected.has_value());
        if (expected) RC_ASSERT(result.value() == *expected);
      }
    }
    RC_ASSERT(store->status().history_bytes <= history_bytes);
    RC_ASSERT(store->status().last_revision == model.revision());
  }
  RC_ASSERT(all_of(*store, std::nullopt, static_cast<std::size_t>(*rc::gen::inRange(1, 6))) == model.now());
  bool is_known_before = false;
  for (std::int64_t time = 990; time <= second + 1; ++time) {
    const auto page = store->page_at(at_second(time), "", 1);
    if (!page) {
      RC_ASSERT(page.error().code == StoreErrorCode::HistoryGone);
      RC_ASSERT(!is_known_before);
      RC_ASSERT(history_bytes < kMoreThanAll);
      continue;
    }
    is_known_before = true;
    RC_ASSERT(all_of(*store, time, 2) == model.at(time));
  }
  RC_ASSERT(is_known_before);
  for (const char* key : {"a", "b", "c"}) {
    const auto found = model.constants.find(key);
    RC_ASSERT(store->constant(key) == (found == model.constants.end() ? std::nullopt : std::optional(found->second)));
  }
}

}  // namespace
}  // namespace spectra::store
