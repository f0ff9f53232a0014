#include "server/stream/tile_encoder.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <tuple>
#include <utility>

#include "fusion/mesh/position_index.hpp"
#include "fusion/temperature_codes.hpp"
#include "protocol/codec/draco_codec.hpp"
#include "server/stream/duration_histogram.hpp"
#include "server/stream/lattice.hpp"

namespace spectra::stream {
namespace {

std::uint32_t bits_of(const std::vector<float>& values, std::size_t v) {
  return values.empty() ? 0 : std::bit_cast<std::uint32_t>(values[v]);
}

/// The triangles of a tile, each corner the first of those vertices that nothing tells apart: neither place nor anything that a picture
/// or a layer of the tile shows. Triangles that share no vertices take several times the bytes.
std::vector<base::Triangle> welded_triangles(const map::Tile& tile,
                                             std::span<const protocol::codec::LatticePoint> points) {
  const std::size_t count = tile.positions.size();
  mesh::PositionIndex index(count);
  std::vector<std::uint32_t> place(count);
  for (std::size_t v = 0; v < count; ++v) place[v] = index.find_or_insert(tile.positions[v]);
  std::vector<base::Triangle> triangles = tile.triangles;
  if (index.positions().size() == count) return triangles;
  const auto content_of = [&](std::uint32_t v) {
    const base::Rgb8 colour = tile.visible[v];
    return std::tuple(place[v], points[v], colour.r, colour.g, colour.b, bits_of(tile.temperature_celsius, v),
                      bits_of(tile.baseline_celsius, v), bits_of(tile.sigma_kelvin, v),
                      tile.seen_at.of_vertex.empty() ? 0 : tile.seen_at.of_vertex[v]);
  };
  std::vector<std::uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::pair(content_of(a), a) < std::pair(content_of(b), b);
  });
  std::vector<std::uint32_t> first_of(count);
  for (std::size_t i = 0; i < count; ++i) {
    const bool is_first = i == 0 || content_of(order[i]) != content_of(order[i - 1]);
    first_of[order[i]] = is_first ? order[i] : first_of[order[i - 1]];
  }
  for (base::Triangle& triangle : triangles) {
    for (std::uint32_t& corner : triangle) corner = first_of[corner];
  }
  return triangles;
}

}  // namespace

protocol::Result<EncodedTile> encoded_tile(const map::Tile& tile, float position_step_m, int encoder_speed) {
  BOOST_OUTCOME_TRY(auto lattice, tile_lattice(tile, position_step_m));
  BOOST_OUTCOME_TRY(auto geometry,
                    protocol::codec::encoded_geometry(lattice.points, welded_triangles(tile, lattice.points),
                                                      lattice.step_m, encoder_speed));
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
