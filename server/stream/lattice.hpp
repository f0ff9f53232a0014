#pragma once

#include <array>
#include <vector>

#include "protocol/codec/draco_codec.hpp"
#include "server/map/scene_snapshot.hpp"

namespace spectra::stream {

/// The step that is in force when `wanted_m` (0: what the scene asks for) is to be the largest one. Always a lattice_step().
float position_step_in_force(float wanted_m, float suggested_m);

/// The coarsest step that a vertex of any tile of a scene has where `step_m` is to be the largest: larger than that where tiles reach so far
/// that floats do not tell it apart.
float coarsest_step(const map::SceneSnapshot& scene, float step_m);

/// That step, doubled until every coordinate within `bounds` is fewer than 2^21 of them from the scene origin and from every
/// other: for a file that has a single lattice.
float one_step_for_all(float step_m, const base::Bounds& bounds);

/// Positions of a tile, seen from a corner of the tile that lies on its lattice.
struct TileLattice {
  std::array<float, 3> origin_m{};  ///< A multiple of the step, exact; relative to the scene origin.
  float step_m = 0;                 ///< Of `points`: the finest that any vertex has.
  float coarsest_step_m = 0;        ///< That any vertex has: none is off by more than half of it on any axis.
  std::vector<protocol::codec::LatticePoint> points;
};

/// The nearest lattice point of every drawn vertex (others: any). Its step is `step_m`, halved as its step_halvings say: origin_m +
/// point * TileLattice::step_m is within half of it of the position on each axis, and equal for equal positions of any two
/// tiles. A step is doubled where floats do not tell so many apart from the scene origin to the vertex or from end to end of
/// the tile (2^24, within a tile 2^23, of a power of two; 2^21 of others). InternalError when a coordinate is not finite.
protocol::Result<TileLattice> tile_lattice(const map::Tile& tile, float step_m);

}  // namespace spectra::stream
