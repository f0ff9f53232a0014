#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "fusion/base/bounds.hpp"
#include "fusion/base/error.hpp"
#include "fusion/files/read_options.hpp"
#include "fusion/mesh/multispectral_mesh.hpp"

namespace spectra::files {

/// One thing that was repaired, left out or interpreted while a scene was read: nothing is lost silently.
struct Note {
  std::string id;  ///< snake_case, stable: "degenerate_faces", "triangulated_polygons", ...
  std::uint64_t count = 0;
  std::string message;  ///< One sentence for a person, with the count.
  /// Something is probably not as it was meant, and the message says what mends it.
  bool needs_attention = false;
};

/// A scene and what has to be said about it.
struct LoadedScene {
  mesh::MultispectralMesh mesh;
  std::vector<Note> notes;
  std::optional<base::Bounds>
      core_bounds{};                    ///< Of the vertices that are no strays; absent: nobody has looked for any.
  std::vector<std::string> comments{};  ///< The header's lines "comment ..." and "obj_info ...", whole, in order.
};

/// Reads PLY 1.0: ascii, and binary of both byte orders; a regular file, plain or packed with gzip. Safe on untrusted input:
/// every count is checked against the bytes that are there, and memory is bounded by a small multiple of the (unpacked)
/// file's size. docs/input.md tells what is recognised; in short:
/// - Positions: x, y, z of any type. Vertices without a finite one, and those at the one place that stands for it
///   (PositionSample::hole), are left out with their faces (MultispectralMesh::left_out). The mesh's origin is chosen as scene_origin.hpp says.
/// - Visible colour: three channels of any type, scaled by the largest value in the file; packed; of splats; of the faces.
/// - Temperature: a scalar whose name says so, or that the options name, of the vertices or the faces. Scaled to degC as the
///   options say. NaN, at or below -273.15 degC, or a value that the options name: missing (NaN). +inf and what is beyond
///   the largest float is +inf (over range), -inf stays -inf.
/// - Faces: the list vertex_indices or vertex_index, and triangle strips. Polygons are cut into triangles as polygon_cutter.hpp
///   says; triangles with a vertex twice and faces of fewer than three corners are left out. Vertices of no triangle are
///   kept.
/// Everything else is skipped. What was guessed, cut, left out, converted or skipped is in the notes.
/// Errors: those of check_read_options(), FileNotFound, FileUnreadable, BadHeader, Truncated, BadValue (also for an empty scene), Unsupported, TooLarge;
/// the message begins with the file's name and says what and where.
base::Result<LoadedScene> read_ply(const std::filesystem::path& path, const ReadOptions& options = {});

/// The same, and takes the temperature of a second file, as thermal_join.hpp says; vertices without one are missing. The options
/// about temperature then belong to the second file; the scale of positions belongs to both, or, where they overlap only so,
/// to the one that needs it (note "scaled_one_file"). `join_distance_m`: 0 = found out.
/// The notes tell how vertices were joined, how many and how far. Unsupported when the two do not overlap in place or size.
base::Result<LoadedScene> read_ply_with_thermal(const std::filesystem::path& path,
                                                const std::filesystem::path& thermal_path,
                                                const ReadOptions& options = {}, double join_distance_m = 0);

}  // namespace spectra::files
