#include "fusion/mesh/topology.hpp"

#include <algorithm>
#include <vector>

#include "fusion/mesh/disjoint_sets.hpp"
#include "fusion/mesh/half_edges.hpp"

namespace spectra::mesh {

TopologyFacts topology_facts(const MultispectralMesh& mesh, const base::Progress& progress) {
  TopologyFacts facts;
  if (mesh.is_point_cloud()) return facts;
  const HalfEdges topology = half_edges(mesh.vertex_count(), mesh.triangles(), progress);
  base::report(progress, base::kTopologyPhase, 0.9);
  const MeshKernel& kernel = topology.kernel;
  facts.non_manifold_edge_count = topology.non_manifold_edge_count;
  facts.flipped_edge_count = topology.flipped_edge_count;

  DisjointSets pieces(kernel.n_faces());
  std::uint64_t boundary_count = 0;
  for (const auto edge : kernel.edges()) {
    const auto side = kernel.face_handle(kernel.halfedge_handle(edge, 0));
    const auto other_side = kernel.face_handle(kernel.halfedge_handle(edge, 1));
    if (side.is_valid() && other_side.is_valid()) {
      pieces.unite(static_cast<std::uint32_t>(side.idx()), static_cast<std::uint32_t>(other_side.idx()));
    } else {
      ++boundary_count;
    }
  }
  for (const auto& [face, other_face] : topology.cut_neighbours) pieces.unite(face, other_face);
  facts.boundary_edge_count = boundary_count - topology.cut_edge_side_count;
  facts.component_count = pieces.set_count();

  for (const auto vertex : kernel.vertices()) {
    facts.unreferenced_vertex_count += kernel.is_isolated(vertex) ? 1U : 0U;
  }
  std::vector<std::uint32_t> cut = topology.source_vertex;
  std::sort(cut.begin(), cut.end());
  facts.non_manifold_vertex_count = static_cast<std::uint64_t>(std::unique(cut.begin(), cut.end()) - cut.begin());
  return facts;
}

}  // namespace spectra::mesh
