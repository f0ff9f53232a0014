#pragma once

#include <memory>
#include <optional>

#include "server/stream/viewer_tiles.hpp"

namespace spectra::stream {

/// One encoding that a job has claimed in the cache, and what came of it.
struct Encoding {
  std::shared_ptr<TileSlot> slot;
  std::shared_ptr<const map::Tile> tile;
  Demand demand;  ///< When it was claimed, as is the next.
  int colour_bits = 8;
  TileLook look;
  std::shared_ptr<const EncodedTile> geometry = nullptr;  ///< Null: it is to be made; else the colours for it.
  std::shared_ptr<const EncodedTile> made_geometry = nullptr;
  Payload made_colours = nullptr;

  bool has_failed() const { return !made_geometry && !made_colours; }
};

/// Encodes, puts the result into the cache too, and ends the claim; what goes wrong is logged once a tile. Takes
/// milliseconds: called by a job, without the stream's lock.
void encode(Encoding& encoding, FrameCache::State& cache);

/// Brings slots to Ready step by step: takes what the cache has, claims what nobody makes, waits for what another viewer
/// makes. Not thread-safe: the stream's lock is held.
class SlotPreparation {
 public:
  /// Both outlive it.
  SlotPreparation(FrameCache::State& cache, ViewerTiles& tiles) : cache_(cache), tiles_(tiles) {}

  /// Ready when the cache has everything; else the slot stays as it is.
  void look_up(TileSlot& slot, const Demand& demand);

  /// One step of an idle slot: the encoding that the caller has to do for it now, or nothing. `waiter` is told when what
  /// another viewer makes is there.
  std::optional<Encoding> advance(const std::shared_ptr<TileSlot>& slot, const Demand& demand,
                                  const std::weak_ptr<CacheWaiter>& waiter);

  /// The next step after one that a job has done. What was made is used from here, not from the cache, which may have had
  /// no room for it.
  std::optional<Encoding> advance_after(const Encoding& done, const Demand& demand,
                                        const std::weak_ptr<CacheWaiter>& waiter);

 private:
  std::optional<Encoding> advance_colours(Encoding encoding, std::shared_ptr<const EncodedTile> geometry,
                                          const std::weak_ptr<CacheWaiter>& waiter);

  FrameCache::State& cache_;
  ViewerTiles& tiles_;
};

}  // namespace spectra::stream
