#include "server/stream/slot_preparation.hpp"

#include <spdlog/spdlog.h>

#include <exception>
#include <string>
#include <utility>

#include "server/stream/tile_encoder.hpp"

namespace spectra::stream {
namespace {

/// Why it failed; empty when it did not.
std::string encode_geometry(Encoding& encoding, FrameCache::State& cache) {
  const Demand& demand = encoding.demand;
  auto result = [&] {
    const TimedWork watch(cache.times.geometry);
    return encoded_tile(*encoding.tile, demand.position_step_m, demand.encoder_speed);
  }();
  if (!result) return result.error().message;
  encoding.made_geometry = cache.store_geometry(demand.geometry_key(encoding.tile), std::move(result).value());
  return {};
}

std::string encode_colours(Encoding& encoding, FrameCache::State& cache) {
  const Demand& demand = encoding.demand;
  auto result =
      encoded_tile_colours(*encoding.tile, *encoding.geometry, *demand.plan, encoding.look, encoding.colour_bits,
                           demand.encoder_speed, demand.colour_transform, demand.carries_marks(), &cache.times);
  if (!result) return result.error().message;
  encoding.made_colours = std::move(result).value();
  cache.store_colours(demand.colour_key(*encoding.geometry, encoding.colour_bits, encoding.look),
                      encoding.made_colours);
  return {};
}

}  // namespace

void encode(Encoding& encoding, FrameCache::State& cache) {
  std::string reason;
  try {
    reason = encoding.geometry ? encode_colours(encoding, cache) : encode_geometry(encoding, cache);
    if (!encoding.has_failed()) return;
  } catch (const std::exception& exception) {
    reason = exception.what();
  }
  if (encoding.geometry) {
    cache.abandon_colours(encoding.demand.colour_key(*encoding.geometry, encoding.colour_bits, encoding.look));
  } else {
    cache.abandon_geometry(encoding.demand.geometry_key(encoding.tile));
  }
  if (cache.is_first_failure(Identity(encoding.tile))) {
    const protocol::TileId id = encoding.tile->id;
    spdlog::error("tile {}/{}/{}/{} cannot be encoded and is left out: {}", id.level, id.x, id.y, id.z, reason);
  }
}

void SlotPreparation::look_up(TileSlot& slot, const Demand& demand) {
  auto geometry = cache_.find_geometry(demand.geometry_key(slot.tile));
  if (!geometry) return;
  if (!demand.fused) {
    tiles_.make_ready(slot, std::move(geometry), nullptr, 0);
    return;
  }
  const int bits = slot.wanted_colour_bits(demand);
  auto colours = cache_.find_colours(demand.colour_key(*geometry, bits, slot.look));
  if (colours) tiles_.make_ready(slot, std::move(geometry), std::move(colours), bits);
}

std::optional<Encoding> SlotPreparation::advance(const std::shared_ptr<TileSlot>& slot, const Demand& demand,
                                                 const std::weak_ptr<CacheWaiter>& waiter) {
  Encoding encoding{slot, slot->tile, demand, slot->wanted_colour_bits(demand), slot->look};
  auto geometry = cache_.claim_geometry(demand.geometry_key(slot->tile), waiter);
  switch (geometry.kind) {
    case Claim<EncodedTile>::Kind::Ready:
      return advance_colours(std::move(encoding), std::move(geometry.value), waiter);
    case Claim<EncodedTile>::Kind::Busy:
      slot->work = TileSlot::Work::Waiting;
      return std::nullopt;
    case Claim<EncodedTile>::Kind::Yours:
      break;
  }
  slot->work = TileSlot::Work::Busy;
  return encoding;
}

std::optional<Encoding> SlotPreparation::advance_colours(Encoding encoding, std::shared_ptr<const EncodedTile> geometry,
                                                         const std::weak_ptr<CacheWaiter>& waiter) {
  TileSlot& slot = *encoding.slot;
  if (!encoding.demand.fused) {
    tiles_.make_ready(slot, std::move(geometry), nullptr, 0);
    return std::nullopt;
  }
  encoding.geometry = std::move(geometry);
  const int bits = encoding.colour_bits;
  auto colours = cache_.claim_colours(encoding.demand.colour_key(*encoding.geometry, bits, encoding.look), waiter);
  switch (colours.kind) {
    case Claim<std::vector<std::byte>>::Kind::Ready:
      tiles_.make_ready(slot, std::move(encoding.geometry), std::move(colours.value), bits);
      return std::nullopt;
    case Claim<std::vector<std::byte>>::Kind::Busy:
      slot.work = TileSlot::Work::Waiting;
      return std::nullopt;
    case Claim<std::vector<std::byte>>::Kind::Yours:
      break;
  }
  slot.work = TileSlot::Work::Busy;
  return encoding;
}

std::optional<Encoding> SlotPreparation::advance_after(const Encoding& done, const Demand& demand,
                                                       const std::weak_ptr<CacheWaiter>& waiter) {
  if (done.demand.geometry_epoch == demand.geometry_epoch) {
    const Encoding next{done.slot, done.tile, demand, done.slot->wanted_colour_bits(demand), done.slot->look};
    if (done.made_geometry) return advance_colours(next, done.made_geometry, waiter);
    if (done.made_colours && demand.fused && done.demand.colour_epoch == demand.colour_epoch &&
        done.colour_bits == next.colour_bits && done.look == next.look) {
      tiles_.make_ready(*done.slot, done.geometry, done.made_colours, done.colour_bits);
      return std::nullopt;
    }
    if (done.made_colours) return advance_colours(next, done.geometry, waiter);
  }
  return advance(done.slot, demand, waiter);
}

}  // namespace spectra::stream
