#pragma once

#include <compare>
#include <cstdint>

namespace spectra::protocol {

/// Names a node of the tile tree; level 0 is the root. Child i of (l,x,y,z) is (l+1, 2x+(i&1), 2y+(i>>1&1), 2z+(i>>2)).
struct TileId {
  std::uint8_t level = 0;
  std::uint32_t x = 0, y = 0, z = 0;
  friend auto operator<=>(const TileId&, const TileId&) = default;
};

}  // namespace spectra::protocol
