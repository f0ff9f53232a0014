#include "fusion/files/read_options.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace spectra::files {

namespace {

constexpr double kCelsiusAtZeroKelvin = -273.15;
/// Factors outside of 1/kMost .. kMost are slips: nanometres and light years are inside, what comes out of the others overflows.
constexpr double kMost = 1e16;

bool is_sensible(double factor) {
  return factor >= 1 / kMost && factor <= kMost;
}

CelsiusScale scale_of(TemperatureUnit unit) {
  switch (unit) {
    case TemperatureUnit::Celsius:
      break;
    case TemperatureUnit::Kelvin:
      return {1, kCelsiusAtZeroKelvin};
    case TemperatureUnit::Centikelvin:
      return {0.01, kCelsiusAtZeroKelvin};
    case TemperatureUnit::Fahrenheit:
      return {5.0 / 9, -32 * 5.0 / 9};
  }
  return {};
}

}  // namespace

std::optional<TemperatureUnit> temperature_unit(std::string_view name) {
  constexpr std::array<std::pair<std::string_view, TemperatureUnit>, 4> kNames = {
      {{"celsius", TemperatureUnit::Celsius},
       {"kelvin", TemperatureUnit::Kelvin},
       {"centikelvin", TemperatureUnit::Centikelvin},
       {"fahrenheit", TemperatureUnit::Fahrenheit}}};
  for (const auto& [known, unit] : kNames) {
    if (known == name) return unit;
  }
  return std::nullopt;
}

base::Result<std::vector<std::string>> colour_properties(std::string_view text) {
  std::vector<std::string> names;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    names.emplace_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  const bool is_any_empty =
      std::any_of(names.begin(), names.end(), [](const std::string& name) { return name.empty(); });
  if ((names.size() != 1 && names.size() != 3) || is_any_empty) {
    return base::failure(
        base::ErrorCode::WrongType,
        "colour-properties is \"" + std::string(text) + "\"; three names with commas between them are wanted, or one",
        "colour_properties");
  }
  return names;
}

std::optional<CelsiusScale> ReadOptions::celsius_scale() const {
  if (temperature_unit) return scale_of(*temperature_unit);
  if (!temperature_scale && !temperature_offset) return std::nullopt;
  return CelsiusScale{temperature_scale.value_or(1), temperature_offset.value_or(0)};
}

base::Result<void> check_read_options(const ReadOptions& options) {
  if (options.temperature_unit && (options.temperature_scale || options.temperature_offset)) {
    return base::failure(base::ErrorCode::Inconsistent,
                         "temperature-unit excludes temperature-scale and temperature-offset", "temperature_unit");
  }
  if (options.temperature_scale && !is_sensible(std::abs(*options.temperature_scale))) {
    return base::failure(base::ErrorCode::OutOfRange,
                         "temperature-scale is the degC in one unit of the file, from 1e-16 to 1e16 or negative: "
                         "0.01 for hundredths of a degree",
                         "temperature_scale");
  }
  if (options.temperature_offset && !(std::abs(*options.temperature_offset) <= kMost)) {
    return base::failure(base::ErrorCode::OutOfRange,
                         "temperature-offset is a number of degC, at most 1e16: -273.15 for kelvin",
                         "temperature_offset");
  }
  for (const double value : options.no_data) {
    if (std::isnan(value)) {
      return base::failure(base::ErrorCode::OutOfRange, "no-data is a number; nan stands for no data anyway",
                           "no_data");
    }
  }
  if (options.colour_white && !is_sensible(*options.colour_white)) {
    return base::failure(base::ErrorCode::OutOfRange,
                         "colour-white is the number of the file that is white, from 1e-16 to 1e16: 4095 for 12 bits",
                         "colour_white");
  }
  if (!is_sensible(options.scale())) {
    return base::failure(base::ErrorCode::OutOfRange,
                         "scale is the metres in one unit of the file, from 1e-16 to 1e16: 0.001 for millimetres",
                         "scale");
  }
  return base::success();
}

}  // namespace spectra::files
