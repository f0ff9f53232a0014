// Thermal highlighting: the palette fades in beyond two thresholds, the further the stronger.
//
//   u = (T - high) / (hi - high)   where T > high        u = (low - T) / (low - lo)   where T < low
//   W = min(1, k u^2), u clamped to [0, 1]; a span that is not positive counts as u = 1; W = 1 for an infinite T
//   F = W M + (1 - W) V            between the thresholds V
//
// Source: Eqs. 6-7; the print divides the cold side by Tmax - Tlow, which gives the coldest point next to no weight or
// thousands. Cost: two comparisons, a palette lookup and a mix. Missing temperature: the visible colour, or the fixed
// colour that is set for it.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "fusion/methods/thermal_highlighting.cpp"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set

#include <limits>

#include "fusion/methods/vertex_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::fusion::HWY_NAMESPACE {

void fuse_highlighting(const ThermalTable& thermal, double hot_above, const Ramp& hot, double cold_below,
                       const Ramp& cold, double k, const VertexSpan& span) {
  const auto weight_of = [&](Doubles temperature) HWY_ATTR {
    const DoubleTag d;
    const auto is_hot = hn::Gt(temperature, hn::Set(d, hot_above));
    const auto is_cold = hn::Lt(temperature, hn::Set(d, cold_below));
    const auto of_side = [&](double hot_value, double cold_value)
                             HWY_ATTR { return hn::IfThenElse(is_hot, hn::Set(d, hot_value), hn::Set(d, cold_value)); };
    // Beyond its threshold, where alone it counts, the way is not negative.
    const Doubles way =
        hn::Add(hn::Mul(hn::Sub(temperature, of_side(hot.origin, cold.origin)), of_side(hot.slope, cold.slope)),
                of_side(hot.offset, cold.offset));
    const Doubles u = hn::Min(way, hn::Set(d, 1));
    const Doubles measured = hn::Min(hn::Set(d, 1), hn::Mul(hn::Set(d, k), hn::Mul(u, u)));
    const auto infinite = hn::Eq(hn::Abs(temperature), hn::Set(d, std::numeric_limits<double>::infinity()));
    return hn::IfThenElseZero(hn::Or(is_hot, is_cold), hn::IfThenElse(infinite, hn::Set(d, 1), measured));
  };
  const auto fill = [&](const float* temperature, const std::uint8_t*, std::size_t count, float* weight)
                        HWY_ATTR { map_in_double(temperature, count, weight, weight_of); };
  fuse_thermal(span, thermal, Weights(fill), Mix());
}

}  // namespace spectra::fusion::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include <algorithm>
#include <cmath>

#include "fusion/methods/threshold.hpp"
#include "fusion/parameter_schema.hpp"

namespace spectra::fusion::methods {
namespace {

enum class Sides { Both, Hot, Cold };

struct Highlighting {
  std::optional<double> low;
  std::optional<double> high;
  Sides sides = Sides::Both;
  double k = 5;
};

ParameterSchema<Highlighting> schema() {
  ParameterSchema<Highlighting> entries;
  entries
      .temperature(&Highlighting::low,
                   {.name = "low",
                    .label = "Low threshold",
                    .help = "Colder than this is highlighted; automatic follows the scene."},
                   [](const Highlighting&, const SceneTemperature& scene) {
                     return beside_mean(scene.summary, -kUnusualSigmas);
                   })
      .temperature(
          &Highlighting::high,
          {.name = "high",
           .label = "High threshold",
           .help = "Hotter than this is highlighted; automatic follows the scene."},
          [](const Highlighting&, const SceneTemperature& scene) { return beside_mean(scene.summary, kUnusualSigmas); })
      .choice(&Highlighting::sides, {.name = "sides",
                                     .label = "Sides",
                                     .help = "Whether hot, cold or both ends are highlighted.",
                                     .options = {"both", "hot", "cold"}})
      .number(&Highlighting::k, {.name = "k",
                                 .label = "Strength",
                                 .help = "How fast the highlight grows beyond a threshold.",
                                 .min = 0,
                                 .step = 0.1});
  return entries;
}

/// An automatic threshold has more digits than anybody reads.
std::string rounded_text(double celsius) {
  return number_text(std::abs(celsius) < 1e9 ? std::round(celsius * 1e4) / 1e4 : celsius);
}

base::Result<void> check(const Highlighting& params) {
  if (params.sides == Sides::Both && params.low && params.high && *params.low > *params.high) {
    return base::failure(base::ErrorCode::Inconsistent,
                         "low (" + rounded_text(*params.low) + " degC) must not be above high (" +
                             rounded_text(*params.high) + " degC) when both sides are highlighted",
                         "low");
  }
  return base::success();
}

HWY_EXPORT(fuse_highlighting);

PreparedMethod prepare(const Highlighting& params, const MethodContext& context) {
  constexpr double kNever = std::numeric_limits<double>::infinity();
  const bool hot = params.sides != Sides::Cold;
  const bool cold = params.sides != Sides::Hot;
  const double low = *params.low;
  const double high = *params.high;
  const Ramp up = high < context.range_maximum ? Ramp::between(high, context.range_maximum, 1, 1) : Ramp::flat(1, 1, 1);
  const Ramp down =
      low > context.range_minimum ? Ramp::between(low, context.range_minimum, 1, 1) : Ramp::flat(1, 1, -1);
  const auto fuse = [thermal = ThermalTable(context), up, down, k = params.k,
                     hot_above = hot ? double{as_stored(high)} : kNever,
                     cold_below = cold ? double{as_stored(low)} : -kNever](const VertexSpan& span) {
    HWY_DYNAMIC_DISPATCH(fuse_highlighting)(thermal, hot_above, up, cold_below, down, k, span);
  };

  const TemperatureSummary& data = context.scene.summary;
  const double minimum = double{data.minimum};
  const double maximum = double{data.maximum};
  std::vector<TemperatureInterval> highlighted;
  if (data.has_temperature() && cold && minimum < low) highlighted.push_back({minimum, std::min(low, maximum)});
  if (data.has_temperature() && hot && maximum > high) highlighted.push_back({std::max(high, minimum), maximum});
  return {lane_kernel(context, fuse), std::move(highlighted)};
}

}  // namespace

Method thermal_highlighting() {
  Method method;
  method.id = "thermal_highlighting";
  method.label = "Thermal highlighting";
  method.summary = "Palette colours fade in towards the hot and cold ends; the middle stays visible.";
  method.highlights = true;
  method.hotter_is_lighter = true;
  return make_method(std::move(method), schema(), &prepare, &check);
}

}  // namespace spectra::fusion::methods

#endif  // HWY_ONCE
