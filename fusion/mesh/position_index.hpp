#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "fusion/base/vertex_types.hpp"

namespace spectra::mesh {

/// Numbers distinct positions in the order in which they come; 0 and -0 are the same. Open addressing, only grows.
class PositionIndex {
 public:
  static constexpr std::uint32_t kAbsent = 0xffffffffu;

  explicit PositionIndex(std::size_t expected_count)
      : slots_(std::bit_ceil(std::size_t{16} + 2 * expected_count), kAbsent) {
    positions_.reserve(expected_count);
  }

  /// The number of a position; a new one gets the next.
  std::uint32_t find_or_insert(const base::Vec3f& position) {
    std::uint32_t& slot = slots_[slot_of(position)];
    if (slot != kAbsent) return slot;
    const auto index = slot = static_cast<std::uint32_t>(positions_.size());
    positions_.push_back(position);
    if (2 * positions_.size() > slots_.size()) grow();
    return index;
  }

  /// The number of a position, or kAbsent. Safe from several threads while none inserts.
  std::uint32_t find(const base::Vec3f& position) const { return slots_[slot_of(position)]; }

  /// By number.
  const std::vector<base::Vec3f>& positions() const { return positions_; }
  std::vector<base::Vec3f> take_positions() && { return std::move(positions_); }

 private:
  std::size_t slot_of(const base::Vec3f& p) const {
    std::uint64_t hash = 0;
    for (const float c : {p.x, p.y, p.z}) {
      hash = (hash ^ std::bit_cast<std::uint32_t>(c + 0.0f)) * 0x9e3779b97f4a7c15;  // -0 + 0 = 0
      hash ^= hash >> 29;
    }
    const std::size_t mask = slots_.size() - 1;
    for (std::size_t i = hash & mask;; i = (i + 1) & mask) {
      if (slots_[i] == kAbsent || positions_[slots_[i]] == p) return i;
    }
  }

  void grow() {
    slots_.assign(2 * slots_.size(), kAbsent);
    for (std::size_t i = 0; i < positions_.size(); ++i) {
      slots_[slot_of(positions_[i])] = static_cast<std::uint32_t>(i);
    }
  }

  std::vector<std::uint32_t> slots_;
  std::vector<base::Vec3f> positions_;
};

}  // namespace spectra::mesh
