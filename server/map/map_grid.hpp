#pragma once

#include <array>
#include <optional>
#include <span>

#include "fusion/base/bounds.hpp"
#include "fusion/base/vertex_types.hpp"
#include "protocol/tile_frame.hpp"

namespace spectra::map {

/// Deepest level of a tile; a cell that cannot be cut further is a leaf whatever its size.
inline constexpr int kDeepestLevel = 31;

/// The cube, fixed for the life of a map, whose halves of halves are the places of tiles. What lies beyond it belongs to the cells
/// at its sides.
class MapGrid {
 public:
  MapGrid() = default;
  MapGrid(const std::array<double, 3>& corner_m, double edge_m) : corner_m_(corner_m), edge_m_(edge_m) {}

  /// So that most of some positions just fill one cell of `level`; the few that are far from
  /// all others, or outside of `core`, are not heeded. The cell's place in the cube is such that what grows beyond it soon has a common cell with
  /// it again. Of no positions: a cell of one metre around 0.
  static MapGrid around(std::span<const base::Vec3f> positions, const std::optional<base::Bounds>& core, int level);

  /// The same with cells of `level` no larger than so much, or than a 2,048th of what they are: there the cube would end before what is in it.
  MapGrid with_cells_of(double most_m, int level) const;
  /// With cells of `level` of that size, `low` in the first of those that with_cells_of() would fill.
  static MapGrid from(const base::Vec3f& low, double cell_m, int level);

  /// The middle of a cell (metres), where it is cut.
  std::array<double, 3> middle_of(const protocol::TileId& cell) const;

  const std::array<double, 3>& corner_m() const { return corner_m_; }
  double edge_m() const { return edge_m_; }

 private:
  std::array<double, 3> corner_m_{};
  double edge_m_ = 1;
};

/// In which octant of a cell a position lies.
inline unsigned octant_at(const std::array<double, 3>& middle, const base::Vec3f& p) {
  return (double{p.x} >= middle[0] ? 1u : 0u) | (double{p.y} >= middle[1] ? 2u : 0u) |
         (double{p.z} >= middle[2] ? 4u : 0u);
}

}  // namespace spectra::map
