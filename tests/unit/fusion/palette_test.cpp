#include "fusion/colour/palette.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

namespace spectra::fusion {
namespace {

TEST(Palettes, AtLeastFifteenWithDistinctIds) {
  std::set<std::string> ids;
  for (const Palette& palette : all_palettes()) ids.insert(palette.id);
  EXPECT_GE(ids.size(), 15U);
  EXPECT_EQ(ids.size(), all_palettes().size());
  for (const char* id : {"white_hot", "black_hot", "iron", "iron_safe", "rainbow", "rainbow_safe", "arctic", "lava",
                         "inferno", "magma", "plasma", "viridis", "cividis", "turbo", "high_contrast"}) {
    EXPECT_NE(find_palette(id), nullptr) << id;
  }
  EXPECT_EQ(find_palette("IRON"), nullptr);
}

TEST(Palettes, StayWithinTheChannelRange) {
  for (const Palette& palette : all_palettes()) {
    for (const auto& row : palette.table) {
      for (const double channel : row) {
        EXPECT_GE(channel, 0) << palette.id;
        EXPECT_LE(channel, 255) << palette.id;
      }
    }
  }
}

TEST(Palettes, NoPaletteHasEqualEnds) {
  for (const Palette& palette : all_palettes()) {
    double difference = 0;
    for (std::size_t channel = 0; channel < 3; ++channel) {
      difference += std::abs(palette.table.front()[channel] - palette.table.back()[channel]);
    }
    EXPECT_GT(difference, 64) << palette.id;
  }
}

TEST(Palettes, NeighbouringRowsAreNeverEqual) {
  for (const Palette& palette : all_palettes()) {
    for (std::size_t row = 1; row < 256; ++row) {
      EXPECT_NE(palette.table[row], palette.table[row - 1]) << palette.id << " row " << row;
    }
  }
}

TEST(Palettes, MarksFollowTheRule) {
  for (const Palette& palette : all_palettes()) {
    EXPECT_EQ(palette.fusion_safe, carries_hue_alone(palette.table)) << palette.id;
  }
  for (const char* id : {"iron_safe", "rainbow_safe"}) EXPECT_TRUE(find_palette(id)->fusion_safe) << id;
  for (const char* id : {"white_hot", "black_hot", "iron", "rainbow", "inferno", "magma", "high_contrast"}) {
    EXPECT_FALSE(find_palette(id)->fusion_safe) << id;
  }
}

TEST(Palettes, RuleRefusesWeakChromaARepeatedHueAndAHalt) {
  const PaletteTable safe = find_palette("rainbow_safe")->table;
  PaletteTable grey = safe;
  grey[100] = {128, 128, 100};
  EXPECT_FALSE(carries_hue_alone(grey));
  PaletteTable repeated = safe;
  repeated[200] = safe[10];
  EXPECT_FALSE(carries_hue_alone(repeated));
  PaletteTable halting = safe;
  halting[120] = halting[119];
  EXPECT_FALSE(carries_hue_alone(halting));
}

TEST(Palettes, TwoTellTwoDirectionsAndTheRestDoNot) {
  std::set<std::string> diverging;
  for (const Palette& palette : all_palettes()) {
    EXPECT_EQ(palette.diverging, is_diverging(palette.table)) << palette.id;
    if (palette.diverging) diverging.insert(palette.id);
  }
  EXPECT_EQ(diverging, (std::set<std::string>{"blue_red", "cyan_amber"}));
}

TEST(Palettes, ADivergingOneHasANeutralMiddleStrongArmsAndEndsThatDiffer) {
  const PaletteTable good = find_palette("blue_red")->table;
  PaletteTable tinted = good;
  tinted[128] = {240, 200, 180};
  EXPECT_FALSE(is_diverging(tinted));
  PaletteTable weak = good;
  weak[200] = {128, 128, 120};
  EXPECT_FALSE(is_diverging(weak));
  PaletteTable turning = good;
  turning[20] = {40, 200, 60};
  EXPECT_FALSE(is_diverging(turning));
  PaletteTable alike = good;
  for (std::size_t row = 0; row < 128; ++row) alike[row] = good[255 - row];
  EXPECT_FALSE(is_diverging(alike));
}

TEST(Palettes, RuleRefusesMoreThanOneTurn) {
  PaletteTable wheel{};
  const auto fill = [&wheel](double degrees_in_all) {
    for (std::size_t row = 0; row < 256; ++row) {
      const double sextant = degrees_in_all / 60 * static_cast<double>(row) / 255;
      for (std::size_t channel = 0; channel < 3; ++channel) {
        const double k = std::fmod(sextant + std::array{5.0, 3.0, 1.0}[channel], 6.0);
        wheel[row][channel] = 255 * (1 - std::clamp(std::min(k, 4 - k), 0.0, 1.0));
      }
    }
  };
  fill(350);
  EXPECT_TRUE(carries_hue_alone(wheel));
  fill(370);
  EXPECT_FALSE(carries_hue_alone(wheel));
}

TEST(PaletteColour, IsLinearBetweenRowsAndClamped) {
  const PaletteTable& table = find_palette("inferno")->table;
  EXPECT_EQ(palette_colour(table, 0), table.front());
  EXPECT_EQ(palette_colour(table, 1), table.back());
  EXPECT_EQ(palette_colour(table, -3), table.front());
  EXPECT_EQ(palette_colour(table, 2), table.back());
  const auto middle = palette_colour(table, 10.25 / 255);
  for (std::size_t channel = 0; channel < 3; ++channel) {
    EXPECT_NEAR(middle[channel], 0.75 * table[10][channel] + 0.25 * table[11][channel], 1e-12);
  }
}

}  // namespace
}  // namespace spectra::fusion
