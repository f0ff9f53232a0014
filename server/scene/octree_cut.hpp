#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "fusion/mesh/multispectral_mesh.hpp"
#include "protocol/tile_frame.hpp"
#include "server/scene/scene_snapshot.hpp"
#include "server/scene/worker_pool.hpp"

namespace spectra::server {

/// Deepest level of a tile; a cell that cannot be cut further is a leaf whatever its size.
inline constexpr int kDeepestLevel = 20;

/// What the octree distributes: a triangle (at its centroid), or a vertex of no triangle.
struct CutElement {
  fusion::Vec3f place;
  std::uint32_t index = 0;  ///< Of the triangle, or of the vertex.
  /// Bit k: corner k is the first in the input to use its vertex, which is therefore owned where this triangle is.
  /// kLoneVertex: the element is a vertex.
  std::uint8_t owned_corners = 0;

  static constexpr std::uint8_t kLoneVertex = 8;
};

/// A leaf to be made: its name and what lies in it. The elements live in the OctreeCut.
struct LeafCut {
  protocol::TileId id;
  std::span<CutElement> elements;
};

/// The leaves, coarse before fine and along a Morton curve within a level. Every element is in exactly one.
struct OctreeCut {
  std::array<std::vector<CutElement>, 2> elements;
  std::vector<LeafCut> leaves;
};

/// Distributes triangles and lone vertices to octree leaves that own at most 1.25 `leaf_vertex_count` vertices (more only
/// where nothing separates them). A cell is halved in the middle along its long axes; where outliers or coincident points
/// make that useless, at the medians. Octants are joined with their neighbours as long as they stay within
/// `leaf_vertex_count`, and those with less than a quarter of it always; every leaf of a scene with triangles has a triangle.
/// A scene of more than `root_vertex_count` vertices is cut in any case. The same for any number of threads.
OctreeCut octree_cut(const fusion::MultispectralMesh& mesh, std::uint32_t leaf_vertex_count, WorkerPool& pool,
                     std::uint32_t root_vertex_count = std::numeric_limits<std::uint32_t>::max());

/// Copies a leaf out of the mesh, along a space-filling curve (it sorts the leaf's elements). Thread-safe for different
/// leaves.
std::shared_ptr<Tile> leaf_tile(const fusion::MultispectralMesh& mesh, const LeafCut& leaf);

/// Interleaves the lowest 21 bits of three coordinates, x lowest.
std::uint64_t morton_code(std::uint32_t x, std::uint32_t y, std::uint32_t z);

/// Lowest and highest of some temperatures, degC; NaN where there is none.
struct TemperatureRange {
  float lowest_celsius = std::numeric_limits<float>::quiet_NaN();
  float highest_celsius = std::numeric_limits<float>::quiet_NaN();

  TemperatureRange joined(const TemperatureRange& other) const;
};

/// The range of those that are not missing.
TemperatureRange temperature_range(std::span<const float> temperature_celsius);

/// Smallest box of some positions; of none: min above max.
Bounds bounds_of(std::span<const fusion::Vec3f> positions);

}  // namespace spectra::server
