#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "fusion/fusion_plan.hpp"
#include "protocol/rpc_error.hpp"
#include "protocol/tile_frame.hpp"
#include "server/map/scene_snapshot.hpp"
#include "server/stream/tile_look.hpp"

namespace spectra::stream {

struct EncodingTimes;

using Payload = std::shared_ptr<const std::vector<std::byte>>;

/// The geometry of a tile as it goes over the wire, and how to put colours into its decoded order. Immutable.
struct EncodedTile {
  std::uint32_t revision = 0;  ///< Names this encoding and no other; the tile revision of the wire. From 1.
  float position_step_m = 0;   ///< The coarsest that a vertex of the tile has.
  std::array<float, 3> origin_m{};
  /// Vertex of the Tile for each decoded vertex; of those that nothing tells apart, where triangles have them as corners, one.
  std::vector<std::uint32_t> input_of_decoded;
  Payload payload;
};

/// Encodes the geometry of a tile of a scene whose largest step is to be `position_step_m`; the revision is left to the cache.
protocol::Result<EncodedTile> encoded_tile(const map::Tile& tile, float position_step_m, int encoder_speed);

/// Fuses a tile under a look of it and encodes its colours in the decoded vertex order of `geometry`, which was made from the same tile; with
/// which vertices are highlighted where it `has_marks`. `times` is told of both.
protocol::Result<Payload> encoded_tile_colours(const map::Tile& tile, const EncodedTile& geometry,
                                               const fusion::FusionPlan& plan, const TileLook& look, int colour_bits,
                                               int encoder_speed,
                                               protocol::ColourTransform transform = protocol::ColourTransform::None,
                                               bool has_marks = false, EncodingTimes* times = nullptr);

/// The visible colours of a tile in the decoded vertex order of `geometry`.
protocol::Result<Payload> encoded_visible_layer(const map::Tile& tile, const EncodedTile& geometry, int encoder_speed,
                                                protocol::ColourTransform transform);

/// Its temperatures as codes (fusion::TemperatureCodes); `step_celsius` 0 = the default one. A tile without temperatures
/// has missing ones.
protocol::Result<Payload> encoded_temperature_layer(const map::Tile& tile, const EncodedTile& geometry,
                                                    int encoder_speed, double step_celsius);

/// How sure its temperatures are, kelvin, in the same codes with the default step. Of a tile of which nothing is known all are missing.
protocol::Result<Payload> encoded_sigma_layer(const map::Tile& tile, const EncodedTile& geometry, int encoder_speed);

}  // namespace spectra::stream
