#include "server/sources/map_keeper.hpp"

#include <gtest/gtest.h>

#include <condition_variable>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <future>
#include <limits>
#include <thread>
#include <variant>

#include "server/sources/block_options.hpp"

namespace spectra::sources {
namespace {

/// A flat sheet of side x side vertices as a PLY file with double coordinates, the part of a lattice that begins at `column`.
std::string square(std::size_t side, std::size_t column = 0, double x0 = 0, double y0 = 0, double spacing = 1) {
  std::string ply = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(side * side) +
                    "\nproperty double x\nproperty double y\nproperty double z\nelement face " +
                    std::to_string(2 * (side - 1) * (side - 1)) +
                    "\nproperty list uchar int vertex_indices\nend_header\n";
  const auto put = [&ply](const auto& value) {
    char bytes[sizeof value];
    std::memcpy(bytes, &value, sizeof value);
    ply.append(bytes, sizeof value);
  };
  for (std::size_t i = 0; i < side * side; ++i) {
    const auto row = static_cast<double>(i / side);
    put(x0 + spacing * static_cast<double>(column + i % side) + 0.137 * row);
    put(y0 + spacing * row);
    put(0.0);
  }
  for (std::size_t row = 0; row + 1 < side; ++row) {
    for (std::size_t step = 0; step + 1 < side; ++step) {
      const auto corner = static_cast<std::int32_t>(row * side + step);
      const auto next = static_cast<std::int32_t>(side);
      for (const auto& triangle :
           {std::array{corner, corner + 1, corner + next}, std::array{corner + 1, corner + next + 1, corner + next}}) {
        put(std::uint8_t{3});
        for (const std::int32_t vertex : triangle) put(vertex);
      }
    }
  }
  return ply;
}

class MapKeeperTest : public testing::Test {
 protected:
  explicit MapKeeperTest(std::uint64_t most_bytes = std::numeric_limits<std::uint64_t>::max())
      : map_(scenes_, pool_, nullptr, std::nullopt, most_bytes) {
    EXPECT_FALSE(map_.is_open());
    EXPECT_FALSE(map_.restore());
    EXPECT_TRUE(map_.is_open());
  }
  ~MapKeeperTest() override {
    map_.end();
    pool_.stop();
  }

  void put(const std::string& id, std::string ply) {
    IncomingBlock block = incoming_block(id, std::string()).value();
    block.ply = std::make_shared<const std::string>(std::move(ply));
    ++asked_;
    map_.put(std::move(block), [this, id](const std::variant<MapKeeper::Taken, net::BlockRefusal>& outcome) {
      const auto* refusal = std::get_if<net::BlockRefusal>(&outcome);
      tell(refusal != nullptr ? id + " refused: " + refusal->code
                              : id + " has " + std::to_string(std::get<MapKeeper::Taken>(outcome).entry.vertex_count));
    });
  }

  void remove(const std::string& id) {
    ++asked_;
    map_.remove(id, [this, id](const std::variant<store::Revision, net::BlockRefusal>& outcome) {
      const auto* refusal = std::get_if<net::BlockRefusal>(&outcome);
      tell(refusal != nullptr ? id + " refused: " + refusal->code : id + " is gone");
    });
  }

  std::vector<std::string> answers() {
    std::unique_lock lock(mutex_);
    answered_.wait(lock, [this] { return answers_.size() == asked_; });
    return answers_;
  }

  std::vector<base::Vec3f> positions_of(const std::string& id) {
    const auto mesh = scenes_.current()->block_mesh(id);
    return {mesh->positions().begin(), mesh->positions().end()};
  }

  map::SceneStore scenes_;
  jobs::WorkerPool pool_{2};
  MapKeeper map_;

 private:
  void tell(std::string answer) {
    const std::lock_guard lock(mutex_);
    answers_.push_back(std::move(answer));
    answered_.notify_all();
  }

  std::mutex mutex_;
  std::condition_variable answered_;
  std::vector<std::string> answers_;
  std::size_t asked_ = 0;
};

class FullMapTest : public MapKeeperTest {
 protected:
  FullMapTest() : MapKeeperTest(2 * MapKeeper::bytes_of(100, 162)) {}
};

TEST_F(FullMapTest, HasRoomAgainWhenABlockIsGoneOrSmaller) {
  const auto answer = [this] { return answers().back(); };
  put("a", square(10));
  EXPECT_EQ(answer(), "a has 100");
  put("b", square(10, 100));
  EXPECT_EQ(answer(), "b has 100");
  put("c", square(2, 200));
  EXPECT_EQ(answer(), "c refused: map_full");
  put("b", square(11, 100));
  EXPECT_EQ(answer(), "b refused: map_full");
  put("b", square(10, 100));
  EXPECT_EQ(answer(), "b has 100") << "in its own place";
  remove("a");
  EXPECT_EQ(answer(), "a is gone");
  put("c", square(2, 200));
  EXPECT_EQ(answer(), "c has 4");
}

TEST_F(MapKeeperTest, ChangesOfABlockTakeEffectInTheirOrderHoweverLongTheyAreRead) {
  put("first", square(3, 1000));
  ASSERT_EQ(answers().size(), 1U);
  put("a", square(300));
  remove("a");
  put("a", square(10));
  put("a", "no PLY at all");
  put("a", square(20));
  remove("a");
  remove("a");
  put("a", square(5));
  EXPECT_EQ(answers().size(), 9U);
  std::vector<std::string> in_order = answers();
  // Refusals of what cannot be read come when it has been read.
  const auto unreadable = std::find(in_order.begin(), in_order.end(), "a refused: unreadable_block");
  ASSERT_NE(unreadable, in_order.end());
  in_order.erase(unreadable);
  EXPECT_EQ(in_order, (std::vector<std::string>{"first has 9", "a has 90000", "a is gone", "a has 100", "a has 400",
                                                "a is gone", "a refused: not_found", "a has 25"}));
  EXPECT_EQ(scenes_.current()->vertex_count(), 9U + 25U);
}

TEST_F(MapKeeperTest, ALongReadKeepsNoOtherBlockWaiting) {
  put("first", square(3, 1000));
  ASSERT_EQ(answers().size(), 1U);
  put("large", square(600));
  put("small", square(3, 2000));
  EXPECT_EQ(answers()[1], "small has 9");
}

TEST_F(MapKeeperTest, WhatBlocksShareIsTheSameWhenAllComeAtOnceIntoAnEmptyMap) {
  // Coordinates whose last bits a float does not have, and blocks that would choose different origins for themselves.
  put("not a PLY", "x");
  for (std::size_t i = 0; i < 12; ++i) put("b" + std::to_string(i), square(9, 8 * i, 500'000.1, 4'000'000.3, 1.1));
  ASSERT_EQ(answers().size(), 13U);
  for (std::size_t i = 0; i + 1 < 12; ++i) {
    const auto left = positions_of("b" + std::to_string(i)), right = positions_of("b" + std::to_string(i + 1));
    ASSERT_EQ(left.size(), 81U);
    for (std::size_t row = 0; row < 9; ++row) EXPECT_EQ(left[9 * row + 8], right[9 * row]) << i;
  }
}

TEST_F(MapKeeperTest, RefusesWhatLiesWhereNothingOfTheMapCan) {
  const auto answer = [this] { return answers().back(); };
  put("unit", square(5, 0, 0, 0, 2e29));
  EXPECT_EQ(answer(), "unit refused: absurd_extent");
  put("place", square(5, 0, 1e12));
  EXPECT_EQ(answer(), "place refused: absurd_extent");
  put("utm", square(9, 0, 691'000, 5'334'000, 0.1));
  EXPECT_EQ(answer(), "utm has 81");
  put("local", square(9));
  EXPECT_EQ(answer(), "local refused: too_far_away");
  put("near", square(9, 0, 1'600'000, 5'334'000, 0.1));
  EXPECT_EQ(answer(), "near has 81") << "909 km";
  remove("utm");
  remove("near");
  EXPECT_EQ(answers().size(), 7U);
  put("local", square(9));
  EXPECT_EQ(answer(), "local has 81") << "an empty map begins anew";
}

// The map as it was is read by the constants of that time, also when it has been emptied and lies elsewhere now.
TEST(MapKeeper, RemembersWhereAMapLayThatWasEmptied) {
  const std::filesystem::path folder = std::filesystem::path(testing::TempDir()) / "spectra-map-emptied";
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  int second = 0;
  const auto open = [&] {
    return store::BlockStore::open((folder / "map.sqlite").string(),
                                   {.now = [&second] { return store::StoreTime(std::chrono::seconds(1000 + second)); }})
        .value();
  };
  const auto change = [&second](MapKeeper& map, const std::string& id, const std::string& ply) {
    ++second;
    std::promise<bool> is_taken;
    if (ply.empty()) {
      map.remove(id,
                 [&](const auto& outcome) { is_taken.set_value(std::holds_alternative<store::Revision>(outcome)); });
    } else {
      IncomingBlock block = incoming_block(id, std::string()).value();
      block.ply = std::make_shared<const std::string>(ply);
      map.put(std::move(block),
              [&](const auto& outcome) { is_taken.set_value(std::holds_alternative<MapKeeper::Taken>(outcome)); });
    }
    ASSERT_TRUE(is_taken.get_future().get()) << id;
  };
  const std::string utm = square(9, 0, 691'000, 5'334'000, 0.1), local = square(9, 0, 0, 0, 0.1);
  const auto serve = [&](const std::optional<store::StoreTime>& at, const auto& use) {
    map::SceneStore scenes;
    jobs::WorkerPool pool(2);
    {
      MapKeeper map(scenes, pool, open(), at);
      ASSERT_EQ(map.restore(), std::nullopt);
      use(map, scenes);
      map.end();
    }
    pool.stop();
  };
  base::Vec3d origin_of_utm;
  const auto positions_of = [](const map::SceneStore& scenes, const std::string& id) {
    const auto mesh = scenes.current()->block_mesh(id);
    return std::vector<base::Vec3f>(mesh->positions().begin(), mesh->positions().end());
  };
  std::vector<base::Vec3f> of_utm;
  serve(std::nullopt, [&](MapKeeper& map, const map::SceneStore& scenes) {
    change(map, "utm", utm);
    origin_of_utm = scenes.current()->origin();
    of_utm = positions_of(scenes, "utm");
    change(map, "utm", "");
    change(map, "local", local);
    EXPECT_EQ(scenes.current()->origin(), base::Vec3d{});
    change(map, "local", "");
  });
  EXPECT_NE(origin_of_utm, base::Vec3d{});
  serve(std::nullopt, [&](MapKeeper& map, const map::SceneStore& scenes) {
    change(map, "utm", utm);
    EXPECT_EQ(scenes.current()->origin(), origin_of_utm) << "emptied before it was served again";
    change(map, "utm", "");
    change(map, "local", local);
  });
  serve(store::StoreTime(std::chrono::seconds(1001)), [&](MapKeeper&, const map::SceneStore& scenes) {
    EXPECT_EQ(scenes.current()->origin(), origin_of_utm);
    EXPECT_EQ(positions_of(scenes, "utm"), of_utm);
  });
  serve(std::nullopt, [&](MapKeeper& map, const map::SceneStore& scenes) {
    EXPECT_EQ(scenes.current()->origin(), base::Vec3d{});
    std::promise<std::vector<base::Vec3f>> past;
    map.read_at(store::StoreTime(std::chrono::seconds(1001)), "utm", [&](const auto& outcome) {
      const auto* scene = std::get_if<files::LoadedScene>(&outcome);
      if (scene == nullptr) return past.set_value({});
      past.set_value({scene->mesh.positions().begin(), scene->mesh.positions().end()});
    });
    EXPECT_EQ(past.get_future().get(), of_utm);
  });
  std::filesystem::remove_all(folder);
}

// Killed before the constants of its map were stored: the first block decides them again, and the others come to a map that is there.
TEST(MapKeeper, MakesTheCoarseTilesOfWhatItRestores) {
  const std::filesystem::path folder = std::filesystem::path(testing::TempDir()) / "spectra-map-keeper";
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  auto store = store::BlockStore::open((folder / "map.sqlite").string(), {}).value();
  for (const std::string id : {"a", "b", "c"}) {
    const auto ply = std::make_shared<const std::string>(square(120, id == "a" ? 0 : id == "b" ? 119 : 238));
    std::promise<bool> is_stored;
    store->put({{id, std::nullopt, std::nullopt, "", 120 * 120, 2 * 119 * 119, {}}, ply, nullptr},
               [&](const store::StoreResult<store::Revision>& outcome) { is_stored.set_value(outcome.has_value()); });
    ASSERT_TRUE(is_stored.get_future().get());
  }
  map::SceneStore scenes;
  jobs::WorkerPool pool(2);
  MapKeeper map(scenes, pool, std::move(store));
  ASSERT_EQ(map.restore(), std::nullopt);
  // Tiles of the first block meet those of the second now, and are made again.
  const auto restored = scenes.current();
  for (int i = 0; i < 1000 && scenes.current() == restored; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_NE(scenes.current(), restored);
  map.end();
  pool.stop();
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace spectra::sources
