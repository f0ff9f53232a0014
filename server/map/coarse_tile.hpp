#pragma once

#include <cstdint>
#include <vector>

#include "fusion/mesh/simplify.hpp"
#include "server/map/border_index.hpp"
#include "server/map/map_tree.hpp"
#include "server/map/scene_snapshot.hpp"

namespace spectra::map {

/// How coarse the tiles above the leaves are, and what they are measured by.
struct CoarseOptions {
  std::uint32_t tile_vertex_count = 32'000;  ///< Most vertices of a coarse tile, unless locked borders need more.
  std::uint32_t top_vertex_count = 20'000;   ///< Most vertices of the top: the first picture must be small.
  float median_celsius = 0;                  ///< What temperatures are measured from; NaN = the scene has none.
  /// A difference of temperature that counts as much as one between black and white; a sixteenth of it catches the eye.
  double span_celsius = 16;
  double seen_levels = 24;  ///< A difference of colour that catches the eye.
  bool is_point_cloud = false;
  float position_step_m = 0;        ///< The largest of the scene.
  std::uint32_t baseline_mark = 0;  ///< Whose baseline the tile gets.
};

/// Makes the tile of a node above the leaves from those of its branches, which are made.
///
/// It is its children joined where their vertices coincide and simplified to a third of their vertices or less. Its
/// vertices are vertices of its children. Those on edges that it shares with tiles beyond it stay as they are in the full
/// mesh, with colour and temperature, until a tile holds both sides: tiles of any levels meet without cracks. Every other
/// vertex stands for a region: it takes the mean visible colour, and the temperature that is furthest from the median.
/// The lowest and the highest temperature under a tile stand on vertices of it. A vertex was seen when the newest of its region was,
/// and its baseline is such that it shows the mean change of its region, or the change that differs most from it where that catches
/// the eye. Of a point cloud the points of a
/// parent are chosen so that no point of its children is far from one.
///
/// geometric_error_m bounds the distance between tile and full mesh, both ways: the largest one measured against the
/// children, with a margin, on top of the children's own. Thread-safe for different nodes while `borders` does not change.
void make_coarse_tile(MapNode& node, bool is_top, const BorderIndex& borders, const CoarseOptions& options,
                      mesh::SimplifyMemory& memory);

/// The positions on open edges of a leaf, as its welded surface has them.
std::vector<base::Vec3f> open_positions(const Tile& leaf);

}  // namespace spectra::map
