#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "fusion/base/error.hpp"
#include "fusion/base/vertex_types.hpp"
#include "fusion/files/block_file.hpp"
#include "fusion/files/ply_face_reader.hpp"
#include "fusion/files/ply_header.hpp"
#include "fusion/files/ply_reader.hpp"
#include "fusion/files/ply_schema.hpp"
#include "fusion/files/ply_survey.hpp"
#include "fusion/files/position_sample.hpp"
#include "fusion/files/read_options.hpp"
#include "fusion/files/vertex_colour.hpp"
#include "fusion/files/vertex_temperature.hpp"

namespace spectra::files {

/// Some vertices in the file's order. The spans are valid during the call only.
struct PlyVertexBlock {
  std::uint64_t first_vertex = 0;
  std::span<const base::Vec3d> positions;      ///< Metres; finite, within 1e30, but for those left out.
  std::span<const base::Rgb8> visible;         ///< Empty when the file has no colours.
  std::span<const float> temperature_celsius;  ///< Empty when the file has none; NaN = missing, +-inf = out of range.
  /// How sure the temperatures are, kelvin (NaN = not known), and when they were looked at, on the file's clock; empty when the file does
  /// not say it.
  std::span<const float> sigma_kelvin;
  std::span<const double> looked_at;
  /// Those without a position, by their index in the block, rising: to be left out of the scene. No triangle has them.
  std::span<const std::uint32_t> left_out;
};

/// Who gets the body of a file: all vertices, then all triangles. A handler that fails ends the reading with its error; an
/// empty one is not called.
struct PlyHandlers {
  std::function<base::Result<void>(const PlyVertexBlock&)> vertices;
  /// Triangles as they will be drawn: polygons cut into triangles, strips into triangles, indices checked and of the file's
  /// order, none with a vertex twice or one that is left out.
  std::function<base::Result<void>(std::span<const base::Triangle>)> triangles;
};

/// Exactly one place of many vertices.
struct CrowdedPlace {
  base::Vec3d place;
  bool is_used = false;  ///< By faces.
};

/// What was found in the body.
struct PlyBodyFacts {
  base::Vec3d min, max;      ///< Of all positions.
  std::optional<Bulk> bulk;  ///< Where nearly all of them are, when that is more than one place.
  base::Vec3d origin;        ///< What to tell them from, as scene_origin.hpp says.
  /// Text whose coordinates, far from 0, have more digits than the floats that they are declared as: they are kept as doubles.
  bool is_finer_than_declared = false;
  /// What stands for holes, found in this reading: PlyStream::leave_out_holes() takes it.
  std::vector<Hole> holes;
  FaceFacts faces;
  TemperatureFacts temperature;
  std::uint64_t left_out_vertex_count = 0;           ///< Without a position within 1e30 m, and holes.
  std::vector<std::uint64_t> hole_counts;            ///< Left out because they are such a hole, of each.
  std::vector<CrowdedPlace> crowded_places;          ///< Many vertices are there, and are kept: it may be a hole.
  std::vector<SharedCoordinate> shared_coordinates;  ///< The same of one coordinate.
  std::uint64_t unreferenced_vertex_count = 0;       ///< Vertices of no triangle; 0 when there is no triangle at all.
  std::uint64_t absurd_time_count = 0;               ///< Vertices that were seen at no Unix time.
  std::uint64_t clamped_colour_count = 0;            ///< Vertices whose colour was out of range or no number.
  std::uint64_t trailing_byte_count = 0;             ///< After the last element; white space does not count in ascii.
  std::uint64_t packed_trailing_byte_count = 0;      ///< After the end of the gzip data.
};

/// How the values of a file are taken.
struct PlyInterpretation {
  explicit PlyInterpretation(const ReadOptions& options)
      : temperature(options), metres_per_unit(options.scale()), origin(options.origin) {}

  PlySchema schema;
  PlySurvey survey;
  ColourConversion colours;  ///< Of the vertices.
  TemperatureConversion temperature;
  double metres_per_unit;
  std::optional<base::Vec3d> origin;  ///< Absent: chosen.
  std::vector<Hole> holes;            ///< Vertices there are no part of the scene.
};

/// A PLY file that is read in blocks, in constant memory but for one or two bits a vertex (12 bytes where faces have more than
/// three corners; and what ply_survey() says): the
/// ground of read_ply(), and the way to work on files larger than memory. Safe on untrusted input. What is accepted, and what
/// colours and temperatures are recognised, is told at read_ply().
class PlyStream {
 public:
  /// Opens the file, judges its header against its size, and looks at its values where their meaning depends on them.
  static base::Result<PlyStream> open(const std::filesystem::path& path, const ReadOptions& options = {});

  const PlyHeader& header() const { return header_; }
  std::uint64_t vertex_count() const { return vertices().count; }
  /// More triangles than this the bytes of the file cannot hold, if all faces are triangles.
  std::uint64_t triangle_count_limit() const;
  bool has_visible() const;
  bool has_temperature() const;
  bool has_confidence() const { return interpretation_.schema.has_confidence(); }
  /// Some coordinate has a type that a float cannot hold; or, as a reading has shown, is text with more digits than that.
  bool has_double_positions() const;
  bool has_double_positions(const PlyBodyFacts& facts) const {
    return has_double_positions() || facts.is_finer_than_declared;
  }
  bool is_text() const { return header_.format == PlyFormat::Ascii; }

  /// Reads the whole body from its beginning; may be called again.
  base::Result<PlyBodyFacts> read(const PlyHandlers& handlers);

  /// Where the reading found holes that are written as a number, they are left out of all later ones, and true tells that this
  /// one is void.
  bool leave_out_holes(const PlyBodyFacts& facts);

  /// What has to be said about the file after a reading, for people.
  std::vector<Note> notes(const PlyBodyFacts& facts) const;

 private:
  PlyStream(BlockFile file, std::string name, ReadOptions options)
      : file_(std::move(file)), name_(std::move(name)), options_(std::move(options)), interpretation_(options_) {}
  base::Result<void> interpret();
  base::Result<void> check_size();
  base::Result<PlyBodyFacts> with_reason(base::Result<PlyBodyFacts> facts);
  const PlyElement& vertices() const { return *header_.find("vertex"); }

  BlockFile file_;
  std::string name_;  ///< Of the file, for messages.
  ReadOptions options_;
  PlyHeader header_;
  PlyInterpretation interpretation_;
  std::vector<base::Vec3f> polygon_positions_;  ///< Of all vertices, once a polygon has needed them.
};

}  // namespace spectra::files
