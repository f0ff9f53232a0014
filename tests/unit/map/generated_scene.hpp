#pragma once

#include <cstdint>

#include "fusion/mesh/multispectral_mesh.hpp"

namespace spectra::testing {

/// A rough terrain of columns x rows vertices, one metre apart, in scan (shuffled) order of vertices and triangles; every
/// seventh temperature is missing; vertex 0 is used by no triangle when `has_lone_vertices`.
struct TerrainOptions {
  std::uint32_t columns = 100, rows = 100;
  std::uint32_t seed = 1;
  bool is_shuffled = true;
  bool has_lone_vertices = false;
  bool has_missing_temperature = true;
};
mesh::MultispectralMesh terrain(const TerrainOptions& options);

/// A rough closed surface: a ring of columns x rows vertices, in scan order.
mesh::MultispectralMesh torus(std::uint32_t columns, std::uint32_t rows, std::uint32_t seed);

/// The same triangles, each with three vertices of its own.
mesh::MultispectralMesh soup_of(const mesh::MultispectralMesh& mesh);

/// Points all over a cube of one metre, with colours and temperatures.
mesh::MultispectralMesh point_cloud(std::uint32_t count, std::uint32_t seed);

/// The same again: meshes are not copyable.
mesh::MultispectralMesh copy_of(const mesh::MultispectralMesh& mesh);

}  // namespace spectra::testing
