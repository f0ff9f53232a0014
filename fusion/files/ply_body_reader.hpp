#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "fusion/files/ply_cursor.hpp"
#include "fusion/files/ply_face_reader.hpp"
#include "fusion/files/ply_stream.hpp"
#include "fusion/files/ply_vertex_reader.hpp"

namespace spectra::files {

/// One reading of the body of a PLY file: the vertices first, then the faces, wherever they stand in it. Used once.
class PlyBodyReader {
 public:
  /// All of it outlives the reader. `polygon_positions` is filled where a polygon needs it, and may be given again.
  PlyBodyReader(BlockFile& file, const PlyHeader& header, const PlyInterpretation& interpretation,
                const PlyHandlers& handlers, std::vector<base::Vec3f>& polygon_positions);
  base::Result<PlyBodyFacts> read();
  /// The error of read() came from a handler: it is not about this file.
  bool handler_has_failed() const { return handler_has_failed_; }

 private:
  /// Of the two passes that a file with its faces first needs.
  enum class Part { Everything, Vertices, Faces };
  base::Result<void> read_part(Part part, PlyFaceReader& faces, PlyCursor& cursor);
  base::Result<void> read_vertices(PlyCursor& cursor, const PlyElement& element);
  base::Result<void> hand_on(PlyRawVertices raw, const PlyElement& element);
  void judge_positions(std::span<base::Vec3d> positions, std::uint64_t first_vertex);
  base::Result<void> convert_colours(const PlyRawVertices& raw, const PlyElement& element);
  void conclude_positions(const PlyFaceReader& faces);
  void convert_temperatures(const PlyRawVertices& raw);
  void count_carried_temperatures(const PlyVertexBlock& block);
  void convert_confidence(const PlyRawVertices& raw);
  base::Result<std::span<const base::Vec3f>> polygon_positions();

  BlockFile& file_;
  const PlyHeader& header_;
  const PlyInterpretation& interpretation_;
  const PlyHandlers& handlers_;
  std::vector<base::Vec3f>& polygon_positions_;
  PlyBodyFacts facts_;
  PositionSample sample_;

  VertexBits is_left_out_;               ///< Empty until the first one.
  std::vector<std::uint32_t> left_out_;  ///< Of the block.
  std::vector<base::Rgb8> colours_;
  std::vector<float> temperatures_, sigmas_;
  std::vector<double> looked_at_;
  std::array<bool, 3> has_more_digits_{};  ///< Of a text: coordinates that are no floats were seen.
  bool handler_has_failed_ = false;
};

}  // namespace spectra::files
