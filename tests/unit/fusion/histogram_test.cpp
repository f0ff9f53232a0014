#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "fusion/statistics/temperature_statistics.hpp"
#include "tests/property/instruction_sets.hpp"

namespace spectra::fusion {
namespace {

Histogram empty_histogram(float minimum, float maximum, std::size_t bins) {
  return {minimum, maximum, std::vector<std::uint64_t>(bins)};
}

TEST(Histogram, FollowsTheFormulaAtComputedEdges) {
  Histogram histogram = empty_histogram(17.3F, 41.9F, 64);
  for (std::size_t edge = 0; edge <= 64; ++edge) {
    const auto value = static_cast<float>(histogram_edge(histogram, edge));
    std::fill(histogram.counts.begin(), histogram.counts.end(), 0);
    add_to_histogram(std::span(&value, 1), histogram);
    const double position = (double{value} - double{17.3F}) / (double{41.9F} - double{17.3F}) * 64.0;
    const auto bin = static_cast<std::size_t>(std::clamp(std::floor(position), 0.0, 63.0));
    EXPECT_EQ(histogram.counts[bin], 1U) << edge;
  }
}

// Every float next to an edge, where a bin computed in float32 may be one off.
TEST(Histogram, FollowsTheFormulaNextToEveryEdgeOnEveryInstructionSet) {
  const float after_one = std::nextafter(1.0F, 2.0F);
  const std::pair<float, float> ranges[] = {{17.3F, 41.9F},      {-5, 12},           {300, 300.2F},
                                            {1, after_one},      {1e-25F, 3.3e-25F}, {-3e29F, 2e29F},
                                            {-3.4e38F, 3.4e38F}, {-1e-31F, 1e-31F},  {-273.15F, 16'000.0F}};
  for (const auto& [minimum, maximum] : ranges) {
    for (const std::size_t bins : {1U, 2U, 64U, 513U, 4096U, 5000U}) {
      Histogram expected = empty_histogram(minimum, maximum, bins);
      const HistogramBinning binning(expected);
      std::vector<float> values(5000, minimum);  // So many that they are counted a register at a time.
      for (std::size_t edge = 0; edge <= bins; ++edge) {
        float value = static_cast<float>(histogram_edge(expected, edge));
        for (int step = 0; step < 3; ++step) value = std::nextafter(value, minimum);
        for (int step = 0; step < 7; ++step) {
          if (value >= minimum && value <= maximum) values.push_back(value);
          value = std::nextafter(value, std::numeric_limits<float>::infinity());
        }
      }
      for (const float value : values) ++expected.counts[binning(value)];
      for (const std::int64_t target : test::instruction_sets()) {
        const test::UsingInstructionSet using_it(target);
        Histogram counted = empty_histogram(minimum, maximum, bins);
        add_to_histogram(values, counted);
        EXPECT_EQ(counted.counts, expected.counts)
            << bins << " bins of " << minimum << " .. " << maximum << " on " << test::name_of(target);
      }
    }
  }
}

TEST(Histogram, LowestIsInTheFirstBinAndHighestInTheLast) {
  Histogram histogram = empty_histogram(-5, 12, 7);
  const float values[] = {-5, 12};
  add_to_histogram(values, histogram);
  EXPECT_EQ(histogram.counts.front(), 1U);
  EXPECT_EQ(histogram.counts.back(), 1U);
}

TEST(Histogram, UniformSceneIsAllInTheFirstBin) {
  Histogram histogram = empty_histogram(21.5F, 21.5F, 16);
  add_to_histogram(std::vector<float>(1000, 21.5F), histogram);
  EXPECT_EQ(histogram.counts[0], 1000U);
}

TEST(Histogram, LeavesOutWhatIsNotFinite) {
  Histogram histogram = empty_histogram(0, 1, 4);
  const float infinity = std::numeric_limits<float>::infinity();
  const float values[] = {std::numeric_limits<float>::quiet_NaN(), infinity, -infinity, 0.5F};
  add_to_histogram(values, histogram);
  EXPECT_EQ(std::accumulate(histogram.counts.begin(), histogram.counts.end(), std::uint64_t{0}), 1U);
}

TEST(Histogram, WholeFloatRangeAndOneStepRange) {
  const float largest = std::numeric_limits<float>::max();
  Histogram wide = empty_histogram(-largest, largest, 4);
  const float wide_values[] = {-largest, -1e36F, 1e36F, largest};
  add_to_histogram(wide_values, wide);
  EXPECT_EQ(wide.counts, (std::vector<std::uint64_t>{1, 1, 1, 1}));
  const float step = std::numeric_limits<float>::denorm_min();
  Histogram narrow = empty_histogram(0, step, 4096);
  const float narrow_values[] = {0, step};
  add_to_histogram(narrow_values, narrow);
  EXPECT_EQ(narrow.counts.front(), 1U);
  EXPECT_EQ(narrow.counts.back(), 1U);
}

TEST(Histogram, QuantilesAreWithinOneBinOfTheSortedValues) {
  std::vector<float> values;
  for (int i = 0; i < 5000; ++i) values.push_back(20 + 10 * std::sin(static_cast<float>(i) * 0.7F));
  std::sort(values.begin(), values.end());
  Histogram histogram = empty_histogram(values.front(), values.back(), 256);
  add_to_histogram(values, histogram);
  const double width = (double{values.back()} - double{values.front()}) / 256;
  for (const double part : {0.0, 0.02, 0.5, 0.9, 0.98, 1.0}) {
    const auto place = std::min<std::size_t>(values.size() - 1, static_cast<std::size_t>(part * 5000));
    EXPECT_NEAR(histogram_quantile(histogram, part), double{values[place]}, width * 1.001) << part;
  }
  EXPECT_EQ(histogram_quantile(empty_histogram(1, 2, 4), 0.5), 0);
}

TEST(Histogram, QuantilesEndAtTheExtremesHoweverFarApart) {
  Histogram histogram = empty_histogram(-7.871614e22F, 50.25F, 4);
  histogram.counts = {1, 0, 0, 1};
  EXPECT_EQ(histogram_quantile(histogram, 0), double{-7.871614e22F});
  EXPECT_EQ(histogram_quantile(histogram, 1), 50.25);
}

TEST(Histogram, MergingPartsEqualsTheWhole) {
  std::vector<float> values;
  for (int i = 0; i < 1000; ++i) values.push_back(static_cast<float>((i * 37) % 101));
  Histogram whole = empty_histogram(0, 100, 32);
  Histogram left = whole;
  Histogram right = whole;
  add_to_histogram(values, whole);
  add_to_histogram(std::span(values).first(333), left);
  add_to_histogram(std::span(values).subspan(333), right);
  merge_histogram(right, left);
  EXPECT_EQ(left.counts, whole.counts);
}

TEST(Histogram, EdgesAscendFromMinimumToMaximum) {
  const Histogram histogram = empty_histogram(17.3F, 41.9F, 64);
  EXPECT_EQ(histogram_edge(histogram, 0), double{17.3F});
  EXPECT_EQ(histogram_edge(histogram, 64), double{41.9F});
  for (std::size_t edge = 0; edge < 64; ++edge) {
    EXPECT_LT(histogram_edge(histogram, edge), histogram_edge(histogram, edge + 1));
  }
}

}  // namespace
}  // namespace spectra::fusion
