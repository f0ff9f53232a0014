// Thermal only: the palette colour of the temperature, nothing of the visible picture.
//
//   F = M
//
// Source: the thermal modality as the paper's figures show it. Cost: one palette lookup.
// Missing temperature: the visible colour, or the fixed colour that is set for it.

#include "fusion/methods/vertex_kernel.hpp"
#include "fusion/parameter_schema.hpp"

namespace spectra::fusion::methods {
namespace {

struct ThermalOnly {};

PreparedMethod prepare(const ThermalOnly&, const MethodContext& context) {
  return {vertex_kernel([thermal = ThermalColour(context)](
                            const Vertex& vertex) { return thermal(double{vertex.temperature_celsius}); },
                        context.missing),
          {}};
}

}  // namespace

Method thermal_only() {
  Method method;
  method.id = "thermal_only";
  method.label = "Thermal only";
  method.summary = "The temperature in palette colours, without the visible picture.";
  return make_method(std::move(method), ParameterSchema<ThermalOnly>{}, &prepare);
}

}  // namespace spectra::fusion::methods
