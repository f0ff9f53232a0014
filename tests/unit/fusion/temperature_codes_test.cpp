#include "fusion/temperature_codes.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace spectra::fusion {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

std::vector<float> round_trip(const TemperatureCodes& codes, const std::vector<float>& celsius) {
  std::vector<std::uint16_t> code(celsius.size());
  codes.encode(celsius, code);
  std::vector<float> back(celsius.size());
  codes.decode(code, back);
  return back;
}

TEST(TemperatureCodes, AreOffByHalfAStepAtMost) {
  std::mt19937 engine(3);
  for (const auto& [low, high] : {std::pair(15.0F, 40.0F), {-40.0F, 600.0F}, {299.9F, 300.1F}, {21.5F, 21.5F}}) {
    std::uniform_real_distribution<float> between(low, high);
    std::vector<float> celsius = {low, high};
    while (celsius.size() < 10'000) celsius.push_back(low < high ? between(engine) : low);
    const TemperatureCodes codes = TemperatureCodes::covering(low, high, 0.01);
    EXPECT_FLOAT_EQ(codes.scale, 0.01F);
    const std::vector<float> back = round_trip(codes, celsius);
    // Beside the step there is the rounding of float32.
    const double bound = 0.005 + std::max(std::abs(double{low}), std::abs(double{high})) * 0x1p-22;
    for (std::size_t i = 0; i < celsius.size(); ++i) {
      ASSERT_NEAR(double{back[i]}, double{celsius[i]}, bound) << "from " << low << " to " << high;
    }
  }
}

TEST(TemperatureCodes, GiveRoundTemperaturesBackAsTheyWere) {
  for (const double step : {0.01, 0.005, 0.001, 0.5}) {
    const int hundredths = step > 0.01 ? 50 : 1;
    for (const int from : {-4000, -27'300, 0, 2150, 12'350}) {
      std::vector<float> celsius;
      for (int i = 0; i < 6500; ++i) celsius.push_back(static_cast<float>((from + i * hundredths) / 100.0));
      const TemperatureCodes codes = TemperatureCodes::covering(celsius.front(), celsius.back(), step);
      const std::vector<float> back = round_trip(codes, celsius);
      for (std::size_t i = 0; i < celsius.size(); ++i) ASSERT_EQ(back[i], celsius[i]) << "in steps of " << step;
    }
  }
  // What a threshold of 22.5 degC is compared with, beside any other temperature of the tile.
  std::mt19937 engine(5);
  std::uniform_real_distribution<float> between(-40, 22);
  for (int round = 0; round < 1000; ++round) {
    const TemperatureCodes codes = TemperatureCodes::covering(between(engine), between(engine) + 62.5F, 0.01);
    ASSERT_EQ(round_trip(codes, {22.5F, 22.1F, 22.07F}), (std::vector<float>{22.5F, 22.1F, 22.07F}));
  }
}

TEST(TemperatureCodes, OfOneTemperatureAreThatTemperature) {
  for (const float celsius : {25.0F, 25.003F, 21.23456F, -273.15F, 0.0F, 1e-20F, 1234.567F, 1e30F, -3e38F}) {
    for (const double step : {0.01, 0.3, 1e-9}) {
      const TemperatureCodes codes = TemperatureCodes::covering(celsius, celsius, step);
      EXPECT_EQ(round_trip(codes, {celsius})[0], celsius) << "in steps of " << step;
    }
  }
}

TEST(TemperatureCodes, OfOtherScalesAreReadWithEachOperationRounded) {
  const TemperatureCodes codes{0.010000000707805157F, 20};
  std::vector<float> back(1);
  codes.decode(std::vector<std::uint16_t>{250}, back);
  EXPECT_EQ(back[0], 250.0F * 0.010000000707805157F + 20.0F);
  const TemperatureCodes moved{0.01F, 20.00123F};
  moved.decode(std::vector<std::uint16_t>{250}, back);
  EXPECT_EQ(back[0], 250.0F * 0.01F + 20.00123F);
}

TEST(TemperatureCodes, TakeALargerStepWhereTheSpanNeedsIt) {
  const TemperatureCodes codes = TemperatureCodes::covering(-500, 1500, 0.01);
  EXPECT_GT(codes.scale, 0.0305F);
  EXPECT_LT(codes.scale, 0.0306F);
  const std::vector<float> back = round_trip(codes, {-500, 1500});
  EXPECT_NEAR(back[0], -500, 0.016);
  EXPECT_NEAR(back[1], 1500, 0.016);
}

TEST(TemperatureCodes, KeepWhatIsMissingAndWhatIsBeyondTheRange) {
  const TemperatureCodes codes = TemperatureCodes::covering(20, 30, 0.01);
  std::vector<std::uint16_t> code(3);
  codes.encode(std::vector<float>{std::nanf(""), kInfinity, -kInfinity}, code);
  EXPECT_EQ(code, (std::vector<std::uint16_t>{65535, 65534, 65533}));
  const std::vector<float> back = round_trip(codes, {std::nanf(""), kInfinity, -kInfinity});
  EXPECT_TRUE(std::isnan(back[0]));
  EXPECT_EQ(back[1], kInfinity);
  EXPECT_EQ(back[2], -kInfinity);
}

TEST(TemperatureCodes, OfNeighboursWithOtherExtremesGiveEqualTemperaturesTheSameValue) {
  const TemperatureCodes left = TemperatureCodes::covering(17.003F, 25, 0.01);
  const TemperatureCodes right = TemperatureCodes::covering(19.998F, 31, 0.01);
  for (const float celsius : {20.0F, 21.234F, 24.999F}) {
    EXPECT_EQ(round_trip(left, {celsius})[0], round_trip(right, {celsius})[0]);
  }
}

TEST(TemperatureCodes, StandAnyTemperatures) {
  std::mt19937 engine(9);
  for (int round = 0; round < 20'000; ++round) {
    float low = std::bit_cast<float>(static_cast<std::uint32_t>(engine()));
    float high = std::bit_cast<float>(static_cast<std::uint32_t>(engine()));
    if (!std::isfinite(low) || !std::isfinite(high)) continue;
    if (low > high) std::swap(low, high);
    const TemperatureCodes codes = TemperatureCodes::covering(low, high, round % 2 ? 0.01 : 1e-9);
    ASSERT_TRUE(std::isfinite(codes.scale) && codes.scale > 0) << low << " to " << high;
    ASSERT_TRUE(std::isfinite(codes.offset)) << low << " to " << high;
    const std::vector<float> back = round_trip(codes, {low, high});
    // Half a step, and the rounding of float32.
    const double bound = 0.51 * double{codes.scale} + std::max(std::abs(double{low}), std::abs(double{high})) * 0x1p-22;
    ASSERT_LE(std::abs(double{back[0]} - double{low}), bound) << low << " to " << high;
    ASSERT_LE(std::abs(double{back[1]} - double{high}), bound) << low << " to " << high;
  }
}

}  // namespace
}  // namespace spectra::fusion
