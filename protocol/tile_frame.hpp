#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "protocol/rpc_error.hpp"
#include "protocol/tile_frame_header.hpp"

namespace spectra::protocol {

/// How colours are written into a frame; both decode to the same colours. A client chooses with scene.subscribe.
enum class ColourTransform : std::uint8_t {
  None,           ///< One attribute (r, g, b).
  SubtractGreen,  ///< Two attributes, g and (r - g, b - g) modulo 256: channels of a picture resemble each other.
};

/// The kind of a frame whose colours are written that way.
constexpr FrameKind colour_frame_kind(ColourTransform transform) {
  return transform == ColourTransform::None ? FrameKind::Colours : FrameKind::ColoursSubtractGreen;
}

constexpr FrameKind visible_frame_kind(ColourTransform transform) {
  return transform == ColourTransform::None ? FrameKind::Visible : FrameKind::VisibleSubtractGreen;
}

/// A received frame: the header and the payload inside `message`. Safe on untrusted input. Errors: too short, wrong magic,
/// header size under 72 or beyond the message, payload size that differs from what is there. An unknown kind is
/// returned as it is: a reader must ignore it.
struct TileFrameView {
  TileFrameHeader header;
  std::span<const std::byte> payload;
};
Result<TileFrameView> decoded_frame(std::span<const std::byte> message);

}  // namespace spectra::protocol
