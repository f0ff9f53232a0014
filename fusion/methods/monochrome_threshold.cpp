// Monochrome threshold: what is hotter than a threshold glows in one hue, brighter when hotter; the rest stays visible.
//
//   I = t            (inverted: 1 - t)
//   B = HSV(hue, I, I) = 255 (I (1 - I) + I^2 pure_hue)
//   F = alpha B + (1 - alpha) V    where T > threshold (inverted: T < threshold), else V
//
// Source: Eqs. 2-4; the print normalises with (T - Tmax), which is never positive and makes the hottest point black.
// Cost: a comparison, a normalisation and a mix. Missing temperature: the visible colour, or the fixed colour that is
// set for it.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "fusion/methods/monochrome_threshold.cpp"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set

#include "fusion/methods/vertex_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::fusion::HWY_NAMESPACE {

void fuse_monochrome(const Ramp& intensity, const float* pure_hue, float threshold, bool invert, float alpha,
                     const VertexSpan& span) {
  const auto on_intensity = [&](Doubles temperature) SPECTRA_IN_LOOP { return on_ramp(intensity, temperature); };
  const Floats limit = all(threshold);
  fuse_shaded(span, on_intensity, [&](const Vertices& vertices, Floats t) SPECTRA_IN_LOOP {
    const Floats squared = hn::Mul(t, t);
    const Floats pale = hn::Sub(t, squared);
    const auto lit = [&](float pure)
                         SPECTRA_IN_LOOP { return hn::Mul(all(255), hn::Add(pale, hn::Mul(squared, all(pure)))); };
    const auto passes = invert ? hn::Lt(vertices.temperature, limit) : hn::Gt(vertices.temperature, limit);
    const Floats weight = hn::IfThenElseZero(passes, all(alpha));
    return mixed(weight, {lit(pure_hue[0]), lit(pure_hue[1]), lit(pure_hue[2])}, vertices.visible);
  });
}

}  // namespace spectra::fusion::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include <array>
#include <cmath>

#include "fusion/colour/hues.hpp"
#include "fusion/methods/threshold.hpp"
#include "fusion/parameter_schema.hpp"

namespace spectra::fusion::methods {
namespace {

struct Monochrome {
  std::optional<double> threshold;
  double alpha = 0.8;
  std::optional<double> hue;
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
      .number(&Monochrome::hue,
              {.name = "hue",
               .label = "Hue",
               .help = "The one hue of the highlight, an angle on the colour circle; automatic is the one the scene "
                       "has least of.",
               .step = 1,
               .unit = "deg"},
              [](const Monochrome&, const SceneTemperature& scene) {
                return scene.hues ? rarest_hue_degrees(scene.hues()) : 0.0;
              });
  add_invert(entries);
  return entries;
}

/// The fully saturated colour of a hue, channels in 0..1.
std::array<float, 3> pure_hue(double degrees) {
  double sextant = std::fmod(degrees, 360.0) / 60;
  if (sextant < 0) sextant += 6;
  const auto channel = [sextant](double offset) {
    const double k = std::fmod(offset + sextant, 6.0);
    return static_cast<float>(1 - std::clamp(std::min(k, 4 - k), 0.0, 1.0));
  };
  return {channel(5), channel(3), channel(1)};
}

HWY_EXPORT(fuse_monochrome);

PreparedMethod prepare(const Monochrome& params, const MethodContext& context) {
  const double low = context.range_minimum;
  const double high = context.range_maximum;
  const Ramp inverted = low == high ? Ramp::flat(0.5, 1, -1) : Ramp::between(high, low, 1, 0.5);
  const auto fuse = [intensity = params.invert ? inverted : Ramp::between(low, high, 1, 0.5),
                     hue = pure_hue(*params.hue), threshold = as_stored(*params.threshold), invert = params.invert,
                     alpha = static_cast<float>(params.alpha)](const VertexSpan& span) {
    HWY_DYNAMIC_DISPATCH(fuse_monochrome)(intensity, hue.data(), threshold, invert, alpha, span);
  };
  return {lane_kernel(context, fuse), beyond_threshold(*params.threshold, params.invert, context.scene.summary)};
}

}  // namespace

Method monochrome_threshold() {
  Method method;
  method.id = "monochrome_threshold";
  method.label = "Monochrome threshold";
  method.summary = "What passes a temperature threshold glows in one hue; the rest stays visible.";
  method.uses_palette = false;
  method.highlights = true;
  method.invert_complements = true;
  return make_method(std::move(method), schema(), &prepare);
}

}  // namespace spectra::fusion::methods

#endif  // HWY_ONCE
