#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "fusion/base/progress.hpp"
#include "fusion/base/vertex_types.hpp"
#include "fusion/mesh/openmesh_kernel.hpp"

namespace spectra::mesh {

/// What had to be cut for triangles to be a manifold: edges of more than two triangles and those whose two triangles run the same way
/// round, and vertices whose triangles form more than one fan. A cut vertex keeps its index for one fan; each further fan gets a new one.
struct ManifoldCuts {
  std::vector<std::uint32_t>
      source_vertex;  ///< Per new vertex (from the input's vertex count on): what it was cut from.

  std::uint64_t non_manifold_edge_count = 0;
  std::uint64_t flipped_edge_count = 0;
  std::uint64_t cut_edge_side_count = 0;  ///< Sides with none against them that are so only because of a cut.
  /// Faces that share a cut edge: what surface is connected there although sides do not show it.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> cut_neighbours;
};

/// Triangles as a manifold, by their sides: side 3 f + k of face f runs from its corner k to the next.
struct PairedSides : ManifoldCuts {
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

  std::vector<base::Triangle> faces;    ///< Of the input's, those that take part, with what was cut.
  std::vector<std::uint32_t> opposite;  ///< Per side, the one against it; kNone where there is none.
};

/// Pairs all edges at once: linear time, at most 80 bytes a triangle while it runs.
/// Triangles with a vertex twice or an index that is not below `vertex_count` take no part. At most 1.4 billion triangles.
/// `progress` is told of kTopologyPhase.
PairedSides paired_sides(std::size_t vertex_count, std::span<const base::Triangle> triangles,
                         const base::Progress& progress = {});

/// The same as an OpenMesh half-edge mesh, which can hold manifolds only.
struct HalfEdges : ManifoldCuts {
  MeshKernel kernel;  ///< Connectivity alone; its point arrays are not filled.
};

/// Fills OpenMesh's arrays directly: linear time, about 150 bytes a triangle while it runs. Otherwise as paired_sides, but at most
/// 350 million triangles: OpenMesh counts half-edges in an int.
HalfEdges half_edges(std::size_t vertex_count, std::span<const base::Triangle> triangles,
                     const base::Progress& progress = {});

}  // namespace spectra::mesh
