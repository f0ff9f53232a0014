#include "server/stream/viewer_stream.hpp"

#include <algorithm>
#include <utility>

#include "server/stream/lattice.hpp"
#include "server/stream/screen_accuracy.hpp"

namespace spectra::stream {
namespace {

// After a change of the settings the coarse tiles whose place is taken by finer ones are coloured first, for a quick
// answer, as long as that adds no more than this part to the whole.
constexpr double kPreviewShare = 0.1;

// Over a link that takes longer than the latency target for a whole answer, these coarse tiles have no more than so many
// bits a channel: hard to tell from eight for the moment that they are seen, and a third to a half of the bytes less.
constexpr int kPreviewColourBits = 6;

}  // namespace

std::shared_ptr<ViewerStream> ViewerStream::create(std::shared_ptr<const map::SceneSnapshot> scene, FrameCache& cache,
                                                   jobs::WorkerPool& pool, std::function<void()> wake) {
  return std::shared_ptr<ViewerStream>(new ViewerStream(std::move(scene), cache.state(), pool, std::move(wake)));
}

ViewerStream::ViewerStream(std::shared_ptr<const map::SceneSnapshot> scene, std::shared_ptr<FrameCache::State> cache,
                           jobs::WorkerPool& pool, std::function<void()> wake)
    : cache_(std::move(cache)), pool_(pool), wake_(std::move(wake)) {
  adopt(std::move(scene));
}

void ViewerStream::change(const std::function<void()>& action) {
  go_on([&] {
    const auto geometry_epoch = demand_.geometry_epoch;
    const auto colour_epoch = demand_.colour_epoch;
    action();
    if (geometry_epoch != demand_.geometry_epoch || colour_epoch != demand_.colour_epoch) {
      drop_superseded();
    }
    look_again();
  });
}

void ViewerStream::go_on(const std::function<void()>& action) {
  {
    const std::lock_guard lock(mutex_);
    if (closed_) return;
    action();
    if (TileSlot* slot = head(); slot != nullptr && slot->work == TileSlot::Work::Idle) {
      preparation_.look_up(*slot, demand_);
    }
    post_jobs();
    tiles_.remove_succeeded(order_.slots(), demand_);
    if (!has_news()) return;
  }
  wake();
}

void ViewerStream::close() {
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

void ViewerStream::set_scene(std::shared_ptr<const map::SceneSnapshot> scene) {
  change([&] { adopt(std::move(scene)); });
}

void ViewerStream::subscribe(const Subscription& subscription) {
  change([&] {
    window_.set_ceiling(subscription.in_flight_bytes);
    take_channels(subscription);
    if (subscription.colour_transform != demand_.colour_transform) {
      demand_.colour_transform = subscription.colour_transform;
      ++demand_.colour_epoch;
      // What was resumed shows the same, however it was written.
      if (!subscribed_) tiles_.keep_colours(demand_.colour_epoch - 1, demand_.colour_epoch, 0);
      ++demand_.raw.epoch[RawDemand::kVisible];
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

void ViewerStream::unsubscribe() {
  change([&] {
    subscribed_ = false;
    // Whoever subscribes again starts from nothing, unless with resume().
    tiles_.forget_all_held();
  });
}

Resumed ViewerStream::resume(std::span<const ResumedTile> claims, const ViewerMemory& memory) {
  Resumed resumed;
  change([&] {
    if (subscribed_) return;
    resumed = tiles_.resume(claims, memory, demand_, quality_.colour_bits, *cache_);
    remove_surplus();
    remove_outdated();
  });
  return resumed;
}

ViewerMemory ViewerStream::memory() const {
  const std::lock_guard lock(mutex_);
  return tiles_.memory();
}

std::uint32_t ViewerStream::set_plan(fusion::FusionPlan plan) {
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

std::uint32_t ViewerStream::generation() const {
  const std::lock_guard lock(mutex_);
  return generation_;
}

void ViewerStream::set_time(double now_s) {
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

void ViewerStream::set_quality(const StreamQuality& quality) {
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

void ViewerStream::set_camera(const Camera& camera) {
  if (!is_usable(camera)) return;
  change([&] {
    camera_ = camera;
    select();
    if (head() != nullptr || tiles_.has_removals()) is_complete_due_ = true;
  });
}

void ViewerStream::acknowledge(std::uint32_t sequence, double now_s) {
  go_on([&] { window_.on_acknowledged(sequence, now_s); });
}

StreamStats ViewerStream::stats() const {
  const std::lock_guard lock(mutex_);
  StreamStats stats;
  stats.round_trip_ms = window_.round_trip_s() * 1e3;
  stats.throughput_bytes_per_s = window_.rate_bytes_per_s();
  stats.queued_bytes = window_.in_flight_bytes() + tiles_.prepared_bytes();
  stats.skipped_frames = skipped_frame_count_;
  stats.failed_tiles = failed_tile_count_;
  stats.generation = generation_;
  stats.shown_revision = subscribed_ && demand_.plan ? tiles_.shown_revision(demand_) : 0;
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

void ViewerStream::cache_changed() {
  go_on([&] {
    for (const auto& slot : tiles_.slots()) {
      if (slot->work == TileSlot::Work::Waiting) slot->work = TileSlot::Work::Idle;
      for (TileSlot::Raw& raw : slot->raw) {
        if (raw.work == TileSlot::Work::Waiting) raw.work = TileSlot::Work::Idle;
      }
    }
  });
}

void ViewerStream::wake() {
  if (wake_pending_.exchange(true)) return;
  const std::lock_guard lock(wake_mutex_);
  if (wake_) wake_();
}

void ViewerStream::adopt(std::shared_ptr<const map::SceneSnapshot> scene) {
  scene_ = std::move(scene);
  order_.clear();
  raw_.clear();
  tiles_.adopt(*scene_, demand_);
  take_looks();
  is_complete_due_ = true;
  answer_first();
}

std::size_t ViewerStream::take_looks() {
  LookRules& rules = demand_.look_rules;
  rules.baseline_mark = scene_->baseline_mark();
  rules.age.reset();
  rules.compares_with_baseline = demand_.plan && demand_.plan->compares_with_baseline();
  if (demand_.plan && demand_.plan->settings().age.mode == fusion::AgeMode::Fade) {
    rules.age = fusion::AgeSteps(demand_.plan->settings().age.half_life_s);
  }
  return tiles_.set_looks(rules);
}

void ViewerStream::answer_first() {
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

bool ViewerStream::is_refining_due() const {
  return demand_.plan && demand_.fused &&
         (point_.pixel_error_factor != 1 || point_.colour_bits != quality_.colour_bits);
}

void ViewerStream::refine() {
  if (!is_refining_due()) return;
  point_ = {.pixel_error_factor = 1, .colour_bits = quality_.colour_bits};
  apply();
}

void ViewerStream::apply() {
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
    const bool is_finer = point_.colour_bits > demand_.colour_bits;
    demand_.colour_bits = point_.colour_bits;
    ++demand_.colour_epoch;
    if (is_finer) tiles_.keep_colours(demand_.colour_epoch - 1, demand_.colour_epoch, demand_.colour_bits);
  }
  select();
  if (head() != nullptr) is_complete_due_ = true;
}

std::vector<SelectedTile> ViewerStream::selected(double pixel_error) const {
  return selected_tiles(tiles_.tree(), camera_, pixel_error, cache_bytes_ > 0 ? cache_bytes_ : kUnbounded);
}

void ViewerStream::remove_surplus() {
  tiles_.remove_surplus(cache_bytes_ > 0 ? cache_bytes_ : Subscription::kCacheBytes);
}

void ViewerStream::select() {
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

void ViewerStream::remove_outdated() {
  if (!demand_.plan || !demand_.fused || is_refining_due()) return;
  for (const auto& slot : order_.slots()) {
    if (slot->wish.is_target && slot->held.geometry_epoch == demand_.geometry_epoch && slot->has_colours(demand_))
      tiles_.remove_outdated_beneath(*slot, demand_);
  }
}

void ViewerStream::drop_superseded() {
  for (const auto& slot : order_.slots()) {
    if (slot->work != TileSlot::Work::Ready) continue;
    ++skipped_frame_count_;
    tiles_.put_down(*slot);
  }
}

void ViewerStream::look_again() {
  order_.rewind();
  raw_.rewind();
}

TileSlot* ViewerStream::head() {
  return demand_.plan ? order_.head(tiles_, demand_) : nullptr;
}

bool ViewerStream::is_complete() {
  return !closed_ && subscribed_ && is_complete_due_ && demand_.plan && !tiles_.has_removals() &&
         !tiles_.has_leaving() && head() == nullptr && !is_refining_due() && (demand_.fused || !raw_.head(demand_));
}

bool ViewerStream::has_news() {
  if (!subscribed_) return false;
  if (tiles_.has_removals() || is_complete() || (head() == nullptr && is_refining_due())) return true;
  const TileSlot* slot = head();
  if (slot != nullptr) return slot->work == TileSlot::Work::Ready;
  const auto due = raw_.head(demand_);
  return due && due->raw().work == TileSlot::Work::Ready;
}

void ViewerStream::take_channels(const Subscription& subscription) {
  RawDemand& raw = demand_.raw;
  if (subscription.temperature_step_celsius != raw.temperature_step_celsius) {
    raw.temperature_step_celsius = subscription.temperature_step_celsius;
    ++raw.epoch[RawDemand::kTemperature];
    for (const auto& slot : tiles_.slots()) slot->raw[RawDemand::kTemperature].put_down();
  }
  raw.is_wanted[RawDemand::kTemperature] = subscription.temperature;
  raw.is_wanted[RawDemand::kVisible] = subscription.visible;
  raw.is_wanted[RawDemand::kSigma] = subscription.temperature_sigma;
  if (subscription.fused == demand_.fused) return;
  demand_.fused = subscription.fused;
  for (const auto& slot : tiles_.slots()) tiles_.put_down(*slot);
  is_complete_due_ = true;
  answer_first();
}

}  // namespace spectra::stream
