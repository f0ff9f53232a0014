#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "fusion/colour/hues.hpp"

namespace spectra::fusion {

/// Facts of the finite temperatures (degC) of a whole scene. Population mean and sigma, from exact sums: the same
/// for every order and every split of the vertices. What the sensor could not measure, above or below its range, is
/// infinite: it is counted apart and enters nothing else here.
struct TemperatureSummary {
  std::uint64_t finite_count = 0;
  std::uint64_t missing_count = 0;      ///< NaN.
  std::uint64_t over_range_count = 0;   ///< +infinity.
  std::uint64_t under_range_count = 0;  ///< -infinity.
  float minimum = 0;                    ///< degC; 0 when finite_count is 0, as are the next three.
  float maximum = 0;
  double mean = 0;
  double sigma = 0;
  bool has_temperature() const { return finite_count > 0; }
};

/// Counts of finite temperatures in equal bins from minimum to maximum:
/// bin = min(bins - 1, floor((T - minimum) / (maximum - minimum) * bins)); a uniform scene is all in bin 0.
struct Histogram {
  float minimum = 0;  ///< degC, the data's own extremes.
  float maximum = 0;
  std::vector<std::uint64_t> counts;
};

/// Lower edge of bin `index`, or the upper edge of the last for index == bins. For display only: bins are defined
/// by the formula above, never by comparing edges.
double histogram_edge(const Histogram& histogram, std::size_t index);

/// Which bin of a histogram a temperature belongs to, by the formula of Histogram; temperatures outside the histogram's
/// extremes count as the nearest, what is infinite belongs to the first or the last bin.
class HistogramBinning {
 public:
  /// The histogram's extremes and bin number are set; it has at least one bin.
  explicit HistogramBinning(const Histogram& histogram)
      : minimum_(double{histogram.minimum}),
        span_(double{histogram.maximum} - double{histogram.minimum}),
        bins_(static_cast<double>(histogram.counts.size())) {}

  std::size_t operator()(float temperature_celsius) const {
    if (!(span_ > 0)) return double{temperature_celsius} < kInfinity ? 0 : static_cast<std::size_t>(bins_ - 1);
    const double position = (double{temperature_celsius} - minimum_) / span_ * bins_;
    // Truncation is the floor, because what is negative stops at 0.
    return position > 0 ? static_cast<std::size_t>(std::min(position, bins_ - 1)) : 0;
  }

  double minimum() const { return minimum_; }
  double span() const { return span_; }
  double bins() const { return bins_; }

 private:
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();
  double minimum_;
  double span_;
  double bins_;
};

/// What a fusion method may know of the scene. `histogram` and `hues`, those of the visible colours, are called only by a
/// method that needs them; the scene may compute them then, and keep them.
struct SceneTemperature {
  TemperatureSummary summary;
  std::function<Histogram(std::uint32_t bins)> histogram;
  std::function<Hues()> hues;
};

/// Collects a TemperatureSummary; exact, mergeable in any order, and of fixed size, so that one accumulator per tile
/// lets an update of a tile leave the others unread. The mean is the exact one correctly rounded, sigma has a relative
/// error below 1e-15. Good for 5e11 values.
class TemperatureAccumulator {
 public:
  TemperatureAccumulator();
  void add(std::span<const float> temperature_celsius);
  void merge(const TemperatureAccumulator& other);
  TemperatureSummary summary() const;

 private:
  void add_one(float value);

  /// Sums of the mantissas, by exponent: no rounding ever happens before summary().
  std::vector<std::int64_t> sum_by_exponent_;
  std::vector<std::uint64_t> square_low_by_exponent_;
  std::vector<std::uint64_t> square_high_by_exponent_;
  std::uint64_t finite_count_ = 0;
  std::uint64_t missing_count_ = 0;
  std::uint64_t over_range_count_ = 0;
  std::uint64_t under_range_count_ = 0;
  float minimum_;
  float maximum_;
};

/// The temperature below which a part of the counted values lies, part in [0, 1]; linear within its bin. Off by at most
/// the width of one bin from the value that stands at that place among all values sorted. 0 of an empty histogram.
double histogram_quantile(const Histogram& histogram, double part);

/// Adds the counts of a histogram of the same extremes and bin number.
void merge_histogram(const Histogram& other, Histogram& histogram);

/// Adds the temperatures to the counts of a histogram whose extremes and bin number are set already; values that are
/// not finite are left out.
void add_to_histogram(std::span<const float> temperature_celsius, Histogram& histogram);

}  // namespace spectra::fusion
