#include "server/stream/viewer_stream.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <deque>
#include <exception>
#include <map>
#include <mutex>
#include <set>
#include <utility>

#include "server/stream/frame_cache.hpp"
#include "server/stream/lattice.hpp"
#include "server/stream/quality_frontier.hpp"
#include "server/stream/sending_window.hpp"
#include "server/stream/tile_encoder.hpp"
#include "server/stream/view_selection.hpp"

namespace spectra::server {
namespace {

using protocol::FrameKind;
using protocol::TileFrameHeader;
using protocol::TileId;

// How much may wait, encoded, for the window of one viewer. Enough to bridge the making of the next tile, little
// enough that a viewer who stopped reading costs nothing.
constexpr std::size_t kPreparedBytes = 1u << 20;

// After a change of the settings the coarse tiles whose place is taken by finer ones are coloured first, for a quick
// answer, as long as that adds no more than this part to the whole.
constexpr double kPreviewShare = 0.1;

// What one viewer has and needs of one tile.
struct Slot {
  enum class Work {
    Idle,     // Nobody is at it.
    Busy,     // A job of this viewer encodes it.
    Waiting,  // A job of another viewer encodes it.
    Ready,    // `geometry` and `colours` answer the present settings.
  };

  std::shared_ptr<const Tile> tile;
  std::size_t node = 0;  // In the tree.
  bool is_gone = false;
  bool is_wanted = false;   // The camera asks for it, ...
  bool is_target = false;   // ... as a tile to be drawn in the end, not only until its children are there.
  bool is_preview = false;  // Coloured even when its children take its place.
  std::uint64_t last_wanted = 0;
  Work work = Work::Idle;
  std::shared_ptr<const EncodedTile> geometry;  // While Ready.
  Payload colours;

  // What was given out last; 0 = nothing. The name of a geometry is its revision on the wire: it rises with each
  // geometry of the tile, even when an encoding comes back that the viewer had before.
  std::uint32_t held_revision = 0;
  std::uint32_t held_name = 0;
  std::uint32_t held_vertex_count = 0;
  std::uint64_t held_geometry_epoch = 0;
  std::uint64_t held_colour_epoch = 0;
  std::uint64_t failed_geometry_epoch = 0;
  std::uint64_t failed_colour_epoch = 0;

  void forget_held() {
    held_revision = 0;
    held_name = 0;
    held_vertex_count = 0;
    held_geometry_epoch = 0;
    held_colour_epoch = 0;
  }
};

// Older than every epoch of a stream: of colours that the viewer has from an earlier connection.
constexpr std::uint64_t kEarlierColourEpoch = 1;

// The settings in force, as a job needs them. An epoch rises with each change that makes frames of that kind stale.
struct Demand {
  std::uint64_t geometry_epoch = 1;
  std::uint64_t colour_epoch = kEarlierColourEpoch + 1;
  float position_step_m = 0;
  int encoder_speed = 7;
  int colour_bits = 8;
  protocol::ColourTransform colour_transform = protocol::ColourTransform::None;
  std::shared_ptr<const fusion::FusionPlan> plan;  // Null before the first set_plan().
  std::shared_ptr<const PlanIdentity> plan_identity;
};

GeometryKey geometry_key_of(const std::shared_ptr<const Tile>& tile, const Demand& demand) {
  return {Identity(tile), demand.position_step_m, demand.encoder_speed};
}

ColourKey colour_key_of(const EncodedTile& geometry, const Demand& demand) {
  return {geometry.revision, demand.plan_identity, demand.colour_bits, demand.colour_transform};
}

// One encoding that a job has claimed, and what came of it.
struct Encoding {
  std::shared_ptr<Slot> slot;
  std::shared_ptr<const Tile> tile;
  Demand demand;
  std::shared_ptr<const EncodedTile> geometry = nullptr;  // Null: it is to be made; else the colours for it.
  std::shared_ptr<const EncodedTile> made_geometry = nullptr;
  Payload made_colours = nullptr;

  GeometryKey geometry_key() const { return geometry_key_of(tile, demand); }
  ColourKey colour_key() const { return colour_key_of(*geometry, demand); }
};

class Stream final : public ViewerStream, public CacheWaiter {
 public:
  Stream(std::shared_ptr<const SceneSnapshot> scene, std::shared_ptr<FrameCache::State> cache, WorkerPool& pool,
         std::function<void()> wake, StreamLimits limits)
      : cache_(std::move(cache)), pool_(pool), limits_(limits), wake_(std::move(wake)) {
    adopt(std::move(scene));
  }

  void close() override {
    {
      const std::lock_guard lock(mutex_);
      closed_ = true;
      for (const auto& slot : slots_) slot->is_gone = true;
      slots_.clear();
      order_.clear();
      removed_.clear();
      tree_ = {};
    }
    // Taking this lock waits for a wake that is being called right now; none follows.
    const std::lock_guard lock(wake_mutex_);
    wake_ = nullptr;
  }

  void set_scene(std::shared_ptr<const SceneSnapshot> scene) override {
    change([&] { adopt(std::move(scene)); });
  }

  void subscribe(std::size_t in_flight_bytes, protocol::ColourTransform transform) override {
    change([&] {
      window_.set_ceiling(in_flight_bytes);
      if (transform != demand_.colour_transform) {
        demand_.colour_transform = transform;
        ++demand_.colour_epoch;
        colour_cost_ = ColourCost(transform);
        is_complete_due_ = true;
      }
      if (subscribed_) return;
      subscribed_ = true;
      is_complete_due_ = true;
    });
  }

  void unsubscribe() override {
    change([&] {
      subscribed_ = false;
      // Whoever subscribes again starts from nothing, unless with resume().
      forget_all_held();
    });
  }

  std::uint32_t resume(std::span<const ResumedTile> tiles) override {
    std::uint32_t current_count = 0;
    change([&] {
      if (subscribed_) return;
      std::map<TileId, Slot*> slot_of;
      for (const auto& slot : slots_) slot_of.emplace(slot->tile->id, slot.get());
      std::set<TileId> seen;
      for (const ResumedTile& resumed : tiles) {
        if (resumed.revision == 0 || !seen.insert(resumed.tile).second) continue;
        const auto known = slot_of.find(resumed.tile);
        if (known == slot_of.end()) {
          push_removal(resumed.tile, resumed.revision);
        } else if (hold_resumed(*known->second, resumed.revision)) {
          ++current_count;
        }
      }
      if (current_count == 0) forget_all_held();
      remove_surplus();
    });
    return current_count;
  }

  std::uint32_t set_plan(fusion::FusionPlan plan) override {
    auto shared_plan = std::make_shared<const fusion::FusionPlan>(std::move(plan));
    std::uint32_t generation = 0;
    change([&] {
      generation = ++generation_;
      demand_.plan_identity = cache_->plan_identity(*shared_plan, scene_);
      demand_.plan = std::move(shared_plan);
      ++demand_.colour_epoch;
      is_complete_due_ = true;
      window_.on_overtaken();
      choose_point();
    });
    return generation;
  }

  std::uint32_t generation() const override {
    const std::lock_guard lock(mutex_);
    return generation_;
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
      choose_point();
    });
  }

  const StreamQuality& quality() const override { return quality_; }

  void set_camera(const Camera& camera) override {
    if (!is_usable(camera)) return;
    change([&] {
      camera_ = camera;
      select();
      if (head() != nullptr || !removed_.empty()) is_complete_due_ = true;
    });
  }

  void acknowledge(std::uint32_t sequence, double now_s) override {
    change([&] { window_.on_acknowledged(sequence, now_s); });
  }

  std::optional<OutgoingFrame> next_frame(double now_s) override {
    const std::lock_guard lock(mutex_);
    wake_pending_ = false;
    if (closed_ || !subscribed_) return std::nullopt;
    if (!removed_.empty()) return next_removal(now_s);
    if (head() == nullptr) refine();
    while (Slot* slot = head()) {
      if (!removed_.empty()) return next_removal(now_s);
      if (slot->work == Slot::Work::Idle) look_up(*slot);
      if (slot->work != Slot::Work::Ready) break;
      if (slot->held_revision != slot->geometry->revision) {
        if (!window_.admits(frame_size(slot->geometry->payload))) return std::nullopt;
        const std::uint32_t name =
            slot->geometry->revision > slot->held_name ? slot->geometry->revision : cache_->unused_revision();
        if (name <= slot->held_name) {
          // Resumed under a revision that is not of this run of the server; what replaces it has to be newer.
          remove_from_viewer(*slot);
          continue;
        }
        prepared_bytes_ -= slot->geometry->payload->size();
        slot->held_name = name;
        slot->held_revision = slot->geometry->revision;
        slot->held_geometry_epoch = demand_.geometry_epoch;
        slot->held_colour_epoch = 0;
        return given_out(header_of(*slot, FrameKind::Geometry), slot->geometry->payload, now_s);
      }
      slot->held_geometry_epoch = demand_.geometry_epoch;
      slot->held_vertex_count = static_cast<std::uint32_t>(slot->geometry->input_of_decoded.size());
      std::optional<OutgoingFrame> frame;
      if (slot->held_colour_epoch != demand_.colour_epoch) {
        if (!window_.admits(frame_size(slot->colours))) return std::nullopt;
        auto header = header_of(*slot, protocol::colour_frame_kind(demand_.colour_transform));
        header.generation = generation_;
        slot->held_colour_epoch = demand_.colour_epoch;
        colour_cost_.learn(demand_.colour_bits, header.vertex_count, slot->colours->size());
        frame = given_out(header, slot->colours, now_s);
        if (slot->is_target && !is_refining_due()) remove_outdated_beneath(*slot);
      }
      put_down(*slot);
      if (frame) {
        post_jobs();
        return frame;
      }
      if (head() == nullptr) refine();
    }
    window_.on_idle();
    post_jobs();
    return std::nullopt;
  }

  std::optional<StreamComplete> take_complete() override {
    const std::lock_guard lock(mutex_);
    wake_pending_ = false;
    if (!is_complete()) return std::nullopt;
    is_complete_due_ = false;
    StreamComplete complete{
        .generation = generation_, .scene_revision = scene_->revision(), .tile_count = 0, .vertex_count = 0};
    for (const auto& slot : order_) {
      if (slot->held_colour_epoch != demand_.colour_epoch) continue;
      ++complete.tile_count;
      complete.vertex_count += slot->held_vertex_count;
    }
    return complete;
  }

  StreamStats stats() const override {
    const std::lock_guard lock(mutex_);
    StreamStats stats;
    stats.round_trip_ms = window_.round_trip_s() * 1e3;
    stats.throughput_bytes_per_s = window_.rate_bytes_per_s();
    stats.queued_bytes = window_.in_flight_bytes() + prepared_bytes_;
    stats.skipped_frames = skipped_frame_count_;
    stats.failed_tiles = failed_tile_count_;
    stats.colour_levels = 1 << demand_.colour_bits;
    if (!closed_) add_accuracy(stats);
    return stats;
  }

  void cache_changed() override {
    change([&] {
      for (const auto& slot : slots_) {
        if (slot->work == Slot::Work::Waiting) slot->work = Slot::Work::Idle;
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
      first_ = 0;
      if (Slot* slot = head(); slot != nullptr && slot->work == Slot::Work::Idle) look_up(*slot);
      post_jobs();
      if (!has_news()) return;
    }
    wake();
  }

  void wake() {
    if (wake_pending_.exchange(true)) return;
    const std::lock_guard lock(wake_mutex_);
    if (wake_) wake_();
  }

  // With the lock held: everything below, except where it says otherwise.

  void adopt(std::shared_ptr<const SceneSnapshot> scene) {
    scene_ = std::move(scene);
    tree_ = ViewTree(*scene_);
    std::map<TileId, std::shared_ptr<Slot>> known_slots;
    for (auto& slot : slots_) known_slots.emplace(slot->tile->id, slot);
    slots_.clear();
    order_.clear();
    for (std::size_t node = 0; node < tree_.nodes().size(); ++node) {
      const auto& tile = tree_.nodes()[node].tile;
      auto slot = std::make_shared<Slot>();
      if (const auto known = known_slots.find(tile->id); known != known_slots.end()) {
        if (known->second->tile == tile) {
          slot = known->second;
        } else {
          slot->held_revision = known->second->held_revision;
          slot->held_name = known->second->held_name;
          abandon(*known->second);
        }
        known_slots.erase(known);
      }
      slot->tile = tile;
      slot->node = node;
      slots_.push_back(std::move(slot));
    }
    for (const auto& [id, slot] : known_slots) {
      remove_from_viewer(*slot);
      abandon(*slot);
    }
    is_complete_due_ = true;
    choose_point();
  }

  void abandon(Slot& slot) {
    put_down(slot);
    slot.is_gone = true;
  }

  void push_removal(TileId tile, std::uint32_t revision) {
    TileFrameHeader header;
    header.kind = FrameKind::Remove;
    header.tile = tile;
    header.revision = revision;
    removed_.push_back(header);
  }

  void remove_from_viewer(Slot& slot) {
    if (slot.held_name != 0) push_removal(slot.tile->id, slot.held_name);
    slot.forget_held();
  }

  void forget_all_held() {
    removed_.clear();
    for (const auto& slot : slots_) {
      put_down(*slot);
      slot->forget_held();
    }
  }

  // Takes a viewer at its word that it holds that geometry; true when it is the one in force. Otherwise it is replaced.
  bool hold_resumed(Slot& slot, std::uint32_t revision) {
    put_down(slot);
    slot.forget_held();
    slot.held_name = revision;
    if (cache_->issued_revision(geometry_key_of(slot.tile, demand_)) != revision) return false;
    slot.held_revision = revision;
    slot.held_vertex_count = static_cast<std::uint32_t>(slot.tile->positions.size());
    slot.held_geometry_epoch = demand_.geometry_epoch;
    slot.held_colour_epoch = kEarlierColourEpoch;
    return true;
  }

  // Decides how a change is answered first; see StreamQuality. Ends in apply().
  void choose_point() {
    point_ = {.pixel_error_factor = 1, .colour_bits = quality_.colour_bits};
    const double rate = window_.rate_bytes_per_s();
    if (quality_.automatic && rate > 0) {
      for (const QualityPoint& point : quality_frontier()) {
        point_ = {point.pixel_error_factor, std::min(point.colour_bits, quality_.colour_bits)};
        const auto selected = selected_tiles(tree_, camera_, quality_.pixel_error * point_.pixel_error_factor);
        const double bytes =
            static_cast<double>(target_vertex_count(selected)) * colour_cost_.bytes_per_vertex(point_.colour_bits);
        if ((bytes / rate + window_.round_trip_s()) * 1e3 <= quality_.latency_target_ms) break;
      }
    }
    apply();
  }

  // Automatic quality: there is a second answer still to come.
  bool is_refining_due() const {
    return demand_.plan && (point_.pixel_error_factor != 1 || point_.colour_bits != quality_.colour_bits);
  }

  void refine() {
    if (!is_refining_due()) return;
    point_ = {.pixel_error_factor = 1, .colour_bits = quality_.colour_bits};
    apply();
  }

  // Brings what is demanded in line with quality, point, camera and scene.
  void apply() {
    const float step = position_step_in_force(wanted_step_m_, scene_->suggested_position_step_m(), scene_->bounds());
    quality_.position_step_m = step;
    if (step != demand_.position_step_m || quality_.encoder_speed != demand_.encoder_speed) {
      demand_.position_step_m = step;
      demand_.encoder_speed = quality_.encoder_speed;
      ++demand_.geometry_epoch;
    }
    if (point_.colour_bits != demand_.colour_bits) {
      demand_.colour_bits = point_.colour_bits;
      ++demand_.colour_epoch;
    }
    select();
    if (head() != nullptr) is_complete_due_ = true;
  }

  void select() {
    ++selection_count_;
    for (const auto& slot : slots_) slot->is_wanted = false;
    const auto selected = selected_tiles(tree_, camera_, quality_.pixel_error * point_.pixel_error_factor);
    order_.clear();
    for (const SelectedTile& tile : selected) {
      const auto& slot = slots_[tile.node];
      slot->is_wanted = true;
      slot->is_target = tile.is_target;
      slot->last_wanted = selection_count_;
      order_.push_back(slot);
    }
    for (const auto& slot : slots_) {
      if (!slot->is_wanted) put_down(*slot);
    }
    choose_previews(target_vertex_count(selected));
    remove_surplus();
    first_ = 0;
  }

  std::uint64_t target_vertex_count(const std::vector<SelectedTile>& selected) const {
    std::uint64_t count = 0;
    for (const SelectedTile& tile : selected) {
      if (tile.is_target) count += tree_.nodes()[tile.node].tile->positions.size();
    }
    return count;
  }

  // The tops always; further levels as far as they cost little, unless everything arrives at once anyway.
  void choose_previews(std::uint64_t target_vertices) {
    const double bytes = static_cast<double>(target_vertices) * colour_cost_.bytes_per_vertex(demand_.colour_bits);
    const double rate = window_.rate_bytes_per_s();
    const bool is_quick = rate > 0 && bytes / rate * 1e3 <= quality_.latency_target_ms;
    const double most = is_quick ? 0 : kPreviewShare * static_cast<double>(target_vertices);
    double preview_vertices = 0;
    std::size_t index = 0;
    while (index < order_.size()) {
      const auto level = order_[index]->tile->id.level;
      std::size_t end = index;
      for (; end < order_.size() && order_[end]->tile->id.level == level; ++end) {
        if (!order_[end]->is_target) preview_vertices += static_cast<double>(order_[end]->tile->positions.size());
      }
      for (; index < end; ++index) {
        order_[index]->is_preview = !tree_.nodes()[order_[index]->node].parent || preview_vertices <= most;
      }
    }
  }

  void remove_surplus() {
    std::uint64_t held_vertices = 0;
    std::vector<Slot*> unused;
    for (const auto& slot : slots_) {
      held_vertices += slot->is_wanted ? slot->tile->positions.size() : slot->held_vertex_count;
      if (!slot->is_wanted && slot->held_vertex_count > 0) unused.push_back(slot.get());
    }
    if (held_vertices <= limits_.held_vertices) return;
    std::sort(unused.begin(), unused.end(),
              [](const Slot* a, const Slot* b) { return a->last_wanted < b->last_wanted; });
    for (Slot* slot : unused) {
      if (held_vertices <= limits_.held_vertices) break;
      held_vertices -= slot->held_vertex_count;
      remove_from_viewer(*slot);
    }
  }

  // A viewer draws the children of a tile in its place when it has them all, whatever colours they have. Beneath a tile
  // that now shows newer colours than they do, and that is fine enough, they would stay in front of it for good.
  void remove_outdated_beneath(const Slot& slot) {
    for (const std::size_t child : tree_.nodes()[slot.node].children) {
      Slot& outdated = *slots_[child];
      if (outdated.held_name != 0 && outdated.held_colour_epoch != demand_.colour_epoch) remove_from_viewer(outdated);
      remove_outdated_beneath(outdated);
    }
  }

  void drop_superseded() {
    for (const auto& slot : order_) {
      if (slot->work != Slot::Work::Ready) continue;
      ++skipped_frame_count_;
      put_down(*slot);
    }
  }

  // Ready -> Idle.
  void put_down(Slot& slot) {
    if (slot.work != Slot::Work::Ready) return;
    prepared_bytes_ -= prepared_size(slot);
    slot.work = Slot::Work::Idle;
    slot.geometry = nullptr;
    slot.colours = nullptr;
  }

  void make_ready(Slot& slot, std::shared_ptr<const EncodedTile> geometry, Payload colours) {
    slot.work = Slot::Work::Ready;
    slot.geometry = std::move(geometry);
    slot.colours = std::move(colours);
    prepared_bytes_ += prepared_size(slot);
  }

  static std::size_t prepared_size(const Slot& slot) {
    return slot.colours->size() + (slot.held_revision == slot.geometry->revision ? 0 : slot.geometry->payload->size());
  }

  bool is_satisfied(const Slot& slot) const {
    if (slot.failed_geometry_epoch == demand_.geometry_epoch) return true;
    if (slot.held_geometry_epoch == demand_.geometry_epoch &&
        (slot.held_colour_epoch == demand_.colour_epoch || slot.failed_colour_epoch == demand_.colour_epoch)) {
      return true;
    }
    return !slot.is_target && !slot.is_preview && is_drawable(slot) && are_children_drawable(slot);
  }

  static bool is_drawable(const Slot& slot) { return slot.held_geometry_epoch != 0 && slot.held_colour_epoch != 0; }

  bool are_children_drawable(const Slot& slot) const {
    const auto& children = tree_.nodes()[slot.node].children;
    return std::all_of(children.begin(), children.end(),
                       [this](std::size_t child) { return is_drawable(*slots_[child]); });
  }

  // What the viewer draws by the REPLACE rule, and the largest error in it.
  void add_accuracy(StreamStats& stats) const {
    const auto& nodes = tree_.nodes();
    std::vector<char> is_covered(nodes.size(), 0);  // By itself or by its children.
    const auto is_replaced = [&](std::size_t index) {
      const auto& children = nodes[index].children;
      return !children.empty() &&
             std::all_of(children.begin(), children.end(), [&](std::size_t child) { return is_covered[child] != 0; });
    };
    for (std::size_t index = nodes.size(); index-- > 0;) {
      is_covered[index] = is_drawable(*slots_[index]) || is_replaced(index) ? 1 : 0;
    }
    std::vector<char> is_passed(nodes.size(), 0);  // Its children are drawn in its place.
    for (std::size_t index = 0; index < nodes.size(); ++index) {
      const ViewTree::Node& node = nodes[index];
      if (is_covered[index] == 0 || (node.parent && is_passed[*node.parent] == 0)) continue;
      if (is_replaced(index)) {
        is_passed[index] = 1;
        continue;
      }
      if (camera_ && !may_be_in_view(*camera_, node.bounds)) continue;
      const auto error_m = static_cast<double>(node.tile->geometric_error_m);
      // Each of three axes may be off by half a step.
      const double rounding_m = static_cast<double>(demand_.position_step_m) / 2 * std::sqrt(3.0);
      stats.position_mm = std::max(stats.position_mm, (error_m + rounding_m) * 1e3);
      if (camera_) {
        const double pixels =
            std::min(screen_error(*camera_, node.bounds, error_m), static_cast<double>(camera_->viewport[1]));
        stats.pixel_error = std::max(stats.pixel_error, pixels);
      }
    }
  }

  // The first tile that is not as it should be; null when there is none, or no settings yet.
  Slot* head() {
    if (!demand_.plan) return nullptr;
    while (first_ < order_.size() && is_satisfied(*order_[first_])) ++first_;
    return first_ < order_.size() ? order_[first_].get() : nullptr;
  }

  bool is_complete() {
    return !closed_ && subscribed_ && is_complete_due_ && demand_.plan && removed_.empty() && head() == nullptr &&
           !is_refining_due();
  }

  bool has_news() {
    if (!subscribed_) return false;
    if (!removed_.empty() || is_complete() || (head() == nullptr && is_refining_due())) return true;
    const Slot* slot = head();
    return slot != nullptr && slot->work == Slot::Work::Ready;
  }

  // Takes what the cache has; leaves the slot idle when anything is missing.
  void look_up(Slot& slot) {
    auto geometry = cache_->find_geometry(geometry_key_of(slot.tile, demand_));
    if (!geometry) return;
    auto colours = cache_->find_colours(colour_key_of(*geometry, demand_));
    if (colours) make_ready(slot, std::move(geometry), std::move(colours));
  }

  // One step of a slot towards Ready: the encoding that the caller has to do for it now, or nothing.
  std::optional<Encoding> advance(const std::shared_ptr<Slot>& slot) {
    if (!is_needed(*slot)) return std::nullopt;
    Encoding encoding{slot, slot->tile, demand_};
    auto geometry = cache_->claim_geometry(encoding.geometry_key(), weak_waiter());
    switch (geometry.kind) {
      case Claim<EncodedTile>::Kind::Ready:
        return advance_colours(std::move(encoding), std::move(geometry.value));
      case Claim<EncodedTile>::Kind::Busy:
        slot->work = Slot::Work::Waiting;
        return std::nullopt;
      case Claim<EncodedTile>::Kind::Yours:
        break;
    }
    slot->work = Slot::Work::Busy;
    return encoding;
  }

  std::optional<Encoding> advance_colours(Encoding encoding, std::shared_ptr<const EncodedTile> geometry) {
    Slot& slot = *encoding.slot;
    encoding.geometry = std::move(geometry);
    auto colours = cache_->claim_colours(encoding.colour_key(), weak_waiter());
    switch (colours.kind) {
      case Claim<std::vector<std::byte>>::Kind::Ready:
        make_ready(slot, std::move(encoding.geometry), std::move(colours.value));
        return std::nullopt;
      case Claim<std::vector<std::byte>>::Kind::Busy:
        slot.work = Slot::Work::Waiting;
        return std::nullopt;
      case Claim<std::vector<std::byte>>::Kind::Yours:
        break;
    }
    slot.work = Slot::Work::Busy;
    return encoding;
  }

  // The next step after one that a job has done. What was made is used from here, not from the cache, which may
  // have had no room for it.
  std::optional<Encoding> advance_after(const Encoding& done) {
    Slot& slot = *done.slot;
    slot.work = Slot::Work::Idle;
    if (!is_needed(slot)) return std::nullopt;
    if (done.demand.geometry_epoch == demand_.geometry_epoch) {
      if (done.made_geometry) return advance_colours({done.slot, done.tile, demand_}, done.made_geometry);
      if (done.made_colours && done.demand.colour_epoch == demand_.colour_epoch) {
        make_ready(slot, done.geometry, done.made_colours);
        return std::nullopt;
      }
      if (done.made_colours) return advance_colours({done.slot, done.tile, demand_}, done.geometry);
    }
    return advance(done.slot);
  }

  bool is_needed(const Slot& slot) const {
    return !closed_ && subscribed_ && !slot.is_gone && slot.is_wanted && !is_satisfied(slot);
  }

  bool may_start(std::size_t index) const {
    const Slot& slot = *order_[index];
    return slot.work == Slot::Work::Idle && (index == first_ || prepared_bytes_ < kPreparedBytes) &&
           !is_satisfied(slot);
  }

  std::optional<Encoding> next_encoding() {
    if (closed_ || !subscribed_ || head() == nullptr) return std::nullopt;
    for (std::size_t index = first_; index < order_.size(); ++index) {
      if (!may_start(index)) continue;
      if (auto encoding = advance(order_[index])) return encoding;
    }
    return std::nullopt;
  }

  // A job is a promise to do whatever is most urgent when its turn comes, so what was superseded while it waited
  // costs nothing, few are enough, and viewers take turns tile by tile.
  void post_jobs() {
    if (closed_ || !subscribed_ || head() == nullptr) return;
    const unsigned most = pool_.thread_count() + 1;
    unsigned startable = 0;
    std::size_t first_startable = 0;
    for (std::size_t index = first_; index < order_.size() && startable < most; ++index) {
      if (!may_start(index)) continue;
      if (startable++ == 0) first_startable = index;
    }
    while (waiting_job_count_ < startable && waiting_job_count_ + running_job_count_ < most) {
      ++waiting_job_count_;
      pool_.post(
          [weak = std::weak_ptr<ViewerStream>(shared_from_this())] {
            if (const auto stream = weak.lock()) static_cast<Stream&>(*stream).run_job();
          },
          order_[first_startable]->tile->id.level);
    }
  }

  std::weak_ptr<CacheWaiter> weak_waiter() {
    return std::shared_ptr<CacheWaiter>(shared_from_this(), static_cast<CacheWaiter*>(this));
  }

  std::optional<OutgoingFrame> next_removal(double now_s) {
    if (!window_.admits(protocol::kTileFrameHeaderSize)) return std::nullopt;
    const TileFrameHeader header = removed_.front();
    removed_.pop_front();
    return given_out(header, nullptr, now_s);
  }

  OutgoingFrame given_out(TileFrameHeader header, Payload payload, double now_s) {
    header.sequence = ++last_sequence_;
    header.payload_size_bytes = payload ? static_cast<std::uint32_t>(payload->size()) : 0;
    OutgoingFrame frame{protocol::encoded_header(header), std::move(payload)};
    window_.on_sent(header.sequence, frame.size_bytes(), now_s);
    return frame;
  }

  static std::size_t frame_size(const Payload& payload) { return protocol::kTileFrameHeaderSize + payload->size(); }

  static TileFrameHeader header_of(const Slot& slot, FrameKind kind) {
    TileFrameHeader header;
    header.kind = kind;
    header.child_mask = slot.tile->child_mask;
    header.tile = slot.tile->id;
    header.revision = slot.held_name;
    header.vertex_count = static_cast<std::uint32_t>(slot.geometry->input_of_decoded.size());
    header.origin_m = slot.geometry->origin_m;
    header.position_step_m = slot.geometry->position_step_m;
    header.geometric_error_m = slot.tile->geometric_error_m;
    header.lowest_celsius = slot.tile->lowest_celsius;
    header.highest_celsius = slot.tile->highest_celsius;
    return header;
  }

  // Without the lock: a job, on a worker.
  void run_job() {
    std::optional<Encoding> encoding;
    {
      const std::lock_guard lock(mutex_);
      --waiting_job_count_;
      ++running_job_count_;
      encoding = next_encoding();
    }
    while (encoding) {
      encode(*encoding);
      const std::lock_guard lock(mutex_);
      if (!encoding->made_geometry && !encoding->made_colours) note_failure(*encoding);
      encoding = advance_after(*encoding);
    }
    change([&] { --running_job_count_; });
  }

  // Without the lock: encodes and puts the result into the cache, too.
  void encode(Encoding& encoding) {
    const Demand& demand = encoding.demand;
    std::string reason;
    try {
      if (!encoding.geometry) {
        auto result = encoded_tile(*encoding.tile, demand.position_step_m, demand.encoder_speed);
        if (result.has_value()) {
          encoding.made_geometry = cache_->store_geometry(encoding.geometry_key(), std::move(result).value());
          return;
        }
        reason = result.error().message;
      } else {
        auto result = encoded_tile_colours(*encoding.tile, *encoding.geometry, *demand.plan, demand.colour_bits,
                                           demand.encoder_speed, demand.colour_transform);
        if (result.has_value()) {
          encoding.made_colours = std::move(result).value();
          cache_->store_colours(encoding.colour_key(), encoding.made_colours);
          return;
        }
        reason = result.error().message;
      }
    } catch (const std::exception& exception) {
      reason = exception.what();
    }
    if (encoding.geometry) {
      cache_->abandon_colours(encoding.colour_key());
    } else {
      cache_->abandon_geometry(encoding.geometry_key());
    }
    if (cache_->is_first_failure(Identity(encoding.tile))) {
      const TileId id = encoding.tile->id;
      spdlog::error("tile {}/{}/{}/{} cannot be encoded and is left out: {}", id.level, id.x, id.y, id.z, reason);
    }
  }

  void note_failure(const Encoding& encoding) {
    ++failed_tile_count_;
    if (encoding.geometry) {
      encoding.slot->failed_colour_epoch = encoding.demand.colour_epoch;
    } else {
      encoding.slot->failed_geometry_epoch = encoding.demand.geometry_epoch;
    }
  }

  const std::shared_ptr<FrameCache::State> cache_;
  WorkerPool& pool_;
  const StreamLimits limits_;

  std::mutex wake_mutex_;
  std::function<void()> wake_;
  std::atomic<bool> wake_pending_{false};

  mutable std::mutex mutex_;
  bool closed_ = false;
  bool subscribed_ = false;
  bool is_complete_due_ = false;
  std::shared_ptr<const SceneSnapshot> scene_;
  ViewTree tree_;
  std::vector<std::shared_ptr<Slot>> slots_;  // Of each node of the tree.
  std::vector<std::shared_ptr<Slot>> order_;  // The wanted ones, as they are to be sent.
  std::size_t first_ = 0;                     // Everything in order_ before it is satisfied.
  std::deque<TileFrameHeader> removed_;
  StreamQuality quality_;
  float wanted_step_m_ = 0;
  std::optional<Camera> camera_;
  QualityPoint point_;
  ColourCost colour_cost_;
  Demand demand_;
  std::uint64_t selection_count_ = 0;
  std::uint32_t generation_ = 0;
  std::uint32_t last_sequence_ = 0;
  SendingWindow window_;
  std::size_t prepared_bytes_ = 0;
  unsigned waiting_job_count_ = 0;
  unsigned running_job_count_ = 0;
  std::uint64_t skipped_frame_count_ = 0;
  std::uint64_t failed_tile_count_ = 0;
};

}  // namespace

std::shared_ptr<ViewerStream> ViewerStream::create(std::shared_ptr<const SceneSnapshot> scene, FrameCache& cache,
                                                   WorkerPool& pool, std::function<void()> wake, StreamLimits limits) {
  return std::make_shared<Stream>(std::move(scene), cache.state(), pool, std::move(wake), limits);
}

}  // namespace spectra::server
