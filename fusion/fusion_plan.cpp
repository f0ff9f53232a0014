#include "fusion/fusion_plan.hpp"

#include "fusion/registry.hpp"

namespace spectra::fusion {

Result<FusionPlan> FusionPlan::prepare(const FusionSettings& settings, const SceneTemperature& scene) {
  const Palette* palette = find_palette(settings.palette);
  if (!palette) {
    return failure(ErrorCode::UnknownPalette, "palette '" + settings.palette + "' is unknown", "palette");
  }
  return prepare(settings, scene, palette->table);
}

Result<FusionPlan> FusionPlan::prepare(const FusionSettings& settings, const SceneTemperature& scene,
                                       const PaletteTable& palette) {
  const Method* method = find_method(settings.method);
  if (!method) {
    return failure(ErrorCode::UnknownMethod, "method '" + settings.method + "' is unknown", "method");
  }
  FusionPlan plan;
  if (!settings.range.automatic) {
    plan.range_minimum_ = settings.range.minimum_celsius;
    plan.range_maximum_ = settings.range.maximum_celsius;
  } else if (scene.summary.has_temperature()) {
    plan.range_minimum_ = double{scene.summary.minimum};
    plan.range_maximum_ = double{scene.summary.maximum};
  }
  ParameterValues in_force = method->resolve(settings.params, plan.range_minimum_, plan.range_maximum_);
  // Without temperature nothing is compared, so automatic values cannot contradict anything.
  if (scene.summary.has_temperature()) {
    BOOST_OUTCOME_TRYV(method->check(in_force));
  }

  const MethodContext context{plan.range_minimum_, plan.range_maximum_, scene, palette, settings.missing};
  PreparedMethod prepared = method->prepare(in_force, context);
  plan.kernel_ = std::move(prepared.kernel);
  plan.settings_ = std::make_shared<const FusionSettings>(settings);
  plan.params_in_force_ = std::make_shared<const ParameterValues>(std::move(in_force));
  plan.highlighted_ = std::make_shared<const std::vector<TemperatureInterval>>(std::move(prepared.highlighted));
  return plan;
}

void FusionPlan::fuse(std::span<const float> temperature_celsius, std::span<const Rgb8> visible,
                      std::span<Rgb8> fused) const noexcept {
  kernel_->fuse(temperature_celsius, visible, fused);
}

}  // namespace spectra::fusion
