#pragma once

#include <cstddef>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

namespace spectra::net {

/// Counts the connections of each address. Thread-safe; outlives its places.
class ConnectionPlaces {
 public:
  /// One connection, counted as long as it lives.
  class Place {
   public:
    Place(Place&& other) noexcept
        : places_(std::exchange(other.places_, nullptr)), address_(std::move(other.address_)) {}
    Place& operator=(Place&&) = delete;
    ~Place() {
      if (places_ != nullptr) places_->give_back(address_);
    }

   private:
    friend class ConnectionPlaces;
    Place(ConnectionPlaces* places, std::string address) : places_(places), address_(std::move(address)) {}
    ConnectionPlaces* places_;
    std::string address_;
  };

  /// Nothing when `most` connections of this address are there.
  std::optional<Place> take(const std::string& address, std::size_t most) {
    const std::lock_guard lock(mutex_);
    std::size_t& count = counts_[address];
    if (count >= most) {
      if (count == 0) counts_.erase(address);
      return std::nullopt;
    }
    ++count;
    return Place(this, address);
  }

 private:
  void give_back(const std::string& address) {
    const std::lock_guard lock(mutex_);
    const auto entry = counts_.find(address);
    if (--entry->second == 0) counts_.erase(entry);
  }

  std::mutex mutex_;
  std::map<std::string, std::size_t> counts_;
};

}  // namespace spectra::net
