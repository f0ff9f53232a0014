#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "server/stream/viewer_tiles.hpp"

namespace spectra::stream {

/// A raw layer of a tile that a job has claimed in the cache, and what came of it.
struct RawEncoding {
  std::shared_ptr<TileSlot> slot;
  std::shared_ptr<const map::Tile> tile;
  Demand demand;           ///< When it was claimed.
  std::size_t layer = 0;   ///< In RawDemand::kLayers.
  std::uint32_t revision;  ///< Of the geometry that the viewer holds.
  Payload made = nullptr;  ///< Null: it failed.
};

/// Encodes, puts the result into the cache too, and ends the claim; what goes wrong is logged once a tile. Takes
/// milliseconds: called by a job, without the stream's lock.
void encode(RawEncoding& encoding, FrameCache::State& cache);

/// Whose raw layers a viewer needs, of the slots that its camera asks for, and in which order: those that are drawn in the end
/// and the tops, which stand in for what is not there; the tops first, then by heat and nearness together.
std::vector<std::shared_ptr<TileSlot>> raw_order(const std::vector<std::shared_ptr<TileSlot>>& wanted,
                                                 const ViewTree& tree, const std::optional<Camera>& camera);

}  // namespace spectra::stream
