#pragma once

#include <cstddef>
#include <vector>

#include "fusion/mesh/openmesh_kernel.hpp"
#include "fusion/mesh/paired_sides.hpp"

namespace spectra::mesh::testing {

/// Paired sides as an OpenMesh half-edge mesh, which can hold manifolds only and is unsound where they are none.
struct HalfEdges {
  PairedSides sides;
  MeshKernel kernel;  ///< Connectivity alone; its point arrays are not filled.
};

HalfEdges half_edges(std::size_t vertex_count, const std::vector<base::Triangle>& triangles);

}  // namespace spectra::mesh::testing
