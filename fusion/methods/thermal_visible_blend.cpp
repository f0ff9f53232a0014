// Thermal-visible blend: both pictures over each other, one opacity for the whole scene.
//
//   F = alpha M + (1 - alpha) V
//
// Source: Eq. 1. Cost: one palette lookup and one mix.
// Missing temperature: the visible colour, or the fixed colour that is set for it.

#include "fusion/methods/vertex_kernel.hpp"
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

PreparedMethod prepare(const Blend& params, const MethodContext& context) {
  return {vertex_kernel(
              [thermal = ThermalColour(context), alpha = params.alpha](const Vertex& vertex) {
                return mixed(alpha, thermal(double{vertex.temperature_celsius}), vertex.visible);
              },
              context.missing),
          {}};
}

}  // namespace

Method thermal_visible_blend() {
  Method method;
  method.id = "thermal_visible_blend";
  method.label = "Thermal-visible blend";
  method.summary = "Both pictures over each other with one opacity.";
  return make_method(std::move(method), schema(), &prepare);
}

}  // namespace spectra::fusion::methods
