#include "server/map/leaf_facts.hpp"

#include <cmath>

namespace spectra::map {

LeafFacts leaf_facts(const Tile& leaf) {
  LeafFacts facts;
  facts.temperature.add(owned_temperature(leaf));
  const auto is_before = [&](std::uint32_t a, std::uint32_t b) {
    return leaf.source_vertex[a] < leaf.source_vertex[b];
  };
  for (std::uint32_t v = 0; v < leaf.owned_count; ++v) {
    const float t = leaf.temperature_celsius[v];
    if (std::isnan(t)) continue;
    if (std::isinf(t)) {
      std::optional<std::uint32_t>& first = t > 0 ? facts.over_range : facts.under_range;
      if (!first || is_before(v, *first)) first = v;
      continue;
    }
    const auto better = [&](std::optional<std::uint32_t>& best, bool is_beyond, bool is_equal) {
      if (is_beyond || (is_equal && is_before(v, *best))) best = v;
    };
    const float hot = facts.hottest ? leaf.temperature_celsius[*facts.hottest] : t;
    const float cold = facts.coldest ? leaf.temperature_celsius[*facts.coldest] : t;
    better(facts.hottest, !facts.hottest || t > hot, t == hot);
    better(facts.coldest, !facts.coldest || t < cold, t == cold);
  }
  return facts;
}

TemperatureRange TemperatureRange::joined(const TemperatureRange& other) const {
  // fmin and fmax prefer a number to NaN.
  return {std::fmin(lowest_celsius, other.lowest_celsius), std::fmax(highest_celsius, other.highest_celsius)};
}

TemperatureRange temperature_range(std::span<const float> temperature_celsius) {
  TemperatureRange range;
  for (const float t : temperature_celsius) {
    if (std::isnan(t)) continue;
    if (!(t >= range.lowest_celsius)) range.lowest_celsius = t;
    if (!(t <= range.highest_celsius)) range.highest_celsius = t;
  }
  return range;
}

}  // namespace spectra::map
