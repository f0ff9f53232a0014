#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "fusion/base/error.hpp"
#include "fusion/base/vertex_types.hpp"

namespace spectra::files {

/// What a PLY file that Spectra writes will hold.
struct PlyLayout {
  std::uint64_t vertex_count = 0;
  std::uint64_t triangle_count = 0;  ///< 0: no element 'face'.
  base::Vec3d origin;                ///< Added to every position.
  bool double_positions = false;
  bool has_temperature = false;
  bool has_confidence = false;  ///< temperature_sigma and seen after the temperature.
  std::string comment;          ///< One line of the header; empty: none.
};

/// How sure a temperature is and when it was seen, one a vertex.
struct PlyConfidence {
  std::span<const float> sigma_kelvin;
  std::span<const double> seen_s;
};

/// Makes the bytes of a binary little-endian PLY file, block after block, in constant memory.
class PlyEncoder {
 public:
  using Sink = std::function<base::Result<void>(std::span<const std::byte>)>;

  PlyEncoder(const PlyLayout& layout, Sink sink);

  /// In this order: all vertices in any number of calls, then all triangles, then finish(). `temperature_celsius` is
  /// read when the layout has one, `confidence` when it has that; the spans have the same length.
  base::Result<void> vertices(std::span<const base::Vec3f> positions, std::span<const base::Rgb8> colours,
                              std::span<const float> temperature_celsius, const PlyConfidence& confidence = {});
  /// One vertex more, whose position is written as it is: it may be no finite one.
  base::Result<void> left_out_vertex(const base::Vec3d& position, base::Rgb8 colour, float temperature_celsius);
  base::Result<void> triangles(std::span<const base::Triangle> triangles);
  /// Hands on what is still buffered. Inconsistent when there were not as many vertices and triangles as was said.
  base::Result<void> finish();

 private:
  base::Result<void> vertex(const base::Vec3d& position, base::Rgb8 colour, float temperature_celsius);
  base::Result<void> flush();
  template <class T>
  void put(T value);

  PlyLayout layout_;
  Sink sink_;
  std::vector<std::byte> buffer_;
  std::size_t size_ = 0;
  std::uint64_t vertices_done_ = 0;
  std::uint64_t triangles_done_ = 0;
};

}  // namespace spectra::files
