#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "server/stream/raw_layers.hpp"

namespace spectra::stream {

/// The raw layers of one viewer: which comes next, which is at work, which is ready. They fill what time the pictures leave, in
/// an order of their own. Not thread-safe: the stream's lock is held.
class RawLane {
 public:
  /// How much may wait, encoded, for the window of one viewer. Enough to bridge the making of the next tile, little
  /// enough that a viewer who stopped reading costs nothing.
  static constexpr std::size_t kPreparedBytes = 1u << 20;

  /// A raw layer that is to be sent.
  struct Due {
    std::shared_ptr<TileSlot> slot;
    std::size_t layer = 0;  ///< In RawDemand::kLayers.
    TileSlot::Raw& raw() const { return slot->raw[layer]; }
  };

  /// `cache` outlives it.
  explicit RawLane(FrameCache::State& cache) : cache_(cache) {}

  /// The tiles, see raw_order().
  void choose(std::vector<std::shared_ptr<TileSlot>> order);
  void clear() { choose({}); }
  /// After a change of what is demanded or held: what was passed is looked at again.
  void rewind() { head_ = 0; }

  /// The first one that is lacking.
  std::optional<Due> head(const Demand& demand);

  /// Ready when the cache has it; else it stays as it is.
  void look_up(const Due& due, const Demand& demand);

  /// How many of them jobs could begin with, at most `most`.
  unsigned startable_count(unsigned most, const Demand& demand);

  /// The next one that nobody has or makes, for a job. `waiter` is told when what another viewer makes is there.
  std::optional<RawEncoding> next_encoding(const Demand& demand, const std::weak_ptr<CacheWaiter>& waiter);

  /// A job has ended. Whether it failed at something that is still demanded.
  bool finish(const RawEncoding& done, const Demand& demand);

  /// Takes the payload of a layer that is Ready, as sent.
  Payload give(const Due& due, const Demand& demand);

 private:
  std::optional<Due> next_due(std::size_t& at, const Demand& demand) const;
  template <class Visit>
  void for_each_due(std::size_t at, const Demand& demand, Visit visit) const;
  ColourKey key(const Due& due, const Demand& demand) const;
  static void make_ready(const Due& due, Payload payload);

  FrameCache::State& cache_;
  std::vector<std::shared_ptr<TileSlot>> order_;
  std::size_t head_ = 0;  // Everything before it is there; a place a layer of each slot.
};

}  // namespace spectra::stream
