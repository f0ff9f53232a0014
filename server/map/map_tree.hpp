#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "fusion/mesh/multispectral_mesh.hpp"
#include "server/jobs/worker_pool.hpp"
#include "server/map/block_baseline.hpp"
#include "server/map/cell_content.hpp"
#include "server/map/leaf_facts.hpp"
#include "server/map/map_grid.hpp"
#include "server/map/scene_snapshot.hpp"
#include "server/map/seen_error.hpp"

namespace spectra::map {

/// A cell of the map with all that lies in it. Shared by the versions of the map in which it is the same; not changed any more
/// once it is part of one.
struct MapNode {
  /// What lies in some octants of the cell.
  struct Branch {
    unsigned octants = 0;  ///< Bit mask.
    std::shared_ptr<const MapNode> node;
  };

  protocol::TileId id;
  CellContent content;
  base::Bounds bounds;           ///< Of the places of all triangles (their centroids) and of vertices of no triangle.
  std::vector<Branch> branches;  ///< None: a leaf.
  std::array<CellContent, 8> octants{};  ///< Unless it is a leaf.
  std::shared_ptr<const Tile> tile;      ///< Of a leaf the full mesh; else the coarse one, null above the top.

  std::vector<BlockNumber> blocks;          ///< Of a leaf: whose triangles or vertices it has, ascending.
  std::vector<base::Vec3f> open_positions;  ///< Of a leaf: where vertices on open edges of its surface are.
  std::optional<LeafFacts> facts;           ///< Of a leaf.

  // Of a coarse tile, for the one above it.
  std::vector<std::uint32_t> weight;  ///< Per vertex: how many vertices of the full mesh it stands for.
  std::vector<FullSample> samples;    ///< Of the full mesh beneath.
  bool is_top = false;                ///< The tile was made to be the first one seen.

  bool is_leaf() const { return branches.empty(); }
};

/// A mesh that becomes part of the map.
struct BlockMesh {
  BlockNumber number = 0;
  const mesh::MultispectralMesh* mesh = nullptr;
  std::vector<StepHalvings> step_halvings;  ///< Per vertex; empty: none are halved.
  BlockBaseline baseline;
};

/// How large tiles are.
struct TileSizes {
  std::uint32_t leaf_vertex_count = kLeafVertexCount;           ///< Of leaves with nothing but settled blocks.
  std::uint32_t changing_leaf_vertex_count = kLeafVertexCount;  ///< Of others.
  std::uint32_t root_vertex_count = 0xffffffffu;                ///< A map of more is cut in any case.
  /// Cells above this level are never leaves, and their octants are never joined: what is far from each other has no tile of the
  /// full mesh together, however little it is.
  int first_leaf_level = 0;

  std::uint32_t leaf_size(const CellContent& content) const {
    return content.changing_count > 0 ? changing_leaf_vertex_count : leaf_vertex_count;
  }
};

/// The tree of another version of a map, its coarse tiles not made yet.
struct ChangedTree {
  std::shared_ptr<const MapNode> root;  ///< Null: nothing is in it.
  /// The nodes that are not those of the version before, coarse before fine; still to be completed.
  std::vector<std::shared_ptr<MapNode>> made;
  std::vector<std::shared_ptr<const MapNode>> dropped_leaves;
};

/// Takes the blocks with the numbers `removed` out of a map and puts others in. What depends on what: the places of
/// tiles and all that lies in a leaf are those of the tree made at once of the blocks that are in the map then. A cell that owns at most 1.25
/// times the leaf size of its content is a leaf; others are cut in their middle. Octants are joined with their neighbours as long as they stay
/// within the leaf size of what they hold together, and those with less than a quarter of it always, unless they are above the first level of
/// leaves, where each has its own; in a map with triangles every leaf has one.
/// The same for any number of threads. `labels` has all blocks of the map, old and new: in a leaf they stand in the order of
/// their names. Must not be called from a job of the pool. `made_share` is told from any thread what share is made.
ChangedTree changed_tree(const std::shared_ptr<const MapNode>& root, const MapGrid& grid, const TileSizes& sizes,
                         std::span<const BlockNumber> removed, std::span<const BlockMesh> added,
                         const BlockLabels& labels, jobs::WorkerPool& pool,
                         const std::function<void(double)>& made_share = {});

/// The same content in the cells of another grid.
ChangedTree cut_anew(const std::shared_ptr<const MapNode>& root, const MapGrid& grid, const TileSizes& sizes,
                     const BlockLabels& labels, jobs::WorkerPool& pool);

/// All leaves of a tree, coarse before fine.
std::vector<std::shared_ptr<const MapNode>> leaves_of(const std::shared_ptr<const MapNode>& root);

/// The lowest node that holds everything: its tile is the first that is seen. Null without a root.
std::shared_ptr<const MapNode> top_of(const std::shared_ptr<const MapNode>& root);

}  // namespace spectra::map
