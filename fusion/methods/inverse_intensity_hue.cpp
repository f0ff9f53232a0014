// Inverse intensity-hue mapping: the visible picture keeps its hue, the temperature gives the brightness.
//
//   I = t^k
//   substitute: hue and saturation of V, value I, that is F = 255 I V / max(V); grey 255 I where V is black
//   scale:      F = I V, which keeps dark print on light paper readable
//
// Source: Eqs. 11-12; the print raises T - Tmax, which is not a number for a fractional k. Cost: a normalisation and a
// power. Missing temperature: the visible colour, or the fixed colour that is set for it.

#include "fusion/methods/vertex_kernel.hpp"
#include "fusion/parameter_schema.hpp"

namespace spectra::fusion::methods {
namespace {

enum class Mode { Substitute, Scale };

struct InverseIntensityHue {
  double k = 1;
  Mode mode = Mode::Substitute;
};

ParameterSchema<InverseIntensityHue> schema() {
  ParameterSchema<InverseIntensityHue> entries;
  entries
      .number(&InverseIntensityHue::k, {.name = "k",
                                        .label = "Exponent",
                                        .help = "Above 1 darkens all but the hottest, below 1 brightens the cold.",
                                        .min = 0,
                                        .max = 100,
                                        .step = 0.1,
                                        .exclusive_min = 0})
      .choice(&InverseIntensityHue::mode,
              {.name = "mode",
               .label = "Brightness",
               .help = "Whether the temperature takes the place of the visible brightness or scales it.",
               .options = {"substitute", "scale"}});
  return entries;
}

PreparedMethod prepare(const InverseIntensityHue& params, const MethodContext& context) {
  const Normalisation normalised(context.range_minimum, context.range_maximum);
  const auto shade = [=, k = params.k, substitute = params.mode == Mode::Substitute](const Vertex& vertex) -> Colour {
    const Colour& v = vertex.visible;
    const double intensity = std::pow(normalised(double{vertex.temperature_celsius}), k);
    if (!substitute) return {intensity * v.r, intensity * v.g, intensity * v.b};
    const double brightest = std::max({v.r, v.g, v.b});
    const double value = 255 * intensity;
    if (!(brightest > 0)) return {value, value, value};
    return {value * v.r / brightest, value * v.g / brightest, value * v.b / brightest};
  };
  return {vertex_kernel(shade, context.missing), {}};
}

}  // namespace

Method inverse_intensity_hue() {
  Method method;
  method.id = "inverse_intensity_hue";
  method.label = "Inverse intensity-hue mapping";
  method.summary = "The visible picture gives the hue, the temperature the brightness.";
  method.uses_palette = false;
  return make_method(std::move(method), schema(), &prepare);
}

}  // namespace spectra::fusion::methods
