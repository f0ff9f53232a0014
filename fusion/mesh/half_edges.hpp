#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "fusion/base/progress.hpp"
#include "fusion/base/vertex_types.hpp"
#include "fusion/mesh/openmesh_kernel.hpp"

namespace spectra::mesh {

/// Triangles as an OpenMesh half-edge mesh, which can hold manifolds only. Where the input is none it is cut: along edges
/// of more than two triangles and along those whose two triangles run the same way round, and at vertices whose
/// triangles form more than one fan. A cut vertex keeps its index for one fan; each further fan gets a new vertex.
struct HalfEdges {
  MeshKernel kernel;  ///< Connectivity alone; its point arrays are not filled.
  std::vector<std::uint32_t>
      source_vertex;  ///< Per new vertex (from the input's vertex count on): what it was cut from.

  std::uint64_t non_manifold_edge_count = 0;
  std::uint64_t flipped_edge_count = 0;
  std::uint64_t cut_edge_side_count = 0;  ///< Boundary edges of the kernel that are so only because of a cut.
  /// Faces that share a cut edge: what surface is connected there although the kernel does not show it.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> cut_neighbours;
};

/// Pairs all edges at once and fills OpenMesh's arrays directly: linear time, about 150 bytes a triangle while it runs.
/// Triangles with a vertex twice or an index that is not below `vertex_count` take no part. At most 350 million triangles:
/// OpenMesh counts half-edges in an int.
/// `progress` is told of kTopologyPhase.
HalfEdges half_edges(std::size_t vertex_count, std::span<const base::Triangle> triangles,
                     const base::Progress& progress = {});

}  // namespace spectra::mesh
