#pragma once

#include <functional>
#include <memory>
#include <optional>
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

  /// Writes one fused colour per vertex, faded by its freshness; the spans that are there have the same length. Total:
  /// any bit pattern is allowed as a temperature.
  virtual void fuse(const base::VertexValues& vertices, std::span<base::Rgb8> fused) const noexcept = 0;
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
  std::optional<ChangeScale> change_scale = {};  ///< As FusionPlan::change_scale().
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
  /// The palette shows changes in both directions, so that one which is not diverging does not tell them apart.
  bool wants_diverging_palette = false;
  /// The method compares temperatures with the vertices' baseline; where there is none it has nothing to show. What it
  /// highlights is then no matter of the temperature alone.
  bool compares_with_baseline = false;

  // What a method promises; the property tests hold it to its word.

  /// Some temperatures are shown otherwise than by the visible colour, and FusionPlan::highlighted() says which (unless
  /// it compares_with_baseline).
  bool highlights = false;
  /// With `invert` what is highlighted is exactly what is not without it, except what stands on a threshold.
  bool invert_complements = false;
  /// Under a palette that gets lighter the hotter of two vertices is in no channel darker, where both are of one visible
  /// colour (for a method that highlights: black, and beyond the hot threshold).
  bool hotter_is_lighter = false;

  /// Whether values that are each allowed also go together; automatic ones are left out of the question.
  std::function<base::Result<void>(const ParameterValues&)> check;
  /// The automatic values replaced by numbers, which follow the scene and never the active range.
  std::function<ParameterValues(const ParameterValues&, const SceneTemperature&)> resolve;
  /// Builds the kernel; the values are resolved and checked.
  std::function<PreparedMethod(const ParameterValues&, const MethodContext&)> prepare;
};

}  // namespace spectra::fusion
