#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "fusion/base/vertex_types.hpp"

namespace spectra::map {

/// What the vertices of a block are compared with where that is not what they showed when the block came: a temperature per
/// vertex, degC, and the time it is of, Unix seconds or NaN. Empty: each vertex is compared with itself.
struct BlockBaseline {
  std::vector<float> celsius;
  std::vector<double> at;

  bool is_empty() const { return celsius.empty(); }
};

/// The vertices of a block that is replaced.
struct ReplacedVertices {
  std::vector<base::Vec3f> positions;
  std::vector<std::uint32_t> source;  ///< Their numbers in the block.
  BlockBaseline baseline;             ///< Of every one.
};

/// The baseline that a block hands on by place to the one that replaces it: each vertex takes that of the nearest vertex before, the
/// first in the block of those that are equally near. Where none is within `reach_m`, and where that one has none, a vertex is seen for
/// the first time: its baseline is its own temperature at `observed_at` (NaN: not known).
BlockBaseline handed_on(const ReplacedVertices& before, std::span<const base::Vec3f> positions,
                        std::span<const float> temperature_celsius, double observed_at, double reach_m);

}  // namespace spectra::map
