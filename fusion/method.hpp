#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "fusion/fusion_plan.hpp"
#include "fusion/parameter.hpp"

namespace spectra::fusion {

/// What fuses the vertices of one plan. Immutable: any number of threads may call it at once.
class Kernel {
 public:
  Kernel() = default;
  Kernel(const Kernel&) = delete;
  Kernel& operator=(const Kernel&) = delete;
  virtual ~Kernel() = default;

  /// Writes one fused colour per vertex; the three spans have the same length. Total: any bit pattern is allowed as
  /// a temperature.
  virtual void fuse(std::span<const float> temperature_celsius, std::span<const Rgb8> visible,
                    std::span<Rgb8> fused) const noexcept = 0;
};

/// What a method may know when it is made ready for a scene.
struct MethodContext {
  double range_minimum = 0;  ///< The active range, degC.
  double range_maximum = 0;
  const SceneTemperature& scene;  ///< Facts of the data, whatever the active range is.
  const PaletteTable& palette;
  MissingDisplay missing;
};

/// A method made ready for a scene.
struct PreparedMethod {
  std::shared_ptr<const Kernel> kernel;
  std::vector<TemperatureInterval> highlighted;  ///< As FusionPlan::highlighted().
};

/// A fusion method as the rest of Spectra sees it. The id and the parameter names are wire and command line names.
struct Method {
  std::string id;
  std::string label;
  std::string summary;  ///< One line for a list.
  std::vector<Parameter> parameters;
  bool needs_temperature = true;
  bool uses_palette = true;
  /// The method gives lightness to the visible picture, so that a palette which is not fusion_safe loses temperature.
  bool wants_fusion_safe_palette = false;

  // What a method promises; the property tests hold it to its word.

  /// Some temperatures are shown otherwise than by the visible colour, and FusionPlan::highlighted() says which.
  bool highlights = false;
  /// With `invert` what is highlighted is exactly what is not without it, except what stands on a threshold.
  bool invert_complements = false;
  /// Under a palette that gets lighter the hotter of two vertices is in no channel darker, where both are of one visible
  /// colour (for a method that highlights: black, and beyond the hot threshold).
  bool hotter_is_lighter = false;

  /// Whether values that are each allowed also go together; automatic ones are left out of the question.
  std::function<Result<void>(const ParameterValues&)> check;
  /// The automatic values replaced by numbers, which follow the scene and never the active range.
  std::function<ParameterValues(const ParameterValues&, const SceneTemperature&)> resolve;
  /// Builds the kernel; the values are resolved and checked.
  std::function<PreparedMethod(const ParameterValues&, const MethodContext&)> prepare;
};

}  // namespace spectra::fusion
