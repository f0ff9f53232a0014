#include "server/mapping/cube_cases.hpp"

#include <cstddef>

namespace spectra::mapping {
namespace {

using Triangles = std::vector<std::array<std::uint8_t, 3>>;

constexpr std::array<CubeEdge, 12> made_edges() {
  std::array<CubeEdge, 12> edges{};
  std::size_t next = 0;
  for (std::uint8_t axis = 0; axis < 3; ++axis) {
    for (std::uint8_t corner = 0; corner < 8; ++corner) {
      if ((corner >> axis & 1) != 0) continue;
      edges[next++] = {corner, static_cast<std::uint8_t>(corner | 1 << axis), axis};
    }
  }
  return edges;
}

constexpr std::array<CubeEdge, 12> kEdges = made_edges();

std::uint8_t edge_between(int a, int b) {
  for (std::uint8_t e = 0; e < 12; ++e) {
    if ((kEdges[e].from == a && kEdges[e].to == b) || (kEdges[e].from == b && kEdges[e].to == a)) return e;
  }
  return 0;
}

/// The corners of the six faces, counter-clockwise as seen from outside the cube.
std::array<std::array<int, 4>, 6> made_faces() {
  std::array<std::array<int, 4>, 6> faces{};
  std::size_t next = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const int u = 1 << (axis + 1) % 3, v = 1 << (axis + 2) % 3, w = 1 << axis;
    faces[next++] = {w, w | u, w | u | v, w | v};
    faces[next++] = {0, v, u | v, u};
  }
  return faces;
}

bool share_face(std::uint8_t a, std::uint8_t b) {
  static const auto faces = made_faces();
  for (const auto& face : faces) {
    int found = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      const std::uint8_t edge = edge_between(face[i], face[(i + 1) % 4]);
      found += edge == a || edge == b ? 1 : 0;
    }
    if (found == 2) return true;
  }
  return false;
}

/// A fan from the corner none of whose diagonals lies in a face of the cube, where the neighbour might have one too.
void cut_into_fan(const std::vector<std::uint8_t>& loop, Triangles& out) {
  const std::size_t n = loop.size();
  std::size_t start = 0;
  for (std::size_t s = 0; s < n; ++s) {
    bool is_free = true;
    for (std::size_t i = 2; i + 1 < n; ++i) is_free = is_free && !share_face(loop[s], loop[(s + i) % n]);
    if (is_free) {
      start = s;
      break;
    }
  }
  for (std::size_t i = 1; i + 1 < n; ++i)
    out.push_back({loop[start], loop[(start + i) % n], loop[(start + i + 1) % n]});
}

Triangles made_triangles(int inside) {
  constexpr int kNone = -1;
  const auto is_inside = [inside](int corner) { return (inside >> corner & 1) != 0; };
  std::array<int, 12> follows{};  // the crossing to which the surface goes on from each, along some face
  follows.fill(kNone);
  static const auto faces = made_faces();
  for (const auto& face : faces) {
    for (std::size_t i = 0; i < 4; ++i) {
      const int here = face[i], next = face[(i + 1) % 4];
      if (is_inside(here) || !is_inside(next)) continue;
      // The line comes in here, and goes out behind the next corners that are inside.
      std::size_t j = i + 1;
      while (is_inside(face[(j + 1) % 4])) ++j;
      follows[edge_between(here, next)] = edge_between(face[j % 4], face[(j + 1) % 4]);
    }
  }
  Triangles triangles;
  std::array<bool, 12> is_done{};
  for (std::size_t first = 0; first < 12; ++first) {
    if (follows[first] == kNone || is_done[first]) continue;
    std::vector<std::uint8_t> loop;
    for (std::size_t e = first; !is_done[e]; e = static_cast<std::size_t>(follows[e])) {
      is_done[e] = true;
      loop.push_back(static_cast<std::uint8_t>(e));
    }
    cut_into_fan(loop, triangles);
  }
  return triangles;
}

}  // namespace

const std::array<CubeEdge, 12>& cube_edges() {
  return kEdges;
}

const CubeCases& cube_cases() {
  static const CubeCases cases = [] {
    CubeCases all;
    for (int i = 0; i < 256; ++i) all[static_cast<std::size_t>(i)] = made_triangles(i);
    return all;
  }();
  return cases;
}

}  // namespace spectra::mapping
