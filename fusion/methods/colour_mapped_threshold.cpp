// Colour-mapped threshold: what is hotter than a threshold shows its palette colour; the rest stays visible.
//
//   F = alpha M + (1 - alpha) V    where T > threshold (inverted: T < threshold), else V
//
// Source: Eq. 5. Cost: a comparison, a palette lookup and a mix. Missing temperature: the visible colour, or the fixed
// colour that is set for it.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "fusion/methods/colour_mapped_threshold.cpp"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set

#include "fusion/methods/vertex_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::fusion::HWY_NAMESPACE {

void fuse_colour_mapped(const ThermalTable& thermal, float threshold, bool invert, float alpha,
                        const VertexSpan& span) {
  const auto fill = [=](const float* temperature, const std::uint8_t*, std::size_t count, float* weight) HWY_ATTR {
    const FloatTag d;
    for (std::size_t i = 0; i < count; i += kLanes) {
      const Floats t = hn::LoadU(d, temperature + i);
      const auto passes = invert ? hn::Lt(t, all(threshold)) : hn::Gt(t, all(threshold));
      hn::Store(hn::IfThenElseZero(passes, all(alpha)), d, weight + i);
    }
  };
  fuse_thermal(span, thermal, Weights(fill), Mix());
}

}  // namespace spectra::fusion::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "fusion/methods/threshold.hpp"
#include "fusion/parameter_schema.hpp"

namespace spectra::fusion::methods {
namespace {

struct ColourMapped {
  std::optional<double> threshold;
  double alpha = 0.85;
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

HWY_EXPORT(fuse_colour_mapped);

PreparedMethod prepare(const ColourMapped& params, const MethodContext& context) {
  const auto fuse = [thermal = ThermalTable(context), threshold = as_stored(*params.threshold), invert = params.invert,
                     alpha = static_cast<float>(params.alpha)](const VertexSpan& span) {
    HWY_DYNAMIC_DISPATCH(fuse_colour_mapped)(thermal, threshold, invert, alpha, span);
  };
  return {lane_kernel(context, fuse), beyond_threshold(*params.threshold, params.invert, context.scene.summary)};
}

}  // namespace

Method colour_mapped_threshold() {
  Method method;
  method.id = "colour_mapped_threshold";
  method.label = "Colour-mapped threshold";
  method.summary = "What passes a temperature threshold shows palette colours; the rest stays visible.";
  method.highlights = true;
  method.invert_complements = true;
  return make_method(std::move(method), schema(), &prepare);
}

}  // namespace spectra::fusion::methods

#endif  // HWY_ONCE
