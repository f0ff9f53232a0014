#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "fusion/base/error.hpp"
#include "fusion/colour/palette.hpp"
#include "fusion/fusion_plan.hpp"
#include "server/map/scene_snapshot.hpp"
#include "server/tradeoff/measure.hpp"

namespace spectra::tradeoff {

/// Distance of the full mesh's vertices to the surface that a client draws.
struct PositionError {
  double rms_mm = 0;
  double worst_mm = 0;
};

/// Differences of what a client's screen shows at those vertices.
struct ColourError {
  double ciede2000_mean = 0;
  double ciede2000_p95 = 0;
  double temperature_p95_celsius = 0;  ///< As read back from the palette; NaN in a scene without thermal data.
};

/// Vertices of the full scene, evenly taken, at which is measured how far off a client's picture is.
class ErrorSamples {
 public:
  /// Fails for a palette that does not exist and for a scene without a vertex that could be drawn.
  static base::Result<ErrorSamples> take(const map::SceneSnapshot& scene, std::uint32_t sample_count,
                                         const std::string& palette);

  /// Of these tiles as a client decodes them when the largest position step is `step_m`. Fails where a tile cannot be encoded.
  base::Result<PositionError> position_error(const Tiles& tiles, float step_m) const;
  /// Of these tiles' colours, fused with look() and rounded to each number of bits, and of the temperature that thermal_only
  /// shows.
  std::vector<ColourError> colour_errors(const Tiles& tiles, const std::vector<int>& colour_bits) const;

  /// The default fusion, in the palette.
  const fusion::FusionPlan& look() const { return look_; }

 private:
  ErrorSamples(fusion::FusionPlan look, fusion::FusionPlan thermal, const fusion::PaletteTable& palette)
      : look_(std::move(look)), thermal_(std::move(thermal)), palette_(palette) {}
  void take_evenly(const map::SceneSnapshot& scene, std::uint32_t wanted);

  fusion::FusionPlan look_;
  fusion::FusionPlan thermal_;
  fusion::PaletteTable palette_;
  std::vector<base::Vec3f> positions_;
  std::vector<base::Rgb8> visible_;
  std::vector<float> temperature_celsius_;
};

}  // namespace spectra::tradeoff
