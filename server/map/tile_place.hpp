#pragma once

#include <cstdint>

#include "protocol/tile_frame.hpp"

namespace spectra::map {

/// The tile that holds a tile of a level above 0.
inline protocol::TileId parent_of(const protocol::TileId& id) {
  return {static_cast<std::uint8_t>(id.level - 1), id.x / 2, id.y / 2, id.z / 2};
}

inline protocol::TileId child_of(const protocol::TileId& id, unsigned octant) {
  return {static_cast<std::uint8_t>(id.level + 1), 2 * id.x + (octant & 1), 2 * id.y + (octant >> 1 & 1),
          2 * id.z + (octant >> 2)};
}

/// Which child of its parent a tile is.
inline unsigned octant_of(const protocol::TileId& id) {
  return (id.x & 1) | (id.y & 1) << 1 | (id.z & 1) << 2;
}

/// The lowest tile that holds both.
inline protocol::TileId common_ancestor(protocol::TileId a, protocol::TileId b) {
  while (a.level > b.level) a = parent_of(a);
  while (b.level > a.level) b = parent_of(b);
  while (a != b) {
    a = parent_of(a);
    b = parent_of(b);
  }
  return a;
}

/// Coarse before fine, along a Morton curve within a level.
inline bool is_before(const protocol::TileId& a, const protocol::TileId& b) {
  if (a.level != b.level) return a.level < b.level;
  // The axis whose coordinates differ in the highest bit decides; of equal ones z before y before x.
  const std::uint32_t x = a.x ^ b.x, y = a.y ^ b.y, z = a.z ^ b.z;
  const auto is_lower = [](std::uint32_t one, std::uint32_t other) { return one < other && one < (one ^ other); };
  if (!is_lower(z, y) && !is_lower(z, x)) return a.z < b.z;
  return is_lower(y, x) ? a.x < b.x : a.y < b.y;
}

}  // namespace spectra::map
