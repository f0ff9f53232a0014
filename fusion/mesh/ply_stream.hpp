#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "fusion/error.hpp"
#include "fusion/mesh/block_file.hpp"
#include "fusion/mesh/ply_header.hpp"
#include "fusion/mesh/ply_reader.hpp"
#include "fusion/mesh/read_options.hpp"
#include "fusion/mesh/vertex_temperature.hpp"
#include "fusion/vertex_types.hpp"

namespace spectra::fusion {

/// Some vertices in the file's order. The spans are valid during the call only.
struct PlyVertexBlock {
  std::uint64_t first_vertex = 0;
  std::span<const Vec3d> positions;            ///< Metres; finite, within the range of float.
  std::span<const Rgb8> visible;               ///< Empty when the file has no colours.
  std::span<const float> temperature_celsius;  ///< Empty when the file has none; NaN = missing, +-inf = out of range.
};

/// Who gets the body of a file. A handler that fails ends the reading with its error; an empty one is not called.
struct PlyHandlers {
  std::function<Result<void>(const PlyVertexBlock&)> vertices;
  /// Triangles as they will be drawn: polygons cut into fans, indices checked, none with a vertex twice.
  std::function<Result<void>(std::span<const Triangle>)> triangles;
};

/// What was found in the body.
struct PlyBodyFacts {
  Vec3d min, max;                               ///< Of all positions.
  std::uint64_t triangle_count = 0;             ///< That were handed on.
  std::uint64_t polygon_count = 0;              ///< Faces of more than three corners, cut into fans.
  std::uint64_t degenerate_triangle_count = 0;  ///< Left out: a vertex twice.
  std::uint64_t incomplete_face_count = 0;      ///< Left out: fewer than three corners.
  std::uint64_t unreferenced_vertex_count = 0;  ///< Vertices of no triangle; 0 when there is no triangle at all.
  TemperatureFacts temperature;
  std::uint64_t trailing_byte_count = 0;  ///< After the last element; white space does not count in ascii.
};

/// A PLY file that is read in blocks, in constant memory but for one bit a vertex: the ground of read_ply(), and the way
/// to work on files larger than memory. Safe on untrusted input. What is accepted, and what colours and temperatures are
/// recognised, is told at read_ply().
class PlyStream {
 public:
  /// Opens the file and judges its header against its size.
  static Result<PlyStream> open(const std::filesystem::path& path, const ReadOptions& options = {});

  const PlyHeader& header() const { return header_; }
  std::uint64_t vertex_count() const { return vertex_count_; }
  /// Faces in the file, of any number of corners.
  std::uint64_t face_count() const { return face_count_; }
  /// More triangles than this the bytes of the file cannot hold, if all faces are triangles.
  std::uint64_t triangle_count_limit() const;
  bool has_visible() const { return slot_properties_[kRed].has_value(); }
  bool has_temperature() const { return slot_properties_[kTemperature].has_value(); }
  /// The faces stand before the vertices in the file, and are handed on in that order.
  bool has_faces_first() const;
  /// Some coordinate is a double in the file.
  bool has_double_positions() const { return has_double_positions_; }

  /// Reads the whole body from its beginning; may be called again.
  Result<PlyBodyFacts> read(const PlyHandlers& handlers);

  /// What has to be said about the file after a reading, for people.
  std::vector<Note> notes(const PlyBodyFacts& facts) const;

 private:
  /// What a vertex property means to us.
  enum Slot : std::size_t { kX, kY, kZ, kRed, kGreen, kBlue, kTemperature, kSlotCount };
  friend class PlyBodyReader;

  PlyStream(BlockFile file, std::string name, ReadOptions options)
      : file_(std::move(file)), name_(std::move(name)), options_(std::move(options)) {}
  Result<void> interpret_header();
  Result<void> interpret_vertex_properties(const PlyElement& element);
  Result<void> find_temperature(const PlyElement& element);
  Result<void> check_size() const;

  BlockFile file_;
  std::string name_;  ///< Of the file, for messages.
  ReadOptions options_;
  PlyHeader header_;
  std::uint64_t vertex_count_ = 0;
  std::uint64_t face_count_ = 0;
  bool has_double_positions_ = false;
  std::array<std::optional<std::size_t>, kSlotCount> slot_properties_;  ///< Slot -> index of the vertex property.
  std::size_t face_list_property_ = 0;  ///< Index of the face property that lists the corners.
  std::vector<Note> header_notes_;
};

}  // namespace spectra::fusion
