// Thermal change: where the temperature is another than the baseline shows its difference; the rest stays visible.
//
//   D = T - B;  F = alpha M((D / span + 1) / 2) + (1 - alpha) V   where |D| > threshold (inverted: |D| < threshold), else V
//
// B is the baseline of the vertex, D is a float32 as T and B are. Source: ours, not of the paper. Cost: a difference, a
// comparison, a palette lookup and a mix. Missing temperature: the visible colour, or the fixed colour that is set for
// it. A missing baseline, and both beyond the sensor's range on the same side: the visible colour, because nothing is
// known of the change.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "fusion/methods/thermal_change.cpp"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set

#include "fusion/methods/vertex_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::fusion::HWY_NAMESPACE {

/// The difference to the baseline; `unknown` where there is none.
class ShownChange {
 public:
  explicit ShownChange(float unknown) : unknown_(unknown) {}

  HWY_INLINE const float* prepare(const Block& block) {
    const FloatTag d;
    for (std::size_t i = 0; i < block.count; i += kLanes) {
      Floats change = all(unknown_);
      if (block.baseline) {
        const Floats difference = hn::Sub(hn::LoadU(d, block.temperature + i), hn::LoadU(d, block.baseline + i));
        change = hn::IfThenElse(hn::IsNaN(difference), change, difference);
      }
      hn::Store(change, d, change_ + i);
    }
    return static_cast<const float*>(change_);
  }

 private:
  float unknown_;
  alignas(64) float change_[kBlock];
};

void fuse_change(const ThermalTable& thermal, float threshold, bool invert, float alpha, const VertexSpan& span) {
  const auto fill = [=](const float* change, const std::uint8_t*, std::size_t count, float* weight) HWY_ATTR {
    const FloatTag d;
    for (std::size_t i = 0; i < count; i += kLanes) {
      const Floats size = hn::Abs(hn::LoadU(d, change + i));
      const auto passes = invert ? hn::Lt(size, all(threshold)) : hn::Gt(size, all(threshold));
      hn::Store(hn::IfThenElseZero(passes, all(alpha)), d, weight + i);
    }
  };
  // What is not known passes no comparison.
  fuse_thermal(span, thermal, Weights(fill), Mix(),
               ShownChange(invert ? std::numeric_limits<float>::infinity() : 0.0F));
}

}  // namespace spectra::fusion::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "fusion/parameter_schema.hpp"

namespace spectra::fusion::methods {
namespace {

struct Change {
  double span = 5;
  double threshold = 0.5;
  double alpha = 0.8;
  bool invert = false;
};

ParameterSchema<Change> schema() {
  ParameterSchema<Change> entries;
  entries
      .number(&Change::span, {.name = "span",
                              .label = "Span",
                              .help = "The change at which the palette ends, warmer or colder.",
                              .min = 0,
                              .max = 100,
                              .step = 0.1,
                              .unit = "K",
                              .exclusive_min = 0})
      .number(&Change::threshold, {.name = "threshold",
                                   .label = "Threshold",
                                   .help = "A change of more than this is highlighted (inverted: of less).",
                                   .min = 0,
                                   .max = 100,
                                   .step = 0.1,
                                   .unit = "K"})
      .number(&Change::alpha, {.name = "alpha",
                               .label = "Opacity",
                               .help = "How much of the highlight covers the visible picture.",
                               .min = 0,
                               .max = 1,
                               .step = 0.01})
      .toggle(&Change::invert,
              {.name = "invert", .label = "Invert", .help = "Highlights what did not change instead of what did."});
  return entries;
}

HWY_EXPORT(fuse_change);

PreparedMethod prepare(const Change& params, const MethodContext& context) {
  const auto fuse = [thermal = ThermalTable(context.palette, -params.span, params.span),
                     threshold = as_stored(params.threshold), invert = params.invert,
                     alpha = static_cast<float>(params.alpha)](const VertexSpan& span) {
    HWY_DYNAMIC_DISPATCH(fuse_change)(thermal, threshold, invert, alpha, span);
  };
  return {lane_kernel(context, fuse), {}, ChangeScale{-params.span, params.span}};
}

}  // namespace

Method thermal_change() {
  Method method;
  method.id = "thermal_change";
  method.label = "Thermal change";
  method.summary = "What became warmer or colder than the baseline shows by how much; the rest stays visible.";
  method.wants_diverging_palette = true;
  method.compares_with_baseline = true;
  method.highlights = true;
  method.invert_complements = true;
  return make_method(std::move(method), schema(), &prepare);
}

}  // namespace spectra::fusion::methods

#endif  // HWY_ONCE
