// What of a stream goes out next, and who makes it: the rest of ViewerStream.
#include <algorithm>
#include <utility>

#include "server/stream/viewer_stream.hpp"

namespace spectra::stream {
namespace {

using protocol::FrameKind;
using protocol::TileFrameHeader;

// After every tile of anybody: raw layers fill what time is left.
constexpr int kRawPriority = 100;

// Of jobs beyond a viewer's UrgentBudget: behind every level, in order of arrival.
constexpr int kInTurnPriority = 50;

std::size_t frame_size(const Payload& payload) {
  return protocol::kTileFrameHeaderSize + payload->size();
}

// What a tile says of itself, whatever is sent of it.
TileFrameHeader header_of(const map::Tile& tile, FrameKind kind) {
  TileFrameHeader header;
  header.kind = kind;
  header.child_mask = tile.child_mask;
  header.tile = tile.id;
  header.geometric_error_m = tile.geometric_error_m;
  header.colour_error_levels = tile.colour_error_levels;
  header.temperature_error_celsius = tile.temperature_error_celsius;
  header.lowest_celsius = tile.lowest_celsius;
  header.highest_celsius = tile.highest_celsius;
  return header;
}

// Of a slot that is Ready.
TileFrameHeader prepared_header_of(const TileSlot& slot, FrameKind kind) {
  TileFrameHeader header = header_of(*slot.tile, kind);
  header.revision = slot.held.wire_revision;
  header.vertex_count = static_cast<std::uint32_t>(slot.prepared.geometry->input_of_decoded.size());
  header.origin_m = slot.prepared.geometry->origin_m;
  header.position_step_m = slot.prepared.geometry->position_step_m;
  return header;
}

// Of a slot whose geometry the viewer has.
TileFrameHeader held_header_of(const TileSlot& slot, FrameKind kind) {
  TileFrameHeader header = header_of(*slot.tile, kind);
  header.revision = slot.held.wire_revision;
  header.vertex_count = slot.held.vertex_count;
  header.origin_m = slot.held.origin_m;
  header.position_step_m = slot.held.position_step_m;
  return header;
}

}  // namespace

std::optional<OutgoingFrame> ViewerStream::next_frame(double now_s) {
  const std::lock_guard lock(mutex_);
  wake_pending_ = false;
  if (!may_work()) return std::nullopt;
  tiles_.remove_succeeded(order_.slots(), demand_);
  if (tiles_.has_removals()) return next_removal(now_s);
  if (head() == nullptr) refine();
  while (TileSlot* slot = head()) {
    if (tiles_.has_removals()) return next_removal(now_s);
    if (slot->work == TileSlot::Work::Idle) preparation_.look_up(*slot, demand_);
    if (slot->work != TileSlot::Work::Ready) break;
    const bool is_geometry_due = slot->held.revision != slot->prepared.geometry->revision;
    const Attempt attempt = is_geometry_due ? next_geometry(*slot, now_s) : next_colours(*slot, now_s);
    if (attempt.frame || attempt.is_held_up) return attempt.frame;
    if (head() == nullptr) refine();
  }
  // What is complete is said before raw layers follow.
  if (demand_.fused && is_complete()) return std::nullopt;
  if (head() == nullptr && !is_refining_due()) {
    if (const auto due = raw_.head(demand_)) return next_raw(*due, now_s);
  }
  window_.on_idle();
  post_jobs();
  return std::nullopt;
}

std::optional<StreamComplete> ViewerStream::take_complete() {
  bool is_followed = false;
  const auto complete = completed(is_followed);
  if (is_followed) wake();
  return complete;
}

std::optional<StreamComplete> ViewerStream::completed(bool& is_followed) {
  const std::lock_guard lock(mutex_);
  wake_pending_ = false;
  if (!is_complete()) return std::nullopt;
  is_complete_due_ = false;
  StreamComplete complete{
      .generation = generation_, .scene_revision = scene_->revision(), .tile_count = 0, .vertex_count = 0};
  for (const auto& slot : order_.slots()) {
    if (demand_.fused ? slot->held.colour_epoch != demand_.colour_epoch : slot->held.wire_revision == 0) continue;
    ++complete.tile_count;
    complete.vertex_count += slot->held.vertex_count;
  }
  is_followed = raw_.head(demand_).has_value();
  return complete;
}

ViewerStream::Attempt ViewerStream::next_geometry(TileSlot& slot, double now_s) {
  if (!window_.admits(frame_size(slot.prepared.geometry->payload))) return {std::nullopt, true};
  const std::uint32_t revision = slot.prepared.geometry->revision;
  const std::uint32_t name = revision > slot.held.wire_revision ? revision : cache_->unused_revision();
  if (name <= slot.held.wire_revision) {
    // Resumed under a revision that never was; what replaces it has to be newer.
    tiles_.remove_from_viewer(slot);
    look_again();
    return {};
  }
  order_.gave(ViewerTiles::is_there(slot, demand_));
  tiles_.give_geometry(slot, name, demand_.geometry_epoch);
  auto frame = given_out(prepared_header_of(slot, FrameKind::Geometry), slot.prepared.geometry->payload, now_s);
  if (!demand_.fused) {
    // Nothing more of the tile follows in this lane. Raw layers may have gone on without it, because it waited for theirs.
    note_geometry(slot);
    tiles_.put_down(slot);
    raw_.rewind();
  }
  return {std::move(frame)};
}

ViewerStream::Attempt ViewerStream::next_colours(TileSlot& slot, double now_s) {
  note_geometry(slot);
  std::optional<OutgoingFrame> frame;
  if (!slot.has_colours(demand_)) {
    const bool is_first_picture = slot.held.colour_epoch == 0 && !tiles_.tree().nodes()[slot.node].parent;
    const std::size_t size_bytes = frame_size(slot.prepared.colours);
    const auto urgency = slot.wish.is_target ? SendingWindow::Urgency::Detail : SendingWindow::Urgency::Answer;
    if (!window_.admits(size_bytes, urgency) && !(is_first_picture && window_.admits_first_picture(size_bytes))) {
      if (window_.admits(size_bytes)) window_.on_idle();  // It is we who wait, not the link.
      return {std::nullopt, true};
    }
    auto header = prepared_header_of(slot, protocol::colour_frame_kind(demand_.colour_transform));
    header.generation = generation_;
    if (!ViewerTiles::is_there(slot, demand_)) order_.gave(false);
    tiles_.give_colours(slot, demand_, last_sequence_ + 1);
    colour_cost_.learn(slot.prepared.colour_bits, header.vertex_count, slot.prepared.colours->size());
    frame = given_out(header, slot.prepared.colours, now_s);
    if (slot.wish.is_target && !is_refining_due()) tiles_.remove_outdated_beneath(slot, demand_);
  }
  tiles_.put_down(slot);
  if (frame) post_jobs();
  return {std::move(frame)};
}

void ViewerStream::note_geometry(TileSlot& slot) {
  slot.held.geometry_epoch = demand_.geometry_epoch;
  slot.held.position_step_m = slot.prepared.geometry->position_step_m;
  slot.held.vertex_count = static_cast<std::uint32_t>(slot.prepared.geometry->input_of_decoded.size());
  slot.held.origin_m = slot.prepared.geometry->origin_m;
}

std::optional<OutgoingFrame> ViewerStream::next_raw(const RawLane::Due& due, double now_s) {
  raw_.look_up(due, demand_);
  if (due.raw().work != TileSlot::Work::Ready) {
    window_.on_idle();
    post_jobs();
    return std::nullopt;
  }
  if (!window_.admits(frame_size(due.raw().payload), SendingWindow::Urgency::Detail)) return std::nullopt;
  auto frame = given_out(held_header_of(*due.slot, raw_frame_kind(due.layer)), raw_.give(due, demand_), now_s);
  if (!demand_.fused && !raw_.head(demand_)) is_complete_due_ = true;
  post_jobs();
  return frame;
}

FrameKind ViewerStream::raw_frame_kind(std::size_t layer) const {
  if (layer == RawDemand::kSigma) return FrameKind::TemperatureSigma;
  return layer == RawDemand::kTemperature ? FrameKind::Temperature
                                          : protocol::visible_frame_kind(demand_.colour_transform);
}

std::optional<OutgoingFrame> ViewerStream::next_removal(double now_s) {
  if (!window_.admits(protocol::kTileFrameHeaderSize)) return std::nullopt;
  return given_out(tiles_.take_removal(), nullptr, now_s);
}

OutgoingFrame ViewerStream::given_out(TileFrameHeader header, Payload payload, double now_s) {
  header.sequence = ++last_sequence_;
  header.payload_size_bytes = payload ? static_cast<std::uint32_t>(payload->size()) : 0;
  OutgoingFrame frame{protocol::encoded_header(header), std::move(payload)};
  window_.on_sent(header.sequence, frame.size_bytes(), now_s);
  return frame;
}

bool ViewerStream::is_needed(const TileSlot& slot) const {
  return may_work() && !slot.is_gone && slot.wish.is_wanted && !tiles_.is_satisfied(slot, demand_);
}

bool ViewerStream::may_start(std::size_t index) const {
  const TileSlot& slot = *order_.slots()[index];
  return slot.work == TileSlot::Work::Idle &&
         (index == order_.head_index() || tiles_.prepared_bytes() < RawLane::kPreparedBytes) &&
         !tiles_.is_satisfied(slot, demand_);
}

std::optional<Encoding> ViewerStream::next_encoding() {
  if (!may_work() || head() == nullptr) return std::nullopt;
  for (std::size_t index = order_.head_index(); index < order_.slots().size(); ++index) {
    const auto& slot = order_.slots()[index];
    if (!may_start(index) || !is_needed(*slot)) continue;
    if (auto encoding = preparation_.advance(slot, demand_, weak_waiter())) return encoding;
  }
  return std::nullopt;
}

std::optional<Encoding> ViewerStream::encoding_after(const Encoding& done) {
  done.slot->work = TileSlot::Work::Idle;
  if (done.has_failed()) note_failure(done);
  if (!is_needed(*done.slot)) return std::nullopt;
  return preparation_.advance_after(done, demand_, weak_waiter());
}

void ViewerStream::note_failure(const Encoding& encoding) {
  ++failed_tile_count_;
  // What stood in for it may have to come after all.
  look_again();
  if (encoding.geometry) {
    encoding.slot->failed.colour_epoch = encoding.demand.colour_epoch;
  } else {
    encoding.slot->failed.geometry_epoch = encoding.demand.geometry_epoch;
  }
}

void ViewerStream::post_jobs() {
  if (!may_work() || !demand_.plan) return;
  const unsigned most = pool_.thread_count() + 1;
  unsigned startable = 0;
  int priority = kRawPriority;
  if (head() == nullptr) startable = raw_.startable_count(most, demand_);
  for (std::size_t index = order_.head_index(); index < order_.slots().size() && startable < most; ++index) {
    if (!may_start(index)) continue;
    if (startable++ == 0) priority = order_.slots()[index]->tile->id.level;
  }
  if (startable == 0) return;
  if (!budget_.is_left(UrgentBudget::Clock::now())) priority = std::max(priority, kInTurnPriority);
  while (waiting_job_count_ < startable && waiting_job_count_ + running_job_count_ < most) {
    ++waiting_job_count_;
    pool_.post(
        [weak = weak_from_this()] {
          if (const auto stream = weak.lock()) stream->run_job();
        },
        priority);
  }
}

std::weak_ptr<CacheWaiter> ViewerStream::weak_waiter() {
  return std::shared_ptr<CacheWaiter>(shared_from_this(), this);
}

void ViewerStream::run_job() {
  std::optional<Encoding> encoding;
  std::optional<RawEncoding> raw;
  {
    const std::lock_guard lock(mutex_);
    --waiting_job_count_;
    ++running_job_count_;
    encoding = next_encoding();
    if (!encoding && may_work() && head() == nullptr) raw = raw_.next_encoding(demand_, weak_waiter());
  }
  if (raw) {
    encode(*raw, *cache_);
    const std::lock_guard lock(mutex_);
    if (raw_.finish(*raw, demand_)) {
      ++failed_tile_count_;
      look_again();
    }
  }
  while (encoding) {
    const auto begin = UrgentBudget::Clock::now();
    encode(*encoding, *cache_);
    const auto end = UrgentBudget::Clock::now();
    const std::lock_guard lock(mutex_);
    budget_.spend(end - begin, end);
    encoding = encoding_after(*encoding);
  }
  go_on([&] { --running_job_count_; });
}

}  // namespace spectra::stream
