#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "server/stream/duration_histogram.hpp"
#include "server/stream/frame_cache.hpp"
#include "server/stream/shelf.hpp"
#include "server/stream/tile_encoder.hpp"

namespace spectra::stream {

/// Which object, by ownership: stays different from every other object even after the object has died and another stands
/// at its address.
class Identity {
 public:
  template <class T>
  explicit Identity(const std::shared_ptr<const T>& object) : owner_(object), address_(object.get()) {}
  bool expired() const { return owner_.expired(); }
  friend bool operator<(const Identity& a, const Identity& b) {
    if (a.owner_.owner_before(b.owner_)) return true;
    if (b.owner_.owner_before(a.owner_)) return false;
    return std::less<>()(a.address_, b.address_);
  }

 private:
  std::weak_ptr<const void> owner_;
  const void* address_;
};

/// Names one geometry encoding before it exists.
struct GeometryKey {
  Identity tile;
  float position_step_m;
  int encoder_speed;
  friend bool operator<(const GeometryKey& a, const GeometryKey& b) {
    if (a.tile < b.tile) return true;
    if (b.tile < a.tile) return false;
    return std::tie(a.position_step_m, a.encoder_speed) < std::tie(b.position_step_m, b.encoder_speed);
  }
};

/// One per distinct picture (settings and the scene's facts that enter them); compared by address.
struct PlanIdentity {};

/// What a layer of a tile holds.
enum class Layer { Fused, Visible, Temperature, TemperatureSigma };

/// Names the encoding of a layer before it exists, by what it shows. The encoder speed is that of the geometry.
struct ColourKey {
  std::uint32_t revision;
  std::shared_ptr<const PlanIdentity> plan;  ///< Of Fused.
  int colour_bits;
  protocol::ColourTransform transform = protocol::ColourTransform::None;
  bool has_marks = false;
  Layer layer = Layer::Fused;
  double step_celsius = 0;  ///< Of Temperature.
  TileLook look = {};       ///< Of Fused.
  friend bool operator<(const ColourKey& a, const ColourKey& b) {
    return std::tie(a.revision, a.plan, a.colour_bits, a.transform, a.has_marks, a.layer, a.step_celsius, a.look) <
           std::tie(b.revision, b.plan, b.colour_bits, b.transform, b.has_marks, b.layer, b.step_celsius, b.look);
  }
};

/// What viewers use of the cache. Every member function is thread-safe and short: encoding happens between a claim
/// and its end, with no lock held. Waiters are called from the thread that ends the claim, again without a lock.
struct FrameCache::State {
  explicit State(std::size_t capacity_bytes);

  std::shared_ptr<const EncodedTile> find_geometry(const GeometryKey& key);
  Claim<EncodedTile> claim_geometry(const GeometryKey& key, const std::weak_ptr<CacheWaiter>& waiter);
  /// Gives the encoding its revision: the one this key had before when the bytes are the same again (the encoder is
  /// deterministic, so an evicted geometry comes back as itself), else a new one.
  std::shared_ptr<const EncodedTile> store_geometry(const GeometryKey& key, EncodedTile geometry);
  void abandon_geometry(const GeometryKey& key);

  Payload find_colours(const ColourKey& key);
  Claim<std::vector<std::byte>> claim_colours(const ColourKey& key, const std::weak_ptr<CacheWaiter>& waiter);
  void store_colours(const ColourKey& key, Payload payload);
  void abandon_colours(const ColourKey& key);

  /// The same object for plans of the same settings that were prepared with the same temperatures, as long as anybody holds it.
  std::shared_ptr<const PlanIdentity> plan_identity(
      const fusion::FusionPlan& plan, const std::shared_ptr<const fusion::SceneTemperature>& prepared_with);

  /// An encoding that was given out.
  struct Issued {
    std::uint32_t revision = 0;
    std::uint64_t digest = 0;
    std::uint32_t vertex_count = 0;  ///< As decoded.
  };
  /// The newest one under that key, whether it is still kept or not; nothing when there was none, or when it is too long ago.
  std::optional<Issued> issued(const GeometryKey& key) const;

  /// A number that names no encoding and never will: for a viewer to whom an encoding must go under another name.
  std::uint32_t unused_revision();

  /// Counts a tile that cannot be encoded; true the first time that this tile fails.
  bool is_first_failure(const Identity& tile);

  std::size_t size_bytes() const;
  std::uint64_t hit_count() const;
  std::uint64_t miss_count() const;

  EncodingTimes times;

 private:
  void evict_surplus();
  /// A tile that is part of no version of a map any more is not asked for again.
  void forget_what_is_gone();

  const std::size_t capacity_bytes_;
  mutable std::mutex mutex_;
  Shelf<GeometryKey, EncodedTile> geometry_;
  Shelf<ColourKey, std::vector<std::byte>> colours_;
  std::map<GeometryKey, Issued> issued_;
  std::map<std::pair<Identity, std::string>, std::weak_ptr<const PlanIdentity>> plans_;
  std::set<Identity> failed_tiles_;
  std::uint32_t last_revision_;
  std::uint64_t hit_count_ = 0;
  std::uint64_t miss_count_ = 0;
  unsigned stored_since_pruning_ = 0;
};

}  // namespace spectra::stream
