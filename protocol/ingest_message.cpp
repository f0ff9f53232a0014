#include "protocol/ingest_message.hpp"

#include <string>

#include "protocol/little_endian.hpp"

namespace spectra::protocol {

std::array<std::byte, kIngestHeaderSize> encoded_header(const IngestHeader& header) {
  std::array<std::byte, kIngestHeaderSize> bytes{};
  LittleEndianWriter out(bytes);
  out.put(kIngestMagic);
  out.put(static_cast<std::uint8_t>(header.kind));
  out.put(std::uint8_t{0});
  out.put(header.target_size_bytes);
  out.put(header.sequence);
  out.put(header.body_size_bytes);
  return bytes;
}

Result<IngestHeader> decoded_ingest_header(std::span<const std::byte> message) {
  const auto malformed = [](std::string field, std::string what) {
    return refusal(RpcErrorCode::InvalidRequest, "block message: " + what, std::move(field));
  };
  if (message.size() < kIngestHeaderSize) {
    return malformed("", std::to_string(message.size()) + " bytes, a header has " + std::to_string(kIngestHeaderSize));
  }
  LittleEndianReader in(message);
  const auto magic = in.get<std::uint32_t>();
  if (magic != kIngestMagic) {
    constexpr std::uint32_t kWithoutVersion = 0xFFFFFF;
    const bool is_other_version = (magic & kWithoutVersion) == (kIngestMagic & kWithoutVersion);
    return malformed("magic", is_other_version ? "a version that is not known; it begins with \"SPI1\" here"
                                               : "does not begin with \"SPI1\"");
  }
  IngestHeader header;
  header.kind = static_cast<IngestKind>(in.get<std::uint8_t>());
  if (in.get<std::uint8_t>() != 0) return malformed("reserved", "byte 5 is not 0");
  header.target_size_bytes = in.get<std::uint16_t>();
  header.sequence = in.get<std::uint64_t>();
  if (header.sequence == 0 || header.sequence > kLargestIngestSequence) {
    return malformed("sequence", "a sequence number is 1 to 2^53 - 1");
  }
  header.body_size_bytes = in.get<std::uint32_t>();
  return header;
}

}  // namespace spectra::protocol
