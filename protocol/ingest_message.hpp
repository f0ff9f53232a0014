#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "protocol/rpc_error.hpp"

namespace spectra::protocol {

/// The subprotocol of /ingest; docs/protocol.md, "A stream of blocks".
inline constexpr const char* kIngestProtocol = "spectra.ingest.v1";

enum class IngestKind : std::uint8_t { Put = 1, Remove = 2 };

/// What a binary message of /ingest begins with. After it: the target ("kitchen?scale=0.001"), then the PLY file of a Put.
struct IngestHeader {
  IngestKind kind = IngestKind::Put;
  std::uint64_t sequence = 0;
  std::uint16_t target_size_bytes = 0;
  std::uint32_t body_size_bytes = 0;

  std::uint64_t message_size_bytes() const;
};

inline constexpr std::size_t kIngestHeaderSize = 20;
inline constexpr std::uint32_t kIngestMagic = 0x31495053;
/// The longest target of a message, bytes.
inline constexpr std::size_t kIngestTargetSize = 4096;
/// The largest sequence number: whole numbers beyond it are not exact in every JSON reader.
inline constexpr std::uint64_t kLargestIngestSequence = (std::uint64_t{1} << 53U) - 1;

inline std::uint64_t IngestHeader::message_size_bytes() const {
  return kIngestHeaderSize + std::uint64_t{target_size_bytes} + body_size_bytes;
}

/// The 20 bytes of a header, little-endian on every machine.
std::array<std::byte, kIngestHeaderSize> encoded_header(const IngestHeader& header);

/// The header that a message begins with. Safe on untrusted input. Errors: too short, not a message of this version, a reserved
/// byte that is not 0, a sequence number that is none. An unknown kind is returned as it is.
Result<IngestHeader> decoded_ingest_header(std::span<const std::byte> message);

}  // namespace spectra::protocol
