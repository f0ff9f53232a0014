#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <list>
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
#include "server/stream/tile_encoder.hpp"
#include "server/stream/viewer_stream.hpp"

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

/// Told when something that was being made by somebody else is there (or has failed): time to look again.
class CacheWaiter {
 public:
  virtual void cache_changed() = 0;

 protected:
  ~CacheWaiter() = default;
};

/// What a claim() found.
template <class Value>
struct Claim {
  enum class Kind {
    Ready,  ///< `value` is it.
    Yours,  ///< The caller must make it, then store() or abandon() it.
    Busy,   ///< Somebody else makes it; the waiter will be told.
  };
  Kind kind;
  std::shared_ptr<const Value> value;
};

/// Values made at most once at a time and kept in order of last use. Not thread-safe on its own.
template <class Key, class Value>
class Shelf {
 public:
  using Waiters = std::vector<std::weak_ptr<CacheWaiter>>;

  /// The value, moved to the recently used end; null when absent or still being made.
  std::shared_ptr<const Value> find(const Key& key) {
    const auto found = entries_.find(key);
    if (found == entries_.end() || !found->second.value) return nullptr;
    by_use_.splice(by_use_.end(), by_use_, found->second.place);
    return found->second.value;
  }

  Claim<Value> claim(const Key& key, const std::weak_ptr<CacheWaiter>& waiter) {
    if (auto value = find(key)) return {Claim<Value>::Kind::Ready, std::move(value)};
    const auto [entry, is_new] = entries_.try_emplace(key);
    if (is_new) return {Claim<Value>::Kind::Yours, nullptr};
    entry->second.waiters.push_back(waiter);
    return {Claim<Value>::Kind::Busy, nullptr};
  }

  /// Ends a claim; returns who waits for it.
  Waiters store(const Key& key, std::shared_ptr<const Value> value, std::size_t size_bytes) {
    const auto entry = entries_.find(key);
    entry->second.value = std::move(value);
    entry->second.size_bytes = size_bytes;
    entry->second.place = by_use_.insert(by_use_.end(), entry);
    size_bytes_ += size_bytes;
    return std::exchange(entry->second.waiters, {});
  }

  /// Ends a claim without a value; returns who waits for it.
  Waiters abandon(const Key& key) {
    const auto entry = entries_.find(key);
    Waiters waiters = std::move(entry->second.waiters);
    entries_.erase(entry);
    return waiters;
  }

  bool empty() const { return by_use_.empty(); }
  std::size_t size_bytes() const { return size_bytes_; }

  void evict_least_recent() { evict(by_use_.begin()); }

  /// Evicts all values for which `is_useless(key, value)`.
  template <class Predicate>
  void evict_if(Predicate is_useless) {
    for (auto place = by_use_.begin(); place != by_use_.end();) {
      const auto next = std::next(place);
      if (is_useless((*place)->first, *(*place)->second.value)) evict(place);
      place = next;
    }
  }

 private:
  struct Entry;
  using Entries = std::map<Key, Entry>;
  struct Entry {
    std::shared_ptr<const Value> value;  // Null while it is being made; only then there are waiters.
    Waiters waiters;
    std::size_t size_bytes = 0;
    typename std::list<typename Entries::iterator>::iterator place;
  };

  void evict(typename std::list<typename Entries::iterator>::iterator place) {
    const auto entry = *place;
    by_use_.erase(place);
    size_bytes_ -= entry->second.size_bytes;
    entries_.erase(entry);
  }

  Entries entries_;
  std::list<typename Entries::iterator> by_use_;
  std::size_t size_bytes_ = 0;
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

  /// The revision of the newest encoding under that key, whether it is still kept or not; nothing when there was none,
  /// or when it is too long ago.
  std::optional<std::uint32_t> issued_revision(const GeometryKey& key) const;

  /// A number that names no encoding and never will: for a viewer to whom an encoding must go under another name.
  std::uint32_t unused_revision();

  /// Counts a tile that cannot be encoded; true the first time that this tile fails.
  bool is_first_failure(const Identity& tile);

  std::size_t size_bytes() const;
  std::uint64_t hit_count() const;
  std::uint64_t miss_count() const;

  EncodingTimes times;

 private:
  struct Issued {
    std::uint32_t revision;
    std::uint64_t digest;
  };

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
