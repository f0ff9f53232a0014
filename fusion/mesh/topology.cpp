#include "fusion/mesh/topology.hpp"

#include <algorithm>
#include <vector>

#include "fusion/mesh/disjoint_sets.hpp"
#include "fusion/mesh/paired_sides.hpp"

namespace spectra::mesh {

TopologyFacts topology_facts(const MultispectralMesh& mesh, const base::Progress& progress) {
  TopologyFacts facts;
  if (mesh.is_point_cloud()) return facts;
  PairedSides sides = paired_sides(mesh.vertex_count(), mesh.triangles(), progress);
  facts.non_manifold_edge_count = sides.non_manifold_edge_count;
  facts.flipped_edge_count = sides.flipped_edge_count;

  DisjointSets pieces(sides.faces.size());
  std::uint64_t boundary_count = 0;
  for (std::uint32_t side = 0; side < sides.opposite.size(); ++side) {
    const std::uint32_t other = sides.opposite[side];
    if (other == PairedSides::kNone) {
      ++boundary_count;
    } else if (side < other) {
      pieces.unite(side / 3, other / 3);
    }
  }
  base::report(progress, base::kTopologyPhase, 0.9);
  for (const auto& [face, other_face] : sides.cut_neighbours) pieces.unite(face, other_face);
  facts.boundary_edge_count = boundary_count - sides.cut_edge_side_count;
  facts.component_count = pieces.set_count();

  // A vertex that is cut keeps its index in one of its triangles.
  std::vector<bool> is_used(mesh.vertex_count(), false);
  for (const base::Triangle& face : sides.faces) {
    for (const std::uint32_t vertex : face) {
      if (vertex < is_used.size()) is_used[vertex] = true;
    }
  }
  facts.unreferenced_vertex_count = static_cast<std::uint64_t>(std::count(is_used.begin(), is_used.end(), false));
  std::vector<std::uint32_t>& cut = sides.source_vertex;
  std::sort(cut.begin(), cut.end());
  facts.non_manifold_vertex_count = static_cast<std::uint64_t>(std::unique(cut.begin(), cut.end()) - cut.begin());
  base::report(progress, base::kTopologyPhase, 1);
  return facts;
}

}  // namespace spectra::mesh
