#pragma once

#include <vector>

#include "fusion/base/error.hpp"
#include "fusion/fusion_plan.hpp"
#include "server/tradeoff/measure.hpp"

namespace spectra::tradeoff {

/// What each codec makes of the geometry of these tiles at a position step: `point` with codec, bytes and times filled in.
/// Raw, zstd, meshoptimizer, and Draco once for each speed. Fails where a tile cannot be encoded.
base::Result<std::vector<GeometryPoint>> geometry_costs(const Tiles& tiles, float step_m,
                                                        const std::vector<int>& encoder_speeds,
                                                        const GeometryPoint& point);

/// The same of their fused colours, for each of `points` at its colour_bits: Draco with and without kSubtractGreen; at eight
/// bits the other codecs, too, which know no fewer. `step_m` is that of the geometry whose vertex order the colours have.
base::Result<std::vector<ColourPoint>> colour_costs(const Tiles& tiles, float step_m, const fusion::FusionPlan& plan,
                                                    const std::vector<ColourPoint>& points);

}  // namespace spectra::tradeoff
