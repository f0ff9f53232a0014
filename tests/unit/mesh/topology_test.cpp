#include "fusion/mesh/topology.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <set>
#include <vector>

#include "../files/allocation_meter.hpp"
#include "half_edges.hpp"

namespace spectra::mesh {
namespace {

using testing::half_edges;
using testing::HalfEdges;

MultispectralMesh mesh_of(std::size_t vertex_count, std::vector<base::Triangle> triangles) {
  MultispectralMesh mesh;
  mesh.resize_vertices(vertex_count);
  mesh.triangles() = std::move(triangles);
  return mesh;
}

/// What OpenMesh relies on: links that agree both ways, boundary vertices that refer to their boundary half-edge, and
/// every half-edge of a vertex reached by turning round it.
void expect_sound(const HalfEdges& topology, std::size_t vertex_count, const std::vector<base::Triangle>& triangles) {
  const MeshKernel& kernel = topology.kernel;
  ASSERT_EQ(kernel.n_faces(), triangles.size());
  ASSERT_EQ(kernel.n_vertices(), vertex_count + topology.sides.source_vertex.size());
  std::vector<std::size_t> outgoing(kernel.n_vertices(), 0);
  for (const auto halfedge : kernel.halfedges()) {
    EXPECT_EQ(kernel.prev_halfedge_handle(kernel.next_halfedge_handle(halfedge)), halfedge);
    EXPECT_EQ(kernel.next_halfedge_handle(kernel.prev_halfedge_handle(halfedge)), halfedge);
    EXPECT_EQ(kernel.to_vertex_handle(halfedge), kernel.from_vertex_handle(kernel.next_halfedge_handle(halfedge)));
    EXPECT_EQ(kernel.face_handle(halfedge), kernel.face_handle(kernel.next_halfedge_handle(halfedge)));
    ++outgoing[static_cast<std::size_t>(kernel.from_vertex_handle(halfedge).idx())];
  }
  for (const auto vertex : kernel.vertices()) {
    std::size_t count = 0;
    for (auto it = kernel.cvoh_iter(vertex); it.is_valid(); ++it) {
      EXPECT_EQ(kernel.from_vertex_handle(*it), vertex);
      ++count;
    }
    EXPECT_EQ(count, outgoing[static_cast<std::size_t>(vertex.idx())]);
    const auto out = kernel.halfedge_handle(vertex);
    bool touches_boundary = false;
    for (auto it = kernel.cvoh_iter(vertex); it.is_valid(); ++it) {
      touches_boundary = touches_boundary || kernel.is_boundary(*it);
    }
    if (out.is_valid()) {
      EXPECT_EQ(kernel.is_boundary(out), touches_boundary);
    }
  }
  for (const auto face : kernel.faces()) {
    base::Triangle corners{};
    std::size_t i = 0;
    for (auto it = kernel.cfv_iter(face); it.is_valid(); ++it, ++i) {
      ASSERT_LT(i, 3U);
      const auto index = static_cast<std::size_t>((*it).idx());
      corners[i] =
          static_cast<std::uint32_t>(index < vertex_count ? index : topology.sides.source_vertex[index - vertex_count]);
    }
    // OpenMesh may begin at any corner.
    base::Triangle expected = triangles[static_cast<std::size_t>(face.idx())];
    std::rotate(expected.begin(), std::find(expected.begin(), expected.end(), corners[0]), expected.end());
    EXPECT_EQ(corners, expected);
  }
}

HalfEdges sound_half_edges(std::size_t vertex_count, const std::vector<base::Triangle>& triangles) {
  HalfEdges topology = half_edges(vertex_count, triangles);
  expect_sound(topology, vertex_count, triangles);
  return topology;
}

const std::vector<base::Triangle> kTetrahedron = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};

TEST(HalfEdges, OfAClosedSurface) {
  const HalfEdges topology = sound_half_edges(4, kTetrahedron);
  EXPECT_EQ(topology.kernel.n_edges(), 6U);
  EXPECT_TRUE(topology.sides.source_vertex.empty());
}

TEST(HalfEdges, OfAnOpenFan) {
  const HalfEdges topology = sound_half_edges(5, {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}});
  EXPECT_EQ(topology.kernel.n_edges(), 7U);
}

TEST(HalfEdges, CutsABowTieAtItsVertex) {
  const HalfEdges topology = sound_half_edges(5, {{0, 1, 2}, {0, 3, 4}});
  EXPECT_EQ(topology.sides.source_vertex, std::vector<std::uint32_t>{0});
}

TEST(HalfEdges, CutsAlongAnEdgeOfThreeTriangles) {
  const HalfEdges topology = sound_half_edges(5, {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}});
  EXPECT_EQ(topology.sides.non_manifold_edge_count, 1U);
  EXPECT_EQ(topology.sides.cut_edge_side_count, 3U);
  EXPECT_EQ(topology.sides.source_vertex.size(), 4U);
}

TEST(HalfEdges, LeavesOutWhatIsNoTriangle) {
  const std::vector<base::Triangle> triangles = {{0, 0, 1}, {0, 1, 2}, {1, 2, 9}, {2, 1, 2}};
  const HalfEdges topology = half_edges(3, triangles);
  EXPECT_EQ(topology.kernel.n_faces(), 1U);
}

TEST(HalfEdges, AreSoundForTrianglesAtRandom) {
  std::mt19937 random(11);
  for (int round = 0; round < 200; ++round) {
    const std::uint32_t vertex_count = 3 + static_cast<std::uint32_t>(random() % 12);
    std::vector<base::Triangle> triangles;
    for (int i = 0; i < 30; ++i) {
      const base::Triangle triangle = {static_cast<std::uint32_t>(random() % vertex_count),
                                       static_cast<std::uint32_t>(random() % vertex_count),
                                       static_cast<std::uint32_t>(random() % vertex_count)};
      if (std::set<std::uint32_t>(triangle.begin(), triangle.end()).size() == 3) triangles.push_back(triangle);
    }
    SCOPED_TRACE(round);
    sound_half_edges(vertex_count, triangles);
  }
}

TEST(Topology, OfAClosedSurface) {
  const TopologyFacts facts = topology_facts(mesh_of(4, kTetrahedron));
  EXPECT_EQ(facts.boundary_edge_count, 0U);
  EXPECT_EQ(facts.component_count, 1U);
  EXPECT_EQ(facts.non_manifold_vertex_count, 0U);
  EXPECT_EQ(facts.unreferenced_vertex_count, 0U);
}

TEST(Topology, OfTwoPiecesAndALoneVertex) {
  const TopologyFacts facts = topology_facts(mesh_of(7, {{0, 1, 2}, {3, 4, 5}}));
  EXPECT_EQ(facts.boundary_edge_count, 6U);
  EXPECT_EQ(facts.component_count, 2U);
  EXPECT_EQ(facts.unreferenced_vertex_count, 1U);
}

TEST(Topology, OfABowTie) {
  const TopologyFacts facts = topology_facts(mesh_of(5, {{0, 1, 2}, {0, 3, 4}}));
  EXPECT_EQ(facts.non_manifold_vertex_count, 1U);
  EXPECT_EQ(facts.component_count, 2U);
  EXPECT_EQ(facts.boundary_edge_count, 6U);
}

TEST(Topology, OfThreeSheetsAtOneEdge) {
  const TopologyFacts facts = topology_facts(mesh_of(5, {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}}));
  EXPECT_EQ(facts.non_manifold_edge_count, 1U);
  EXPECT_EQ(facts.non_manifold_vertex_count, 2U);
  EXPECT_EQ(facts.boundary_edge_count, 6U);
  EXPECT_EQ(facts.component_count, 1U);
}

TEST(Topology, OfTwoTrianglesThatDisagreeAboutOutside) {
  const TopologyFacts facts = topology_facts(mesh_of(4, {{0, 1, 2}, {0, 1, 3}}));
  EXPECT_EQ(facts.flipped_edge_count, 1U);
  EXPECT_EQ(facts.non_manifold_edge_count, 0U);
  EXPECT_EQ(facts.boundary_edge_count, 4U);
  EXPECT_EQ(facts.component_count, 1U);
}

TEST(Topology, IsWhatOpenMeshSays) {
  std::mt19937 random(5);
  for (int round = 0; round < 100; ++round) {
    SCOPED_TRACE(round);
    const std::uint32_t vertex_count = 4 + static_cast<std::uint32_t>(random() % 20);
    std::vector<base::Triangle> triangles;
    for (int i = 0; i < 25; ++i)
      triangles.push_back({static_cast<std::uint32_t>(random() % vertex_count),
                           static_cast<std::uint32_t>(random() % vertex_count),
                           static_cast<std::uint32_t>(random() % vertex_count)});
    const TopologyFacts facts = topology_facts(mesh_of(vertex_count, triangles));
    const HalfEdges topology = half_edges(vertex_count, triangles);
    const MeshKernel& kernel = topology.kernel;
    const auto edges = kernel.edges();
    const auto boundary_count =
        std::count_if(edges.begin(), edges.end(), [&kernel](auto edge) { return kernel.is_boundary(edge); });
    EXPECT_EQ(facts.boundary_edge_count,
              static_cast<std::uint64_t>(boundary_count) - topology.sides.cut_edge_side_count);
    const auto vertices = kernel.vertices();
    EXPECT_EQ(facts.unreferenced_vertex_count,
              static_cast<std::uint64_t>(std::count_if(vertices.begin(), vertices.end(),
                                                       [&kernel](auto vertex) { return kernel.is_isolated(vertex); })));
  }
}

/// A polygon of very many corners on few vertices: every edge is one of very many triangles.
TEST(Topology, OfWhatIsNoManifoldAtAllTakesLittleMemory) {
  constexpr std::uint32_t kTriangles = 200'000;
  std::vector<base::Triangle> triangles;
  for (std::uint32_t i = 0; i < kTriangles; ++i) triangles.push_back({0, 1 + i % 254, 2 + i % 254});
  const MultispectralMesh mesh = mesh_of(256, std::move(triangles));
  const test::AllocationMeter meter;
  const TopologyFacts facts = topology_facts(mesh);
  EXPECT_GT(facts.non_manifold_edge_count, 0U);
  EXPECT_LT(meter.peak_bytes(), 130 * kTriangles);
}

TEST(Topology, OfAPointCloud) {
  const TopologyFacts facts = topology_facts(mesh_of(5, {}));
  EXPECT_EQ(facts.unreferenced_vertex_count, 0U);
  EXPECT_EQ(facts.component_count, 0U);
}

}  // namespace
}  // namespace spectra::mesh
