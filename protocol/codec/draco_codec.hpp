#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "protocol/rpc_error.hpp"
#include "protocol/tile_frame.hpp"

namespace spectra::protocol::codec {

/// Positions on the lattice of a tile: metres = origin_m + lattice * step_m.
using LatticePoint = std::array<std::int32_t, 3>;
/// Vertex indices of a triangle within a tile.
using TileTriangle = std::array<std::uint32_t, 3>;
using ColourBytes = std::array<std::uint8_t, 3>;

/// An encoded geometry and how its decoded vertices relate to the ones that went in.
struct EncodedGeometry {
  std::vector<std::byte> payload;  ///< A Draco stream with one POSITION attribute, metres relative to the tile origin.
  /// For each decoded vertex the input vertex it came from. Draco splits non-manifold vertices and drops vertices of no
  /// triangle, so it is neither injective nor onto.
  std::vector<std::uint32_t> input_of_decoded;
};

/// Encodes a triangle mesh (edgebreaker) or, without triangles, a point cloud. `positions` are lattice coordinates >= 0
/// and < 2^23; `step_m` is exactly representable with few enough bits that coordinate * step is exact in float. The map
/// is proven: the stream is decoded, and every vertex lies on the lattice point of the vertex it is said to come from,
/// every triangle is there once; InternalError otherwise. `speed` 0 (smallest) .. 10 (fastest).
Result<EncodedGeometry> encoded_geometry(std::span<const LatticePoint> positions,
                                         std::span<const TileTriangle> triangles, float step_m, int speed);

/// Encodes colours, value i for decoded vertex i, as a sequential Draco point cloud: one COLOR attribute of 3 bytes, or with
/// SubtractGreen a COLOR attribute of one byte and a GENERIC one of two.
/// With colour_bits b < 8 each channel is first rounded to the nearest multiple of 2^(8-b), half up, 256 becoming 255.
/// `marks`, where there are any, one per colour and each 0 or 1, follow as a GENERIC attribute of one byte.
Result<std::vector<std::byte>> encoded_colours(std::span<const ColourBytes> colours, int colour_bits, int speed,
                                               ColourTransform transform = ColourTransform::None,
                                               std::span<const std::uint8_t> marks = {});

/// Temperatures as whole numbers: degC = code * scale + offset; how that is rounded is fusion::TemperatureCodes'.
struct TemperatureTable {
  float scale = 1;
  float offset = 0;
};

/// Encodes codes, value i for decoded vertex i: scale and offset, then a sequential Draco point cloud with one GENERIC attribute
/// of one u16.
Result<std::vector<std::byte>> encoded_temperature_codes(std::span<const std::uint16_t> codes,
                                                         const TemperatureTable& table, int speed);

/// The channel value that a decoder sees for `value` at `colour_bits`.
std::uint8_t rounded_channel(std::uint8_t value, int colour_bits);

/// For tests and benchmarks: what a client decodes. Never fed with bytes from the network.
struct DecodedGeometry {
  std::vector<std::array<float, 3>> positions_m;  ///< Relative to the tile origin.
  std::vector<TileTriangle> triangles;
};
Result<DecodedGeometry> decoded_geometry(std::span<const std::byte> payload);
Result<std::vector<ColourBytes>> decoded_colours(std::span<const std::byte> payload,
                                                 ColourTransform transform = ColourTransform::None);
struct DecodedTemperatureCodes {
  TemperatureTable table;
  std::vector<std::uint16_t> codes;
};
Result<DecodedTemperatureCodes> decoded_temperature_codes(std::span<const std::byte> payload);
/// The marks beside colours; empty where there are none.
Result<std::vector<std::uint8_t>> decoded_marks(std::span<const std::byte> payload);

}  // namespace spectra::protocol::codec
