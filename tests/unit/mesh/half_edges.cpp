#include "half_edges.hpp"

#include <cstdint>

namespace spectra::mesh::testing {

namespace {

/// The side after it, of the same face.
std::uint32_t next_side(std::uint32_t side) {
  return side % 3 == 2 ? side - 2 : side + 1;
}

void fill_kernel(std::size_t vertex_count, const std::vector<base::Triangle>& faces,
                 const std::vector<std::uint32_t>& opposite, MeshKernel& kernel) {
  using OpenMesh::FaceHandle;
  using OpenMesh::HalfedgeHandle;
  using OpenMesh::VertexHandle;
  const auto side_count = static_cast<std::uint32_t>(opposite.size());
  const auto vertex_of = [&faces](std::uint32_t side) {
    return VertexHandle(static_cast<int>(faces[side / 3][side % 3]));
  };

  std::vector<int> halfedge_of(side_count);
  int halfedge_count = 0;
  for (std::uint32_t side = 0; side < side_count; ++side) {
    const bool is_second = opposite[side] < side;
    halfedge_of[side] = is_second ? halfedge_of[opposite[side]] + 1 : halfedge_count;
    if (!is_second) halfedge_count += 2;
  }
  kernel.resize(vertex_count, static_cast<std::size_t>(halfedge_count) / 2, faces.size());

  for (std::uint32_t side = 0; side < side_count; ++side) {
    const HalfedgeHandle halfedge(halfedge_of[side]);
    const FaceHandle face(static_cast<int>(side / 3));
    kernel.set_vertex_handle(halfedge, vertex_of(next_side(side)));
    kernel.set_face_handle(halfedge, face);
    kernel.set_next_halfedge_handle(halfedge, HalfedgeHandle(halfedge_of[next_side(side)]));
    if (side % 3 == 0) kernel.set_halfedge_handle(face, halfedge);
    kernel.set_halfedge_handle(vertex_of(side), halfedge);
  }
  // A boundary half-edge leaves the vertex that its side arrives at; each vertex has at most one, and refers to it.
  for (std::uint32_t side = 0; side < side_count; ++side) {
    if (opposite[side] != PairedSides::kNone) continue;
    const HalfedgeHandle boundary(halfedge_of[side] + 1);
    kernel.set_vertex_handle(boundary, vertex_of(side));
    kernel.set_boundary(boundary);
    kernel.set_halfedge_handle(vertex_of(next_side(side)), boundary);
  }
  for (std::uint32_t side = 0; side < side_count; ++side) {
    if (opposite[side] != PairedSides::kNone) continue;
    kernel.set_next_halfedge_handle(HalfedgeHandle(halfedge_of[side] + 1), kernel.halfedge_handle(vertex_of(side)));
  }
}

}  // namespace

HalfEdges half_edges(std::size_t vertex_count, const std::vector<base::Triangle>& triangles) {
  HalfEdges result{.sides = paired_sides(vertex_count, triangles), .kernel = {}};
  fill_kernel(vertex_count + result.sides.source_vertex.size(), result.sides.faces, result.sides.opposite,
              result.kernel);
  return result;
}

}  // namespace spectra::mesh::testing
