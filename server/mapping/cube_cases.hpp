#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace spectra::mapping {

/// How a surface cuts a cube of eight voxels. Corners are numbered by their place: bit 0 is x, bit 1 y, bit 2 z. Edge 4 a + k runs along
/// axis a from the k-th of the corners whose bit a is 0.
struct CubeEdge {
  std::uint8_t from, to;  ///< Corners.
  std::uint8_t axis;
};

/// The twelve edges.
const std::array<CubeEdge, 12>& cube_edges();

/// The triangles of all 256 cases.
using CubeCases = std::array<std::vector<std::array<std::uint8_t, 3>>, 256>;

/// The triangles of each case, as edges, counter-clockwise as seen from outside. Bit c of the case: corner c is inside (behind the surface).
/// Made from the faces: on each, the crossings are joined so that inside corners are cut off one by one, which depends on the face alone,
/// so that cubes that share a face agree; the pieces form loops, which are cut into fans (Lorensen and Cline, SIGGRAPH 1987; ambiguous
/// faces as Nielson and Hamann, VIS 1991, have them when they are always separated).
const CubeCases& cube_cases();

}  // namespace spectra::mapping
