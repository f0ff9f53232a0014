// Thermal highlighting: the palette fades in beyond two thresholds, the further the stronger.
//
//   u = (T - high) / (hi - high)   where T > high        u = (low - T) / (low - lo)   where T < low
//   W = min(1, k u^2), u clamped to [0, 1]; a span that is not positive counts as u = 1
//   F = W M + (1 - W) V            between the thresholds V
//
// Source: Eqs. 6-7; the print divides the cold side by Tmax - Tlow, which gives the coldest point next to no weight or
// thousands. Cost: two comparisons, a palette lookup and a mix. Missing temperature: the visible colour, or the fixed
// colour that is set for it.

#include "fusion/methods/vertex_kernel.hpp"
#include "fusion/parameter_schema.hpp"

namespace spectra::fusion::methods {
namespace {

enum class Sides { Both, Hot, Cold };

struct Highlighting {
  std::optional<double> low;
  std::optional<double> high;
  Sides sides = Sides::Both;
  double k = 1;
};

ParameterSchema<Highlighting> schema() {
  ParameterSchema<Highlighting> entries;
  entries
      .temperature(&Highlighting::low,
                   {.name = "low",
                    .label = "Low threshold",
                    .help = "Colder than this is highlighted; automatic follows the range."},
                   [](const Highlighting&) { return 0.15; })
      .temperature(&Highlighting::high,
                   {.name = "high",
                    .label = "High threshold",
                    .help = "Hotter than this is highlighted; automatic follows the range."},
                   [](const Highlighting&) { return 0.85; })
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

Result<void> check(const Highlighting& params) {
  if (params.sides == Sides::Both && params.low && params.high && *params.low > *params.high) {
    return failure(ErrorCode::Inconsistent,
                   "low (" + std::to_string(*params.low) + " degC) must not be above high (" +
                       std::to_string(*params.high) + " degC) when both sides are highlighted",
                   "low");
  }
  return success();
}

/// How far a temperature is beyond a threshold, as a part of the way to the end of the range. Halves stay finite.
double excess(double distance_halved, double span_halved) {
  if (!(span_halved > 0)) return 1;
  return distance_halved >= span_halved ? 1 : std::max(0.0, distance_halved / span_halved);
}

PreparedMethod prepare(const Highlighting& params, const MethodContext& context) {
  const bool hot = params.sides != Sides::Cold;
  const bool cold = params.sides != Sides::Hot;
  const double low = *params.low;
  const double high = *params.high;
  const double span_above = context.range_maximum / 2 - high / 2;
  const double span_below = low / 2 - context.range_minimum / 2;
  const auto shade = [=, thermal = ThermalColour(context), k = params.k, stored_low = as_stored(low),
                      stored_high = as_stored(high)](const Vertex& vertex) -> Colour {
    const double t = double{vertex.temperature_celsius};
    double u = 0;
    if (hot && vertex.temperature_celsius > stored_high) {
      u = excess(t / 2 - high / 2, span_above);
    } else if (cold && vertex.temperature_celsius < stored_low) {
      u = excess(low / 2 - t / 2, span_below);
    } else {
      return vertex.visible;
    }
    return mixed(std::min(1.0, k * (u * u)), thermal(t), vertex.visible);
  };

  const TemperatureSummary& data = context.scene.summary;
  const double minimum = double{data.minimum};
  const double maximum = double{data.maximum};
  std::vector<TemperatureInterval> highlighted;
  if (data.has_temperature() && cold && minimum < low) highlighted.push_back({minimum, std::min(low, maximum)});
  if (data.has_temperature() && hot && maximum > high) highlighted.push_back({std::max(high, minimum), maximum});
  return {vertex_kernel(shade, context.missing), std::move(highlighted)};
}

}  // namespace

Method thermal_highlighting() {
  Method method;
  method.id = "thermal_highlighting";
  method.label = "Thermal highlighting";
  method.summary = "Palette colours fade in towards the hot and cold ends; the middle stays visible.";
  return make_method(std::move(method), schema(), &prepare, &check);
}

}  // namespace spectra::fusion::methods
