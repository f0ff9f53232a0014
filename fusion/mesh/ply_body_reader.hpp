#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "fusion/mesh/ply_stream.hpp"

namespace spectra::fusion {

/// One reading of the body of a PlyStream, whose file stands at the body's beginning. Used once.
class PlyBodyReader {
 public:
  PlyBodyReader(PlyStream& stream, const PlyHandlers& handlers);
  Result<PlyBodyFacts> read();
  /// The error of read() came from a handler: it is not about this file.
  bool handler_has_failed() const { return handler_has_failed_; }

 private:
  Result<void> read_vertices(const PlyElement& element);
  template <bool kSwapped>
  Result<void> read_fixed_vertices(const PlyElement& element);
  Result<void> read_vertices_one_by_one(const PlyElement& element);
  Result<void> finish_vertex_block(std::size_t count);
  Result<void> convert_colours(std::size_t count);

  Result<void> read_faces(const PlyElement& element);
  template <bool kSwapped>
  Result<void> read_plain_triangles(const PlyElement& element);
  Result<void> read_face(const PlyElement& element);
  Result<void> read_corners(const PlyProperty& property);
  Result<void> add_triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c);
  Result<void> flush_triangles();
  Result<std::uint32_t> corner_index(std::int64_t value) const;

  Result<void> handed_on(Result<void> result);

  Result<void> skip_element(const PlyElement& element);
  Result<void> skip_list(const PlyProperty& property);
  Result<void> skip_values(std::uint64_t count, PlyScalar type);

  Result<void> begin_entry(const PlyElement& element);
  Result<void> end_entry();
  Result<double> read_value(PlyScalar type);
  Result<std::int64_t> read_whole_number(PlyScalar type);
  Result<std::uint64_t> read_list_count(const PlyProperty& property);
  Result<std::string_view> next_token();
  Error shortage() const;
  std::string where() const;

  PlyStream& stream_;
  BlockFile& file_;
  const PlyHandlers& handlers_;
  const bool is_text_;
  const bool is_swapped_;
  const double metres_per_unit_;
  PlyBodyFacts facts_;

  const PlyElement* element_ = nullptr;  ///< Being read, for messages.
  std::uint64_t entry_ = 0;

  std::vector<Vec3d> positions_;
  std::array<std::vector<double>, 3> colour_values_;
  std::vector<Rgb8> colours_;
  std::vector<double> temperature_values_;
  std::vector<float> temperatures_;
  const TemperatureConversion temperature_conversion_;

  std::vector<Triangle> triangles_;
  bool handler_has_failed_ = false;
  std::vector<std::uint64_t> is_referenced_;  ///< One bit a vertex.
};

}  // namespace spectra::fusion
