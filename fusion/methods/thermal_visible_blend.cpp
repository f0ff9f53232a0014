// Thermal-visible blend: both pictures over each other, one opacity for the whole scene.
//
//   F = alpha M + (1 - alpha) V
//
// Source: Eq. 1. Cost: one palette lookup and one mix.
// Missing temperature: the visible colour, or the fixed colour that is set for it.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "fusion/methods/thermal_visible_blend.cpp"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set

#include "fusion/methods/vertex_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::fusion::HWY_NAMESPACE {

void fuse_blend(const ThermalTable& thermal, float alpha, const VertexSpan& span) {
  fuse_thermal(span, thermal, ConstantWeight(alpha), Mix());
}

}  // namespace spectra::fusion::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "fusion/parameter_schema.hpp"

namespace spectra::fusion::methods {
namespace {

struct Blend {
  double alpha = 0.5;
};

ParameterSchema<Blend> schema() {
  ParameterSchema<Blend> entries;
  entries.number(&Blend::alpha, {.name = "alpha",
                                 .label = "Thermal opacity",
                                 .help = "0 shows the visible picture alone, 1 the thermal picture alone.",
                                 .min = 0,
                                 .max = 1,
                                 .step = 0.01});
  return entries;
}

HWY_EXPORT(fuse_blend);

PreparedMethod prepare(const Blend& params, const MethodContext& context) {
  const auto fuse = [thermal = ThermalTable(context),
                     alpha = static_cast<float>(params.alpha)](const VertexSpan& span) {
    HWY_DYNAMIC_DISPATCH(fuse_blend)(thermal, alpha, span);
  };
  return {lane_kernel(context, fuse), {}};
}

}  // namespace

Method thermal_visible_blend() {
  Method method;
  method.id = "thermal_visible_blend";
  method.label = "Thermal-visible blend";
  method.summary = "Both pictures over each other with one opacity.";
  method.hotter_is_lighter = true;
  return make_method(std::move(method), schema(), &prepare);
}

}  // namespace spectra::fusion::methods

#endif  // HWY_ONCE
