// Made by protocol/generate from protocol/schema. Not to be edited.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "protocol/tile_id.hpp"

namespace spectra::protocol {

enum class FrameKind : std::uint8_t {
  Geometry = 1,
  Colours = 2,
  Remove = 3,
  Temperature = 4,
  Visible = 5,
  ColoursSubtractGreen = 6,
  VisibleSubtractGreen = 7,
  TemperatureSigma = 8
};

/// Header of a binary message.
struct TileFrameHeader {
  /// 1 geometry, 2 colours, 3 remove, 4 temperature, 5 visible, 6 colours_subtract_green, 7 visible_subtract_green,
  /// 8 temperature_sigma; a reader ignores others.
  FrameKind kind = FrameKind::Geometry;
  /// Bit i set = child octant i (x + 2y + 4z) exists.
  std::uint8_t child_mask = 0;
  /// +1 per frame on this connection, from 1.
  std::uint32_t sequence = 0;
  /// Of the fusion settings that the colours show; 0 where it means nothing.
  std::uint32_t generation = 0;
  /// Level, zero, x, y, z; level 0 = root = coarsest; child i of (l,x,y,z) = (l+1, 2x+(i&1), 2y+(i>>1&1),
  /// 2z+(i>>2)).
  TileId tile;
  /// Of the tile's geometry.
  std::uint32_t revision = 0;
  std::uint32_t vertex_count = 0;
  /// Tile origin, metres, relative to the scene origin.
  std::array<float, 3> origin_m{};
  /// Metres; the largest error per axis is half of it.
  float position_step_m = 0;
  /// Against the full mesh, metres; 0 at leaves.
  float geometric_error_m = 0;
  /// Lowest temperature under this tile, degC; NaN = none, infinite = beyond the sensor's range.
  float lowest_celsius = 0;
  /// The highest.
  float highest_celsius = 0;
  std::uint32_t payload_size_bytes = 0;
  /// Largest difference of a channel between the tile's visible colours and the full mesh under it, 95th percentile
  /// of the tile, or of that eighth or 64th of its box (with at least a 32nd of its surface) where it is the
  /// largest, levels; 0 at leaves; 255 where a map has grown and the tile that shows what was there before is not
  /// made anew yet. NaN where the sender did not say.
  float colour_error_levels = 0;
  /// The same in degC; 0 at leaves; NaN = no temperature. NaN where the sender did not say.
  float temperature_error_celsius = 0;
};

inline constexpr std::uint32_t kTileFrameMagic = 0x31435053;  // "SPC1"
inline constexpr std::size_t kTileFrameHeaderSize = 80;
/// Headers of the first senders end before what was added.
inline constexpr std::size_t kSmallestTileFrameHeaderSize = 72;
inline constexpr std::size_t kTileFrameHeaderSizeOffset = 6;
/// Where `sequence` stands, so that a shared frame can be given a connection's own number.
inline constexpr std::size_t kTileFrameSequenceOffset = 8;

/// The bytes of a header, little-endian on every machine.
std::array<std::byte, kTileFrameHeaderSize> encoded_header(const TileFrameHeader& header);

/// The header that a message begins with. The caller has checked that there are `size` bytes, and that a header has so many.
TileFrameHeader header_in(std::span<const std::byte> message, std::size_t size);

}  // namespace spectra::protocol
