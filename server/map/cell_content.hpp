#pragma once

#include <cstdint>
#include <string>
#include <unordered_map>

#include "server/map/vertex_times.hpp"

namespace spectra::map {

/// Names a block as long as it is part of the map; one that replaces it gets another number.
using BlockNumber = std::uint32_t;

/// What is known of a block beside its mesh.
struct BlockLabel {
  std::string name;
  bool is_settled = false;            ///< What the scene began with; other blocks are expected to change.
  double observed_at = kUnknownTime;  ///< Unix seconds.
  double baseline_at =
      kUnknownTime;  ///< The time of the baseline of those of its vertices that are compared with themselves.
};

/// Of all blocks of a map, and which mark of its baseline is the newest.
struct BlockLabels {
  std::unordered_map<BlockNumber, BlockLabel> of_block;
  std::uint32_t baseline_mark = 0;

  const BlockLabel& at(BlockNumber block) const { return of_block.at(block); }
};

/// How much lies in a cell. Triangles count where their centroid is; a vertex where the first triangle of its block is that
/// has it, or, of no triangle, where it is itself.
struct CellContent {
  std::uint64_t triangle_count = 0;
  std::uint64_t owned_count = 0;     ///< Vertices.
  std::uint64_t changing_count = 0;  ///< Elements of blocks that are not settled.
  bool is_empty() const { return triangle_count == 0 && owned_count == 0; }
  CellContent& operator+=(const CellContent& other) {
    triangle_count += other.triangle_count;
    owned_count += other.owned_count;
    changing_count += other.changing_count;
    return *this;
  }
  CellContent& operator-=(const CellContent& other) {
    triangle_count -= other.triangle_count;
    owned_count -= other.owned_count;
    changing_count -= other.changing_count;
    return *this;
  }
  friend bool operator==(const CellContent&, const CellContent&) = default;
};

}  // namespace spectra::map
