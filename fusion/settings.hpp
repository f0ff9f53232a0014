#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "fusion/age.hpp"
#include "fusion/base/error.hpp"
#include "fusion/base/vertex_types.hpp"
#include "fusion/parameter.hpp"
#include "fusion/statistics/temperature_statistics.hpp"

namespace spectra::fusion {

/// Where the active temperature range comes from.
enum class RangeMode {
  Auto,        ///< The extremes of the finite temperatures of the whole scene.
  Manual,      ///< Set by hand.
  Percentile,  ///< The temperatures below which two shares of the finite ones lie.
};

/// Bins of the histogram from which percentiles are read: they are off by at most one bin.
inline constexpr std::uint32_t kPercentileBins = 4096;

/// The active temperature range. What its mode does not use is at its default.
struct RangeSetting {
  RangeMode mode = RangeMode::Auto;
  double minimum_celsius = 0;  ///< Of Manual; finite, <= maximum_celsius.
  double maximum_celsius = 0;
  double low_percent = 1;  ///< Of Percentile; 0 <= low_percent < high_percent <= 100.
  double high_percent = 99;

  static RangeSetting manual(double minimum_celsius, double maximum_celsius) {
    return {.mode = RangeMode::Manual, .minimum_celsius = minimum_celsius, .maximum_celsius = maximum_celsius};
  }
  static RangeSetting percentile(double low_percent = 1, double high_percent = 99) {
    return {.mode = RangeMode::Percentile, .low_percent = low_percent, .high_percent = high_percent};
  }
  friend bool operator==(const RangeSetting&, const RangeSetting&) = default;
};

/// How vertices without temperature are shown: nullopt = their visible colour, else this fixed colour.
using MissingDisplay = std::optional<base::Rgb8>;

/// Everything that decides a fused colour beside the vertex itself. Always complete and valid: made by
/// default_settings() and changed by with_change() only. Two equal settings give equal pictures.
struct FusionSettings {
  std::string method;
  ParameterValues params;  ///< One value for every parameter of the method.
  std::string palette;
  RangeSetting range;
  MissingDisplay missing;
  AgeSetting age;  ///< Of no meaning where no vertex has a time, as in a file.
  friend bool operator==(const FusionSettings&, const FusionSettings&) = default;
};

/// A partial change of AgeSetting; what is absent stays.
struct AgeChange {
  std::optional<AgeMode> mode;
  std::optional<double> half_life_s;
};

/// A partial change; what is absent stays. Parameters merge; a new method starts at its defaults.
struct FusionChange {
  std::optional<std::string> method = {};
  ParameterValues params = {};
  std::optional<std::string> palette = {};
  std::optional<RangeSetting> range = {};
  std::optional<MissingDisplay> missing = {};
  AgeChange age = {};
};

/// thermal_visible_blend at its defaults, palette iron, automatic range, missing shown as visible: what a file is fused
/// with where nothing else is said.
FusionSettings default_settings();

/// What a person sees first of a scene: the method that shows its outliers, over the range that holds all but the outermost
/// temperatures, so that one hot pipe does not hide a person. The visible colours of a scene without temperature.
FusionSettings first_view_settings(const TemperatureSummary& scene);

/// The settings after a change, or an Error that names the field; the given settings are untouched.
base::Result<FusionSettings> with_change(const FusionSettings& settings, const FusionChange& change);

/// A text that is equal exactly for equal settings: the key of caches.
std::string cache_key(const FusionSettings& settings);

}  // namespace spectra::fusion
