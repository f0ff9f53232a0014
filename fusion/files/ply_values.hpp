#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>

#include "fusion/files/ply_header.hpp"

namespace spectra::files {

/// One value of a binary file, whose bytes may be in the other order and need no alignment.
template <class T, bool kSwapped>
T load_value(const unsigned char* bytes) {
  using Bits = std::conditional_t<sizeof(T) == 1, std::uint8_t,
                                  std::conditional_t<sizeof(T) == 2, std::uint16_t,
                                                     std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>>>;
  Bits bits;
  std::memcpy(&bits, bytes, sizeof(T));
  if constexpr (kSwapped && sizeof(T) == 2) bits = __builtin_bswap16(bits);
  if constexpr (kSwapped && sizeof(T) == 4) bits = __builtin_bswap32(bits);
  if constexpr (kSwapped && sizeof(T) == 8) bits = __builtin_bswap64(bits);
  return std::bit_cast<T>(bits);
}

/// Calls `use` with a value of the C++ type that belongs to `type`.
template <class Use>
decltype(auto) with_type(PlyScalar type, Use&& use) {
  switch (type) {
    case PlyScalar::Int8:
      return use(std::int8_t{});
    case PlyScalar::UInt8:
      return use(std::uint8_t{});
    case PlyScalar::Int16:
      return use(std::int16_t{});
    case PlyScalar::UInt16:
      return use(std::uint16_t{});
    case PlyScalar::Int32:
      return use(std::int32_t{});
    case PlyScalar::UInt32:
      return use(std::uint32_t{});
    case PlyScalar::Int64:
      return use(std::int64_t{});
    case PlyScalar::UInt64:
      return use(std::uint64_t{});
    case PlyScalar::Float32:
      return use(float{});
    case PlyScalar::Float64:
      break;
  }
  return use(double{});
}

/// One value of any type; a double holds them all exactly but whole numbers beyond 2^53.
template <bool kSwapped>
double load_double(PlyScalar type, const unsigned char* bytes) {
  return with_type(type,
                   [bytes](auto zero) { return static_cast<double>(load_value<decltype(zero), kSwapped>(bytes)); });
}

/// `count` values of one property of consecutive entries of `stride` bytes, each to `out[i * out_stride]`.
template <bool kSwapped>
void load_column(PlyScalar type, const unsigned char* bytes, std::size_t stride, std::size_t count, double* out,
                 std::size_t out_stride) {
  with_type(type, [=](auto zero) {
    for (std::size_t i = 0; i < count; ++i) {
      out[i * out_stride] = static_cast<double>(load_value<decltype(zero), kSwapped>(bytes + i * stride));
    }
  });
}

/// The shortest text that is read back as that number.
std::string number_text(double value);
/// At most so many digits of it, for people.
std::string short_number(double value, int digits = 6);
/// The shortest text that is read back as a value of that type.
std::string value_text(double value, PlyScalar type);
/// A number as text files have it: with a leading '+', with an exponent as Fortran writes it (1.5D+01), "inf", and nan in
/// every spelling that programs have for it, "null" and "NA" among them. nullopt: not a number.
std::optional<double> parse_number(std::string_view token);
/// A whole number as text files have it.
std::optional<std::int64_t> parse_whole_number(std::string_view token);

}  // namespace spectra::files
