#include "fusion/mesh/vertex_temperature.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace spectra::fusion {

namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
constexpr float kBeyond = std::numeric_limits<float>::infinity();
constexpr double kFloatMax = static_cast<double>(std::numeric_limits<float>::max());
/// Compared as a float, because that is how files have it: the nearest float lies above the real number.
constexpr float kAbsoluteZeroCelsius = -273.15F;

}  // namespace

TemperatureConversion::TemperatureConversion(const ReadOptions& options)
    : scale_(options.celsius_scale().value_or(CelsiusScale{})), no_data_(options.no_data) {}

/// A value that a program has rounded to float is still the value that was named.
bool TemperatureConversion::is_no_data(double value) const {
  return std::any_of(no_data_.begin(), no_data_.end(), [value](double named) {
    if (value == named) return true;
    return std::abs(value) <= kFloatMax && std::abs(named) <= kFloatMax &&
           static_cast<float>(value) == static_cast<float>(named);
  });
}

void TemperatureConversion::convert(std::span<const double> values, std::span<float> celsius,
                                    TemperatureFacts& facts) const {
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double scaled = scale_.factor * values[i] + scale_.offset;
    // The usual value first, so that a file of usual values is read as fast as it can be.
    if (std::abs(scaled) <= kFloatMax && static_cast<float>(scaled) > kAbsoluteZeroCelsius && no_data_.empty()) {
      celsius[i] = static_cast<float>(scaled);
    } else if (std::isnan(values[i])) {
      celsius[i] = kNone;
    } else if (is_no_data(values[i])) {
      celsius[i] = kNone;
      ++facts.no_data_count;
    } else if (scaled > kFloatMax) {
      celsius[i] = kBeyond;
      ++facts.over_range_count;
    } else if (std::isinf(values[i])) {
      celsius[i] = -kBeyond;
      ++facts.under_range_count;
    } else if (scaled < -kFloatMax || static_cast<float>(scaled) <= kAbsoluteZeroCelsius) {
      celsius[i] = kNone;
      ++facts.impossible_count;
    } else {
      celsius[i] = static_cast<float>(scaled);
    }
    facts.missing_count += std::isnan(celsius[i]) ? 1U : 0U;
  }
}

}  // namespace spectra::fusion
