#include "protocol/tile_frame.hpp"

#include <string>

#include "protocol/little_endian.hpp"

namespace spectra::protocol {

Result<TileFrameView> decoded_frame(std::span<const std::byte> message) {
  const auto malformed = [](std::string field, std::string what) {
    return refusal(RpcErrorCode::InvalidRequest, "tile frame: " + what, std::move(field));
  };
  if (message.size() < kSmallestTileFrameHeaderSize)
    return malformed("", "message of " + std::to_string(message.size()) + " bytes, a header has at least " +
                             std::to_string(kSmallestTileFrameHeaderSize));
  if (LittleEndianReader(message).get<std::uint32_t>() != kTileFrameMagic)
    return malformed("magic", "does not start with \"SPC1\"");
  const std::size_t header_size = LittleEndianReader(message.subspan(kTileFrameHeaderSizeOffset)).get<std::uint16_t>();
  if (header_size < kSmallestTileFrameHeaderSize || header_size > message.size())
    return malformed("header_size", "header size " + std::to_string(header_size) + " is not between " +
                                        std::to_string(kSmallestTileFrameHeaderSize) + " and the message's " +
                                        std::to_string(message.size()) + " bytes");

  TileFrameView view{header_in(message, header_size), message.subspan(header_size)};
  if (view.payload.size() != view.header.payload_size_bytes)
    return malformed("payload_size", "payload of " + std::to_string(view.payload.size()) + " bytes, the header says " +
                                         std::to_string(view.header.payload_size_bytes));
  return view;
}

}  // namespace spectra::protocol
