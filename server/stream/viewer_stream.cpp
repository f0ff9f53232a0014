#include "server/stream/viewer_stream.hpp"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <utility>
#include <vector>

#include "server/stream/frame_cache.hpp"
#include "server/stream/lattice.hpp"
#include "server/stream/quality_frontier.hpp"
#include "server/stream/raw_lane.hpp"
#include "server/stream/screen_accuracy.hpp"
#include "server/stream/sending_order.hpp"
#include "server/stream/sending_window.hpp"
#include "server/stream/slot_preparation.hpp"
#include "server/stream/urgent_budget.hpp"
#include "server/stream/view_selection.hpp"
#include "server/stream/viewer_tiles.hpp"

namespace spectra::stream {
namespace {

using protocol::FrameKind;
using protocol::TileFrameHeader;

// Places in RawDemand::kLayers.
constexpr std::size_t kTemperature = 0;
constexpr std::size_t kVisible = 1;
constexpr std::size_t kSigma = 2;
static_assert(RawDemand::kLayers[kTemperature] == Layer::Temperature &&
              RawDemand::kLayers[kVisible] == Layer::Visible && RawDemand::kLayers[kSigma] == Layer::TemperatureSigma);

// After every tile of anybody: raw layers fill what time is left.
constexpr int kRawPriority = 100;

// Of jobs beyond a viewer's UrgentBudget: behind every level, in order of arrival.
constexpr int kInTurnPriority = 50;

// After a change of the settings the coarse tiles whose place is taken by finer ones are coloured first, for a quick
// answer, as long as that adds no more than this part to the whole.
constexpr double kPreviewShare = 0.1;

// Over a link that takes longer than the latency target for a whole answer, these coarse tiles have no more than so many
// bits a channel: hard to tell from eight for the moment that they are seen, and a third to a half of the bytes less.
constexpr int kPreviewColourBits = 6;

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

// Ties together what the viewer asks for (quality, camera, settings: the demand), what it has (ViewerTiles), what comes
// next (SendingOrder), who makes it (SlotPreparation, on the pool) and how much may be on its way (SendingWindow). One lock
// guards them all.
class Stream final : public ViewerStream, public CacheWaiter {
 public:
  Stream(std::shared_ptr<const map::SceneSnapshot> scene, std::shared_ptr<FrameCache::State> cache,
         jobs::WorkerPool& pool, std::function<void()> wake)
      : cache_(std::move(cache)), pool_(pool), wake_(std::move(wake)) {
    adopt(std::move(scene));
  }

  void close() override {
    {
      const std::lock_guard lock(mutex_);
      closed_ = true;
      tiles_.clear();
      order_.clear();
      raw_.clear();
    }
    // Taking this lock waits for a wake that is being called right now; none follows.
    const std::lock_guard lock(wake_mutex_);
    wake_ = nullptr;
  }

  void set_scene(std::shared_ptr<const map::SceneSnapshot> scene) override {
    change([&] { adopt(std::move(scene)); });
  }

  void subscribe(const Subscription& subscription) override {
    change([&] {
      window_.set_ceiling(subscription.in_flight_bytes);
      take_channels(subscription);
      if (subscription.colour_transform != demand_.colour_transform) {
        demand_.colour_transform = subscription.colour_transform;
        ++demand_.colour_epoch;
        ++demand_.raw.epoch[kVisible];
        colour_cost_ = ColourCost(subscription.colour_transform);
        is_complete_due_ = true;
      }
      if (subscription.cache_bytes != cache_bytes_) {
        cache_bytes_ = subscription.cache_bytes;
        select();
        is_complete_due_ = true;
      }
      if (subscribed_) return;
      // What was resumed is in the form of this subscription.
      for (const auto& slot : tiles_.slots()) {
        for (std::size_t layer = 0; layer < slot->raw.size(); ++layer) {
          if (slot->raw[layer].held_epoch != 0) slot->raw[layer].held_epoch = demand_.raw.epoch[layer];
        }
      }
      subscribed_ = true;
      is_complete_due_ = true;
    });
  }

  void unsubscribe() override {
    change([&] {
      subscribed_ = false;
      // Whoever subscribes again starts from nothing, unless with resume().
      tiles_.forget_all_held();
    });
  }

  std::uint32_t resume(std::span<const ResumedTile> claims) override {
    std::uint32_t current_count = 0;
    change([&] {
      if (subscribed_) return;
      current_count = tiles_.resume(claims, demand_, *cache_);
      remove_surplus();
    });
    return current_count;
  }

  std::uint32_t set_plan(fusion::FusionPlan plan) override {
    auto shared_plan = std::make_shared<const fusion::FusionPlan>(std::move(plan));
    std::uint32_t generation = 0;
    change([&] {
      generation = ++generation_;
      demand_.plan_identity = cache_->plan_identity(*shared_plan, scene_->reference_temperature());
      demand_.plan = std::move(shared_plan);
      ++demand_.colour_epoch;
      take_looks();
      is_complete_due_ = true;
      window_.on_overtaken();
      answer_first();
    });
    return generation;
  }

  std::uint32_t generation() const override {
    const std::lock_guard lock(mutex_);
    return generation_;
  }

  void set_time(double now_s) override {
    {
      const std::lock_guard lock(mutex_);
      demand_.look_rules.now_s = now_s;
      if (now_s <= tiles_.next_look_s()) return;
    }
    change([&] {
      // What is drawn stays complete; a new answer is one only where something is another.
      if (take_looks() > 0) is_complete_due_ = true;
    });
  }

  void set_quality(const StreamQuality& quality) override {
    change([&] {
      if (quality.position_step_m != quality_.position_step_m) {
        wanted_step_m_ = quality.position_step_m > 0 ? quality.position_step_m : 0;
      }
      quality_ = quality;
      quality_.colour_bits = std::clamp(quality.colour_bits, 4, 8);
      quality_.encoder_speed = std::clamp(quality.encoder_speed, 0, 10);
      is_complete_due_ = true;
      answer_first();
    });
  }

  const StreamQuality& quality() const override { return quality_; }

  void set_camera(const Camera& camera) override {
    if (!is_usable(camera)) return;
    change([&] {
      camera_ = camera;
      select();
      if (head() != nullptr || tiles_.has_removals()) is_complete_due_ = true;
    });
  }

  void acknowledge(std::uint32_t sequence, double now_s) override {
    change([&] { window_.on_acknowledged(sequence, now_s); });
  }

  std::optional<OutgoingFrame> next_frame(double now_s) override {
    const std::lock_guard lock(mutex_);
    wake_pending_ = false;
    if (!may_work()) return std::nullopt;
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

  std::optional<StreamComplete> take_complete() override {
    bool is_followed = false;
    const auto complete = completed(is_followed);
    if (is_followed) wake();
    return complete;
  }

  StreamStats stats() const override {
    const std::lock_guard lock(mutex_);
    StreamStats stats;
    stats.round_trip_ms = window_.round_trip_s() * 1e3;
    stats.throughput_bytes_per_s = window_.rate_bytes_per_s();
    stats.queued_bytes = window_.in_flight_bytes() + tiles_.prepared_bytes();
    stats.skipped_frames = skipped_frame_count_;
    stats.failed_tiles = failed_tile_count_;
    std::vector<HeldQuality> held;
    for (const auto& slot : tiles_.slots())
      held.push_back({!slot->is_drawable()     ? 0
                      : slot->has_raw_layers() ? 8
                                               : slot->held.colour_bits,
                      slot->held.position_step_m});
    const ScreenAccuracy accuracy = screen_accuracy(tiles_.tree(), held, camera_);
    const int colour_bits_drawn = std::min(accuracy.colour_bits, demand_.colour_bits);
    const double rounding_levels = colour_bits_drawn < 8 ? 1 << (7 - colour_bits_drawn) : 0;
    const double off_levels = accuracy.colour_error_levels + rounding_levels;
    stats.colour_levels = off_levels > 0.5 ? std::max(1, static_cast<int>(128 / off_levels)) : 256;
    stats.temperature_celsius = accuracy.temperature_celsius;
    stats.position_mm = accuracy.position_mm;
    stats.pixel_error = accuracy.pixel_error;
    return stats;
  }

  void cache_changed() override {
    change([&] {
      for (const auto& slot : tiles_.slots()) {
        if (slot->work == TileSlot::Work::Waiting) slot->work = TileSlot::Work::Idle;
        for (TileSlot::Raw& raw : slot->raw) {
          if (raw.work == TileSlot::Work::Waiting) raw.work = TileSlot::Work::Idle;
        }
      }
    });
  }

 private:
  // Every change of state goes through here: afterwards superseded frames are dropped, jobs are posted for what is
  // missing, and the session is woken when there is something for it.
  template <class Action>
  void change(const Action& action) {
    {
      const std::lock_guard lock(mutex_);
      if (closed_) return;
      const auto geometry_epoch = demand_.geometry_epoch;
      const auto colour_epoch = demand_.colour_epoch;
      action();
      if (geometry_epoch != demand_.geometry_epoch || colour_epoch != demand_.colour_epoch) {
        drop_superseded();
      }
      order_.rewind();
      raw_.rewind();
      if (TileSlot* slot = head(); slot != nullptr && slot->work == TileSlot::Work::Idle) {
        preparation_.look_up(*slot, demand_);
      }
      post_jobs();
      if (!has_news()) return;
    }
    wake();
  }

  // With the lock not held. `is_followed`: raw layers have waited for it.
  std::optional<StreamComplete> completed(bool& is_followed) {
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

  void wake() {
    if (wake_pending_.exchange(true)) return;
    const std::lock_guard lock(wake_mutex_);
    if (wake_) wake_();
  }

  // With the lock held: everything below, except where it says otherwise.

  void adopt(std::shared_ptr<const map::SceneSnapshot> scene) {
    scene_ = std::move(scene);
    order_.clear();
    raw_.clear();
    tiles_.adopt(*scene_);
    take_looks();
    is_complete_due_ = true;
    answer_first();
  }

  // How many of the tiles that are wanted look otherwise now.
  std::size_t take_looks() {
    LookRules& rules = demand_.look_rules;
    rules.baseline_mark = scene_->baseline_mark();
    rules.age.reset();
    rules.compares_with_baseline = demand_.plan && demand_.plan->compares_with_baseline();
    if (demand_.plan && demand_.plan->settings().age.mode == fusion::AgeMode::Fade) {
      rules.age = fusion::AgeSteps(demand_.plan->settings().age.half_life_s);
    }
    return tiles_.set_looks(rules);
  }

  // Something has changed: the first answer may be coarser than the last; see StreamQuality.
  void answer_first() {
    if (!demand_.fused) {
      point_ = {.pixel_error_factor = 1, .colour_bits = quality_.colour_bits};
      return apply();
    }
    const auto target_vertices = [this](double pixel_error) {
      return target_vertex_count(tiles_.tree(), selected(pixel_error));
    };
    point_ = first_answer(quality_, window_.rate_bytes_per_s(), window_.round_trip_s(), colour_cost_, target_vertices);
    apply();
  }

  // There is a second answer still to come.
  bool is_refining_due() const {
    return demand_.plan && demand_.fused &&
           (point_.pixel_error_factor != 1 || point_.colour_bits != quality_.colour_bits);
  }

  void refine() {
    if (!is_refining_due()) return;
    point_ = {.pixel_error_factor = 1, .colour_bits = quality_.colour_bits};
    apply();
  }

  // Brings what is demanded in line with quality, point, camera and scene.
  void apply() {
    const float step = position_step_in_force(wanted_step_m_, scene_->suggested_position_step_m());
    quality_.position_step_m = step;
    if (step != demand_.position_step_m || quality_.encoder_speed != demand_.encoder_speed) {
      demand_.position_step_m = step;
      demand_.encoder_speed = quality_.encoder_speed;
      ++demand_.geometry_epoch;
    }
    if (quality_.marks != demand_.marks) {
      demand_.marks = quality_.marks;
      if (demand_.plan && demand_.plan->highlights()) ++demand_.colour_epoch;
    }
    if (point_.colour_bits != demand_.colour_bits) {
      demand_.colour_bits = point_.colour_bits;
      ++demand_.colour_epoch;
    }
    select();
    if (head() != nullptr) is_complete_due_ = true;
  }

  std::vector<SelectedTile> selected(double pixel_error) const {
    return selected_tiles(tiles_.tree(), camera_, pixel_error, cache_bytes_ > 0 ? cache_bytes_ : kUnbounded);
  }

  void remove_surplus() { tiles_.remove_surplus(cache_bytes_ > 0 ? cache_bytes_ : Subscription::kCacheBytes); }

  void select() {
    const auto chosen = selected(quality_.pixel_error * point_.pixel_error_factor);
    const auto vertices = static_cast<double>(target_vertex_count(tiles_.tree(), chosen));
    const double rate = window_.rate_bytes_per_s();
    const double bytes = vertices * colour_cost_.bytes_per_vertex(demand_.colour_bits);
    // No previews of what arrives at once anyway.
    const bool is_quick = rate > 0 && bytes / rate * 1e3 <= quality_.latency_target_ms;
    const bool is_slow = rate > 0 && !is_quick;
    demand_.preview_colour_bits = is_slow ? std::min(demand_.colour_bits, kPreviewColourBits) : demand_.colour_bits;
    order_.choose(tiles_, chosen, is_quick ? 0 : kPreviewShare * vertices);
    raw_.choose(raw_order(order_.slots(), tiles_.tree(), camera_));
    remove_surplus();
    remove_outdated();
  }

  // Beneath tiles that have become fine enough when they had their colours already.
  void remove_outdated() {
    if (!demand_.plan || !demand_.fused || is_refining_due()) return;
    for (const auto& slot : order_.slots()) {
      if (slot->wish.is_target && slot->held.geometry_epoch == demand_.geometry_epoch && slot->has_colours(demand_))
        tiles_.remove_outdated_beneath(*slot, demand_);
    }
  }

  void drop_superseded() {
    for (const auto& slot : order_.slots()) {
      if (slot->work != TileSlot::Work::Ready) continue;
      ++skipped_frame_count_;
      tiles_.put_down(*slot);
    }
  }

  // The first tile that is not as it should be; null when there is none, or no settings yet.
  TileSlot* head() { return demand_.plan ? order_.head(tiles_, demand_) : nullptr; }

  bool is_complete() {
    return !closed_ && subscribed_ && is_complete_due_ && demand_.plan && !tiles_.has_removals() && head() == nullptr &&
           !is_refining_due() && (demand_.fused || !raw_.head(demand_));
  }

  bool has_news() {
    if (!subscribed_) return false;
    if (tiles_.has_removals() || is_complete() || (head() == nullptr && is_refining_due())) return true;
    const TileSlot* slot = head();
    if (slot != nullptr) return slot->work == TileSlot::Work::Ready;
    const auto due = raw_.head(demand_);
    return due && due->raw().work == TileSlot::Work::Ready;
  }

  // What a Ready slot gives: a frame, nothing yet because of the window, or nothing at all.
  struct Attempt {
    std::optional<OutgoingFrame> frame;
    bool is_held_up = false;
  };

  Attempt next_geometry(TileSlot& slot, double now_s) {
    if (!window_.admits(frame_size(slot.prepared.geometry->payload))) return {std::nullopt, true};
    const std::uint32_t revision = slot.prepared.geometry->revision;
    const std::uint32_t name = revision > slot.held.wire_revision ? revision : cache_->unused_revision();
    if (name <= slot.held.wire_revision) {
      // Resumed under a revision that never was; what replaces it has to be newer.
      tiles_.remove_from_viewer(slot);
      return {};
    }
    tiles_.give_geometry(slot, name, demand_.geometry_epoch);
    auto frame = given_out(prepared_header_of(slot, FrameKind::Geometry), slot.prepared.geometry->payload, now_s);
    if (!demand_.fused) {
      // Nothing more of the tile follows in this lane.
      note_geometry(slot);
      tiles_.put_down(slot);
    }
    return {std::move(frame)};
  }

  Attempt next_colours(TileSlot& slot, double now_s) {
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
      tiles_.give_colours(slot, demand_.colour_epoch);
      colour_cost_.learn(slot.prepared.colour_bits, header.vertex_count, slot.prepared.colours->size());
      frame = given_out(header, slot.prepared.colours, now_s);
      if (slot.wish.is_target && !is_refining_due()) tiles_.remove_outdated_beneath(slot, demand_);
    }
    tiles_.put_down(slot);
    if (frame) post_jobs();
    return {std::move(frame)};
  }

  // A tile's geometry has gone out and is the one in force.
  void note_geometry(TileSlot& slot) {
    slot.held.geometry_epoch = demand_.geometry_epoch;
    slot.held.position_step_m = slot.prepared.geometry->position_step_m;
    slot.held.vertex_count = static_cast<std::uint32_t>(slot.prepared.geometry->input_of_decoded.size());
    slot.held.origin_m = slot.prepared.geometry->origin_m;
  }

  void take_channels(const Subscription& subscription) {
    RawDemand& raw = demand_.raw;
    if (subscription.temperature_step_celsius != raw.temperature_step_celsius) {
      raw.temperature_step_celsius = subscription.temperature_step_celsius;
      ++raw.epoch[kTemperature];
    }
    raw.is_wanted[kTemperature] = subscription.temperature;
    raw.is_wanted[kVisible] = subscription.visible;
    raw.is_wanted[kSigma] = subscription.temperature_sigma;
    if (subscription.fused == demand_.fused) return;
    demand_.fused = subscription.fused;
    for (const auto& slot : tiles_.slots()) tiles_.put_down(*slot);
    is_complete_due_ = true;
    answer_first();
  }

  std::optional<OutgoingFrame> next_raw(const RawLane::Due& due, double now_s) {
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

  FrameKind raw_frame_kind(std::size_t layer) const {
    if (layer == kSigma) return FrameKind::TemperatureSigma;
    return layer == kTemperature ? FrameKind::Temperature : protocol::visible_frame_kind(demand_.colour_transform);
  }

  std::optional<OutgoingFrame> next_removal(double now_s) {
    if (!window_.admits(protocol::kTileFrameHeaderSize)) return std::nullopt;
    return given_out(tiles_.take_removal(), nullptr, now_s);
  }

  OutgoingFrame given_out(TileFrameHeader header, Payload payload, double now_s) {
    header.sequence = ++last_sequence_;
    header.payload_size_bytes = payload ? static_cast<std::uint32_t>(payload->size()) : 0;
    OutgoingFrame frame{protocol::encoded_header(header), std::move(payload)};
    window_.on_sent(header.sequence, frame.size_bytes(), now_s);
    return frame;
  }

  bool may_work() const { return !closed_ && subscribed_; }

  bool is_needed(const TileSlot& slot) const {
    return may_work() && !slot.is_gone && slot.wish.is_wanted && !tiles_.is_satisfied(slot, demand_);
  }

  bool may_start(std::size_t index) const {
    const TileSlot& slot = *order_.slots()[index];
    return slot.work == TileSlot::Work::Idle &&
           (index == order_.head_index() || tiles_.prepared_bytes() < RawLane::kPreparedBytes) &&
           !tiles_.is_satisfied(slot, demand_);
  }

  std::optional<Encoding> next_encoding() {
    if (!may_work() || head() == nullptr) return std::nullopt;
    for (std::size_t index = order_.head_index(); index < order_.slots().size(); ++index) {
      const auto& slot = order_.slots()[index];
      if (!may_start(index) || !is_needed(*slot)) continue;
      if (auto encoding = preparation_.advance(slot, demand_, weak_waiter())) return encoding;
    }
    return std::nullopt;
  }

  std::optional<Encoding> encoding_after(const Encoding& done) {
    done.slot->work = TileSlot::Work::Idle;
    if (done.has_failed()) note_failure(done);
    if (!is_needed(*done.slot)) return std::nullopt;
    return preparation_.advance_after(done, demand_, weak_waiter());
  }

  void note_failure(const Encoding& encoding) {
    ++failed_tile_count_;
    if (encoding.geometry) {
      encoding.slot->failed.colour_epoch = encoding.demand.colour_epoch;
    } else {
      encoding.slot->failed.geometry_epoch = encoding.demand.geometry_epoch;
    }
  }

  // A job is a promise to do whatever is most urgent when its turn comes, so what was superseded while it waited
  // costs nothing, few are enough, and viewers take turns tile by tile.
  void post_jobs() {
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
          [weak = std::weak_ptr<ViewerStream>(shared_from_this())] {
            if (const auto stream = weak.lock()) static_cast<Stream&>(*stream).run_job();
          },
          priority);
    }
  }

  std::weak_ptr<CacheWaiter> weak_waiter() {
    return std::shared_ptr<CacheWaiter>(shared_from_this(), static_cast<CacheWaiter*>(this));
  }

  // Without the lock: a job, on a worker.
  void run_job() {
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
      if (raw_.finish(*raw, demand_)) ++failed_tile_count_;
    }
    while (encoding) {
      const auto begin = UrgentBudget::Clock::now();
      encode(*encoding, *cache_);
      const auto end = UrgentBudget::Clock::now();
      const std::lock_guard lock(mutex_);
      budget_.spend(end - begin, end);
      encoding = encoding_after(*encoding);
    }
    change([&] { --running_job_count_; });
  }

  const std::shared_ptr<FrameCache::State> cache_;
  jobs::WorkerPool& pool_;

  std::mutex wake_mutex_;
  std::function<void()> wake_;
  std::atomic<bool> wake_pending_{false};

  mutable std::mutex mutex_;
  bool closed_ = false;
  bool subscribed_ = false;
  bool is_complete_due_ = false;
  std::shared_ptr<const map::SceneSnapshot> scene_;
  StreamQuality quality_;
  float wanted_step_m_ = 0;
  std::optional<Camera> camera_;
  std::uint64_t cache_bytes_ = 0;
  QualityPoint point_;
  ColourCost colour_cost_;
  Demand demand_;
  ViewerTiles tiles_;
  SendingOrder order_;
  RawLane raw_{*cache_};
  SlotPreparation preparation_{*cache_, tiles_};
  SendingWindow window_;
  UrgentBudget budget_;
  std::uint32_t generation_ = 0;
  std::uint32_t last_sequence_ = 0;
  unsigned waiting_job_count_ = 0;
  unsigned running_job_count_ = 0;
  std::uint64_t skipped_frame_count_ = 0;
  std::uint64_t failed_tile_count_ = 0;
};

}  // namespace

std::shared_ptr<ViewerStream> ViewerStream::create(std::shared_ptr<const map::SceneSnapshot> scene, FrameCache& cache,
                                                   jobs::WorkerPool& pool, std::function<void()> wake) {
  return std::make_shared<Stream>(std::move(scene), cache.state(), pool, std::move(wake));
}

}  // namespace spectra::stream
