#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "fusion/fusion_plan.hpp"
#include "fusion/settings.hpp"
#include "protocol/tile_frame.hpp"
#include "server/jobs/worker_pool.hpp"
#include "server/map/scene_snapshot.hpp"

namespace spectra::stream {

/// The knobs of PROTOCOL quality.set, as in force.
///
/// In automatic mode colour_bits and pixel_error are what a viewer gets in the end. Each change of the settings is first
/// answered at the finest point of a frontier (coarser colours, then larger pixel errors) that is expected to arrive
/// within latency_target_ms at the measured rate; when that is delivered and nothing newer has come, the rest follows.
struct StreamQuality {
  bool automatic = false;
  float position_step_m = 0;  ///< Always a lattice_step(); 0 = the scene's suggestion.
  int colour_bits = 8;
  double pixel_error = 1;
  int encoder_speed = 7;
  double latency_target_ms = 200;
  bool marks = false;  ///< Where the method highlights something, colours carry which vertices.
  friend bool operator==(const StreamQuality&, const StreamQuality&) = default;
};

/// The largest step <= `wanted_m` of the form m * 2^e with m in 4..7, so that lattice * step is exact in float.
float lattice_step(double wanted_m);

/// Where a viewer looks from; metres relative to the scene origin.
struct Camera {
  base::Vec3f eye, target, up;
  double fov_y_deg = 50;
  std::array<int, 2> viewport{1280, 720};
};

/// A frame ready to be written: a header of this connection's own and a payload shared by all viewers.
struct OutgoingFrame {
  std::array<std::byte, protocol::kTileFrameHeaderSize> header;
  std::shared_ptr<const std::vector<std::byte>> payload;  ///< May be null (remove).
  std::size_t size_bytes() const { return header.size() + (payload ? payload->size() : 0); }
};

/// stream.complete of the protocol.
struct StreamComplete {
  std::uint32_t generation = 0;
  std::uint32_t scene_revision = 0;
  std::uint32_t tile_count = 0;
  std::uint64_t vertex_count = 0;
};

/// stream.stats of the protocol, without what only the connection knows.
struct StreamStats {
  double round_trip_ms = 0;
  double throughput_bytes_per_s = 0;
  std::uint64_t queued_bytes = 0;
  std::uint64_t skipped_frames = 0;
  std::uint64_t failed_tiles = 0;  ///< Tiles that could not be encoded; the log names them.
  double position_mm = 0;          ///< The accuracy of what the viewer can draw now: largest distance to the full mesh,
  int colour_levels = 256;         ///< levels per channel that can be told apart, by rounding and by coarse tiles,
  double pixel_error = 0;          ///< the largest distance in pixels within the view; 0 before the first camera, and
  std::optional<double> temperature_celsius;  ///< what temperatures are off, 95th percentile; nothing without any.
};

/// What a viewer says of itself in scene.subscribe.
struct Subscription {
  std::size_t in_flight_bytes = 0;  ///< Bounds the sending window; 0 = our choice (which is also the largest).
  /// Most bytes of decoded tiles, see decoded_bytes(). Tiles not looked at for longest are removed, and what the camera
  /// asks for is refined no further than fits, where its lack is seen most first; the tops of the tree are always sent.
  /// 0 = kCacheBytes for what is left over from earlier cameras, and no bound to what the present one asks for.
  std::uint64_t cache_bytes = 0;
  protocol::ColourTransform colour_transform = protocol::ColourTransform::None;  ///< Of visible colours, too.
  bool fused = true;  ///< Colours by the plan; without, tiles come as geometry and raw layers.
  /// Raw layers come after everything else, hottest and nearest first, and the visible colours after the temperatures of a tile.
  bool temperature = false;
  bool visible = false;
  bool temperature_sigma = false;       ///< Comes as the raw layers do, after them.
  double temperature_step_celsius = 0;  ///< 0 = the default.

  static constexpr std::uint64_t kCacheBytes = 256u << 20;
};

/// A tile that a viewer still has from an earlier connection, geometry and colours.
struct ResumedTile {
  protocol::TileId tile;
  std::uint32_t revision = 0;
  bool has_raw_layers = false;  ///< Temperatures and visible colours, in the form that it subscribes to.
};

struct EncodingTimes;

/// Encoded geometry and colours, each made once and shared by every viewer with the same need; bounded in bytes, the
/// least recently used goes first. Thread-safe. One for the whole server.
class FrameCache {
 public:
  explicit FrameCache(std::size_t capacity_bytes);
  ~FrameCache();
  std::size_t size_bytes() const;
  std::uint64_t hit_count() const;   ///< Colour frames that were there when a viewer needed them.
  std::uint64_t miss_count() const;  ///< Encodings (geometry or colours) that had to be made.
  const EncodingTimes& times() const;

  struct State;  ///< Seen by server/stream only; outlives the cache while a job of a stream still uses it.
  const std::shared_ptr<State>& state() { return state_; }

 private:
  std::shared_ptr<State> state_;
};

/// What one viewer is sent: decides the order, asks the cache and the workers for frames, keeps to the sending window,
/// and lets the newest settings overtake what is not yet on the wire. It has no socket and no clock of its own: the session
/// calls it on its strand, writes what next_frame() gives, and is woken when there may be more.
class ViewerStream : public std::enable_shared_from_this<ViewerStream> {
 public:
  /// `wake` is called from any thread whenever next_frame() or take_complete() may have something new; it must only
  /// post to the session's strand. It is not called after close().
  static std::shared_ptr<ViewerStream> create(std::shared_ptr<const map::SceneSnapshot> scene, FrameCache& cache,
                                              jobs::WorkerPool& pool, std::function<void()> wake);
  virtual ~ViewerStream() = default;

  virtual void close() = 0;

  /// A scene that replaces the current one: tiles that are gone get remove frames, changed ones new geometry.
  virtual void set_scene(std::shared_ptr<const map::SceneSnapshot> scene) = 0;

  /// Starts sending. A later call replaces the subscription; what was sent with another transform or step is sent anew, what
  /// the viewer has is not, nor is geometry.
  virtual void subscribe(const Subscription& subscription) = 0;
  virtual void unsubscribe() = 0;

  /// Called before subscribe(): tiles that the viewer says it holds from an earlier stream on the same cache. What is
  /// still current (the revision was issued for that tile, with the position step and encoder speed in force) is not sent
  /// again, its colours are, as after a change of the settings; what is not is replaced, and what is gone is removed.
  /// Returns how many are current; when none is, everything is sent as to a viewer who holds nothing. Safe on untrusted
  /// input: a false claim spoils only the picture of the viewer who makes it.
  virtual std::uint32_t resume(std::span<const ResumedTile> tiles) = 0;

  /// A plan made (on a worker) with the reference_temperature() of the current scene; returns the generation its colours will carry, from 1.
  virtual std::uint32_t set_plan(fusion::FusionPlan plan) = 0;
  virtual std::uint32_t generation() const = 0;
  /// What time it is, Unix seconds: called before everything else, and now and then. What is faded by its age is sent anew, in the
  /// same generation, where a step of it has passed; without such a step it costs nothing.
  virtual void set_time(double now_s) = 0;
  virtual void set_quality(const StreamQuality& quality) = 0;
  virtual const StreamQuality& quality() const = 0;
  /// Chooses the tiles: see selected_tiles(). A camera that makes no sense (not finite, no direction) is ignored.
  virtual void set_camera(const Camera& camera) = 0;

  /// stream.ack; a sequence that was never sent, or an older one than before, is ignored. `now_s` is a steady clock.
  virtual void acknowledge(std::uint32_t sequence, double now_s) = 0;

  /// The next frame the window lets through, or nothing now. Sequence numbers rise by one.
  virtual std::optional<OutgoingFrame> next_frame(double now_s) = 0;

  /// Once after everything that the newest settings, quality, camera and scene ask for has been given out by
  /// next_frame(); raw layers count only for a viewer who is not given fused colours. The counts are of the tiles that show the newest generation; a tile whose place is taken by its
  /// children may be left with older colours until it is needed again.
  virtual std::optional<StreamComplete> take_complete() = 0;

  virtual StreamStats stats() const = 0;
};

}  // namespace spectra::stream
