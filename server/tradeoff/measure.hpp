#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "fusion/base/error.hpp"
#include "fusion/base/progress.hpp"
#include "server/map/scene_snapshot.hpp"

namespace spectra::tradeoff {

using Tiles = std::vector<std::shared_ptr<const map::Tile>>;

/// What `spectra tradeoff` measures and how closely.
struct TradeoffOptions {
  std::uint32_t sample_count = 20'000;  ///< Vertices of the full scene at which errors are taken.
  std::string palette = "inferno";      ///< The temperature is read back from its colours.
  std::vector<int> encoder_speeds{0, 5, 7, 10};
  std::vector<int> colour_bits{8, 7, 6, 5, 4};
  std::vector<double> step_factors{0.25, 0.5, 1, 2, 4, 8};            ///< Times the scene's suggested position step.
  std::vector<double> temperature_steps_celsius{0.01, 0.05, 0.2, 1};  ///< Of raw layers.
};

/// Codec of colours in frames of kind 6: Draco, after subtracting green from red and blue.
inline constexpr std::string_view kSubtractGreen = "draco subtract_green";

/// Geometry at one level of detail, position step and encoder: cost and position error against the full mesh surface.
struct GeometryPoint {
  std::string codec;  ///< "draco", "raw", "zstd", "meshoptimizer".
  int level = 0;      ///< Depth to which the tree is refined; the highest is full detail.
  std::uint64_t vertex_count = 0;
  double position_step_mm = 0;
  int encoder_speed = 0;
  std::uint64_t size_bytes = 0;
  double encode_ms = 0;
  double decode_ms = 0;
  double error_rms_mm = 0;
  double error_worst_mm = 0;
};

/// Colours at one level of detail and number of bits: cost, and error of what the screen shows at the samples.
struct ColourPoint {
  std::string
      codec;  ///< As above; "draco" are the plain colour frames, kSubtractGreen those that the web client asks for.
  int level = 0;
  int colour_bits = 8;
  std::uint64_t size_bytes = 0;
  double encode_ms = 0;  ///< Fusing included.
  double decode_ms = 0;
  double ciede2000_mean = 0;
  double ciede2000_p95 = 0;
  double temperature_p95_celsius = 0;  ///< NaN in a scene without thermal data.
};

/// Both raw layers of the full detail, from which a client fuses by itself: what they cost once, and what rounding the temperatures to a
/// step does to them and to fused colours.
struct RawPoint {
  double temperature_step_celsius = 0;
  std::uint64_t temperature_bytes = 0;
  std::uint64_t visible_bytes = 0;  ///< The smaller of plain and kSubtractGreen, for each tile.
  double encode_ms = 0;
  double decode_ms = 0;
  double temperature_worst_celsius = 0;
  double levels_mean = 0;  ///< Largest difference of a channel of the fused colours, of 255.
  double levels_p95 = 0;

  std::uint64_t size_bytes() const { return temperature_bytes + visible_bytes; }
};

/// Everything that was measured. The full grid of knobs is every GeometryPoint with every ColourPoint of the same level.
struct TradeoffMeasurement {
  std::string scene;
  std::uint64_t vertex_count = 0;
  std::uint64_t triangle_count = 0;
  int level_count = 0;
  double suggested_step_mm = 0;  ///< The scene's suggested position step.
  std::vector<GeometryPoint> geometry;
  std::vector<ColourPoint> colours;
  std::vector<RawPoint> raw;  ///< Empty for a scene without temperatures.
};

/// Colours of the full detail as the web client asks for them: what a change of settings costs that is not made there.
const ColourPoint& full_change(const TradeoffMeasurement& measurement);
/// From which setting on raw layers have cost less than fused colours; 1 is the first.
std::uint64_t break_even(const RawPoint& raw, const ColourPoint& change);

/// Measures on one thread, as one core of the server would work; `progress` is told of kMeasuringPhase.
base::Result<TradeoffMeasurement> measured_tradeoff(const map::SceneSnapshot& scene, const TradeoffOptions& options,
                                                    const base::Progress& progress = {});

inline constexpr std::string_view kMeasuringPhase = "measuring";

/// One knob setting that a link of some rate deserves.
struct Recommendation {
  double rate_mbit_per_s = 0;
  GeometryPoint geometry;
  ColourPoint colours;
  double first_picture_s = 0;     ///< Geometry and colours of this level over the link.
  double parameter_change_s = 0;  ///< Colours alone.
};

/// For each rate the most accurate point, with colours as the web client asks for them, whose parameter change takes at most
/// `change_target_s` and whose first full picture at most `picture_target_s`; where none does, the cheapest.
std::vector<Recommendation> recommended_points(const TradeoffMeasurement& measurement,
                                               const std::vector<double>& rates_mbit_per_s,
                                               double change_target_s = 0.5, double picture_target_s = 10);

}  // namespace spectra::tradeoff
