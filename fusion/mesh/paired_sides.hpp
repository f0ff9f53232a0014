#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "fusion/base/progress.hpp"
#include "fusion/base/vertex_types.hpp"

namespace spectra::mesh {

/// Triangles as a manifold, by their sides: side 3 f + k of face f runs from its corner k to the next. Where the input is none it is cut:
/// along edges of more than two triangles and along those whose two triangles run the same way round, and at vertices whose triangles form
/// more than one fan. A cut vertex keeps its index for one fan; each further fan gets a new one.
struct PairedSides {
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

  std::vector<base::Triangle> faces;    ///< Of the input's, those that take part, with what was cut.
  std::vector<std::uint32_t> opposite;  ///< Per side, the one against it; kNone where there is none.
  /// Per new vertex (from the input's vertex count on): what it was cut from.
  std::vector<std::uint32_t> source_vertex;

  std::uint64_t non_manifold_edge_count = 0;
  std::uint64_t flipped_edge_count = 0;
  std::uint64_t cut_edge_side_count = 0;  ///< Sides with none against them that are so only because of a cut.
  /// Faces that share a cut edge: what surface is connected there although sides do not show it.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> cut_neighbours;
};

/// Pairs all edges at once: linear time; while it runs 60 bytes a triangle of a manifold, 130 where every edge is cut.
/// Triangles with a vertex twice or an index that is not below `vertex_count` take no part. At most 1.4 billion triangles.
/// `progress` is told of kTopologyPhase.
PairedSides paired_sides(std::size_t vertex_count, std::span<const base::Triangle> triangles,
                         const base::Progress& progress = {});

}  // namespace spectra::mesh
