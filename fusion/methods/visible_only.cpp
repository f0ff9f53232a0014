// Visible only: the picture of the colour camera, untouched.
//
//   F = V
//
// Source: the visible modality as the paper's figures show it. Cost: a copy.
// Missing temperature: the visible colour always; a fixed colour for missing temperature is not applied, because
// temperature plays no part in this picture.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "fusion/methods/visible_only.cpp"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set

#include "fusion/methods/vertex_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::fusion::HWY_NAMESPACE {

void fuse_visible(const VertexSpan& span) {
  if (!span.freshness) {
    if (span.fused != span.visible) std::memcpy(span.fused, span.visible, 3 * span.count);
    return;
  }
  fuse_shaded(
      span, [](Doubles temperature) HWY_ATTR { return temperature; },
      [](const Vertices& vertices, Floats) HWY_ATTR { return vertices.visible; });
}

}  // namespace spectra::fusion::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "fusion/parameter_schema.hpp"

namespace spectra::fusion::methods {
namespace {

struct VisibleOnly {};

HWY_EXPORT(fuse_visible);

PreparedMethod prepare(const VisibleOnly&, const MethodContext& context) {
  const MethodContext without_marks{context.range_minimum, context.range_maximum, context.scene, context.palette,
                                    std::nullopt};
  return {lane_kernel(without_marks, [](const VertexSpan& span) { HWY_DYNAMIC_DISPATCH(fuse_visible)(span); }), {}};
}

}  // namespace

Method visible_only() {
  Method method;
  method.id = "visible_only";
  method.label = "Visible only";
  method.summary = "The visible picture as the colour camera saw it.";
  method.needs_temperature = false;
  method.uses_palette = false;
  return make_method(std::move(method), ParameterSchema<VisibleOnly>{}, &prepare);
}

}  // namespace spectra::fusion::methods

#endif  // HWY_ONCE
