#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "server/scene/position_step.hpp"
#include "server/scene/scene_snapshot.hpp"
#include "server/scene/worker_pool.hpp"

namespace spectra::server {

/// How coarse the tiles above the leaves are.
struct TreeOptions {
  std::uint32_t tile_vertex_count = 32'000;  ///< Most vertices of a coarse tile, unless locked borders need more.
  std::uint32_t root_vertex_count = 20'000;  ///< Most vertices of the root: the first picture must be small.
  float median_celsius = 0;                  ///< What temperatures are measured from; NaN = the scene has none.
  /// A difference of temperature that counts as much as one between black and white; a sixteenth of it catches the eye.
  double span_celsius = 16;
  double seen_levels = 24;  ///< A difference of colour that catches the eye.
  const PositionSteps* position_steps =
      nullptr;  ///< How finely the vertices of coarse tiles are rounded; null: as one.
};

/// Makes the tiles above the leaves, up to the root, and returns all tiles: coarse before fine, along a Morton curve within
/// a level.
///
/// A parent is its children joined where their vertices coincide and simplified to a third of their vertices or less. Its
/// vertices are vertices of its children. Those on edges that it shares with tiles beyond it stay as they are in the full
/// mesh, with colour and temperature, until a tile holds both sides: tiles of any levels meet without cracks. Every other
/// vertex stands for a region: it takes the mean visible colour, and the temperature that is furthest from the median.
/// The lowest and the highest temperature under a tile stand on vertices of it. Of a point cloud the points of a
/// parent are chosen so that no point of its children is far from one.
///
/// geometric_error_m bounds the distance between tile and full mesh, both ways: the largest one measured against the
/// children, with a margin, on top of the children's own. The same tiles for any number of threads. `made_share` is told from
/// any thread what share of the tiles above the leaves is made.
std::vector<std::shared_ptr<const Tile>> tile_tree(std::vector<std::shared_ptr<Tile>> leaves, bool is_point_cloud,
                                                   const TreeOptions& options, WorkerPool& pool,
                                                   const std::function<void(double)>& made_share = {});

}  // namespace spectra::server
