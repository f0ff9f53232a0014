#include "fusion/files/vertex_temperature.hpp"

#include <algorithm>
#include <cmath>

namespace spectra::files {

namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
constexpr float kBeyond = std::numeric_limits<float>::infinity();
constexpr double kFloatMax = static_cast<double>(std::numeric_limits<float>::max());
/// Compared as a float, because that is how files have it: the nearest float lies above the real number.
constexpr float kAbsoluteZeroCelsius = -273.15F;
/// Hundredths of a degree are hardly ever outside of these.
constexpr float kLeastHundredths = -9'990;
constexpr float kLeastNone = -10'000;

/// A small negative number is 0 as a float, and not -0: what is written of it reads as 0.
float rounded(double celsius) {
  return static_cast<float>(celsius) + 0.0F;
}

/// Takes note of what only numbers have that may be hundredths or tenths.
void describe_large(std::span<const float> celsius, TemperatureFacts& facts) {
  for (const float c : celsius) {
    facts.large_count += is_large(c) ? 1U : 0U;
    if (c != 65'535.0F) facts.highest_but_full = std::max(facts.highest_but_full, c);
    if (c > kHottest && c <= kMostHundredths) {
      facts.hot_low = std::min(facts.hot_low, c);
      facts.hot_high = std::max(facts.hot_high, c);
    }
  }
}

bool is_fraction(float celsius) {
  return celsius >= kLeastHundredths && celsius <= kMostHundredths && celsius != std::floor(celsius);
}

/// Adds `sign` times each number, of which `least` is the least.
void add_least(std::span<const float> celsius, float least, float sign, LeastNumber& sum) {
  LeastNumber own{least};
  if (least <= sum.value) {
    for (const float c : celsius) {
      const float number = sign * c;
      own.count += number == least ? 1U : 0U;
      own.next = number != least && number < own.next ? number : own.next;
    }
  }
  sum.add(own);
}

/// Takes note of finite temperatures.
void describe(std::span<const float> celsius, TemperatureFacts& facts) {
  float lowest = kBeyond;
  float highest = -kBeyond;
  float nearest_zero = facts.nearest_zero;
  std::uint32_t zero = 0;
  std::uint32_t full = 0;
  std::uint32_t kelvin = 0;
  std::uint32_t tenths = 0;
  std::uint32_t hundredths = 0;
  std::uint32_t hot = 0;
  std::uint32_t cold = 0;
  for (const float c : celsius) {
    lowest = c < lowest ? c : lowest;
    highest = c > highest ? c : highest;
    const float magnitude = c == 0.0F ? kBeyond : std::abs(c);
    nearest_zero = magnitude < nearest_zero ? magnitude : nearest_zero;
    zero += static_cast<std::uint32_t>(c == 0.0F);
    full += static_cast<std::uint32_t>(c == 65'535.0F);
    kelvin += static_cast<std::uint32_t>(c >= 200.0F) & static_cast<std::uint32_t>(c < 400.0F);
    tenths += static_cast<std::uint32_t>(c >= 2000.0F) & static_cast<std::uint32_t>(c < 4000.0F);
    hundredths += static_cast<std::uint32_t>(c >= 20'000.0F) & static_cast<std::uint32_t>(c < 40'000.0F);
    hot += static_cast<std::uint32_t>(c > kHottest);
    cold += static_cast<std::uint32_t>(c < -100.0F);
  }
  add_least(celsius, lowest, 1, facts.low);
  add_least(celsius, -highest, -1, facts.high);
  facts.finite_count += celsius.size();
  facts.nearest_zero = nearest_zero;
  facts.zero_count += zero;
  facts.full_count += full;
  facts.kelvin_like_count += kelvin;
  facts.tenth_kelvin_like_count += tenths;
  facts.centikelvin_like_count += hundredths;
  facts.too_hot_count += hot;
  facts.too_cold_count += cold;
  facts.has_fractions = facts.has_fractions || std::any_of(celsius.begin(), celsius.end(), is_fraction);
  if (lowest <= -kSeldomDegrees || highest >= kSeldomDegrees) {
    describe_large(celsius, facts);
  } else {
    facts.highest_but_full = std::max(facts.highest_but_full, highest);
  }
}

}  // namespace

TemperatureConversion::TemperatureConversion(const ReadOptions& options)
    : scale_(options.celsius_scale().value_or(CelsiusScale{})), no_data_(options.no_data) {}

/// A value that a program has rounded to float is still the value that was named.
std::uint64_t TemperatureConversion::no_data_bit(double value) const {
  const auto found = std::find_if(no_data_.begin(), no_data_.end(), [value](double named) {
    if (value == named) return true;
    // The shortest text of the largest float lies beyond it, but is rounded to it.
    constexpr double kRoundedToLargest = 0x1.FFFFFFp127;
    return std::abs(value) < kRoundedToLargest && std::abs(named) < kRoundedToLargest &&
           static_cast<float>(value) == static_cast<float>(named);
  });
  return found == no_data_.end() ? 0 : std::uint64_t{1} << std::min<std::ptrdiff_t>(found - no_data_.begin(), 63);
}

float TemperatureConversion::converted(double value, TemperatureFacts& facts) const {
  if (std::isnan(value)) return kNone;
  if (const std::uint64_t bit = no_data_bit(value); bit != 0) {
    ++facts.no_data_count;
    facts.no_data_seen |= bit;
    return kNone;
  }
  const double scaled = scale_.factor * value + scale_.offset;
  if (scaled > kFloatMax) {
    ++facts.over_range_count;
    return kBeyond;
  }
  if (std::isinf(value)) {
    ++facts.under_range_count;
    return -kBeyond;
  }
  if (scaled < -kFloatMax || static_cast<float>(scaled) <= kAbsoluteZeroCelsius) {
    ++facts.impossible_count;
    const auto cold = static_cast<float>(std::max(scaled, -kFloatMax));
    if (cold > kLeastHundredths) {
      facts.cold_low = std::min(facts.cold_low, cold);
      facts.cold_high = std::max(facts.cold_high, cold);
    } else if (cold >= kLeastNone) {
      facts.coldest_none = std::min(facts.coldest_none, cold);
    }
    return kNone;
  }
  const float celsius = rounded(scaled);
  describe({&celsius, 1}, facts);
  return celsius;
}

void TemperatureConversion::convert(std::span<const double> values, std::span<float> celsius,
                                    TemperatureFacts& facts) const {
  // Usual values first, so that a file of them is read as fast as it can be.
  if (no_data_.empty()) {
    bool all_usual = true;
    for (std::size_t i = 0; i < values.size(); ++i) {
      const double scaled = scale_.factor * values[i] + scale_.offset;
      celsius[i] = rounded(scaled);
      all_usual = all_usual & (scaled <= kFloatMax) & (celsius[i] > kAbsoluteZeroCelsius);
    }
    if (all_usual) return describe(celsius, facts);
  }
  for (std::size_t i = 0; i < values.size(); ++i) {
    celsius[i] = converted(values[i], facts);
    facts.missing_count += std::isnan(celsius[i]) ? 1U : 0U;
  }
}

}  // namespace spectra::files
