#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "fusion/base/vertex_types.hpp"

namespace spectra::files {

/// What stands for "no position" in a file: a place, or one coordinate, such as the height of cells that nobody has measured.
struct Hole {
  base::Vec3d place;                           ///< Metres.
  std::array<bool, 3> axes{true, true, true};  ///< Which of its coordinates tell.

  bool has(const base::Vec3d& p) const {
    return (!axes[0] || p.x == place.x) && (!axes[1] || p.y == place.y) && (!axes[2] || p.z == place.z);
  }
};

/// A number that many vertices have for one of their coordinates, far from all others.
struct SharedCoordinate {
  Hole as_hole;
  double share = 0;  ///< Of all vertices.
};

/// One vertex of a file.
struct SampledVertex {
  std::uint64_t vertex = 0;
  base::Vec3d position;  ///< Metres.
};

/// Tells whether a triangle uses the vertex.
using IsUsed = std::function<bool(std::uint64_t vertex)>;

struct CoordinateHoles {
  std::optional<Hole> certain;
  std::vector<SharedCoordinate> possible;  ///< Only where there is no certain one.
};

/// Whether a place of very many vertices (in the numbers of the file), that is `sizes` times as far from the others as those are
/// large, stands for "no position". Not the tip of a cone whose triangles share no vertices: what triangles use must be 0 0 0,
/// a number that is written for none, or 1000 times as far away as the scene is large.
bool stands_for_none(const base::Vec3d& place, double sizes, bool is_used);
/// Its numbers (of the file) alone say so.
bool is_written_for_none(const base::Vec3d& place);

/// The number that stands for "not measured" in one coordinate (of several, each certain, one: the rest when that is taken out): a dozen vertices share them exactly, farther from all others
/// than those are from each other. A true form has such numbers too (both ends of a pipe, a base far below), so that more
/// must be there:
///
/// - a number that is written for none alone (-9999, -32768, 65.535, ...): no triangle uses it, or the others have a dozen different
///   numbers, or it is 1000 times as far away as the scene is large;
/// - a power of ten: the others have a hundred different numbers, or a dozen and each an eighth as many vertices at most; its
///   vertices are among the others in the file and in the other two coordinates, and twice as far away as the scene is large,
///   16 times where triangles use them;
/// - any other: the same, but 1000 times where triangles use it;
/// - or it is 1e9 times as far away as the scene is large.
///
/// Two such numbers, one at either end, are judged each without the other. `metres` in one unit of the file.
CoordinateHoles find_coordinate_holes(std::span<const SampledVertex> vertices, double metres, const IsUsed& is_used);

}  // namespace spectra::files
