#pragma once

#include <optional>
#include <string>

#include "fusion/error.hpp"
#include "fusion/parameter.hpp"
#include "fusion/vertex_types.hpp"

namespace spectra::fusion {

/// The active temperature range: automatic = extremes of the finite temperatures of the whole scene.
struct RangeSetting {
  bool automatic = true;
  double minimum_celsius = 0;  ///< Used when not automatic; finite, <= maximum_celsius.
  double maximum_celsius = 0;
  friend bool operator==(const RangeSetting&, const RangeSetting&) = default;
};

/// How vertices without temperature are shown: nullopt = their visible colour, else this fixed colour.
using MissingDisplay = std::optional<Rgb8>;

/// Everything that decides a fused colour beside the vertex itself. Always complete and valid: made by
/// default_settings() and changed by with_change() only. Two equal settings give equal pictures.
struct FusionSettings {
  std::string method;
  ParameterValues params;  ///< One value for every parameter of the method.
  std::string palette;
  RangeSetting range;
  MissingDisplay missing;
  friend bool operator==(const FusionSettings&, const FusionSettings&) = default;
};

/// A partial change; what is absent stays. Parameters merge; a new method starts at its defaults.
struct FusionChange {
  std::optional<std::string> method;
  ParameterValues params;
  std::optional<std::string> palette;
  std::optional<RangeSetting> range;
  std::optional<MissingDisplay> missing;
};

/// thermal_visible_blend at its defaults, palette iron, automatic range, missing shown as visible.
FusionSettings default_settings();

/// The settings after a change, or an Error that names the field; the given settings are untouched.
Result<FusionSettings> with_change(const FusionSettings& settings, const FusionChange& change);

/// A text that is equal exactly for equal settings: the key of caches.
std::string cache_key(const FusionSettings& settings);

}  // namespace spectra::fusion
