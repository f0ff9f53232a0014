// Histogram distribution: temperatures far from the scene's mean stand out in palette colours.
//
//   F = alpha M + (1 - alpha) V   where T < mu - k sigma or T > mu + k sigma, else V
//   inverted: in the closed inside instead; sigma = 0 highlights nothing
//
// Source: Eqs. 13-14 with the population mean and sigma of the data. Cost: two comparisons, a palette lookup and a mix.
// Missing temperature: the visible colour, or the fixed colour that is set for it.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "fusion/methods/histogram_distribution.cpp"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set

#include "fusion/methods/vertex_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::fusion::HWY_NAMESPACE {

void fuse_distribution(const ThermalTable& thermal, float first_inside, float last_inside, float weight_inside,
                       float weight_outside, const VertexSpan& span) {
  const auto fill = [=](const float* temperature, const std::uint8_t*, std::size_t count, float* weight) HWY_ATTR {
    const FloatTag d;
    for (std::size_t i = 0; i < count; i += kLanes) {
      const Floats t = hn::LoadU(d, temperature + i);
      const auto inside = hn::And(hn::Ge(t, all(first_inside)), hn::Le(t, all(last_inside)));
      hn::Store(hn::IfThenElse(inside, all(weight_inside), all(weight_outside)), d, weight + i);
    }
  };
  fuse_thermal(span, thermal, Weights(fill), Mix());
}

}  // namespace spectra::fusion::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "fusion/parameter_schema.hpp"

namespace spectra::fusion::methods {
namespace {

struct Distribution {
  double k = 1.5;
  double alpha = 1;
  bool invert = false;
};

ParameterSchema<Distribution> schema() {
  ParameterSchema<Distribution> entries;
  entries
      .number(&Distribution::k, {.name = "k",
                                 .label = "Deviations",
                                 .help = "How many standard deviations from the mean count as ordinary.",
                                 .min = 0,
                                 .max = 10,
                                 .step = 0.1})
      .number(&Distribution::alpha, {.name = "alpha",
                                     .label = "Opacity",
                                     .help = "How much of the highlight covers the visible picture.",
                                     .min = 0,
                                     .max = 1,
                                     .step = 0.01})
      .toggle(&Distribution::invert, {.name = "invert",
                                      .label = "Invert",
                                      .help = "Highlights the ordinary temperatures instead of the unusual ones."});
  return entries;
}

HWY_EXPORT(fuse_distribution);

PreparedMethod prepare(const Distribution& params, const MethodContext& context) {
  const TemperatureSummary& data = context.scene.summary;
  const double lower = data.mean - params.k * data.sigma;
  const double upper = data.mean + params.k * data.sigma;
  const bool spread = data.sigma > 0;
  const auto alpha = static_cast<float>(spread ? params.alpha : 0);
  const auto fuse = [thermal = ThermalTable(context), first_inside = smallest_at_least(lower),
                     last_inside = largest_at_most(upper), weight_inside = params.invert ? alpha : 0.0F,
                     weight_outside = params.invert ? 0.0F : alpha](const VertexSpan& span) {
    HWY_DYNAMIC_DISPATCH(fuse_distribution)(thermal, first_inside, last_inside, weight_inside, weight_outside, span);
  };

  std::vector<TemperatureInterval> highlighted;
  const double minimum = double{data.minimum};
  const double maximum = double{data.maximum};
  if (spread && params.invert) {
    highlighted.push_back({std::max(lower, minimum), std::min(upper, maximum)});
  } else if (spread) {
    if (minimum < lower) highlighted.push_back({minimum, lower});
    if (maximum > upper) highlighted.push_back({upper, maximum});
  }
  return {lane_kernel(context, fuse), std::move(highlighted)};
}

}  // namespace

Method histogram_distribution() {
  Method method;
  method.id = "histogram_distribution";
  method.label = "Histogram distribution";
  method.summary = "Temperatures far from the scene's mean show palette colours; the rest stays visible.";
  method.highlights = true;
  method.invert_complements = true;
  return make_method(std::move(method), schema(), &prepare);
}

}  // namespace spectra::fusion::methods

#endif  // HWY_ONCE
