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

/// L per vertex, from the interleaved visible colours.
void write_lightness(float k, const std::uint8_t* visible, std::size_t count, float* lightness) {
  const FloatTag d;
  const IntTag di;
  const hn::ScalableTag<std::uint8_t> bytes;
  const hn::Rebind<std::uint8_t, FloatTag> quarter;
  alignas(64) std::uint8_t plane[3][kBlock];
  for (std::size_t i = 0; i < count; i += hn::Lanes(bytes)) {
    hn::Vec<decltype(bytes)> r, g, b;
    hn::LoadInterleaved3(bytes, visible + 3 * i, r, g, b);
    hn::Store(r, bytes, plane[0] + i);
    hn::Store(g, bytes, plane[1] + i);
    hn::Store(b, bytes, plane[2] + i);
  }
  for (std::size_t i = 0; i < count; i += kLanes) {
    const auto part = [&](std::size_t channel, float thousandths) HWY_ATTR {
      const auto value = hn::ConvertTo(d, hn::PromoteTo(di, hn::Load(quarter, plane[channel] + i)));
      return hn::Mul(value, all(thousandths));
    };
    // A thousand times the luma is a whole number that float32 holds exactly, and so is what it is above mid grey.
    const Floats luma = hn::Add(hn::Add(part(0, 299), part(1, 587)), part(2, 114));
    const Floats above = hn::Mul(hn::Sub(luma, all(127500)), all(k / 127500));
    hn::Store(hn::Min(hn::Max(above, all(-1)), all(1)), d, lightness + i);
  }
}

void fuse_intensity_hue(const ThermalTable& thermal, float k, const VertexSpan& span) {
  const auto fill = [k](const float*, const std::uint8_t* visible, std::size_t count, float* lightness)
                        HWY_ATTR { write_lightness(k, visible, count, lightness); };
  const auto lit = [](Floats lightness, Floats m, Floats) HWY_ATTR {
    const auto lighter = hn::Gt(lightness, all(0));
    return hn::Add(m, hn::Mul(lightness, hn::IfThenElse(lighter, hn::Sub(all(255), m), m)));
  };
  fuse_thermal(span, thermal, AlwaysShown(Weights(fill)), lit);
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
  method.hotter_is_lighter = true;
  return make_method(std::move(method), schema(), &prepare);
}

}  // namespace spectra::fusion::methods

#endif  // HWY_ONCE
