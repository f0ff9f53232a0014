#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "fusion/error.hpp"
#include "fusion/mesh/multispectral_mesh.hpp"

namespace spectra::fusion {

/// One thing that was repaired, left out or interpreted while a scene was read: nothing is lost silently.
struct Note {
  std::string id;  ///< snake_case, stable: "degenerate_faces", "triangulated_polygons", ...
  std::uint64_t count = 0;
  std::string message;  ///< One sentence for a person, with the count.
};

/// A scene and what has to be said about it.
struct LoadedScene {
  MultispectralMesh mesh;
  std::vector<Note> notes;
};

/// Reads PLY (ascii, binary of both byte orders) with bounds on everything: safe on untrusted input; memory is bounded
/// by a small multiple of the file's size. Accepts float or double x,y,z; red,green,blue or diffuse_*; temperature under
/// the names temperature, temp, thermal, t, scalar_temperature in any case; polygons of any size (cut into triangle fans).
/// Errors: FileNotFound, FileUnreadable, BadHeader, Truncated, BadValue, Unsupported, each naming what and where.
Result<LoadedScene> read_ply(const std::filesystem::path& path);

/// The same, and takes the temperature of a second file: same vertex count = same order, else the nearest thermal vertex
/// within `join_distance_m` (0 = three times the median spacing of the thermal vertices); vertices without one are missing.
Result<LoadedScene> read_ply_with_thermal(const std::filesystem::path& path, const std::filesystem::path& thermal_path,
                                          double join_distance_m = 0);

}  // namespace spectra::fusion
