#include "server/stream/tile_encoder.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include "fusion/temperature_codes.hpp"
#include "protocol/codec/draco_codec.hpp"
#include "server/stream/duration_histogram.hpp"
#include "server/stream/lattice.hpp"

namespace spectra::stream {

protocol::Result<EncodedTile> encoded_tile(const map::Tile& tile, float position_step_m, int encoder_speed) {
  BOOST_OUTCOME_TRY(auto lattice, tile_lattice(tile, position_step_m));
  BOOST_OUTCOME_TRY(auto geometry,
                    protocol::codec::encoded_geometry(lattice.points, tile.triangles, lattice.step_m, encoder_speed));
  return EncodedTile{.revision = 0,
                     .position_step_m = lattice.coarsest_step_m,
                     .origin_m = lattice.origin_m,
                     .input_of_decoded = std::move(geometry.input_of_decoded),
                     .payload = std::make_shared<const std::vector<std::byte>>(std::move(geometry.payload))};
}

protocol::Result<Payload> encoded_tile_colours(const map::Tile& tile, const EncodedTile& geometry,
                                               const fusion::FusionPlan& plan, const TileLook& look, int colour_bits,
                                               int encoder_speed, protocol::ColourTransform transform, bool has_marks,
                                               EncodingTimes* times) {
  std::optional<TimedWork> watch;
  if (times != nullptr) watch.emplace(times->fusing);
  const std::vector<base::Rgb8> fused = fused_colours(tile, plan, look);
  if (times != nullptr) watch.emplace(times->colours);
  std::vector<protocol::codec::ColourBytes> colours(geometry.input_of_decoded.size());
  for (std::size_t i = 0; i < colours.size(); ++i) {
    const base::Rgb8 colour = fused[geometry.input_of_decoded[i]];
    colours[i] = {colour.r, colour.g, colour.b};
  }
  std::vector<std::uint8_t> marks;
  if (has_marks) {
    const std::vector<std::uint8_t> marked = highlight_marks(tile, plan, look);
    for (const std::uint32_t input : geometry.input_of_decoded) marks.push_back(marked[input]);
  }
  BOOST_OUTCOME_TRY(auto payload,
                    protocol::codec::encoded_colours(colours, colour_bits, encoder_speed, transform, marks));
  return std::make_shared<const std::vector<std::byte>>(std::move(payload));
}

protocol::Result<Payload> encoded_visible_layer(const map::Tile& tile, const EncodedTile& geometry, int encoder_speed,
                                                protocol::ColourTransform transform) {
  std::vector<protocol::codec::ColourBytes> colours;
  colours.reserve(geometry.input_of_decoded.size());
  for (const std::uint32_t input : geometry.input_of_decoded) {
    const base::Rgb8 colour = tile.visible[input];
    colours.push_back({colour.r, colour.g, colour.b});
  }
  BOOST_OUTCOME_TRY(auto payload, protocol::codec::encoded_colours(colours, 8, encoder_speed, transform));
  return std::make_shared<const std::vector<std::byte>>(std::move(payload));
}

namespace {

/// A number per vertex of the tile, none where there are none at all, in the decoded order.
protocol::Result<Payload> encoded_scalars(std::span<const float> of_vertex, const EncodedTile& geometry,
                                          int encoder_speed, double step) {
  std::vector<float> values;
  values.reserve(geometry.input_of_decoded.size());
  float lowest = std::numeric_limits<float>::infinity();
  float highest = -lowest;
  for (const std::uint32_t input : geometry.input_of_decoded) {
    const float value = of_vertex.empty() ? std::numeric_limits<float>::quiet_NaN() : of_vertex[input];
    values.push_back(value);
    if (!std::isfinite(value)) continue;
    lowest = std::min(lowest, value);
    highest = std::max(highest, value);
  }
  using Codes = fusion::TemperatureCodes;
  const double step_in_force = step > 0 ? step : Codes::kDefaultStepCelsius;
  const Codes codes = lowest <= highest ? Codes::covering(lowest, highest, step_in_force) : Codes{};
  std::vector<std::uint16_t> code(values.size());
  codes.encode(values, code);
  BOOST_OUTCOME_TRY(auto payload,
                    protocol::codec::encoded_temperature_codes(code, {codes.scale, codes.offset}, encoder_speed));
  return std::make_shared<const std::vector<std::byte>>(std::move(payload));
}

}  // namespace

protocol::Result<Payload> encoded_temperature_layer(const map::Tile& tile, const EncodedTile& geometry,
                                                    int encoder_speed, double step_celsius) {
  return encoded_scalars(tile.temperature_celsius, geometry, encoder_speed, step_celsius);
}

protocol::Result<Payload> encoded_sigma_layer(const map::Tile& tile, const EncodedTile& geometry, int encoder_speed) {
  return encoded_scalars(tile.sigma_kelvin, geometry, encoder_speed, 0);
}

}  // namespace spectra::stream
