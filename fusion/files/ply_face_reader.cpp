#include "fusion/files/ply_face_reader.hpp"

#include <algorithm>
#include <bit>
#include <limits>
#include <string>
#include <utility>

#include "fusion/files/ply_values.hpp"

namespace spectra::files {

namespace {

constexpr std::size_t kBlockTriangles = 4096;

/// The bytes of a whole number of the type the other way round.
std::int64_t swapped(std::int64_t value, PlyScalar type) {
  switch (type) {
    case PlyScalar::Int16:
    case PlyScalar::UInt16:
      return __builtin_bswap16(static_cast<std::uint16_t>(value));
    case PlyScalar::Int32:
    case PlyScalar::UInt32:
      return __builtin_bswap32(static_cast<std::uint32_t>(value));
    default:
      return value;
  }
}

base::Result<std::uint32_t> vertex_index(const PlyCursor& cursor, std::int64_t value, PlyScalar type,
                                         std::uint64_t vertex_count) {
  if (value < 0 || static_cast<std::uint64_t>(value) >= vertex_count) {
    const std::int64_t other = cursor.is_text() ? value : swapped(value, type);
    const bool is_swapped = other != value && other >= 0 && static_cast<std::uint64_t>(other) < vertex_count;
    return base::failure(base::ErrorCode::BadValue,
                         cursor.where() + " refers to vertex " + std::to_string(value) + ", but there are " +
                             std::to_string(vertex_count) + " vertices, counted from 0" +
                             (is_swapped ? "; with its bytes the other way round it would be vertex " +
                                               std::to_string(other) + ": the header may name the wrong byte order"
                                         : ""));
  }
  return static_cast<std::uint32_t>(value);
}

/// -1 ends a strip; in an unsigned type that is its largest value.
bool ends_strip(std::int64_t value, PlyScalar type) {
  if (value == -1) return true;
  switch (type) {
    case PlyScalar::UInt8:
      return value == std::numeric_limits<std::uint8_t>::max();
    case PlyScalar::UInt16:
      return value == std::numeric_limits<std::uint16_t>::max();
    case PlyScalar::UInt32:
      return value == std::numeric_limits<std::uint32_t>::max();
    default:
      return false;
  }
}

}  // namespace

std::uint64_t VertexBits::count() const {
  std::uint64_t count = 0;
  for (const std::uint64_t word : words_) count += static_cast<std::uint64_t>(std::popcount(word));
  return count;
}

PlyFaceReader::PlyFaceReader(PlyCursor& cursor, std::uint64_t vertex_count, const VertexBits& left_out,
                             const Sink& sink, Positions positions)
    : cursor_(cursor),
      vertex_count_(vertex_count),
      left_out_(left_out),
      sink_(sink),
      fetch_positions_(std::move(positions)) {
  is_referenced_.resize(vertex_count);
  triangles_.reserve(kBlockTriangles);
}

FaceFacts PlyFaceReader::facts() const {
  FaceFacts facts = facts_;
  facts.referenced_vertex_count = is_referenced_.count();
  return facts;
}

base::Result<void> PlyFaceReader::read_faces(const PlyElement& element, std::size_t corner_list) {
  const PlyProperty& list = element.properties[corner_list];
  const bool is_usual = !cursor_.is_text() && left_out_.is_empty() && element.properties.size() == 1 &&
                        size_bytes(list.count_type) == 1 && size_bytes(list.type) == 4;
  while (cursor_.entry < element.count) {
    if (is_usual) {
      BOOST_OUTCOME_TRY(cursor_.is_swapped() ? read_plain_triangles<true>(element)
                                             : read_plain_triangles<false>(element));
      if (cursor_.entry == element.count) break;
    }
    BOOST_OUTCOME_TRY(read_face(element, corner_list));
    ++cursor_.entry;
  }
  return flush();
}

/// Faces of a one-byte count and four-byte indices, as long as they are valid triangles and in the buffer; whatever
/// else comes is left to read_face().
template <bool kSwapped>
base::Result<void> PlyFaceReader::read_plain_triangles(const PlyElement& element) {
  constexpr std::size_t kTriangleBytes = 13;
  const auto vertex_count = static_cast<std::uint32_t>(vertex_count_);
  BlockFile& file = cursor_.file();
  while (cursor_.entry < element.count) {
    const auto bytes = file.ready(kTriangleBytes);
    const auto count = static_cast<std::size_t>(
        std::min<std::uint64_t>({bytes.size() / kTriangleBytes, kBlockTriangles, element.count - cursor_.entry}));
    if (triangles_.size() + count > kBlockTriangles) {
      BOOST_OUTCOME_TRY(flush());
    }
    const unsigned char* face = bytes.data();
    std::size_t done = 0;
    for (; done < count && *face == 3; ++done, face += kTriangleBytes) {
      const auto a = load_value<std::uint32_t, kSwapped>(face + 1);
      const auto b = load_value<std::uint32_t, kSwapped>(face + 5);
      const auto c = load_value<std::uint32_t, kSwapped>(face + 9);
      const bool is_valid = a < vertex_count && b < vertex_count && c < vertex_count && a != b && b != c && c != a;
      if (!is_valid) break;
      triangles_.push_back({a, b, c});
    }
    file.consume(done * kTriangleBytes);
    cursor_.entry += done;
    if (done < count || count == 0) return base::success();
  }
  return base::success();
}

base::Result<void> PlyFaceReader::read_face(const PlyElement& element, std::size_t corner_list) {
  BOOST_OUTCOME_TRY(cursor_.begin_entry(element));
  for (std::size_t p = 0; p < element.properties.size(); ++p) {
    const PlyProperty& property = element.properties[p];
    if (p == corner_list) {
      BOOST_OUTCOME_TRY(read_corners(cursor_, property, vertex_count_, corners_));
    } else if (property.is_list) {
      BOOST_OUTCOME_TRY(cursor_.skip_list(property));
    } else {
      BOOST_OUTCOME_TRY(cursor_.skip_values(1, property.type));
    }
  }
  BOOST_OUTCOME_TRY(cursor_.end_entry());
  return add_face();
}

base::Result<void> read_corners(PlyCursor& cursor, const PlyProperty& list, std::uint64_t vertex_count,
                                std::vector<std::uint32_t>& corners) {
  corners.clear();
  BOOST_OUTCOME_TRY(const std::uint64_t count, cursor.read_list_count(list));
  // A face of fewer than three corners is left out, whatever they are.
  if (count < 3) return cursor.skip_values(count, list.type);
  for (std::uint64_t corner = 0; corner < count; ++corner) {
    BOOST_OUTCOME_TRY(const std::int64_t value, cursor.read_whole_number(list.type));
    BOOST_OUTCOME_TRY(const std::uint32_t index, vertex_index(cursor, value, list.type, vertex_count));
    corners.push_back(index);
  }
  return base::success();
}

base::Result<void> PlyFaceReader::add_face() {
  if (corners_.size() < 3) {
    ++facts_.incomplete_face_count;
    return base::success();
  }
  if (!left_out_.is_empty() &&
      std::any_of(corners_.begin(), corners_.end(), [this](std::uint32_t corner) { return left_out_[corner]; })) {
    ++facts_.left_out_face_count;
    return base::success();
  }
  if (corners_.size() > 3) return add_polygon();
  return add_triangle({corners_[0], corners_[1], corners_[2]});
}

base::Result<void> PlyFaceReader::add_polygon() {
  ++facts_.polygon_count;
  if (positions_.empty()) {
    BOOST_OUTCOME_TRY(positions_, fetch_positions_());
  }
  corner_positions_.clear();
  for (const std::uint32_t corner : corners_) corner_positions_.push_back(positions_[corner]);
  const auto result = cutter_.cut(corner_positions_);
  if (result == mesh::PolygonCutter::Result::Ears) {
    for (const base::Triangle& ear : cutter_.triangles()) {
      BOOST_OUTCOME_TRY(add_triangle({corners_[ear[0]], corners_[ear[1]], corners_[ear[2]]}));
    }
    return base::success();
  }
  if (result == mesh::PolygonCutter::Result::Failed) {
    const bool is_large = corners_.size() > mesh::PolygonCutter::kMostCorners;
    ++(is_large ? facts_.large_polygon_count : facts_.crossing_polygon_count);
  }
  for (std::size_t i = 2; i < corners_.size(); ++i) {
    BOOST_OUTCOME_TRY(add_triangle({corners_[0], corners_[i - 1], corners_[i]}));
  }
  return base::success();
}

base::Result<void> PlyFaceReader::read_strips(const PlyElement& element, std::size_t corner_list) {
  for (; cursor_.entry < element.count; ++cursor_.entry) {
    BOOST_OUTCOME_TRY(cursor_.begin_entry(element));
    for (std::size_t p = 0; p < element.properties.size(); ++p) {
      const PlyProperty& property = element.properties[p];
      if (p == corner_list) {
        BOOST_OUTCOME_TRY(read_strip(property));
      } else if (property.is_list) {
        BOOST_OUTCOME_TRY(cursor_.skip_list(property));
      } else {
        BOOST_OUTCOME_TRY(cursor_.skip_values(1, property.type));
      }
    }
    BOOST_OUTCOME_TRY(cursor_.end_entry());
  }
  return flush();
}

/// Every vertex after the second of a strip makes a triangle with the two before it, turned the other way each time.
/// Triangles with a vertex twice only lead from one part of a strip to the next.
base::Result<void> PlyFaceReader::read_strip(const PlyProperty& list) {
  BOOST_OUTCOME_TRY(const std::uint64_t count, cursor_.read_list_count(list));
  std::uint64_t length = 0;
  std::uint32_t before = 0;
  std::uint32_t last = 0;
  for (std::uint64_t i = 0; i < count; ++i) {
    BOOST_OUTCOME_TRY(const std::int64_t value, cursor_.read_whole_number(list.type));
    if (ends_strip(value, list.type)) {
      length = 0;
      continue;
    }
    BOOST_OUTCOME_TRY(const std::uint32_t vertex, vertex_index(cursor_, value, list.type, vertex_count_));
    if (++length == 1) ++facts_.strip_count;
    if (length >= 3 && before != last && last != vertex && vertex != before) {
      const bool is_left_out = !left_out_.is_empty() && (left_out_[before] || left_out_[last] || left_out_[vertex]);
      if (is_left_out) {
        ++facts_.left_out_face_count;
      } else {
        const bool is_turned = length % 2 == 0;
        BOOST_OUTCOME_TRY(
            add_triangle(is_turned ? base::Triangle{last, before, vertex} : base::Triangle{before, last, vertex}));
      }
    }
    before = last;
    last = vertex;
  }
  return base::success();
}

base::Result<void> PlyFaceReader::add_triangle(const base::Triangle& triangle) {
  if (triangle[0] == triangle[1] || triangle[1] == triangle[2] || triangle[2] == triangle[0]) {
    ++facts_.degenerate_triangle_count;
    return base::success();
  }
  triangles_.push_back(triangle);
  return triangles_.size() < kBlockTriangles ? base::success() : flush();
}

base::Result<void> PlyFaceReader::flush() {
  if (triangles_.empty()) return base::success();
  for (const base::Triangle& triangle : triangles_) {
    for (const std::uint32_t index : triangle) is_referenced_.set(index);
  }
  facts_.triangle_count += triangles_.size();
  if (sink_) {
    auto result = sink_(triangles_);
    sink_has_failed_ = !result;
    BOOST_OUTCOME_TRY(std::move(result));
  }
  triangles_.clear();
  return base::success();
}

}  // namespace spectra::files
