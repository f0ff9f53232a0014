#pragma once

#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>

namespace spectra::protocol {

/// Writes little-endian values one after another, whatever the machine's own order.
class LittleEndianWriter {
 public:
  explicit LittleEndianWriter(std::span<std::byte> out) : out_(out) {}

  template <std::unsigned_integral T>
  void put(T value) {
    for (std::size_t i = 0; i < sizeof(T); ++i)
      out_[at_++] = static_cast<std::byte>((static_cast<std::uint64_t>(value) >> (8 * i)) & 0xFF);
  }
  void put(float value) { put(std::bit_cast<std::uint32_t>(value)); }

 private:
  std::span<std::byte> out_;
  std::size_t at_ = 0;
};

/// Reads what LittleEndianWriter wrote; the caller has checked that there is enough.
class LittleEndianReader {
 public:
  explicit LittleEndianReader(std::span<const std::byte> in) : in_(in) {}

  template <std::unsigned_integral T>
  T get() {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < sizeof(T); ++i) value |= std::to_integer<std::uint64_t>(in_[at_++]) << (8 * i);
    return static_cast<T>(value);
  }
  float get_float() { return std::bit_cast<float>(get<std::uint32_t>()); }

 private:
  std::span<const std::byte> in_;
  std::size_t at_ = 0;
};

}  // namespace spectra::protocol
