#pragma once

#include <optional>
#include <vector>

#include "server/stream/view_selection.hpp"

namespace spectra::stream {

/// The largest errors in what a viewer sees.
struct ScreenAccuracy {
  double position_mm = 0;                     ///< Distance to the full mesh; 0 while nothing can be drawn.
  double pixel_error = 0;                     ///< The same in pixels; 0 without a camera.
  int colour_bits = 8;                        ///< A channel of the coarsest colours.
  double colour_error_levels = 0;             ///< Of coarse tiles, 95th percentile; rounding not counted.
  std::optional<double> temperature_celsius;  ///< The same of temperatures; nothing where none is seen.
};

/// What a viewer has of one node.
struct HeldQuality {
  int colour_bits = 0;        ///< 0: the node cannot be drawn.
  float position_step_m = 0;  ///< The coarsest that its positions are rounded to.
};

/// Of what the viewer draws by the REPLACE rule within the view; `held` is by node.
ScreenAccuracy screen_accuracy(const ViewTree& tree, const std::vector<HeldQuality>& held,
                               const std::optional<Camera>& camera);

}  // namespace spectra::stream
