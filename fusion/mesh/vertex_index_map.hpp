#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace spectra::mesh {

/// From a vertex (block and number) to its index in a tile: an open-addressing hash table that only grows.
class VertexIndexMap {
 public:
  static constexpr std::uint32_t kAbsent = 0xffffffffu;

  explicit VertexIndexMap(std::size_t expected_count)
      : slots_(std::bit_ceil(std::size_t{16} + 2 * expected_count)), mask_(slots_.size() - 1) {}

  /// The value of `key`, after storing `value` if it had none. `value` must not be kAbsent.
  std::uint32_t find_or_insert(std::uint64_t key, std::uint32_t value) {
    Slot& slot = slot_of(key);
    if (slot.value != kAbsent) return slot.value;
    slot = {key, value};
    if (2 * ++count_ > slots_.size()) grow();
    return value;
  }

  /// The value of `key`, or kAbsent.
  std::uint32_t find(std::uint64_t key) { return slot_of(key).value; }

 private:
  struct Slot {
    std::uint64_t key = 0;
    std::uint32_t value = kAbsent;
  };

  Slot& slot_of(std::uint64_t key) {
    std::size_t i = (key * 0x9e3779b97f4a7c15u) >> 32;
    for (i &= mask_;; i = (i + 1) & mask_) {
      if (slots_[i].value == kAbsent || slots_[i].key == key) return slots_[i];
    }
  }

  void grow() {
    std::vector<Slot> old(2 * slots_.size());
    old.swap(slots_);
    mask_ = slots_.size() - 1;
    for (const Slot& slot : old) {
      if (slot.value != kAbsent) slot_of(slot.key) = slot;
    }
  }

  std::vector<Slot> slots_;
  std::size_t mask_;
  std::size_t count_ = 0;
};

}  // namespace spectra::mesh
