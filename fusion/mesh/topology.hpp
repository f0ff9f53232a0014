#pragma once

#include <cstdint>

#include "fusion/mesh/multispectral_mesh.hpp"

namespace spectra::fusion {

/// Facts of a mesh's connectivity.
struct TopologyFacts {
  std::uint64_t boundary_edge_count = 0;
  std::uint64_t non_manifold_edge_count = 0;    ///< Edges of more than two triangles.
  std::uint64_t non_manifold_vertex_count = 0;  ///< Vertices whose triangles form more than one fan.
  std::uint64_t unreferenced_vertex_count = 0;  ///< Vertices of no triangle (0 for a point cloud).
  std::uint64_t component_count = 0;            ///< Connected pieces of surface.
};

/// Builds the half-edge connectivity of the mesh with OpenMesh (non-manifold places are split for it) and reads the
/// facts off it.
TopologyFacts topology_facts(const MultispectralMesh& mesh);

}  // namespace spectra::fusion
