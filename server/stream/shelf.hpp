#pragma once

#include <cstddef>
#include <iterator>
#include <list>
#include <map>
#include <memory>
#include <utility>
#include <vector>

namespace spectra::stream {

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

}  // namespace spectra::stream
