#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "fake_scene.hpp"
#include "fusion/files/ply_reader.hpp"
#include "protocol/codec/draco_codec.hpp"
#include "simulated_link.hpp"

namespace spectra::stream {
namespace {

using protocol::FrameKind;
using testing::LinkSpeed;
using testing::plan_with_alpha;
using testing::SimulatedLink;

constexpr LinkSpeed kRadio{5e6 / 8, 0.1};
constexpr double kDrag_s = 3;
constexpr int kChangesPerSecond = 30;

/// What came of a slider that was dragged for three seconds after the whole scene had arrived.
struct Drag {
  double worst_lag_s = 0;       ///< How old, at any moment, the first setting not yet seen on the coarse picture was.
  double settle_s = 0;          ///< From the last change to the arrival of its last frame.
  std::size_t final_bytes = 0;  ///< Of the last generation.
  std::size_t coarse_count = 0;
  std::size_t most_in_flight_bytes = 0;
};

Drag dragged(const std::shared_ptr<const map::SceneSnapshot>& scene, LinkSpeed speed, StreamQuality quality = {}) {
  FrameCache cache(256u << 20);
  jobs::WorkerPool pool(2);
  SimulatedLink link(scene, cache, pool, speed);
  link.stream().set_quality(quality);
  link.stream().subscribe({});
  link.stream().set_plan(plan_with_alpha(*scene, 0));
  link.run();
  EXPECT_TRUE(link.completed_s.contains(1));
  link.arrivals.clear();
  link.most_in_flight_bytes = 0;

  // Changes are numbered by their generation; the first of the drag is 2. A change takes half a round trip to arrive.
  const double start_s = link.now_s() + 1;
  constexpr int kChanges = static_cast<int>(kDrag_s * kChangesPerSecond);
  const auto made_s = [&](std::uint32_t generation) {
    return start_s + static_cast<double>(generation - 2) / kChangesPerSecond;
  };
  for (int i = 0; i < kChanges; ++i) {
    link.at(made_s(static_cast<std::uint32_t>(i) + 2) + speed.round_trip_s / 2,
            [&link, &scene, i] { link.stream().set_plan(plan_with_alpha(*scene, 0.01 * (i + 1))); });
  }
  link.run();

  Drag drag;
  drag.most_in_flight_bytes = link.most_in_flight_bytes;
  constexpr std::uint32_t kLast = kChanges + 1;
  const auto root = scene->tiles().front()->id;
  std::uint32_t shown = 1;
  std::map<protocol::TileId, std::uint32_t> generation_of;
  for (const auto& arrival : link.arrivals) {
    EXPECT_EQ(arrival.header.kind, FrameKind::Colours);
    EXPECT_GT(arrival.header.generation, generation_of[arrival.header.tile]) << "an older generation over a newer";
    generation_of[arrival.header.tile] = arrival.header.generation;
    if (arrival.header.generation == kLast) {
      drag.final_bytes += arrival.size_bytes;
      drag.settle_s = arrival.at_s - made_s(kLast);
    }
    if (arrival.header.tile == root) {
      // Just before this arrival the picture lacked every change after `shown`.
      drag.worst_lag_s = std::max(drag.worst_lag_s, arrival.at_s - made_s(shown + 1));
      shown = arrival.header.generation;
      ++drag.coarse_count;
    }
  }
  EXPECT_EQ(shown, kLast);
  EXPECT_TRUE(link.completed_s.contains(kLast));
  return drag;
}

/// Three levels of tiles of `side` x `side` vertices: 1, 4 and 16.
std::shared_ptr<const map::SceneSnapshot> three_level_scene(int side) {
  std::vector<std::shared_ptr<const map::Tile>> tiles;
  for (std::uint8_t level = 0; level < 3; ++level) {
    const auto count = 1u << level;
    for (std::uint32_t y = 0; y < count; ++y) {
      for (std::uint32_t x = 0; x < count; ++x) {
        auto tile = testing::patch_tile({level, x, y, 0}, side, static_cast<int>(y * count + x), 20);
        // Noise that no predictor sees through.
        std::uint32_t state = 12'345 + level * 64U + y * 8 + x;
        for (auto& colour : tile->visible) {
          state = state * 1'664'525 + 1'013'904'223;
          colour = {static_cast<std::uint8_t>(100 + (state >> 28)), static_cast<std::uint8_t>(100 + (state >> 20) % 16),
                    static_cast<std::uint8_t>(100 + (state >> 12) % 16)};
        }
        tile->child_mask = level < 2 ? 0x0f : 0;
        tile->geometric_error_m = level == 0 ? 0.2F : level == 1 ? 0.05F : 0;
        tiles.push_back(std::move(tile));
      }
    }
  }
  return testing::scene_of(std::move(tiles));
}

void report(const char* name, const Drag& drag, LinkSpeed speed) {
  std::cout << name << ": worst lag " << drag.worst_lag_s * 1e3 << " ms, " << drag.coarse_count
            << " coarse pictures, settled after " << drag.settle_s * 1e3 << " ms, ideal "
            << (static_cast<double>(drag.final_bytes) / speed.bytes_per_s + speed.round_trip_s) * 1e3 << " ms for "
            << drag.final_bytes << " bytes, at most " << drag.most_in_flight_bytes << " in flight\n";
}

void expect_bars(const Drag& drag, LinkSpeed speed) {
  EXPECT_LE(drag.worst_lag_s, 0.4);
  EXPECT_LE(drag.settle_s, 1.25 * static_cast<double>(drag.final_bytes) / speed.bytes_per_s + speed.round_trip_s);
}

TEST(RadioLink, ADraggedSliderIsFollowedAndSettlesAtTheRateOfTheLink) {
  const auto scene = three_level_scene(96);
  const Drag drag = dragged(scene, kRadio);
  report("5 Mbit/s, 100 ms", drag, kRadio);
  expect_bars(drag, kRadio);
  EXPECT_GE(drag.coarse_count, 10U);
}

/// One change of the settings after the whole scene has arrived: when every leaf showed it for the first time and for the
/// last time, counted from the change, and the colours in the end.
struct Answer {
  double first_s = 0;
  double last_s = 0;
  std::map<protocol::TileId, std::vector<std::byte>> colours;
};

Answer answered(const std::shared_ptr<const map::SceneSnapshot>& scene, StreamQuality quality) {
  FrameCache cache(256u << 20);
  jobs::WorkerPool pool(2);
  SimulatedLink link(scene, cache, pool, kRadio);
  link.stream().set_quality(quality);
  link.stream().subscribe({});
  link.stream().set_plan(plan_with_alpha(*scene, 0));
  link.run();
  link.arrivals.clear();
  const double change_s = link.now_s() + 1;
  link.at(change_s, [&] { link.stream().set_plan(plan_with_alpha(*scene, 0.5)); });
  link.run();
  EXPECT_TRUE(link.completed_s.contains(2));
  Answer answer;
  std::map<protocol::TileId, double> first_s;
  for (const auto& arrival : link.arrivals) {
    if (arrival.header.tile.level < 2) continue;
    first_s.emplace(arrival.header.tile, arrival.at_s - change_s);
    answer.last_s = arrival.at_s - change_s;
  }
  EXPECT_EQ(first_s.size(), 16U);
  for (const auto& [tile, at_s] : first_s) answer.first_s = std::max(answer.first_s, at_s);
  for (auto& [tile, payload] : link.colours) {
    if (tile.level == 2) answer.colours.emplace(tile, std::move(payload));
  }
  return answer;
}

TEST(RadioLink, AutomaticQualityAnswersSoonerAndEndsTheSame) {
  const auto scene = three_level_scene(64);
  const Answer manual = answered(scene, {});
  StreamQuality quality;
  quality.automatic = true;
  quality.latency_target_ms = 1000 * manual.first_s * 0.7;
  const Answer automatic = answered(scene, quality);
  EXPECT_LT(automatic.first_s, 0.9 * manual.first_s);
  EXPECT_GT(automatic.last_s, automatic.first_s);
  EXPECT_EQ(automatic.colours, manual.colours);

  quality.latency_target_ms = 1000 * manual.last_s * 3;
  const Answer patient = answered(scene, quality);
  EXPECT_EQ(patient.first_s, patient.last_s) << "full quality at once where it is in time";
  EXPECT_EQ(patient.colours, manual.colours);
}

/// The largest remainder of any channel of a tile's colours, rounded to six bits: 0 when they carry no more.
int beyond_six_bits(const std::vector<std::byte>& payload) {
  int worst = 0;
  const auto decoded = protocol::codec::decoded_colours(payload);
  for (const protocol::codec::ColourBytes& colour : decoded.value()) {
    for (const std::uint8_t value : colour) worst = std::max(worst, value == 255 ? 0 : value % 4);
  }
  return worst;
}

TEST(RadioLink, WhatIsDrawnForAMomentCarriesFewerBitsOnASlowLinkOnly) {
  const auto scene = three_level_scene(96);
  for (const LinkSpeed speed : {LinkSpeed{5e4, 0.1}, LinkSpeed{1e8, 0.002}}) {
    const bool is_slow = speed.bytes_per_s < 1e6;
    FrameCache cache(256u << 20);
    jobs::WorkerPool pool(2);
    SimulatedLink link(scene, cache, pool, speed);
    link.stream().subscribe({});
    link.stream().set_plan(plan_with_alpha(*scene, 0));
    link.run();
    link.at(link.now_s() + 1, [&] { link.stream().set_plan(plan_with_alpha(*scene, 0.3)); });
    link.run();
    ASSERT_TRUE(link.completed_s.contains(2));
    for (const auto& tile : scene->tiles()) {
      const int beyond = beyond_six_bits(link.colours.at(tile->id));
      if (tile->id.level == 0) {
        EXPECT_EQ(beyond == 0, is_slow);
      } else if (tile->id.level == 2) {
        EXPECT_GT(beyond, 0) << "what is drawn in the end is exact";
      }
    }
    EXPECT_EQ(link.stream().stats().colour_levels, 256);
  }
}

TEST(RadioLink, AViewerThatStopsAcknowledgingHoldsBoundedMemory) {
  const auto scene = three_level_scene(96);
  FrameCache cache(256u << 20);
  jobs::WorkerPool pool(2);
  SimulatedLink link(scene, cache, pool, {.bytes_per_s = 1e9, .round_trip_s = 0.001});
  link.stream().subscribe({});
  link.stream().set_plan(plan_with_alpha(*scene, 0));
  link.run();
  link.stop_acknowledging();
  link.arrivals.clear();
  const double start_s = link.now_s() + 1;
  for (int i = 0; i < 60; ++i) {
    link.at(start_s + i / 30.0,
            [&link, &scene, i] { link.stream().set_plan(plan_with_alpha(*scene, 0.01 * (i + 1))); });
  }
  link.run();
  EXPECT_LE(link.most_queued_bytes, 8u << 20);
  EXPECT_FALSE(link.completed_s.contains(61));
  std::size_t sent_bytes = 0;
  for (const auto& arrival : link.arrivals) sent_bytes += arrival.size_bytes;
  EXPECT_LE(sent_bytes, 4u << 20) << "no more than the window";
}

TEST(RadioLink, TheRealSceneIsFollowedToo) {
  const char* folder = std::getenv("SPECTRA_TEST_DATA");
  if (folder == nullptr) GTEST_SKIP() << "SPECTRA_TEST_DATA names no folder with the real scenes";
  auto read = files::read_ply(std::string(folder) + "/arco_castle_1m.ply");
  ASSERT_TRUE(read.has_value());
  jobs::WorkerPool pool(2);
  const auto scene = map::SceneSnapshot::build(std::move(read.value().mesh), 1, pool, 32'000, map::LevelsOfDetail::All);
  const Drag drag = dragged(scene, kRadio);
  report("arco_castle_1m", drag, kRadio);
  expect_bars(drag, kRadio);
}

}  // namespace
}  // namespace spectra::stream
