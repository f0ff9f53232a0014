#include "server/stream/lattice.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "server/stream/viewer_stream.hpp"

namespace spectra::server {
namespace {

// A lattice coordinate of 21 bits times a step of three significant bits fills the 24 bits of a float.
constexpr std::int32_t kLatticeLimit = 1 << 21;

}  // namespace

float lattice_step(double wanted_m) {
  constexpr double kSmallest = 4 * static_cast<double>(std::numeric_limits<float>::min());
  constexpr double kLargest = 7 * 0x1p124;
  if (!(wanted_m > kSmallest)) return static_cast<float>(kSmallest);
  if (wanted_m >= kLargest) return static_cast<float>(kLargest);
  int exponent = 0;
  const double fraction = std::frexp(wanted_m, &exponent);  // [0.5, 1): eight times that is 4 .. 7 and a remainder
  return static_cast<float>(std::ldexp(std::floor(8 * fraction), exponent - 3));
}

float position_step_in_force(float wanted_m, float suggested_m, const Bounds& bounds) {
  double step = static_cast<double>(lattice_step(static_cast<double>(wanted_m > 0 ? wanted_m : suggested_m)));
  double reach = 0;
  for (const auto member : {&fusion::Vec3f::x, &fusion::Vec3f::y, &fusion::Vec3f::z}) {
    const auto low = static_cast<double>(bounds.min.*member);
    const auto high = static_cast<double>(bounds.max.*member);
    reach = std::max({reach, std::abs(low), std::abs(high), high - low});
  }
  while (std::isfinite(reach) && reach >= step * (kLatticeLimit - 2)) step *= 2;
  return lattice_step(step);
}

protocol::Result<TileLattice> tile_lattice(const Tile& tile, float step_m) {
  TileLattice lattice;
  lattice.points.resize(tile.positions.size());
  if (tile.positions.empty()) return lattice;
  const auto step = static_cast<double>(step_m);
  std::array<std::int32_t, 3> lowest{};
  lowest.fill(std::numeric_limits<std::int32_t>::max());
  for (std::size_t i = 0; i < tile.positions.size(); ++i) {
    const fusion::Vec3f& position = tile.positions[i];
    const std::array<float, 3> coordinates{position.x, position.y, position.z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double nearest = std::floor(static_cast<double>(coordinates[axis]) / step + 0.5);
      if (!(std::abs(nearest) < kLatticeLimit)) {
        return protocol::refusal(protocol::RpcErrorCode::InternalError,
                                 "vertex " + std::to_string(i) + " lies " + std::to_string(coordinates[axis]) +
                                     " m from the scene origin, which is beyond 2^21 position steps of " +
                                     std::to_string(step) + " m");
      }
      lattice.points[i][axis] = static_cast<std::int32_t>(nearest);
      lowest[axis] = std::min(lowest[axis], lattice.points[i][axis]);
    }
  }
  for (std::size_t axis = 0; axis < 3; ++axis) lattice.origin_m[axis] = static_cast<float>(lowest[axis] * step);
  for (auto& point : lattice.points) {
    for (std::size_t axis = 0; axis < 3; ++axis) point[axis] -= lowest[axis];
  }
  return lattice;
}

}  // namespace spectra::server
