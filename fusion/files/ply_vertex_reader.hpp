#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "fusion/base/vertex_types.hpp"
#include "fusion/files/ply_cursor.hpp"
#include "fusion/files/ply_schema.hpp"

namespace spectra::files {

/// Some vertices in the file's order, as the numbers that the file has. The spans are valid until the next block is asked for.
struct PlyRawVertices {
  std::uint64_t first_vertex = 0;
  std::span<base::Vec3d> positions;
  std::array<std::span<double>, 3> colours;  ///< Empty when the vertices have none. Packed ones: the first alone.
  std::span<double> temperatures;            ///< Empty when the vertices have none.
  std::span<double> sigmas, seen;            ///< The same.
};

/// Reads the element 'vertex' in blocks. The cursor stands at its beginning.
class PlyVertexReader {
 public:
  PlyVertexReader(PlyCursor& cursor, const PlyElement& element, const PlySchema& schema);

  /// The next vertices; none at the end.
  base::Result<PlyRawVertices> next();

 private:
  template <bool kSwapped>
  base::Result<void> read_columns(std::size_t& count);
  base::Result<void> read_one_by_one(std::size_t count);

  /// A column that is read, and where its values go.
  struct Column {
    std::size_t property = 0;
    PlyScalar type = PlyScalar::Float32;
    std::size_t offset = 0;  ///< In a binary entry.
    double* out = nullptr;
    std::size_t out_stride = 1;
  };

  PlyCursor& cursor_;
  const PlyElement& element_;
  const bool has_fixed_size_;
  const std::size_t block_vertices_;
  std::size_t entry_bytes_ = 0;  ///< When they all have the same.
  std::vector<Column> columns_;
  std::vector<base::Vec3d> positions_;
  std::array<std::vector<double>, 3> colours_;
  std::vector<double> temperatures_, sigmas_, seen_;
};

}  // namespace spectra::files
