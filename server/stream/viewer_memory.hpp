#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "protocol/tile_frame.hpp"
#include "server/stream/demand.hpp"
#include "server/stream/tile_look.hpp"

namespace spectra::stream {

/// What a viewer was given of one tile, as far as the stream that goes on after its connection asks.
struct RememberedTile {
  protocol::TileId tile;
  std::uint32_t revision = 0;
  std::uint32_t wire_revision = 0;  ///< 0: nothing is remembered.
  std::uint8_t child_mask = 0;
  std::uint8_t colour_bits = 0;
  std::uint32_t colour_sequence = 0;
  std::uint64_t bytes = 0;    ///< Decoded.
  float position_step_m = 0;  ///< The coarsest of the tile; 0: it is not known where the tile stands.
  std::array<float, 3> origin_m{};
  Picture picture;
  TileLook look;
};

/// What a viewer has been given, tile by tile: outlives its connection, so that who comes back gets only what has changed. Immutable.
class ViewerMemory {
 public:
  ViewerMemory() = default;
  /// At most one of each tile, in any order.
  explicit ViewerMemory(std::vector<RememberedTile> tiles);

  bool empty() const { return tiles_.empty(); }
  std::size_t size() const { return tiles_.size(); }
  /// Null where nothing is remembered of the tile.
  const RememberedTile* find(protocol::TileId tile) const;
  /// Of memory that it takes, with that of the pictures which it keeps known.
  std::size_t size_bytes() const { return size_bytes_; }

 private:
  std::vector<RememberedTile> tiles_;  // By their ids.
  std::size_t size_bytes_ = sizeof(ViewerMemory);
};

}  // namespace spectra::stream
