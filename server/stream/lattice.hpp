#pragma once

#include <array>
#include <vector>

#include "protocol/draco_codec.hpp"
#include "server/scene/scene_snapshot.hpp"

namespace spectra::server {

/// The position step that a scene is really sent with: the wanted one, or the scene's suggestion for `wanted_m` 0, raised
/// where needed so that every coordinate within `bounds` is fewer than 2^21 steps from the scene origin and from every
/// other. Always a lattice_step(). Only scenes of more than two million steps (4 km at 2 mm) are affected.
float position_step_in_force(float wanted_m, float suggested_m, const Bounds& bounds);

/// Positions of a tile on the lattice of the whole scene, seen from a corner of the tile that lies on it.
struct TileLattice {
  std::array<float, 3> origin_m{};  ///< A multiple of the step, exact; relative to the scene origin.
  std::vector<protocol::LatticePoint> points;
};

/// The nearest lattice point of every vertex: origin_m + point * step_m is within step_m / 2 of the position on each axis,
/// and equal for equal positions of any two tiles. InternalError when a coordinate is not finite or too far out.
protocol::Result<TileLattice> tile_lattice(const Tile& tile, float step_m);

}  // namespace spectra::server
