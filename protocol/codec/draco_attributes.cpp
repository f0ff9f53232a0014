#include "protocol/codec/draco_attributes.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <string>

namespace spectra::protocol::codec {
namespace {

/// A float as text that strtof reads back exactly in every locale: a hexadecimal integer times a power of two.
std::string exact_text(float value) {
  int exponent = 0;
  const auto mantissa = static_cast<std::int32_t>(std::ldexp(std::frexp(std::abs(value), &exponent), 24));
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%s0x%xp%d", value < 0 ? "-" : "", static_cast<unsigned>(mantissa),
                exponent - 24);
  return text.data();
}

}  // namespace

draco::Options quantisation_options(std::span<const float> origin, std::uint32_t largest, float step) {
  const int bits = std::max(1, static_cast<int>(std::bit_width(largest)));
  // As text, because Draco's own setters keep six decimals only.
  std::string origin_text;
  for (const float coordinate : origin) origin_text += (origin_text.empty() ? "" : " ") + exact_text(coordinate);
  draco::Options options;
  options.SetInt("quantization_bits", bits);
  options.SetString("quantization_origin", origin_text);
  options.SetString("quantization_range", exact_text(static_cast<float>((1 << bits) - 1) * step));
  return options;
}

std::vector<std::byte> bytes_of(const draco::EncoderBuffer& buffer) {
  const auto* data = reinterpret_cast<const std::byte*>(buffer.data());
  return {data, data + buffer.size()};
}

}  // namespace spectra::protocol::codec
