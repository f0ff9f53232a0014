#pragma once

#include "fusion/base/error.hpp"
#include "fusion/base/progress.hpp"
#include "fusion/files/ply_reader.hpp"

namespace spectra::files {

/// Whether two scenes can show the same thing, by their sizes and places without strays: not when one is a thousand (a hundred
/// ...) times as large as the other in every direction, as metres are of millimetres, nor when they are apart. The error is about
/// the thermal scene and says what mends it.
base::Result<void> check_overlap(const LoadedScene& scene, const LoadedScene& thermal);

/// Whether two scenes are as large as if they showed the same thing in one unit: of one shape the same (within a tenth), of others
/// closer than two units of length are.
bool sizes_agree(const LoadedScene& scene, const LoadedScene& thermal);

/// Gives the scene the temperatures of another one.
/// - In order, where it has as many vertices and each of them is where the other's is, but for the rounding of files.
/// - Else by place: the temperature at the nearest point of the thermal surface (of its triangles, between their corners, and of
///   its vertices of no triangle) within a distance: `join_distance_m`, or, when that is 0, three spacings of the thermal
///   vertices, or three times what the surfaces are apart in the middle (two reconstructions of one thing never
///   coincide), or half an edge of the coarser of the two, but at most a fiftieth of the scene
///   (the spacings of a surface a two-hundredth, of a cloud a tenth). Beyond the border of the thermal surface it reaches one spacing, or a third of the distance.
///   What is not reached is missing. Any number of threads, the same answer.
/// `progress` is told of kJoiningPhase. Notes are added to the scene's: "thermal_joined_in_order", or "thermal_joined_nearest" with how many and how far, and
/// "thermal_not_reached". Unsupported when less than a tenth of the scene reaches the other and less than a tenth of the other the
/// scene, and when the other is all in one place or spans less than the distance found.
base::Result<void> join_thermal(const LoadedScene& thermal, double join_distance_m, LoadedScene& scene,
                                const base::Progress& progress = {});

}  // namespace spectra::files
