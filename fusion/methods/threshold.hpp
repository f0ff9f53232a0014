#pragma once

#include <algorithm>

#include "fusion/parameter_schema.hpp"

namespace spectra::fusion::methods {

/// The automatic thresholds: so many standard deviations from the mean, within the data's extremes.
inline constexpr double kUnusualSigmas = 1.5;
inline double beside_mean(const TemperatureSummary& data, double sigmas) {
  return std::clamp(data.mean + sigmas * data.sigma, double{data.minimum}, double{data.maximum});
}

/// The entry `threshold`, shared by the methods that have one.
template <class Params>
void add_threshold(ParameterSchema<Params>& entries) {
  entries.temperature(&Params::threshold,
                      {.name = "threshold",
                       .label = "Threshold",
                       .help = "Hotter than this is highlighted (inverted: colder); automatic follows the scene."},
                      [](const Params& params, const SceneTemperature& scene) {
                        return beside_mean(scene.summary, params.invert ? -kUnusualSigmas : kUnusualSigmas);
                      });
}

/// The entry `invert` of the threshold methods.
template <class Params>
void add_invert(ParameterSchema<Params>& entries) {
  entries.toggle(
      &Params::invert,
      {.name = "invert", .label = "Invert", .help = "Highlights what is colder than the threshold instead of hotter."});
}

/// The temperatures above (inverted: below) the threshold, within the data's extremes.
inline std::vector<TemperatureInterval> beyond_threshold(double threshold, bool invert,
                                                         const TemperatureSummary& data) {
  const double minimum = double{data.minimum};
  const double maximum = double{data.maximum};
  if (!data.has_temperature()) return {};
  if (invert) {
    if (!(minimum < threshold)) return {};
    return {{minimum, std::min(threshold, maximum)}};
  }
  if (!(maximum > threshold)) return {};
  return {{std::max(threshold, minimum), maximum}};
}

}  // namespace spectra::fusion::methods
