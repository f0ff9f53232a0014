#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace spectra::map {

inline constexpr double kUnknownTime = std::numeric_limits<double>::quiet_NaN();

/// A time per vertex, Unix seconds, of which there are few different ones; NaN where it is not known. Costs nothing where all are the
/// same, else 4 bytes a vertex.
struct VertexTimes {
  std::vector<double> distinct;          ///< Ascending, NaN last; none: not known of any.
  std::vector<std::uint32_t> of_vertex;  ///< Places in `distinct`; empty: all have the only one.

  static VertexTimes of(std::span<const double> times);

  double at(std::size_t vertex) const {
    if (distinct.empty()) return kUnknownTime;
    return distinct[of_vertex.empty() ? 0 : of_vertex[vertex]];
  }
};

/// The later of two times; the known one where only one is.
inline double later(double a, double b) {
  return a >= b || b != b ? a : b;
}

}  // namespace spectra::map
