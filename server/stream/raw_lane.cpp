#include "server/stream/raw_lane.hpp"

#include <utility>

namespace spectra::stream {

void RawLane::choose(std::vector<std::shared_ptr<TileSlot>> order) {
  order_ = std::move(order);
  head_ = 0;
}

std::optional<RawLane::Due> RawLane::head(const Demand& demand) {
  return next_due(head_, demand);
}

// The first one from place `at` on, which becomes its place.
std::optional<RawLane::Due> RawLane::next_due(std::size_t& at, const Demand& demand) const {
  constexpr std::size_t kLayers = RawDemand::kLayers.size();
  for (; at < kLayers * order_.size(); ++at) {
    const auto& slot = order_[at / kLayers];
    if (slot->lacks_raw(at % kLayers, demand)) return Due{slot, at % kLayers};
  }
  return std::nullopt;
}

// From place `at` on, while little waits encoded and `visit` returns true.
template <class Visit>
void RawLane::for_each_due(std::size_t at, const Demand& demand, Visit visit) const {
  std::size_t prepared_bytes = 0;
  for (auto due = next_due(at, demand); due && prepared_bytes < kPreparedBytes; due = next_due(++at, demand)) {
    if (!visit(*due)) return;
    if (due->raw().payload) prepared_bytes += due->raw().payload->size();
  }
}

void RawLane::look_up(const Due& due, const Demand& demand) {
  if (due.raw().work != TileSlot::Work::Idle) return;
  if (auto payload = cache_.find_colours(key(due, demand))) make_ready(due, std::move(payload));
}

unsigned RawLane::startable_count(unsigned most, const Demand& demand) {
  unsigned startable = 0;
  for_each_due(head_, demand, [&](const Due& due) {
    if (due.raw().work == TileSlot::Work::Idle) ++startable;
    return startable < most;
  });
  return startable;
}

std::optional<RawEncoding> RawLane::next_encoding(const Demand& demand, const std::weak_ptr<CacheWaiter>& waiter) {
  std::optional<RawEncoding> encoding;
  for_each_due(0, demand, [&](const Due& due) {
    if (due.raw().work != TileSlot::Work::Idle) return true;
    using Kind = Claim<std::vector<std::byte>>::Kind;
    auto claim = cache_.claim_colours(key(due, demand), waiter);
    switch (claim.kind) {
      case Kind::Ready:
        make_ready(due, std::move(claim.value));
        return true;
      case Kind::Busy:
        due.raw().work = TileSlot::Work::Waiting;
        return true;
      case Kind::Yours:
        due.raw().work = TileSlot::Work::Busy;
        encoding = RawEncoding{due.slot, due.slot->tile, demand, due.layer, due.slot->held.revision};
        return false;
    }
    return true;
  });
  return encoding;
}

bool RawLane::finish(const RawEncoding& done, const Demand& demand) {
  const Due due{done.slot, done.layer};
  due.raw().work = TileSlot::Work::Idle;
  const std::uint64_t epoch = done.demand.raw.epoch[done.layer];
  const bool is_current = done.slot->held.revision == done.revision && demand.raw.epoch[done.layer] == epoch;
  if (!is_current) return false;
  if (!done.made) {
    due.raw().failed_epoch = epoch;
    return true;
  }
  if (done.slot->lacks_raw(done.layer, demand)) make_ready(due, done.made);
  return false;
}

Payload RawLane::give(const Due& due, const Demand& demand) {
  due.raw().held_epoch = demand.raw.epoch[due.layer];
  due.raw().work = TileSlot::Work::Idle;
  return std::exchange(due.raw().payload, nullptr);
}

ColourKey RawLane::key(const Due& due, const Demand& demand) const {
  return demand.raw_key(due.slot->held.revision, RawDemand::kLayers[due.layer]);
}

void RawLane::make_ready(const Due& due, Payload payload) {
  due.raw().payload = std::move(payload);
  due.raw().work = TileSlot::Work::Ready;
}

}  // namespace spectra::stream
