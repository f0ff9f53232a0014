#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "protocol/ingest_message.hpp"

/// Any bytes as the beginning of a block message: what is accepted is written back as it was, everything else is told why.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace spectra;
  using namespace spectra::protocol;
  const auto message = std::as_bytes(std::span(data, size));
  const auto header = protocol::decoded_ingest_header(message);
  if (!header) {
    if (header.error().message.empty()) std::abort();
    return 0;
  }
  const protocol::IngestHeader& read = header.value();
  if (read.sequence == 0 || read.sequence > kLargestIngestSequence) std::abort();
  if (read.message_size_bytes() < protocol::kIngestHeaderSize) std::abort();
  const auto again = protocol::encoded_header(read);
  if (!std::equal(again.begin(), again.end(), message.begin())) std::abort();
  return 0;
}
