#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "protocol/rpc_error.hpp"

namespace spectra::protocol {

enum class FrameKind : std::uint8_t {
  Geometry = 1,
  Colours = 2,
  Remove = 3,
  Temperature = 4,
  Visible = 5,
  ColoursSubtractGreen = 6,
  VisibleSubtractGreen = 7,
};

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

/// Names a node of the tile tree; level 0 is the root. Child i of (l,x,y,z) is (l+1, 2x+(i&1), 2y+(i>>1&1), 2z+(i>>2)).
struct TileId {
  std::uint8_t level = 0;
  std::uint32_t x = 0, y = 0, z = 0;
  friend auto operator<=>(const TileId&, const TileId&) = default;
};

/// Header of a binary message; docs/protocol.md, "Tile frames", has the byte table.
struct TileFrameHeader {
  FrameKind kind = FrameKind::Geometry;
  std::uint8_t child_mask = 0;
  std::uint32_t sequence = 0;
  std::uint32_t generation = 0;
  TileId tile;
  std::uint32_t revision = 0;
  std::uint32_t vertex_count = 0;
  std::array<float, 3> origin_m{};
  float position_step_m = 0;
  float geometric_error_m = 0;
  float lowest_celsius = 0;  ///< NaN = none.
  float highest_celsius = 0;
  std::uint32_t payload_size_bytes = 0;
  float colour_error_levels = 0;        ///< Of a channel, 95th percentile; NaN = the sender did not say.
  float temperature_error_celsius = 0;  ///< 95th percentile; NaN = none, or the sender did not say.
};

inline constexpr std::size_t kTileFrameHeaderSize = 80;
/// Headers of the first senders end before the two errors.
inline constexpr std::size_t kSmallestTileFrameHeaderSize = 72;
inline constexpr std::uint32_t kTileFrameMagic = 0x31435053;
/// Where `sequence` stands, so that a shared frame can be given a connection's own number.
inline constexpr std::size_t kTileFrameSequenceOffset = 8;

/// The 80 bytes of a header, little-endian on every machine.
std::array<std::byte, kTileFrameHeaderSize> encoded_header(const TileFrameHeader& header);

/// A received frame: the header and the payload inside `message`. Safe on untrusted input. Errors: too short, wrong magic,
/// header size under 72 or beyond the message, payload size that differs from what is there. An unknown kind is
/// returned as it is: a reader must ignore it.
struct TileFrameView {
  TileFrameHeader header;
  std::span<const std::byte> payload;
};
Result<TileFrameView> decoded_frame(std::span<const std::byte> message);

}  // namespace spectra::protocol
