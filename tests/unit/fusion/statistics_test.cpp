#include "fusion/statistics/temperature_statistics.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace spectra::fusion {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kLargest = std::numeric_limits<float>::max();
constexpr float kSmallest = std::numeric_limits<float>::denorm_min();

TemperatureSummary summary_of(const std::vector<float>& values) {
  TemperatureAccumulator accumulator;
  accumulator.add(values);
  return accumulator.summary();
}

void expect_equal(const TemperatureSummary& a, const TemperatureSummary& b) {
  EXPECT_EQ(a.finite_count, b.finite_count);
  EXPECT_EQ(a.missing_count, b.missing_count);
  EXPECT_EQ(a.over_range_count, b.over_range_count);
  EXPECT_EQ(a.under_range_count, b.under_range_count);
  EXPECT_EQ(a.minimum, b.minimum);
  EXPECT_EQ(a.maximum, b.maximum);
  EXPECT_EQ(a.mean, b.mean);
  EXPECT_EQ(a.sigma, b.sigma);
}

TEST(TemperatureStatistics, NothingHasNoTemperature) {
  EXPECT_FALSE(summary_of({}).has_temperature());
  const TemperatureSummary missing = summary_of({kNan, kInfinity, -kInfinity});
  EXPECT_FALSE(missing.has_temperature());
  EXPECT_EQ(missing.missing_count, 1U);
  EXPECT_EQ(missing.over_range_count, 1U);
  EXPECT_EQ(missing.under_range_count, 1U);
  EXPECT_EQ(missing.mean, 0);
}

TEST(TemperatureStatistics, SmallExactCase) {
  const TemperatureSummary summary = summary_of({2, 4, kNan, 4, 4, 5, 5, 7, 9, -kInfinity});
  EXPECT_EQ(summary.finite_count, 8U);
  EXPECT_EQ(summary.missing_count, 1U);
  EXPECT_EQ(summary.under_range_count, 1U);
  EXPECT_EQ(summary.over_range_count, 0U);
  EXPECT_EQ(summary.minimum, 2);
  EXPECT_EQ(summary.maximum, 9);
  EXPECT_EQ(summary.mean, 5);
  EXPECT_EQ(summary.sigma, 2);
}

TEST(TemperatureStatistics, EqualValuesHaveThatMeanAndNoSigma) {
  for (const float value : {30.1F, -273.15F, kLargest, -kSmallest, 1e-20F}) {
    const TemperatureSummary summary = summary_of(std::vector<float>(1'000'003, value));
    EXPECT_EQ(summary.mean, double{value});
    EXPECT_EQ(summary.sigma, 0);
  }
}

TEST(TemperatureStatistics, TenMillionKelvinValuesOfSmallSigma) {
  std::mt19937 generator(7);
  std::normal_distribution<float> distribution(300.0F, 0.05F);
  std::vector<float> values(10'000'000);
  for (float& value : values) value = distribution(generator);
  const TemperatureSummary summary = summary_of(values);
  long double sum = 0;
  for (const float value : values) sum += static_cast<long double>(value) - 300.0L;
  const long double mean = sum / 1e7L;
  long double squares = 0;
  for (const float value : values) {
    const long double off = static_cast<long double>(value) - 300.0L - mean;
    squares += off * off;
  }
  const auto exact_mean = static_cast<double>(300.0L + mean);
  const auto exact_sigma = static_cast<double>(std::sqrt(squares / 1e7L));
  EXPECT_NEAR(summary.mean, exact_mean, 1e-13 * exact_mean);
  EXPECT_NEAR(summary.sigma, exact_sigma, 1e-12 * exact_sigma);
}

TEST(TemperatureStatistics, ExtremesOfFloat32DoNotOverflow) {
  const TemperatureSummary summary = summary_of({kLargest, -kLargest});
  EXPECT_EQ(summary.mean, 0);
  EXPECT_EQ(summary.sigma, double{kLargest});
  const TemperatureSummary tiny = summary_of({kSmallest, 0});
  EXPECT_EQ(tiny.mean, double{kSmallest} / 2);
  EXPECT_EQ(tiny.sigma, double{kSmallest} / 2);
  const TemperatureSummary mixed = summary_of({kLargest, kSmallest, -kLargest});
  EXPECT_EQ(mixed.mean, double{kSmallest} / 3);
  EXPECT_DOUBLE_EQ(mixed.sigma, double{kLargest} * std::sqrt(2.0 / 3.0));
}

TEST(TemperatureStatistics, MeanIsCorrectlyRounded) {
  // The exact mean is a third of the way between two float32 neighbours of 1.
  const float above = std::nextafter(1.0F, 2.0F);
  EXPECT_EQ(summary_of({1, 1, above}).mean, 1.0 + (double{above} - 1.0) / 3.0);
}

TEST(TemperatureStatistics, NegativeZeroDoesNotDependOnOrder) {
  EXPECT_FALSE(std::signbit(summary_of({-0.0F, 0.0F}).minimum));
  EXPECT_FALSE(std::signbit(summary_of({0.0F, -0.0F}).maximum));
  EXPECT_FALSE(std::signbit(summary_of({-0.0F}).minimum));
}

TEST(TemperatureStatistics, OrderSplitAndMergeChangeNothing) {
  std::mt19937 generator(11);
  std::uniform_int_distribution<std::uint32_t> any_bits;
  std::vector<float> values(20'000);
  for (float& value : values) value = std::bit_cast<float>(any_bits(generator));
  const TemperatureSummary whole = summary_of(values);
  for (int round = 0; round < 5; ++round) {
    std::shuffle(values.begin(), values.end(), generator);
    TemperatureAccumulator merged;
    std::vector<TemperatureAccumulator> parts(7);
    for (std::size_t i = 0; i < values.size(); i += 97) {
      parts[i % 7].add(std::span(values).subspan(i, std::min<std::size_t>(97, values.size() - i)));
    }
    for (const TemperatureAccumulator& part : parts) merged.merge(part);
    expect_equal(merged.summary(), whole);
  }
}

TEST(TemperatureStatistics, BlocksOfOneExponentAddUpLikeSingleValues) {
  std::mt19937 generator(3);
  std::uniform_real_distribution<float> kelvin(256.0F, 511.0F);
  std::vector<float> values(64 * 50 + 17);
  for (float& value : values) value = kelvin(generator);
  values[700] = -300.0F;  // one block with a sign, one with something missing, one with another exponent
  values[1500] = kNan;
  values[2100] = 0.25F;
  TemperatureAccumulator one_by_one;
  for (const float value : values) one_by_one.add(std::span(&value, 1));
  expect_equal(summary_of(values), one_by_one.summary());
}

TEST(TemperatureStatistics, MergingDoubledManyTimesReachesTenBillion) {
  TemperatureAccumulator accumulator;
  const std::vector<float> values = {kLargest, -kLargest, 300.0F, 300.5F};
  accumulator.add(values);
  const TemperatureSummary once = accumulator.summary();
  for (int doubling = 0; doubling < 32; ++doubling) accumulator.merge(TemperatureAccumulator(accumulator));
  const TemperatureSummary many = accumulator.summary();
  EXPECT_EQ(many.finite_count, 4ULL << 32);
  EXPECT_EQ(many.mean, once.mean);
  EXPECT_EQ(many.sigma, once.sigma);
}

}  // namespace
}  // namespace spectra::fusion
