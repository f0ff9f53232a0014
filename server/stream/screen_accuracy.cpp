#include "server/stream/screen_accuracy.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace spectra::stream {

ScreenAccuracy screen_accuracy(const ViewTree& tree, const std::vector<HeldQuality>& held,
                               const std::optional<Camera>& camera) {
  const auto& nodes = tree.nodes();
  std::vector<bool> is_covered(nodes.size());  // By itself or by its children.
  const auto is_replaced = [&](std::size_t index) {
    const auto& children = nodes[index].children;
    return !children.empty() &&
           std::all_of(children.begin(), children.end(), [&](std::size_t child) { return is_covered[child]; });
  };
  for (std::size_t index = nodes.size(); index-- > 0;) {
    is_covered[index] = held[index].colour_bits > 0 || is_replaced(index);
  }
  ScreenAccuracy accuracy;
  std::vector<bool> is_passed(nodes.size());  // Its children are drawn in its place.
  for (std::size_t index = 0; index < nodes.size(); ++index) {
    const ViewTree::Node& node = nodes[index];
    if (!is_covered[index] || (node.parent && !is_passed[*node.parent])) continue;
    if (is_replaced(index)) {
      is_passed[index] = true;
      continue;
    }
    if (camera && !may_be_in_view(*camera, node.bounds)) continue;
    accuracy.colour_bits = std::min(accuracy.colour_bits, held[index].colour_bits);
    const auto error_m = static_cast<double>(node.tile->geometric_error_m);
    accuracy.colour_error_levels =
        std::max(accuracy.colour_error_levels, static_cast<double>(node.tile->colour_error_levels));
    const auto celsius = static_cast<double>(node.tile->temperature_error_celsius);
    if (!std::isnan(celsius))
      accuracy.temperature_celsius = std::max(accuracy.temperature_celsius.value_or(0), celsius);
    // Each of three axes may be off by half a step.
    const double rounding_m = static_cast<double>(held[index].position_step_m) / 2 * std::sqrt(3.0);
    accuracy.position_mm = std::max(accuracy.position_mm, (error_m + rounding_m) * 1e3);
    if (camera) {
      const double pixels =
          std::min(screen_error(*camera, node.bounds, error_m), static_cast<double>(camera->viewport[1]));
      accuracy.pixel_error = std::max(accuracy.pixel_error, pixels);
    }
  }
  return accuracy;
}

}  // namespace spectra::stream
