#include "fusion/mesh/topology.hpp"

#include <algorithm>
#include <numeric>
#include <vector>

#include "fusion/mesh/half_edges.hpp"

namespace spectra::fusion {

namespace {

/// Sets that are united step by step; counts how many are left.
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count) : parents_(count), set_count_(count) {
    std::iota(parents_.begin(), parents_.end(), 0U);
  }

  void unite(std::uint32_t a, std::uint32_t b) {
    a = root(a);
    b = root(b);
    if (a == b) return;
    parents_[std::max(a, b)] = std::min(a, b);
    --set_count_;
  }

  std::size_t set_count() const { return set_count_; }

 private:
  std::uint32_t root(std::uint32_t item) {
    while (parents_[item] != item) item = parents_[item] = parents_[parents_[item]];
    return item;
  }

  std::vector<std::uint32_t> parents_;
  std::size_t set_count_;
};

}  // namespace

TopologyFacts topology_facts(const MultispectralMesh& mesh) {
  TopologyFacts facts;
  if (mesh.is_point_cloud()) return facts;
  const HalfEdges topology = half_edges(mesh.vertex_count(), mesh.triangles());
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

}  // namespace spectra::fusion
