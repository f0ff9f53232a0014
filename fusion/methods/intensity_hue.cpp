// Intensity-hue mapping: hue tells the temperature, lightness the visible picture.
//
//   g = (299 R + 587 G + 114 B) / 1000 of V,   L = clamp(k (2 g / 255 - 1), -1, 1)
//   F = M + L (255 - M)  where L > 0,  else  M + L M
//
// Source: Eqs. 8-10; Eqs. 8 and 9 with the slash of Eq. 8 mended to 255 (1 - k) / 2, without which mid grey always
// turns white and the second branch is dead. The HSV hue of M is kept exactly. Cost: one palette lookup, one luma.
// Missing temperature: the visible colour, or the fixed colour that is set for it.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "fusion/methods/intensity_hue.cpp"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set

#include "fusion/methods/vertex_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::fusion::HWY_NAMESPACE {

void fuse_intensity_hue(const ThermalTable& thermal, float k, const VertexSpan& span) {
  PaletteStage palette(thermal);
  fuse_vertices(span, palette, [&](const Vertices& vertices, std::size_t i) HWY_ATTR {
    const Colours& v = vertices.visible;
    // A thousand times the luma is a whole number that float32 holds exactly, and so is what it is above mid grey.
    const Floats luma = hn::Add(hn::Add(hn::Mul(all(299), v.r), hn::Mul(all(587), v.g)), hn::Mul(all(114), v.b));
    const Floats lightness = hn::Mul(hn::Sub(luma, all(127500)), all(k / 127500));
    const Floats lighter = hn::Min(hn::Max(lightness, all(0)), all(1));
    const Floats darker = hn::Max(hn::Min(lightness, all(0)), all(-1));
    const Colours m = palette.colours(i);
    const auto lit = [&](Floats channel) HWY_ATTR {
      return hn::Add(hn::Add(channel, hn::Mul(darker, channel)), hn::Mul(lighter, hn::Sub(all(255), channel)));
    };
    return Colours{lit(m.r), lit(m.g), lit(m.b)};
  });
}

}  // namespace spectra::fusion::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

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

HWY_EXPORT(fuse_intensity_hue);

PreparedMethod prepare(const IntensityHue& params, const MethodContext& context) {
  const auto fuse = [thermal = ThermalTable(context), k = static_cast<float>(params.k)](const VertexSpan& span) {
    HWY_DYNAMIC_DISPATCH(fuse_intensity_hue)(thermal, k, span);
  };
  return {lane_kernel(context, fuse), {}};
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

#endif  // HWY_ONCE
