#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "server/mapping/voxel_map.hpp"

namespace spectra::mapping {

/// Voxels of a block as bits, a byte a row along x, rows by y + 8 z.
struct BlockBits {
  alignas(64) std::array<std::uint8_t, kBlockVoxels / kBlockEdge> known{}, inside{};
};

/// Known: those that weigh `least_weight` or more. Inside: those of them behind the surface. Every instruction set gives the same.
void find_bits(const VoxelBlock& block, std::uint16_t least_weight, BlockBits& out);

/// Edges of the grid that the surface crosses within a block and to its neighbours, the first `count` of each array: what is known of their two
/// voxels, and the vertices that lie on them.
struct CrossedEdges {
  static constexpr std::size_t kMost = std::size_t{3} * 9 * 9 * 9;
  static constexpr std::size_t kRoom = kMost + 16;  ///< A whole register is read and written at the end.
  template <class T>
  using Array = std::array<T, kRoom>;

  /// The voxel at an end, as VoxelBlock and HeatBlock have it.
  struct Ends {
    Array<std::int32_t> distance, colour_weight, red, green, blue;
    Array<float> celsius, variance, own_variance, seen_s;
    ///< Variance: infinite where there is no temperature. Own: of its error (BlockHead::heat_certainty).
  };

  std::size_t count = 0;
  Array<std::int32_t> x, y, z;  ///< Of the first voxel, in voxels.
  Array<std::int32_t> axis;     ///< Along which the second is the next.
  Ends first, second;

  Array<float> x_m, y_m, z_m;
  Array<std::int32_t> red, green, blue;        ///< -1: neither end has a colour.
  Array<float> celsius, sigma_kelvin, seen_s;  ///< NaN: neither has a temperature.
  bool has_one_on_voxel;                       ///< Some vertex may be where a voxel is.
};

/// Finds the vertices. Temperature and variance go by what each end knows; sigma is at least `least_sigma_kelvin`. Every instruction set gives the
/// same bytes.
void find_vertices(CrossedEdges& edges, double voxel_m, float least_sigma_kelvin);

}  // namespace spectra::mapping
