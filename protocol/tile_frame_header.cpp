// Made by protocol/generate from protocol/schema. Not to be edited.
#include "protocol/tile_frame_header.hpp"

#include <limits>

#include "protocol/little_endian.hpp"

namespace spectra::protocol {

std::array<std::byte, kTileFrameHeaderSize> encoded_header(const TileFrameHeader& header) {
  std::array<std::byte, kTileFrameHeaderSize> bytes{};
  LittleEndianWriter out(bytes);
  out.put(kTileFrameMagic);
  out.put(static_cast<std::uint8_t>(header.kind));
  out.put(header.child_mask);
  out.put(static_cast<std::uint16_t>(kTileFrameHeaderSize));
  out.put(header.sequence);
  out.put(header.generation);
  out.put(static_cast<std::uint32_t>(header.tile.level));  // And its three zero bytes.
  out.put(header.tile.x);
  out.put(header.tile.y);
  out.put(header.tile.z);
  out.put(header.revision);
  out.put(header.vertex_count);
  for (const float coordinate : header.origin_m) out.put(coordinate);
  out.put(header.position_step_m);
  out.put(header.geometric_error_m);
  out.put(header.lowest_celsius);
  out.put(header.highest_celsius);
  out.put(header.payload_size_bytes);
  out.put(header.colour_error_levels);
  out.put(header.temperature_error_celsius);
  return bytes;
}

TileFrameHeader header_in(std::span<const std::byte> message, std::size_t size) {
  TileFrameHeader header;
  LittleEndianReader in(message);
  in.get<std::uint32_t>();  // The magic number.
  header.kind = static_cast<FrameKind>(in.get<std::uint8_t>());
  header.child_mask = in.get<std::uint8_t>();
  in.get<std::uint16_t>();  // The size.
  header.sequence = in.get<std::uint32_t>();
  header.generation = in.get<std::uint32_t>();
  header.tile.level = static_cast<std::uint8_t>(in.get<std::uint32_t>() & 0xFF);
  header.tile.x = in.get<std::uint32_t>();
  header.tile.y = in.get<std::uint32_t>();
  header.tile.z = in.get<std::uint32_t>();
  header.revision = in.get<std::uint32_t>();
  header.vertex_count = in.get<std::uint32_t>();
  for (float& coordinate : header.origin_m) coordinate = in.get_float();
  header.position_step_m = in.get_float();
  header.geometric_error_m = in.get_float();
  header.lowest_celsius = in.get_float();
  header.highest_celsius = in.get_float();
  header.payload_size_bytes = in.get<std::uint32_t>();
  header.colour_error_levels = size < 76 ? std::numeric_limits<float>::quiet_NaN() : in.get_float();
  header.temperature_error_celsius = size < 80 ? std::numeric_limits<float>::quiet_NaN() : in.get_float();
  return header;
}

}  // namespace spectra::protocol
