// Thermal only: the palette colour of the temperature, nothing of the visible picture.
//
//   F = M
//
// Source: the thermal modality as the paper's figures show it. Cost: one palette lookup.
// Missing temperature: the visible colour, or the fixed colour that is set for it.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "fusion/methods/thermal_only.cpp"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set

#include "fusion/methods/vertex_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::fusion::HWY_NAMESPACE {

void fuse_thermal_only(const ThermalTable& thermal, const VertexSpan& span) {
  const auto palette_alone = [](Floats, Floats palette, Floats) HWY_ATTR { return palette; };
  fuse_thermal(span, thermal, ConstantWeight(1), palette_alone);
}

}  // namespace spectra::fusion::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "fusion/parameter_schema.hpp"

namespace spectra::fusion::methods {
namespace {

struct ThermalOnly {};

HWY_EXPORT(fuse_thermal_only);

PreparedMethod prepare(const ThermalOnly&, const MethodContext& context) {
  const auto fuse = [thermal = ThermalTable(context)](const VertexSpan& span) {
    HWY_DYNAMIC_DISPATCH(fuse_thermal_only)(thermal, span);
  };
  return {lane_kernel(context, fuse), {}};
}

}  // namespace

Method thermal_only() {
  Method method;
  method.id = "thermal_only";
  method.label = "Thermal only";
  method.summary = "The temperature in palette colours, without the visible picture.";
  method.hotter_is_lighter = true;
  return make_method(std::move(method), ParameterSchema<ThermalOnly>{}, &prepare);
}

}  // namespace spectra::fusion::methods

#endif  // HWY_ONCE
