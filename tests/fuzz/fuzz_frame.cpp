#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "protocol/tile_frame.hpp"

/// Any bytes as a tile frame: what is accepted lies within the message, and its header is written back as it was.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace spectra;
  using namespace spectra::protocol;
  const auto message = std::as_bytes(std::span(data, size));
  const auto frame = protocol::decoded_frame(message);
  if (!frame) {
    if (frame.error().message.empty()) std::abort();
    return 0;
  }
  const auto& [header, payload] = frame.value();
  if (payload.size() != header.payload_size_bytes || payload.size() > size - protocol::kSmallestTileFrameHeaderSize)
    std::abort();
  const bool is_plain = message[6] == std::byte{protocol::kTileFrameHeaderSize} && message[7] == std::byte{0} &&
                        message[17] == std::byte{0} && message[18] == std::byte{0} && message[19] == std::byte{0};
  const auto again = protocol::encoded_header(header);
  if (is_plain && !std::equal(again.begin(), again.end(), message.begin())) std::abort();
  return 0;
}
