#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <vector>

#include "protocol/tile_frame.hpp"

namespace spectra::stream {

/// A frame ready to be written: a header of this connection's own and a payload shared by all viewers.
struct OutgoingFrame {
  std::array<std::byte, protocol::kTileFrameHeaderSize> header;
  std::shared_ptr<const std::vector<std::byte>> payload;  ///< May be null (remove).
  std::size_t size_bytes() const { return header.size() + (payload ? payload->size() : 0); }
};

}  // namespace spectra::stream
