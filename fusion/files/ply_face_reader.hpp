#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "fusion/base/vertex_types.hpp"
#include "fusion/files/ply_cursor.hpp"
#include "fusion/files/ply_schema.hpp"
#include "fusion/mesh/polygon_cutter.hpp"

namespace spectra::files {

/// One bit a vertex.
class VertexBits {
 public:
  void resize(std::uint64_t vertex_count) { words_.assign((vertex_count + 63) / 64, 0); }
  bool is_empty() const { return words_.empty(); }
  void set(std::uint64_t vertex) { words_[vertex / 64] |= std::uint64_t{1} << (vertex % 64); }
  bool operator[](std::uint64_t vertex) const { return (words_[vertex / 64] >> (vertex % 64) & 1U) != 0; }
  std::uint64_t count() const;

 private:
  std::vector<std::uint64_t> words_;
};

/// What was found among the faces.
struct FaceFacts {
  std::uint64_t triangle_count = 0;          ///< That were handed on.
  std::uint64_t polygon_count = 0;           ///< Faces of more than three corners, cut into triangles.
  std::uint64_t crossing_polygon_count = 0;  ///< Of these, cut into fans that may not be right: they cross themselves.
  std::uint64_t large_polygon_count = 0;     ///< The same, because they are concave and have too many corners.
  std::uint64_t strip_count = 0;             ///< Triangle strips, cut into triangles.
  std::uint64_t degenerate_triangle_count = 0;  ///< Left out: a vertex twice.
  std::uint64_t incomplete_face_count = 0;      ///< Left out: fewer than three corners.
  std::uint64_t left_out_face_count = 0;        ///< Left out with a vertex that is left out.
  std::uint64_t referenced_vertex_count = 0;
};

/// Reads the elements 'face' and 'tristrips' as the triangles that will be drawn.
class PlyFaceReader {
 public:
  using Sink = std::function<base::Result<void>(std::span<const base::Triangle>)>;
  /// The position of every vertex; asked for at the first polygon of more than three corners. The file stays where it is.
  using Positions = std::function<base::Result<std::span<const base::Vec3f>>()>;

  /// Faces with a vertex of `left_out` (empty: none) are left out. An empty sink is not called; when it fails, so does the
  /// reading, with its error. All of it outlives the reader.
  PlyFaceReader(PlyCursor& cursor, std::uint64_t vertex_count, const VertexBits& left_out, const Sink& sink,
                Positions positions);

  base::Result<void> read_faces(const PlyElement& element, std::size_t corner_list);
  base::Result<void> read_strips(const PlyElement& element, std::size_t corner_list);

  FaceFacts facts() const;
  bool is_referenced(std::uint64_t vertex) const { return is_referenced_[vertex]; }
  /// The error came from the sink: it is not about this file.
  bool sink_has_failed() const { return sink_has_failed_; }

 private:
  template <bool kSwapped>
  base::Result<void> read_plain_triangles(const PlyElement& element);
  base::Result<void> read_face(const PlyElement& element, std::size_t corner_list);
  base::Result<void> read_strip(const PlyProperty& list);
  base::Result<void> add_face();
  base::Result<void> add_polygon();
  base::Result<void> add_triangle(const base::Triangle& triangle);
  base::Result<void> flush();

  PlyCursor& cursor_;
  const std::uint64_t vertex_count_;
  const VertexBits& left_out_;
  const Sink& sink_;
  const Positions fetch_positions_;
  std::span<const base::Vec3f> positions_;
  FaceFacts facts_;
  VertexBits is_referenced_;
  std::vector<base::Triangle> triangles_;
  std::vector<std::uint32_t> corners_;  ///< Of the face that is read.
  std::vector<base::Vec3f> corner_positions_;
  mesh::PolygonCutter cutter_;
  bool sink_has_failed_ = false;
};

/// Reads the corners of one face, whose list comes next; replaces what is in `corners`.
base::Result<void> read_corners(PlyCursor& cursor, const PlyProperty& list, std::uint64_t vertex_count,
                                std::vector<std::uint32_t>& corners);

}  // namespace spectra::files
