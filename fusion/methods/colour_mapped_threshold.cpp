// Colour-mapped threshold: what is hotter than a threshold shows its palette colour; the rest stays visible.
//
//   F = alpha M + (1 - alpha) V    where T > threshold (inverted: T < threshold), else V
//
// Source: Eq. 5. Cost: a comparison, a palette lookup and a mix. Missing temperature: the visible colour, or the fixed
// colour that is set for it.

#include "fusion/methods/threshold.hpp"
#include "fusion/methods/vertex_kernel.hpp"
#include "fusion/parameter_schema.hpp"

namespace spectra::fusion::methods {
namespace {

struct ColourMapped {
  std::optional<double> threshold;
  double alpha = 0.5;
  bool invert = false;
};

ParameterSchema<ColourMapped> schema() {
  ParameterSchema<ColourMapped> entries;
  add_threshold(entries);
  entries.number(&ColourMapped::alpha, {.name = "alpha",
                                        .label = "Opacity",
                                        .help = "How much of the highlight covers the visible picture.",
                                        .min = 0,
                                        .max = 1,
                                        .step = 0.01});
  add_invert(entries);
  return entries;
}

PreparedMethod prepare(const ColourMapped& params, const MethodContext& context) {
  const float threshold = as_stored(*params.threshold);
  const auto shade = [=, thermal = ThermalColour(context), alpha = params.alpha,
                      invert = params.invert](const Vertex& vertex) -> Colour {
    const float t = vertex.temperature_celsius;
    if (!(invert ? t < threshold : t > threshold)) return vertex.visible;
    return mixed(alpha, thermal(double{t}), vertex.visible);
  };
  return {vertex_kernel(shade, context.missing),
          beyond_threshold(*params.threshold, params.invert, context.scene.summary)};
}

}  // namespace

Method colour_mapped_threshold() {
  Method method;
  method.id = "colour_mapped_threshold";
  method.label = "Colour-mapped threshold";
  method.summary = "What passes a temperature threshold shows palette colours; the rest stays visible.";
  return make_method(std::move(method), schema(), &prepare);
}

}  // namespace spectra::fusion::methods
