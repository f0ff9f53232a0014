#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "fusion/fusion_plan.hpp"
#include "server/jobs/worker_pool.hpp"
#include "server/map/scene_snapshot.hpp"
#include "server/stream/camera.hpp"
#include "server/stream/demand.hpp"
#include "server/stream/frame_cache.hpp"
#include "server/stream/outgoing_frame.hpp"
#include "server/stream/quality_frontier.hpp"
#include "server/stream/raw_lane.hpp"
#include "server/stream/sending_order.hpp"
#include "server/stream/sending_window.hpp"
#include "server/stream/slot_preparation.hpp"
#include "server/stream/stream_quality.hpp"
#include "server/stream/stream_report.hpp"
#include "server/stream/subscription.hpp"
#include "server/stream/urgent_budget.hpp"
#include "server/stream/view_selection.hpp"
#include "server/stream/viewer_tiles.hpp"

namespace spectra::stream {

/// What one viewer is sent: decides the order, asks the cache and the workers for frames, keeps to the sending window,
/// and lets the newest settings overtake what is not yet on the wire. It has no socket and no clock of its own: the session
/// calls it on its strand, writes what next_frame() gives, and is woken when there may be more.
/// Ties together what the viewer asks for (quality, camera, settings: the demand), what it has (ViewerTiles), what comes
/// next (SendingOrder), who makes it (SlotPreparation, on the pool) and how much may be on its way (SendingWindow). One lock
/// guards them all.
class ViewerStream final : public std::enable_shared_from_this<ViewerStream>, private CacheWaiter {
 public:
  /// `wake` is called from any thread whenever next_frame() or take_complete() may have something new; it must only
  /// post to the session's strand. It is not called after close().
  static std::shared_ptr<ViewerStream> create(std::shared_ptr<const map::SceneSnapshot> scene, FrameCache& cache,
                                              jobs::WorkerPool& pool, std::function<void()> wake);

  void close();

  /// A scene that replaces the current one: tiles that are gone get remove frames, changed ones new geometry.
  void set_scene(std::shared_ptr<const map::SceneSnapshot> scene);

  /// Starts sending. A later call replaces the subscription; what was sent with another transform or step is sent anew, what
  /// the viewer has is not, nor is geometry.
  void subscribe(const Subscription& subscription);
  void unsubscribe();

  /// Called before subscribe(): tiles that the viewer says it holds from an earlier stream on the same cache. What is
  /// still current (the revision was issued for that tile, with the position step and encoder speed in force) is not sent
  /// again; what is not is replaced, and what is gone is removed. Colours are sent again, as after a change of the settings, but
  /// those of which the viewer says in which frame they came, and `memory`, what that stream had given out, says that they
  /// were as demanded now. When nothing is current, everything is sent as to a viewer who holds nothing. Safe on untrusted
  /// input: a false claim spoils only the picture of the viewer who makes it.
  Resumed resume(std::span<const ResumedTile> tiles, const ViewerMemory& memory = {});
  /// What has been given out, for the stream that goes on after this one.
  ViewerMemory memory() const;

  /// A plan made (on a worker) with the reference_temperature() of the current scene; returns the generation its colours will carry, from 1.
  std::uint32_t set_plan(fusion::FusionPlan plan);
  std::uint32_t generation() const;
  /// What time it is, Unix seconds: called before everything else, and now and then. What is faded by its age is sent anew, in the
  /// same generation, where a step of it has passed; without such a step it costs nothing.
  void set_time(double now_s);
  void set_quality(const StreamQuality& quality);
  const StreamQuality& quality() const { return quality_; }
  /// Chooses the tiles: see selected_tiles(). A camera that makes no sense (not finite, no direction) is ignored.
  void set_camera(const Camera& camera);

  /// stream.ack; a sequence that was never sent, or an older one than before, is ignored. `now_s` is a steady clock.
  void acknowledge(std::uint32_t sequence, double now_s);

  /// The next frame the window lets through, or nothing now. Sequence numbers rise by one.
  std::optional<OutgoingFrame> next_frame(double now_s);

  /// Once after everything that the newest settings, quality, camera and scene ask for has been given out by
  /// next_frame(); raw layers count only for a viewer who is not given fused colours. The counts are of the tiles that show
  /// the newest generation; a tile whose place is taken by its children may be left with older colours until it is needed again.
  std::optional<StreamComplete> take_complete();

  StreamStats stats() const;

 private:
  ViewerStream(std::shared_ptr<const map::SceneSnapshot> scene, std::shared_ptr<FrameCache::State> cache,
               jobs::WorkerPool& pool, std::function<void()> wake);

  // With the lock not held.
  void cache_changed() override;
  /// Every change of what is demanded or held goes through here: superseded frames are dropped, and what was sent is looked at again.
  void change(const std::function<void()>& action);
  /// With what else has happened: afterwards jobs are posted for what is missing, and the session is woken when there is something for it.
  void go_on(const std::function<void()>& action);
  /// `is_followed`: raw layers have waited for it.
  std::optional<StreamComplete> completed(bool& is_followed);
  void wake();
  /// A job, on a worker.
  void run_job();

  // With the lock held: what is demanded.
  void adopt(std::shared_ptr<const map::SceneSnapshot> scene);
  void take_channels(const Subscription& subscription);
  /// How many of the tiles that are wanted look otherwise now.
  std::size_t take_looks();
  /// Something has changed: the first answer may be coarser than the last; see StreamQuality.
  void answer_first();
  /// There is a second answer still to come.
  bool is_refining_due() const;
  void refine();
  /// Brings what is demanded in line with quality, point, camera and scene.
  void apply();
  std::vector<SelectedTile> selected(double pixel_error) const;
  void remove_surplus();
  void select();
  /// Beneath tiles that have become fine enough when they had their colours already.
  void remove_outdated();
  void drop_superseded();
  /// Tiles that were as they should be may be so no more.
  void look_again();
  /// The first tile that is not as it should be; null when there is none, or no settings yet.
  TileSlot* head();
  bool is_complete();
  bool has_news();

  // With the lock held: what goes out, and who makes it (viewer_stream_sending.cpp).
  /// What a Ready slot gives: a frame, nothing yet because of the window, or nothing at all.
  struct Attempt {
    std::optional<OutgoingFrame> frame;
    bool is_held_up = false;
  };
  Attempt next_geometry(TileSlot& slot, double now_s);
  Attempt next_colours(TileSlot& slot, double now_s);
  /// A tile's geometry has gone out and is the one in force.
  void note_geometry(TileSlot& slot);
  std::optional<OutgoingFrame> next_raw(const RawLane::Due& due, double now_s);
  protocol::FrameKind raw_frame_kind(std::size_t layer) const;
  std::optional<OutgoingFrame> next_removal(double now_s);
  OutgoingFrame given_out(protocol::TileFrameHeader header, Payload payload, double now_s);
  bool may_work() const { return !closed_ && subscribed_; }
  bool is_needed(const TileSlot& slot) const;
  bool may_start(std::size_t index) const;
  std::optional<Encoding> next_encoding();
  std::optional<Encoding> encoding_after(const Encoding& done);
  void note_failure(const Encoding& encoding);
  /// A job is a promise to do whatever is most urgent when its turn comes, so what was superseded while it waited
  /// costs nothing, few are enough, and viewers take turns tile by tile.
  void post_jobs();
  std::weak_ptr<CacheWaiter> weak_waiter();

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

}  // namespace spectra::stream
