#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "fusion/base/error.hpp"
#include "fusion/base/vertex_types.hpp"
#include "fusion/colour/palette.hpp"
#include "fusion/settings.hpp"
#include "fusion/statistics/temperature_statistics.hpp"

namespace spectra::fusion {

/// A closed interval of temperatures, degC.
struct TemperatureInterval {
  double low = 0;
  double high = 0;
};

/// The changes of temperature, kelvin, that stand at the two ends of the palette.
struct ChangeScale {
  double minimum = 0;
  double maximum = 0;
};

class Kernel;

/// Settings made ready for one scene: everything that does not depend on the vertex is computed once. Immutable and
/// cheap to copy; any number of threads may fuse with it at once.
class FusionPlan {
 public:
  /// Resolves automatic values against the scene and builds the kernel. Computes a histogram only when the method
  /// needs one. Fails with Inconsistent when values that became known contradict each other (low > high).
  static base::Result<FusionPlan> prepare(const FusionSettings& settings, const SceneTemperature& scene);

  /// The same with a palette table of the caller's instead of the one the settings name.
  static base::Result<FusionPlan> prepare(const FusionSettings& settings, const SceneTemperature& scene,
                                          const PaletteTable& palette);

  /// Fused colours of vertices; all spans that are there have the same length. Total: no input makes undefined
  /// behaviour. The answer for a vertex depends on that vertex alone, so any split and any thread count give the same
  /// bytes. Freshness is applied as it stands, whatever the settings say of age: only the caller knows the time.
  void fuse(const base::VertexValues& vertices, std::span<base::Rgb8> fused) const noexcept;

  /// The same of vertices without a baseline, all fresh.
  void fuse(std::span<const float> temperature_celsius, std::span<const base::Rgb8> visible,
            std::span<base::Rgb8> fused) const noexcept {
    fuse(base::VertexValues{temperature_celsius, visible}, fused);
  }

  /// Writes 1 where the method highlights a temperature so that it can be seen at all, else 0: of one visible colour that no
  /// highlight resembles, it makes another. All 0 for a method that treats all temperatures alike. `baseline_celsius`
  /// may be empty: no vertex has any.
  void mark(std::span<const float> temperature_celsius, std::span<const float> baseline_celsius,
            std::span<std::uint8_t> marked) const noexcept;

  /// The method highlights some temperatures: mark() may write 1.
  bool highlights() const { return marking_kernel_ != nullptr; }

  const FusionSettings& settings() const { return *settings_; }

  /// The active range in degC; both 0 when the scene has no temperature.
  double range_minimum() const { return range_minimum_; }
  double range_maximum() const { return range_maximum_; }

  /// Every parameter with the value in force: automatic ones resolved to numbers.
  const ParameterValues& params_in_force() const { return *params_in_force_; }

  /// The temperatures that the method shows otherwise than by the visible colour, ascending and disjoint, within the
  /// data's extremes, one of which stands for what is beyond the sensor's range where that alone is highlighted; empty
  /// for a method that treats all temperatures alike, and for one that compares with the baseline: what that shows is no
  /// interval of temperatures.
  const std::vector<TemperatureInterval>& highlighted() const { return *highlighted_; }

  /// The temperatures are compared with the vertices' baseline.
  bool compares_with_baseline() const { return compares_with_baseline_; }

  /// What the palette stands for where that is changes of temperature; nothing where it is the active range.
  const std::optional<ChangeScale>& change_scale() const { return change_scale_; }

 private:
  FusionPlan() = default;
  std::shared_ptr<const Kernel> kernel_;
  std::shared_ptr<const Kernel>
      marking_kernel_;  ///< Under a palette of the plan's own; none where nothing is highlighted.
  std::shared_ptr<const FusionSettings> settings_;
  std::shared_ptr<const ParameterValues> params_in_force_;
  std::shared_ptr<const std::vector<TemperatureInterval>> highlighted_;
  double range_minimum_ = 0;
  double range_maximum_ = 0;
  std::optional<ChangeScale> change_scale_;
  bool compares_with_baseline_ = false;
};

}  // namespace spectra::fusion
