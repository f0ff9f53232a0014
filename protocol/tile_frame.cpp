#include "protocol/tile_frame.hpp"

#include <limits>
#include <string>

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
  out.put(static_cast<std::uint32_t>(header.tile.level));  // level and its three zero bytes
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

Result<TileFrameView> decoded_frame(std::span<const std::byte> message) {
  const auto malformed = [](std::string field, std::string what) {
    return refusal(RpcErrorCode::InvalidRequest, "tile frame: " + what, std::move(field));
  };
  if (message.size() < kSmallestTileFrameHeaderSize)
    return malformed("", "message of " + std::to_string(message.size()) + " bytes, a header has at least " +
                             std::to_string(kSmallestTileFrameHeaderSize));
  LittleEndianReader in(message);
  if (in.get<std::uint32_t>() != kTileFrameMagic) return malformed("magic", "does not start with \"SPC1\"");

  TileFrameView view;
  TileFrameHeader& header = view.header;
  header.kind = static_cast<FrameKind>(in.get<std::uint8_t>());
  header.child_mask = in.get<std::uint8_t>();
  const std::size_t header_size = in.get<std::uint16_t>();
  if (header_size < kSmallestTileFrameHeaderSize || header_size > message.size())
    return malformed("header_size", "header size " + std::to_string(header_size) + " is not between " +
                                        std::to_string(kSmallestTileFrameHeaderSize) + " and the message's " +
                                        std::to_string(message.size()) + " bytes");
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
  header.colour_error_levels = header.temperature_error_celsius = std::numeric_limits<float>::quiet_NaN();
  if (header_size >= kTileFrameHeaderSize) {
    header.colour_error_levels = in.get_float();
    header.temperature_error_celsius = in.get_float();
  }

  view.payload = message.subspan(header_size);
  if (view.payload.size() != header.payload_size_bytes)
    return malformed("payload_size", "payload of " + std::to_string(view.payload.size()) + " bytes, the header says " +
                                         std::to_string(header.payload_size_bytes));
  return view;
}

}  // namespace spectra::protocol
