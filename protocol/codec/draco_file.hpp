#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "protocol/codec/draco_codec.hpp"

namespace spectra::protocol::codec {

/// What a Draco file keeps of a mesh; the less, the smaller it is.
enum class DracoKeeping {
  Shape,       ///< Positions and temperatures on lattices; vertices in an order of their own.
  Order,       ///< The same values, with the vertices and triangles in order and number.
  Everything,  ///< Every value as it is, too.
};

/// A whole mesh with colours and, where it has one, temperature. Positions are finite.
struct DracoFileInput {
  std::span<const std::array<float, 3>> positions_m;  ///< Relative to `origin_m`.
  std::span<const ColourBytes> colours;
  std::span<const float> temperature_celsius;  ///< Empty: none. NaN: missing. Infinite: beyond what was measurable.
  std::span<const TileTriangle> triangles;     ///< Empty: point cloud.
  std::array<double, 3> origin_m{};
  /// A lattice step as encoded_geometry() takes it; 0: positions as they are. No meaning with Everything.
  float position_step_m = 0;
};

/// One Draco stream and what it has lost.
struct DracoFile {
  std::vector<std::byte> bytes;
  /// What was asked for, or Order for a Shape with very many triangles round a vertex or an edge, and for one of points without a lattice
  /// or that is smaller so.
  DracoKeeping kept = DracoKeeping::Shape;
  /// Of the lattice; 0: positions are as they were, also where Order is kept for a Shape and all vertices are too far apart for its step.
  float position_step_m = 0;
  float temperature_step_celsius = 0;         ///< 0: exact, or none.
  std::uint64_t left_out_vertex_count = 0;    ///< Of no triangle.
  std::uint64_t merged_vertex_count = 0;      ///< Of a shape: one with another that has the same place and values.
  std::uint64_t left_out_triangle_count = 0;  ///< That name a vertex twice.
  std::uint64_t added_triangle_count = 0;     ///< Of one vertex each, after the others; see draco_file().
  std::uint64_t split_vertex_count = 0;  ///< Vertices more than the shape has: non-manifold ones, one for every fan.
  std::uint64_t over_range_count = 0;    ///< Temperatures of infinity, written as the values below.
  std::uint64_t under_range_count = 0;
  float over_range_celsius = 0;
  float under_range_celsius = 0;
};

/// Stands for a missing temperature in a file of DracoKeeping::Shape or Order: colder than anything can be.
inline constexpr float kDracoMissingCelsius = -1000;

/// Temperatures are written in steps of this, or of twice, four times ... it where they reach beyond +-65,536 degC.
inline constexpr float kDracoTemperatureStepCelsius = 1.0F / 64;

/// Attributes: POSITION (float, metres), COLOR (3 bytes, sRGB), GENERIC (float, degC) with the metadata name
/// "temperature", unit "degC", step, missing, over_range and under_range; metadata of the whole: origin_m and
/// position_step_m, if there is one. Decoded values are within half a step of those that went in. `speed` 0 (smallest) .. 10 (fastest).
/// A decoder takes no more than three vertices for every triangle of a mesh whose order is kept: where there are too few,
/// triangles that name the first vertex three times follow. InternalError for arrays that do not belong together.
Result<DracoFile> draco_file(const DracoFileInput& input, DracoKeeping wanted, int speed);

}  // namespace spectra::protocol::codec
