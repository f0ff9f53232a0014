#pragma once

#include <vector>

#include "fusion/base/error.hpp"
#include "fusion/fusion_plan.hpp"
#include "server/tradeoff/measure.hpp"

namespace spectra::tradeoff {

/// Both raw layers of these tiles for each temperature step (degC), at the position step and encoder speed of the stream; levels are those of
/// colours fused by `plan`.
base::Result<std::vector<RawPoint>> raw_costs(const Tiles& tiles, float step_m, const fusion::FusionPlan& plan,
                                              const std::vector<double>& temperature_steps_celsius);

}  // namespace spectra::tradeoff
