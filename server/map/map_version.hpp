#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "fusion/files/ply_reader.hpp"
#include "fusion/mesh/multispectral_mesh.hpp"
#include "server/map/map_tree.hpp"
#include "server/map/scene_snapshot.hpp"

namespace spectra::map {

/// What a mesh is beside its vertices and triangles.
struct MeshFacts {
  std::string name;
  base::Vec3d origin;
  bool has_visible = false, has_temperature = false, double_positions = false;
  std::vector<mesh::LeftOutVertex> left_out;
  base::UpAxis up = base::UpAxis::Z;
  bool is_metric = false;
  mesh::ToldCoordinates told;
  std::uint64_t vertex_count = 0, triangle_count = 0;
};

MeshFacts facts_of(const mesh::MultispectralMesh& mesh);

/// A block that is part of a map; its mesh is in the leaves.
struct MapBlock {
  BlockNumber number = 0;
  MeshFacts facts;
  std::optional<base::Bounds> core_bounds;
  std::optional<double> observed_at;  ///< Unix seconds.
  std::vector<files::Note> notes;
};
using BlocksByName = std::map<std::string, std::shared_ptr<const MapBlock>, std::less<>>;

/// Where the vertices and triangles of a block stand in a mesh of several.
struct BlockPlace {
  std::uint64_t first_vertex = 0;
  std::uint64_t first_triangle = 0;
};
using BlockPlaces = std::unordered_map<BlockNumber, BlockPlace>;

/// The mesh of some blocks as they were put; the leaves have all of them. `facts` are those of the mesh.
mesh::MultispectralMesh mesh_of_blocks(std::span<const std::shared_ptr<const MapNode>> leaves,
                                       const BlockPlaces& blocks, const MeshFacts& facts);

/// What its vertices are compared with, in the same order.
std::vector<float> baseline_of_blocks(std::span<const std::shared_ptr<const MapNode>> leaves, const BlockPlaces& blocks,
                                      std::uint64_t vertex_count, std::uint32_t baseline_mark);

/// The block of a vertex of a leaf.
inline BlockNumber block_of(const Tile& leaf, std::size_t vertex) {
  return leaf.vertex_block.empty() ? leaf.block : leaf.vertex_block[vertex];
}

/// All that a version of a map is made of.
struct MapVersion {
  std::uint32_t revision = 0;
  MeshFacts facts;  ///< Of all blocks together.
  std::vector<files::Note> notes;
  bool is_live = false;
  std::optional<double> oldest_observed_at, newest_observed_at;  ///< Of the blocks that say so, Unix seconds.
  std::optional<std::uint32_t> baseline_mark;                    ///< See SceneSnapshot, as the next.
  std::optional<double> baseline_marked_at;
  /// By block, Unix seconds or NaN: of the baseline of vertices that are compared with themselves.
  std::unordered_map<BlockNumber, double> own_baseline_at;
  std::optional<base::Bounds> core_bounds;  ///< Absent: all of it.
  BlocksByName blocks;
  std::vector<std::shared_ptr<const MapNode>> leaves;
  int top_level = 0;                               ///< Of the lowest tile that holds everything.
  std::vector<std::shared_ptr<const Tile>> tiles;  ///< Those that are seen, coarse before fine.
  float position_step_m = 0;
  fusion::TemperatureSummary summary;
  std::optional<fusion::Histogram> percentiles;  ///< Of kPercentileBins bins; absent: counted when asked for.
  std::shared_ptr<const fusion::SceneTemperature> reference;  ///< Null: what is told of this version itself.
};

std::shared_ptr<const SceneSnapshot> snapshot_of(MapVersion version);

}  // namespace spectra::map
