#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "fusion/mesh/multispectral_mesh.hpp"
#include "fusion/mesh/ply_reader.hpp"
#include "server/scene/map_tree.hpp"
#include "server/scene/scene_snapshot.hpp"

namespace spectra::server {

/// Where the vertices and triangles of a block stand among those of the whole map: blocks in the order of their names.
struct BlockPlace {
  std::uint64_t first_vertex = 0;
  std::uint64_t first_triangle = 0;
};

/// All that a version of a map is made of.
struct MapVersion {
  std::uint32_t revision = 0;
  std::string name;
  fusion::Vec3d origin;
  bool has_visible = false, has_temperature = false, double_positions = false;
  std::vector<fusion::LeftOutVertex> left_out;
  fusion::UpAxis up = fusion::UpAxis::Z;
  bool is_metric = false;
  std::vector<fusion::Note> notes;
  bool is_live = false;
  std::optional<double> oldest_observed_at, newest_observed_at;  ///< Of the blocks that say so, Unix seconds.
  std::optional<Bounds> core_bounds;                             ///< Absent: all of it.
  std::uint64_t vertex_count = 0, triangle_count = 0;
  std::unordered_map<BlockNumber, BlockPlace> blocks;
  std::vector<std::shared_ptr<const MapNode>> leaves;
  int top_level = 0;                               ///< Of the lowest tile that holds everything.
  std::vector<std::shared_ptr<const Tile>> tiles;  ///< Those that are seen, coarse before fine.
  float position_step_m = 0;
  fusion::TemperatureSummary summary;
  fusion::Histogram percentiles;                              ///< Of kPercentileBins bins.
  std::shared_ptr<const fusion::SceneTemperature> reference;  ///< Null: what is told of this version itself.
};

std::shared_ptr<const SceneSnapshot> snapshot_of(MapVersion version);

}  // namespace spectra::server
