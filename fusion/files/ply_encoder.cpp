#include "fusion/files/ply_encoder.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <utility>

namespace spectra::files {

namespace {

constexpr std::size_t kMaxBufferBytes = std::size_t{256} * 1024;
/// No entry is longer: three doubles, a colour, a temperature, its sigma and time.
constexpr std::size_t kMaxEntryBytes = 3 * 8 + 3 + 4 + 4 + 8;

std::string header_text(const PlyLayout& layout) {
  const std::string coordinate = layout.double_positions ? "double" : "float";
  std::string text = "ply\nformat binary_little_endian 1.0\ncomment written by Spectra\n";
  if (!layout.comment.empty()) text += "comment " + layout.comment + "\n";
  text += "element vertex " + std::to_string(layout.vertex_count) + "\n";
  for (const char* const axis : {"x", "y", "z"}) text += "property " + coordinate + " " + axis + "\n";
  for (const char* const channel : {"red", "green", "blue"}) {
    text += "property uchar " + std::string(channel) + "\n";
  }
  if (layout.has_temperature) text += "property float temperature\n";
  if (layout.has_confidence) text += "property float temperature_sigma\nproperty double seen\n";
  if (layout.triangle_count > 0) {
    text += "element face " + std::to_string(layout.triangle_count) + "\nproperty list uchar int vertex_indices\n";
  }
  return text + "end_header\n";
}

/// Room for all of a small file, and for at least one entry beside the header.
std::size_t buffer_bytes(const PlyLayout& layout, std::size_t header_bytes) {
  const std::uint64_t entries = std::min<std::uint64_t>(layout.vertex_count, kMaxBufferBytes) +
                                std::min<std::uint64_t>(layout.triangle_count, kMaxBufferBytes) + 1;
  return header_bytes + static_cast<std::size_t>(std::min<std::uint64_t>(entries * kMaxEntryBytes, kMaxBufferBytes));
}

}  // namespace

PlyEncoder::PlyEncoder(const PlyLayout& layout, Sink sink) : layout_(layout), sink_(std::move(sink)) {
  const std::string header = header_text(layout);
  buffer_.resize(buffer_bytes(layout, header.size()));
  std::memcpy(buffer_.data(), header.data(), header.size());
  size_ = header.size();
}

template <class T>
void PlyEncoder::put(T value) {
  std::array<std::byte, sizeof(T)> bytes = std::bit_cast<std::array<std::byte, sizeof(T)>>(value);
  if constexpr (std::endian::native == std::endian::big) std::reverse(bytes.begin(), bytes.end());
  std::memcpy(buffer_.data() + size_, bytes.data(), bytes.size());
  size_ += bytes.size();
}

base::Result<void> PlyEncoder::vertices(std::span<const base::Vec3f> positions, std::span<const base::Rgb8> colours,
                                        std::span<const float> temperature_celsius, const PlyConfidence& confidence) {
  if (layout_.has_confidence &&
      (confidence.sigma_kelvin.size() != positions.size() || confidence.seen_s.size() != positions.size())) {
    return base::failure(base::ErrorCode::Inconsistent,
                         "the vertices to write have " + std::to_string(positions.size()) + " positions, " +
                             std::to_string(confidence.sigma_kelvin.size()) + " deviations and " +
                             std::to_string(confidence.seen_s.size()) + " times");
  }
  if (colours.size() != positions.size() ||
      (layout_.has_temperature && temperature_celsius.size() != positions.size())) {
    return base::failure(base::ErrorCode::Inconsistent,
                         "the vertices to write have " + std::to_string(positions.size()) + " positions, " +
                             std::to_string(colours.size()) + " colours and " +
                             std::to_string(temperature_celsius.size()) + " temperatures");
  }
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const base::Vec3d position = {layout_.origin.x + static_cast<double>(positions[i].x),
                                  layout_.origin.y + static_cast<double>(positions[i].y),
                                  layout_.origin.z + static_cast<double>(positions[i].z)};
    BOOST_OUTCOME_TRY(vertex(position, colours[i], layout_.has_temperature ? temperature_celsius[i] : 0));
    if (layout_.has_confidence) {
      put(confidence.sigma_kelvin[i]);
      put(confidence.seen_s[i]);
    }
  }
  return base::success();
}

base::Result<void> PlyEncoder::left_out_vertex(const base::Vec3d& position, base::Rgb8 colour,
                                               float temperature_celsius) {
  BOOST_OUTCOME_TRY(vertex(position, colour, temperature_celsius));
  if (layout_.has_confidence) {
    put(std::numeric_limits<float>::quiet_NaN());
    put(std::numeric_limits<double>::quiet_NaN());
  }
  return base::success();
}

inline base::Result<void> PlyEncoder::vertex(const base::Vec3d& position, base::Rgb8 colour,
                                             float temperature_celsius) {
  if (buffer_.size() - size_ < kMaxEntryBytes) {
    BOOST_OUTCOME_TRY(flush());
  }
  for (const double coordinate : {position.x, position.y, position.z}) {
    if (layout_.double_positions) {
      put(coordinate);
    } else {
      put(static_cast<float>(coordinate));
    }
  }
  put(colour.r);
  put(colour.g);
  put(colour.b);
  if (layout_.has_temperature) put(temperature_celsius);
  ++vertices_done_;
  return base::success();
}

base::Result<void> PlyEncoder::triangles(std::span<const base::Triangle> triangles) {
  for (const base::Triangle& triangle : triangles) {
    if (buffer_.size() - size_ < kMaxEntryBytes) {
      BOOST_OUTCOME_TRY(flush());
    }
    put(std::uint8_t{3});
    for (const std::uint32_t index : triangle) put(index);
  }
  triangles_done_ += triangles.size();
  return base::success();
}

base::Result<void> PlyEncoder::finish() {
  if (vertices_done_ != layout_.vertex_count || triangles_done_ != layout_.triangle_count) {
    return base::failure(base::ErrorCode::Inconsistent, "the header promises " + std::to_string(layout_.vertex_count) +
                                                            " vertices and " + std::to_string(layout_.triangle_count) +
                                                            " triangles, but " + std::to_string(vertices_done_) +
                                                            " and " + std::to_string(triangles_done_) +
                                                            " were written");
  }
  return flush();
}

base::Result<void> PlyEncoder::flush() {
  const std::size_t size = std::exchange(size_, 0);
  return sink_(std::span<const std::byte>(buffer_).first(size));
}

}  // namespace spectra::files
