#include "server/stream/frame_cache_state.hpp"

#include <cstdio>
#include <functional>
#include <random>
#include <string_view>
#include <variant>

namespace spectra::stream {
namespace {

// Map nodes, list nodes, control blocks and vector heads of one entry, roughly.
constexpr std::size_t kEntryOverheadBytes = 400;
constexpr std::size_t kMostIssuedRevisions = 65'536;
constexpr std::size_t kMostPlansBeforePruning = 1024;
/// After so many new geometries those of tiles that are gone are looked for.
constexpr unsigned kStoredBeforePruning = 64;

template <class T>
std::string_view bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

std::uint64_t digest_of(const EncodedTile& geometry) {
  const std::hash<std::string_view> hash;
  return hash(bytes_of(*geometry.payload)) ^ (hash(bytes_of(geometry.input_of_decoded)) * 0x9e3779b97f4a7c15u);
}

void append_exact(std::string& text, double value) {
  char buffer[40];
  std::snprintf(buffer, sizeof buffer, "%a;", value);
  text += buffer;
}

std::string picture_text(const fusion::FusionPlan& plan) {
  // How old what is: the look of a tile says that.
  fusion::FusionSettings settings = plan.settings();
  settings.age = {};
  std::string text = fusion::cache_key(settings) + '\n';
  append_exact(text, plan.range_minimum());
  append_exact(text, plan.range_maximum());
  for (const auto& [name, value] : plan.params_in_force()) {
    if (const auto* number = std::get_if<double>(&value)) append_exact(text += name, *number);
  }
  for (const fusion::TemperatureInterval& interval : plan.highlighted()) {
    append_exact(text, interval.low);
    append_exact(text, interval.high);
  }
  return text;
}

void tell(const std::vector<std::weak_ptr<CacheWaiter>>& waiters) {
  for (const auto& waiter : waiters) {
    if (const auto alive = waiter.lock()) alive->cache_changed();
  }
}

}  // namespace

FrameCache::FrameCache(std::size_t capacity_bytes) : state_(std::make_shared<State>(capacity_bytes)) {}
FrameCache::~FrameCache() = default;
std::size_t FrameCache::size_bytes() const {
  return state_->size_bytes();
}
std::uint64_t FrameCache::hit_count() const {
  return state_->hit_count();
}
std::uint64_t FrameCache::miss_count() const {
  return state_->miss_count();
}

const EncodingTimes& FrameCache::times() const {
  return state_->times;
}

// Revisions start somewhere else in each run of the server, so that a viewer who comes back after a restart with
// revisions of the last run does not name encodings of this one by accident.
FrameCache::State::State(std::size_t capacity_bytes)
    : capacity_bytes_(capacity_bytes), last_revision_(std::random_device()() & 0x3fff'ffffU) {}

std::shared_ptr<const EncodedTile> FrameCache::State::find_geometry(const GeometryKey& key) {
  const std::lock_guard lock(mutex_);
  return geometry_.find(key);
}

Claim<EncodedTile> FrameCache::State::claim_geometry(const GeometryKey& key, const std::weak_ptr<CacheWaiter>& waiter) {
  const std::lock_guard lock(mutex_);
  auto claim = geometry_.claim(key, waiter);
  if (claim.kind == Claim<EncodedTile>::Kind::Yours) ++miss_count_;
  return claim;
}

std::shared_ptr<const EncodedTile> FrameCache::State::store_geometry(const GeometryKey& key, EncodedTile geometry) {
  const std::uint64_t digest = digest_of(geometry);
  const std::size_t size_bytes =
      geometry.payload->size() + geometry.input_of_decoded.size() * sizeof(std::uint32_t) + kEntryOverheadBytes;
  auto value = std::make_shared<EncodedTile>(std::move(geometry));
  std::vector<std::weak_ptr<CacheWaiter>> waiters;
  {
    const std::lock_guard lock(mutex_);
    if (++stored_since_pruning_ >= kStoredBeforePruning) forget_what_is_gone();
    // Forgetting is safe: a geometry that comes back is then sent again under a new revision.
    if (issued_.size() >= kMostIssuedRevisions) issued_.clear();
    const auto [issued, is_new] = issued_.try_emplace(key);
    if (is_new || issued->second.digest != digest) {
      issued->second = {++last_revision_, digest, static_cast<std::uint32_t>(value->input_of_decoded.size())};
    }
    value->revision = issued->second.revision;
    waiters = geometry_.store(key, value, size_bytes);
    evict_surplus();
  }
  tell(waiters);
  return value;
}

void FrameCache::State::abandon_geometry(const GeometryKey& key) {
  std::unique_lock lock(mutex_);
  const auto waiters = geometry_.abandon(key);
  lock.unlock();
  tell(waiters);
}

Payload FrameCache::State::find_colours(const ColourKey& key) {
  const std::lock_guard lock(mutex_);
  auto payload = colours_.find(key);
  if (payload) ++hit_count_;
  return payload;
}

Claim<std::vector<std::byte>> FrameCache::State::claim_colours(const ColourKey& key,
                                                               const std::weak_ptr<CacheWaiter>& waiter) {
  const std::lock_guard lock(mutex_);
  auto claim = colours_.claim(key, waiter);
  if (claim.kind == Claim<std::vector<std::byte>>::Kind::Ready) ++hit_count_;
  if (claim.kind == Claim<std::vector<std::byte>>::Kind::Yours) ++miss_count_;
  return claim;
}

void FrameCache::State::store_colours(const ColourKey& key, Payload payload) {
  std::unique_lock lock(mutex_);
  const std::size_t size_bytes = payload->size() + kEntryOverheadBytes;
  const auto waiters = colours_.store(key, std::move(payload), size_bytes);
  evict_surplus();
  lock.unlock();
  tell(waiters);
}

void FrameCache::State::abandon_colours(const ColourKey& key) {
  std::unique_lock lock(mutex_);
  const auto waiters = colours_.abandon(key);
  lock.unlock();
  tell(waiters);
}

std::shared_ptr<const PlanIdentity> FrameCache::State::plan_identity(
    const fusion::FusionPlan& plan, const std::shared_ptr<const fusion::SceneTemperature>& prepared_with) {
  std::pair key(Identity(prepared_with), picture_text(plan));
  const std::lock_guard lock(mutex_);
  if (plans_.size() >= kMostPlansBeforePruning) {
    std::erase_if(plans_, [](const auto& item) { return item.second.expired(); });
  }
  std::weak_ptr<const PlanIdentity>& known = plans_[std::move(key)];
  auto identity = known.lock();
  if (!identity) known = identity = std::make_shared<const PlanIdentity>();
  return identity;
}

std::optional<FrameCache::State::Issued> FrameCache::State::issued(const GeometryKey& key) const {
  const std::lock_guard lock(mutex_);
  const auto found = issued_.find(key);
  return found == issued_.end() ? std::nullopt : std::optional(found->second);
}

std::uint32_t FrameCache::State::unused_revision() {
  const std::lock_guard lock(mutex_);
  return ++last_revision_;
}

bool FrameCache::State::is_first_failure(const Identity& tile) {
  const std::lock_guard lock(mutex_);
  std::erase_if(failed_tiles_, [](const Identity& known) { return known.expired(); });
  return failed_tiles_.insert(tile).second;
}

std::size_t FrameCache::State::size_bytes() const {
  const std::lock_guard lock(mutex_);
  return geometry_.size_bytes() + colours_.size_bytes();
}

std::uint64_t FrameCache::State::hit_count() const {
  const std::lock_guard lock(mutex_);
  return hit_count_;
}

std::uint64_t FrameCache::State::miss_count() const {
  const std::lock_guard lock(mutex_);
  return miss_count_;
}

void FrameCache::State::forget_what_is_gone() {
  stored_since_pruning_ = 0;
  std::erase_if(issued_, [](const auto& item) { return item.first.tile.expired(); });
  std::set<std::uint32_t> gone;
  geometry_.evict_if([&](const GeometryKey& key, const EncodedTile& geometry) {
    if (!key.tile.expired()) return false;
    gone.insert(geometry.revision);
    return true;
  });
  if (gone.empty()) return;
  colours_.evict_if([&](const ColourKey& key, const std::vector<std::byte>&) { return gone.contains(key.revision); });
}

void FrameCache::State::evict_surplus() {
  // A colour frame is made again in a tenth of the time of its geometry, and a moving slider leaves many that nobody
  // asks for again: colours go first, as long as they hold more than a quarter.
  while (geometry_.size_bytes() + colours_.size_bytes() > capacity_bytes_) {
    const bool take_colours = !colours_.empty() && (geometry_.empty() || colours_.size_bytes() > capacity_bytes_ / 4);
    if (take_colours) {
      colours_.evict_least_recent();
    } else {
      geometry_.evict_least_recent();
    }
  }
}

}  // namespace spectra::stream
