#pragma once

#include <span>
#include <utility>
#include <vector>

#include "fusion/fusion_plan.hpp"

namespace spectra::fusion::test {

/// The facts of a scene with these temperatures.
inline SceneTemperature scene_of(std::vector<float> temperature) {
  TemperatureAccumulator accumulator;
  accumulator.add(temperature);
  SceneTemperature scene;
  scene.summary = accumulator.summary();
  scene.histogram = [values = std::move(temperature), summary = scene.summary](std::uint32_t bins) {
    Histogram histogram{summary.minimum, summary.maximum, std::vector<std::uint64_t>(bins)};
    add_to_histogram(values, histogram);
    return histogram;
  };
  return scene;
}

/// The default settings after a change that must be allowed.
inline FusionSettings settings_with(const std::string& method, ParameterValues params = {},
                                    std::optional<RangeSetting> range = {}, MissingDisplay missing = {}) {
  FusionChange change;
  change.method = method;
  change.params = std::move(params);
  change.range = range;
  change.missing = missing;
  return with_change(default_settings(), change).value();
}

/// Fused colours of vertices under a plan.
inline std::vector<base::Rgb8> fused(const FusionPlan& plan, std::span<const float> temperature,
                                     std::span<const base::Rgb8> visible) {
  std::vector<base::Rgb8> result(temperature.size());
  plan.fuse(temperature, visible, result);
  return result;
}

}  // namespace spectra::fusion::test
