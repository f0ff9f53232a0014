#pragma once

#include "fusion/mesh/ply_reader.hpp"

namespace spectra::fusion {

/// Finds out of a scene that was read what its numbers alone do not say, for those who look at it: sets core_bounds. What a
/// person should know of it is added to the notes:
/// - "stray_points": vertices far from everything else.
void survey(LoadedScene& scene);

}  // namespace spectra::fusion
