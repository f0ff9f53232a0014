#pragma once

#include <cstdint>

#include "fusion/base/progress.hpp"
#include "fusion/mesh/multispectral_mesh.hpp"

namespace spectra::mesh {

/// Facts of a mesh's connectivity. Triangles with a vertex twice or an index out of range take no part.
struct TopologyFacts {
  std::uint64_t boundary_edge_count = 0;        ///< Edges of one triangle.
  std::uint64_t non_manifold_edge_count = 0;    ///< Edges of more than two triangles.
  std::uint64_t flipped_edge_count = 0;         ///< Edges of two triangles that see different sides as outer.
  std::uint64_t non_manifold_vertex_count = 0;  ///< Vertices whose triangles form more than one fan.
  std::uint64_t unreferenced_vertex_count = 0;  ///< Vertices of no triangle (0 for a point cloud).
  std::uint64_t component_count = 0;            ///< Pieces of surface connected over edges, flipped or not.
};

/// Pairs the sides of the triangles (see paired_sides) and reads the facts off that. `progress` is told of kTopologyPhase.
TopologyFacts topology_facts(const MultispectralMesh& mesh, const base::Progress& progress = {});

}  // namespace spectra::mesh
