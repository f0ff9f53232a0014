#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "fusion/statistics/temperature_statistics.hpp"
#include "server/map/scene_snapshot.hpp"

namespace spectra::map {

/// What one leaf contributes to the facts of the scene.
struct LeafFacts {
  fusion::TemperatureAccumulator temperature;
  std::optional<std::uint32_t> hottest, coldest;         ///< Of the finite ones; indices into the leaf.
  std::optional<std::uint32_t> over_range, under_range;  ///< The first of the input.
};

LeafFacts leaf_facts(const Tile& leaf);

/// Lowest and highest of some temperatures, degC; NaN where there is none.
struct TemperatureRange {
  float lowest_celsius = std::numeric_limits<float>::quiet_NaN();
  float highest_celsius = std::numeric_limits<float>::quiet_NaN();

  TemperatureRange joined(const TemperatureRange& other) const;
};

/// The range of those that are not missing.
TemperatureRange temperature_range(std::span<const float> temperature_celsius);

/// The temperatures of the vertices that a leaf owns.
inline std::span<const float> owned_temperature(const Tile& tile) {
  return std::span(tile.temperature_celsius).first(tile.owned_count);
}

}  // namespace spectra::map
