// Intensity-hue mapping: hue tells the temperature, lightness the visible picture.
//
//   g = (299 R + 587 G + 114 B) / 1000 of V,   L = clamp(k (2 g / 255 - 1), -1, 1)
//   F = M + L (255 - M)  where L > 0,  else  M + L M
//
// Source: Eqs. 8-10; Eqs. 8 and 9 with the slash of Eq. 8 mended to 255 (1 - k) / 2, without which mid grey always
// turns white and the second branch is dead. The HSV hue of M is kept exactly. Cost: one palette lookup, one luma.
// Missing temperature: the visible colour, or the fixed colour that is set for it.

#include "fusion/methods/vertex_kernel.hpp"
#include "fusion/parameter_schema.hpp"

namespace spectra::fusion::methods {
namespace {

struct IntensityHue {
  double k = 0.6;
};

ParameterSchema<IntensityHue> schema() {
  ParameterSchema<IntensityHue> entries;
  entries.number(&IntensityHue::k, {.name = "k",
                                    .label = "Contrast",
                                    .help = "How strongly the visible picture lightens and darkens the hue.",
                                    .min = 0,
                                    .max = 4,
                                    .step = 0.05});
  return entries;
}

PreparedMethod prepare(const IntensityHue& params, const MethodContext& context) {
  const auto shade = [thermal = ThermalColour(context), k = params.k](const Vertex& vertex) -> Colour {
    const Colour& v = vertex.visible;
    const double grey_thousandfold = 299 * v.r + 587 * v.g + 114 * v.b;
    const double lightness = std::clamp(k * (2 * grey_thousandfold / 255000 - 1), -1.0, 1.0);
    const Colour m = thermal(double{vertex.temperature_celsius});
    if (lightness > 0) {
      return {m.r + lightness * (255 - m.r), m.g + lightness * (255 - m.g), m.b + lightness * (255 - m.b)};
    }
    return {m.r + lightness * m.r, m.g + lightness * m.g, m.b + lightness * m.b};
  };
  return {vertex_kernel(shade, context.missing), {}};
}

}  // namespace

Method intensity_hue() {
  Method method;
  method.id = "intensity_hue";
  method.label = "Intensity-hue mapping";
  method.summary = "The temperature gives the hue, the visible picture the lightness.";
  method.wants_fusion_safe_palette = true;
  return make_method(std::move(method), schema(), &prepare);
}

}  // namespace spectra::fusion::methods
