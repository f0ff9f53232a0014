#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "fusion/files/read_options.hpp"

namespace spectra::files {

/// Degrees Celsius above which there are hardly any.
constexpr float kHottest = 3000;
constexpr float kSeldomDegrees = 150;
/// Hundredths of a degree are hardly ever more.
constexpr float kMostHundredths = 12'000;
/// Hundredths of a degree, and tenths, are mostly; degrees hardly.
inline bool is_large(float celsius) {
  return std::abs(celsius) >= kSeldomDegrees && std::abs(celsius) <= kMostHundredths;
}

/// The least of many numbers, how many are exactly that, and the least of the others; none: infinity.
struct LeastNumber {
  float value = std::numeric_limits<float>::infinity();
  std::uint64_t count = 0;
  float next = std::numeric_limits<float>::infinity();

  /// Those of other numbers.
  void add(const LeastNumber& other) {
    if (other.value < value) {
      *this = {other.value, other.count, other.next < value ? other.next : value};
    } else if (other.value == value) {
      count += other.count;
      next = other.next < next ? other.next : next;
    } else if (other.value < next) {
      next = other.value;
    }
  }
};

/// What was found among the temperatures of a file.
struct TemperatureFacts {
  std::uint64_t missing_count = 0;      ///< Without a temperature, for whatever reason (also the next two).
  std::uint64_t impossible_count = 0;   ///< At or below absolute zero.
  std::uint64_t no_data_count = 0;      ///< One of the values that the options name.
  std::uint64_t no_data_seen = 0;       ///< Which of them were found: bit i of value i, of the first 64.
  std::uint64_t over_range_count = 0;   ///< +inf, or beyond the largest float.
  std::uint64_t under_range_count = 0;  ///< -inf.

  // Of the finite ones, which may be in another unit than degC.
  std::uint64_t finite_count = 0;
  LeastNumber low;
  LeastNumber high;                                             ///< Of their negatives.
  std::uint64_t zero_count = 0;                                 ///< Exactly 0, which often stands for nothing.
  float nearest_zero = std::numeric_limits<float>::infinity();  ///< The smallest magnitude of the others.
  std::uint64_t full_count = 0;  ///< Exactly 65535, all bits of a sensor's count, which often stands for nothing.
  std::uint64_t kelvin_like_count = 0;        ///< 200 to 400.
  std::uint64_t tenth_kelvin_like_count = 0;  ///< 2000 to 4000.
  std::uint64_t centikelvin_like_count = 0;   ///< 20000 to 40000.
  std::uint64_t too_hot_count = 0;            ///< Above 3000.
  std::uint64_t too_cold_count = 0;           ///< Below -100.

  // Which may be hundredths or tenths of a degree.
  bool has_fractions = false;                                        ///< Not whole, of those from -10000 to 12000.
  std::uint64_t large_count = 0;                                     ///< 150 to 12000 away from 0.
  float highest_but_full = -std::numeric_limits<float>::infinity();  ///< Of those that are not 65535.
  /// Of those above 3000, up to 12000.
  float hot_low = std::numeric_limits<float>::infinity();
  float hot_high = -std::numeric_limits<float>::infinity();
  /// Of the impossible ones, down to -9990.
  float cold_low = std::numeric_limits<float>::infinity();
  float cold_high = -std::numeric_limits<float>::infinity();
  float coldest_none =
      0;  ///< The lowest of -10000 to -9990, which are hardly hundredths, but often stand for no data; 0: none.
};

/// Turns the numbers of a file into temperatures in degC: NaN where nothing was measured, +inf and -inf where the sensor
/// was beyond its range, anything else a float above absolute zero.
class TemperatureConversion {
 public:
  explicit TemperatureConversion(const ReadOptions& options);

  /// `values` and `celsius` have the same length. The facts of all calls add up.
  void convert(std::span<const double> values, std::span<float> celsius, TemperatureFacts& facts) const;

  double kelvin_per_unit() const { return scale_.factor; }

 private:
  float converted(double value, TemperatureFacts& facts) const;
  /// The bit of no_data_seen; 0 when the value is data.
  std::uint64_t no_data_bit(double value) const;

  CelsiusScale scale_;
  std::vector<double> no_data_;
};

}  // namespace spectra::files
