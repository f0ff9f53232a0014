#include "server/stream/tile_look.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

namespace spectra::stream {
namespace {

/// The first letter of a look that is not empty: what the vertices are compared with.
enum BaselineLetter : char { kNotAsked = '-', kNothing = '0', kThemselves = 't', kKept = 'k' };

char baseline_letter(const map::Tile& tile, const LookRules& rules) {
  if (!rules.compares_with_baseline) return kNotAsked;
  const std::span<const float> baseline = map::baseline_of(tile, rules.baseline_mark);
  if (baseline.empty()) return kNothing;
  return baseline.data() == tile.temperature_celsius.data() ? kThemselves : kKept;
}

std::span<const float> baseline_under(const map::Tile& tile, const TileLook& look) {
  if (look.empty() || look[0] == kNotAsked || look[0] == kNothing) return {};
  return look[0] == kKept ? tile.baseline_celsius : tile.temperature_celsius;
}

/// One for each vertex, or none where all are fresh.
std::vector<std::uint8_t> freshness_under(const map::Tile& tile, const TileLook& look) {
  if (look.size() < 2) return {};
  const auto of_time = [&look](std::size_t time) { return static_cast<std::uint8_t>(look[1 + time] - '0'); };
  std::vector<std::uint8_t> freshness(tile.positions.size(), of_time(0));
  for (std::size_t v = 0; v < tile.seen_at.of_vertex.size(); ++v) freshness[v] = of_time(tile.seen_at.of_vertex[v]);
  return freshness;
}

}  // namespace

TileLook look_of(const map::Tile& tile, const LookRules& rules) {
  TileLook look;
  if (const char letter = baseline_letter(tile, rules); letter != kNotAsked) look += letter;
  if (!rules.age) return look;
  TileLook steps;
  for (const double time : tile.seen_at.distinct) {
    steps += static_cast<char>('0' + rules.age->freshness(rules.now_s - time));
  }
  constexpr char kFresh = '0' + fusion::AgeSteps::kFresh;
  if (std::all_of(steps.begin(), steps.end(), [](char step) { return step == kFresh; })) return look;
  if (look.empty()) look += kNotAsked;
  return look + steps;
}

double next_look_s(const map::Tile& tile, const LookRules& rules) {
  double next = std::numeric_limits<double>::infinity();
  if (!rules.age) return next;
  for (const double time : tile.seen_at.distinct) {
    const std::uint8_t freshness = rules.age->freshness(rules.now_s - time);
    // A time that is not known stays fresh.
    if (freshness > 0 && !std::isnan(time)) next = std::min(next, time + rules.age->last_age_s(freshness));
  }
  return next;
}

std::vector<base::Rgb8> fused_colours(const map::Tile& tile, const fusion::FusionPlan& plan, const TileLook& look) {
  std::vector<float> no_temperature;
  std::span<const float> temperature = tile.temperature_celsius;
  if (temperature.empty()) {
    no_temperature.assign(tile.visible.size(), std::numeric_limits<float>::quiet_NaN());
    temperature = no_temperature;
  }
  const std::vector<std::uint8_t> freshness = freshness_under(tile, look);
  std::vector<base::Rgb8> fused(tile.visible.size());
  plan.fuse({temperature, tile.visible, baseline_under(tile, look), freshness}, fused);
  return fused;
}

std::vector<std::uint8_t> highlight_marks(const map::Tile& tile, const fusion::FusionPlan& plan, const TileLook& look) {
  std::vector<std::uint8_t> marked(tile.visible.size());
  if (!tile.temperature_celsius.empty()) plan.mark(tile.temperature_celsius, baseline_under(tile, look), marked);
  return marked;
}

}  // namespace spectra::stream
