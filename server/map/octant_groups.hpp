#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "server/map/cell_content.hpp"

namespace spectra::map {

using OctantContents = std::array<CellContent, 8>;

/// Octants that become one child.
struct OctantGroup {
  unsigned octants = 0;  ///< Bit mask.
  CellContent count;
  unsigned heaviest = 0;  ///< Names the child.
};

/// Joins octants that are not empty until none is small beside the leaf size: neighbours that fit into one leaf, and what has less than a
/// quarter of one with the nearest other. `leaf_size`: how many vertices a leaf of such a content may own. `has_triangles`: none may be without
/// any. What is in them alone decides.
std::vector<OctantGroup> octant_groups(const OctantContents& counts,
                                       const std::function<std::uint64_t(const CellContent&)>& leaf_size,
                                       bool has_triangles);

}  // namespace spectra::map
