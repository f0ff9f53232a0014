#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "fusion/base/vertex_types.hpp"

namespace spectra::mesh {

/// Divides points into at most `group_count` groups, always halving the largest, and names for each point the one that
/// stands for its group (that nearest to the mean). Coincident points are never parted. `members` are the points that take
/// part; the others stand for themselves.
std::vector<std::uint32_t> group_representatives(std::span<const base::Vec3f> points,
                                                 std::vector<std::uint32_t> members, std::size_t group_count);

}  // namespace spectra::mesh
