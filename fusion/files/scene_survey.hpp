#pragma once

#include "fusion/files/ply_reader.hpp"
#include "fusion/files/read_options.hpp"

namespace spectra::files {

/// Finds out of a scene that was read what its numbers alone do not say, for those who look at it: sets core_bounds and the
/// mesh's up (as the options say; else as the file's comments tell it or its shape shows it; else z), and whether it is metric (when the
/// options give a scale, or the comments speak of metres). What a person should
/// know of it is added to the notes:
/// - "stray_points": vertices far from everything else;
/// - "up_found": up is not z, and nobody said so;
/// - "unit_told": the comments name another unit than metres, and nobody gave a scale;
/// - "may_be_millimetres": the size is one of a room, but in millimetres.
void survey(LoadedScene& scene, const ReadOptions& options = {});

}  // namespace spectra::files
