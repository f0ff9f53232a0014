#pragma once

#include <optional>
#include <vector>

#include "server/stream/view_selection.hpp"

namespace spectra::server {

/// The largest errors in what a viewer sees.
struct ScreenAccuracy {
  double position_mm = 0;  ///< Distance to the full mesh; 0 while nothing can be drawn.
  double pixel_error = 0;  ///< The same in pixels; 0 without a camera.
  int colour_bits = 8;     ///< A channel of the coarsest colours.
};

/// Of what the viewer draws by the REPLACE rule within the view, when it has colours of `colour_bits` for each node, 0 where
/// the node cannot be drawn. Positions are rounded to `position_step_m`.
ScreenAccuracy screen_accuracy(const ViewTree& tree, const std::vector<int>& colour_bits,
                               const std::optional<Camera>& camera, float position_step_m);

}  // namespace spectra::server
