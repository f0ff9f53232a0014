#pragma once

#include <boost/unordered/unordered_flat_map.hpp>
#include <cstdint>
#include <mutex>
#include <shared_mutex>
#include <span>
#include <vector>

#include "fusion/base/vertex_types.hpp"
#include "protocol/tile_frame.hpp"

namespace spectra::map {

/// Where the surfaces of leaves are open, and in which leaves. Vertices there stay as they are in all tiles that do not hold all of
/// these leaves, so that neighbours meet without cracks. Thread-safe: whoever reads sees all of a change or nothing of it.
class BorderIndex {
 public:
  /// Of a position that is open in no leaf.
  static constexpr std::uint8_t kUnshared = 255;

  /// While one exists nobody else reads or changes.
  class Change {
   public:
    explicit Change(BorderIndex& index) : index_(index), lock_(index.mutex_) {}
    void add(const protocol::TileId& leaf, std::span<const base::Vec3f> positions);
    /// The same positions as were added.
    void remove(const protocol::TileId& leaf, std::span<const base::Vec3f> positions);

   private:
    BorderIndex& index_;
    const std::unique_lock<std::shared_mutex> lock_;
  };

  /// For each position the level of the lowest tile that holds all leaves in which it is open.
  std::vector<std::uint8_t> sharing_levels(std::span<const base::Vec3f> positions) const;

  /// Calls visit(leaf) for the leaves in which a position is open; visit must not change the index.
  template <class Visit>
  void for_each_holder(const base::Vec3f& position, Visit visit) const {
    const std::shared_lock lock(mutex_);
    const auto found = first_.find(position);
    for (std::uint32_t e = found == first_.end() ? kNone : found->second; e != kNone; e = entries_[e].next) {
      visit(entries_[e].leaf);
    }
  }

 private:
  static constexpr std::uint32_t kNone = 0xffffffffu;

  struct Hash {
    using is_avalanching = void;
    std::size_t operator()(const base::Vec3f& p) const;
  };
  struct Entry {
    protocol::TileId leaf;
    std::uint32_t next = kNone;
  };

  std::uint8_t sharing_level(const base::Vec3f& position) const;

  mutable std::shared_mutex mutex_;
  boost::unordered_flat_map<base::Vec3f, std::uint32_t, Hash> first_;  ///< Of the entries of a position.
  std::vector<Entry> entries_;
  std::uint32_t free_ = kNone;  ///< The first entry that is not used.
};

}  // namespace spectra::map
