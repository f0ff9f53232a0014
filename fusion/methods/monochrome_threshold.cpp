// Monochrome threshold: what is hotter than a threshold glows in one hue, brighter when hotter; the rest stays visible.
//
//   I = t            (inverted: 1 - t)
//   B = HSV(hue, I, I) = 255 (I (1 - I) + I^2 pure_hue)
//   F = alpha B + (1 - alpha) V    where T > threshold (inverted: T < threshold), else V
//
// Source: Eqs. 2-4; the print normalises with (T - Tmax), which is never positive and makes the hottest point black.
// Cost: a comparison, a normalisation and a mix. Missing temperature: the visible colour, or the fixed colour that is
// set for it.

#include "fusion/methods/threshold.hpp"
#include "fusion/methods/vertex_kernel.hpp"
#include "fusion/parameter_schema.hpp"

namespace spectra::fusion::methods {
namespace {

struct Monochrome {
  std::optional<double> threshold;
  double alpha = 0.5;
  double hue = 0;
  bool invert = false;
};

ParameterSchema<Monochrome> schema() {
  ParameterSchema<Monochrome> entries;
  add_threshold(entries);
  entries
      .number(&Monochrome::alpha, {.name = "alpha",
                                   .label = "Opacity",
                                   .help = "How much of the highlight covers the visible picture.",
                                   .min = 0,
                                   .max = 1,
                                   .step = 0.01})
      .number(&Monochrome::hue, {.name = "hue",
                                 .label = "Hue",
                                 .help = "The one hue of the highlight, an angle on the colour circle; it wraps.",
                                 .step = 1,
                                 .unit = "deg"});
  add_invert(entries);
  return entries;
}

/// The fully saturated colour of a hue, channels in 0..1.
Colour pure_hue(double degrees) {
  double sextant = std::fmod(degrees, 360.0) / 60;
  if (sextant < 0) sextant += 6;
  const auto channel = [sextant](double offset) {
    const double k = std::fmod(offset + sextant, 6.0);
    return 1 - std::clamp(std::min(k, 4 - k), 0.0, 1.0);
  };
  return {channel(5), channel(3), channel(1)};
}

PreparedMethod prepare(const Monochrome& params, const MethodContext& context) {
  const Normalisation normalised(context.range_minimum, context.range_maximum);
  const float threshold = as_stored(*params.threshold);
  const auto shade = [=, alpha = params.alpha, invert = params.invert,
                      hue = pure_hue(params.hue)](const Vertex& vertex) -> Colour {
    const float t = vertex.temperature_celsius;
    if (!(invert ? t < threshold : t > threshold)) return vertex.visible;
    const double intensity = invert ? 1 - normalised(double{t}) : normalised(double{t});
    const auto lit = [intensity](double pure) {
      return 255 * (intensity * (1 - intensity) + intensity * intensity * pure);
    };
    return mixed(alpha, {lit(hue.r), lit(hue.g), lit(hue.b)}, vertex.visible);
  };
  return {vertex_kernel(shade, context.missing),
          beyond_threshold(*params.threshold, params.invert, context.scene.summary)};
}

}  // namespace

Method monochrome_threshold() {
  Method method;
  method.id = "monochrome_threshold";
  method.label = "Monochrome threshold";
  method.summary = "What passes a temperature threshold glows in one hue; the rest stays visible.";
  method.uses_palette = false;
  return make_method(std::move(method), schema(), &prepare);
}

}  // namespace spectra::fusion::methods
