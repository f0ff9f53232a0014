#include "fusion/mesh/ply_body_reader.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <system_error>
#include <utility>

#include "fusion/mesh/ply_values.hpp"

namespace spectra::fusion {

namespace {

constexpr std::size_t kBlockVertices = 1024;
constexpr std::size_t kBlockTriangles = 4096;
/// A number in a text file must be written with at most this many characters.
constexpr std::size_t kMaxTokenBytes = 512;
constexpr double kFloatMax = static_cast<double>(std::numeric_limits<float>::max());

bool is_blank(unsigned char c) {
  return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f';
}
bool is_space(unsigned char c) {
  return is_blank(c) || c == '\n';
}

/// Whole numbers from 0 to 255 as they are, floats from 0 to 1 scaled; nullopt: outside.
std::optional<std::uint8_t> colour_byte(double value, PlyScalar type) {
  if (is_floating(type)) {
    if (!(value >= 0 && value <= 1)) return std::nullopt;
    return static_cast<std::uint8_t>(std::floor(value * 255 + 0.5));
  }
  if (!(value >= 0 && value <= 255) || value != std::floor(value)) return std::nullopt;
  return static_cast<std::uint8_t>(value);
}

bool has_no_list(const PlyElement& element) {
  return std::none_of(element.properties.begin(), element.properties.end(),
                      [](const PlyProperty& property) { return property.is_list; });
}

}  // namespace

PlyBodyReader::PlyBodyReader(PlyStream& stream, const PlyHandlers& handlers)
    : stream_(stream),
      file_(stream.file_),
      handlers_(handlers),
      is_text_(stream.header_.format == PlyFormat::Ascii),
      is_swapped_((stream.header_.format == PlyFormat::BinaryBigEndian) ==
                  (std::endian::native == std::endian::little)),
      metres_per_unit_(stream.options_.metres_per_unit),
      temperature_conversion_(stream.options_) {}

Result<PlyBodyFacts> PlyBodyReader::read() {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  facts_.min = {kInfinity, kInfinity, kInfinity};
  facts_.max = {-kInfinity, -kInfinity, -kInfinity};
  for (const PlyElement& element : stream_.header_.elements) {
    element_ = &element;
    entry_ = 0;
    if (element.name == "vertex") {
      BOOST_OUTCOME_TRY(read_vertices(element));
    } else if (element.name == "face" && element.count > 0) {
      BOOST_OUTCOME_TRY(read_faces(element));
    } else {
      BOOST_OUTCOME_TRY(skip_element(element));
    }
  }
  if (facts_.triangle_count > 0) {
    std::uint64_t referenced_count = 0;
    for (const std::uint64_t bits : is_referenced_) {
      referenced_count += static_cast<std::uint64_t>(std::popcount(bits));
    }
    facts_.unreferenced_vertex_count = stream_.vertex_count_ - referenced_count;
  }
  if (is_text_) {
    for (auto bytes = file_.ready(1); !bytes.empty() && is_space(bytes[0]); bytes = file_.ready(1)) {
      file_.consume(1);
    }
  }
  facts_.trailing_byte_count = file_.remaining();
  return facts_;
}

Result<void> PlyBodyReader::read_vertices(const PlyElement& element) {
  positions_.resize(kBlockVertices);
  if (stream_.has_visible()) {
    colours_.resize(kBlockVertices);
    for (auto& channel : colour_values_) channel.resize(kBlockVertices);
  }
  if (stream_.has_temperature()) {
    temperatures_.resize(kBlockVertices);
    temperature_values_.resize(kBlockVertices);
  }
  if (is_text_ || !has_no_list(element)) return read_vertices_one_by_one(element);
  return is_swapped_ ? read_fixed_vertices<true>(element) : read_fixed_vertices<false>(element);
}

template <bool kSwapped>
Result<void> PlyBodyReader::read_fixed_vertices(const PlyElement& element) {
  std::vector<std::size_t> offsets;
  std::size_t stride = 0;
  for (const PlyProperty& property : element.properties) {
    offsets.push_back(stride);
    stride += size_bytes(property.type);
  }
  const auto load = [&](std::size_t slot, const unsigned char* bytes, std::size_t count, double* out,
                        std::size_t out_stride) {
    const std::size_t property = *stream_.slot_properties_[slot];
    load_column<kSwapped>(element.properties[property].type, bytes + offsets[property], stride, count, out, out_stride);
  };
  while (entry_ < element.count) {
    const auto bytes = file_.ready(stride);
    if (bytes.size() < stride) return shortage();
    const auto count = static_cast<std::size_t>(
        std::min<std::uint64_t>({bytes.size() / stride, kBlockVertices, element.count - entry_}));
    load(PlyStream::kX, bytes.data(), count, &positions_[0].x, 3);
    load(PlyStream::kY, bytes.data(), count, &positions_[0].y, 3);
    load(PlyStream::kZ, bytes.data(), count, &positions_[0].z, 3);
    if (stream_.has_visible()) {
      for (std::size_t channel = 0; channel < 3; ++channel) {
        load(PlyStream::kRed + channel, bytes.data(), count, colour_values_[channel].data(), 1);
      }
    }
    if (stream_.has_temperature()) {
      load(PlyStream::kTemperature, bytes.data(), count, temperature_values_.data(), 1);
    }
    file_.consume(count * stride);
    BOOST_OUTCOME_TRY(finish_vertex_block(count));
  }
  return success();
}

Result<void> PlyBodyReader::read_vertices_one_by_one(const PlyElement& element) {
  std::vector<double*> targets(element.properties.size(), nullptr);
  std::array<double, PlyStream::kSlotCount> values{};
  for (std::size_t slot = 0; slot < PlyStream::kSlotCount; ++slot) {
    if (stream_.slot_properties_[slot]) targets[*stream_.slot_properties_[slot]] = &values[slot];
  }
  while (entry_ < element.count) {
    const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(kBlockVertices, element.count - entry_));
    for (std::size_t i = 0; i < count; ++i, ++entry_) {
      BOOST_OUTCOME_TRY(begin_entry(element));
      for (std::size_t p = 0; p < element.properties.size(); ++p) {
        const PlyProperty& property = element.properties[p];
        if (property.is_list) {
          BOOST_OUTCOME_TRY(skip_list(property));
        } else if (targets[p] != nullptr) {
          BOOST_OUTCOME_TRY(*targets[p], read_value(property.type));
        } else {
          BOOST_OUTCOME_TRY(skip_values(1, property.type));
        }
      }
      BOOST_OUTCOME_TRY(end_entry());
      positions_[i] = {values[PlyStream::kX], values[PlyStream::kY], values[PlyStream::kZ]};
      if (stream_.has_visible()) {
        for (std::size_t channel = 0; channel < 3; ++channel) {
          colour_values_[channel][i] = values[PlyStream::kRed + channel];
        }
      }
      if (stream_.has_temperature()) temperature_values_[i] = values[PlyStream::kTemperature];
    }
    entry_ -= count;
    BOOST_OUTCOME_TRY(finish_vertex_block(count));
  }
  return success();
}

/// Checks and converts the first `count` values of the block's arrays, hands them on, and moves entry_ on.
Result<void> PlyBodyReader::finish_vertex_block(std::size_t count) {
  if (metres_per_unit_ != 1) {
    for (Vec3d& p : std::span(positions_).first(count)) {
      p = {p.x * metres_per_unit_, p.y * metres_per_unit_, p.z * metres_per_unit_};
    }
  }
  bool is_good = true;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d& p = positions_[i];
    is_good = is_good && std::abs(p.x) <= kFloatMax && std::abs(p.y) <= kFloatMax && std::abs(p.z) <= kFloatMax;
    facts_.min = {std::min(facts_.min.x, p.x), std::min(facts_.min.y, p.y), std::min(facts_.min.z, p.z)};
    facts_.max = {std::max(facts_.max.x, p.x), std::max(facts_.max.y, p.y), std::max(facts_.max.z, p.z)};
  }
  if (!is_good) {
    for (std::size_t i = 0; i < count; ++i, ++entry_) {
      for (const double value : {positions_[i].x, positions_[i].y, positions_[i].z}) {
        if (!(std::abs(value) <= kFloatMax)) {
          return failure(ErrorCode::BadValue, where() + " has the coordinate " + number_text(value) +
                                                  "; positions must be finite and within the range of a float");
        }
      }
    }
  }
  BOOST_OUTCOME_TRY(convert_colours(count));
  if (stream_.has_temperature()) {
    temperature_conversion_.convert(std::span<const double>(temperature_values_).first(count),
                                    std::span(temperatures_).first(count), facts_.temperature);
  }
  const std::uint64_t first_vertex = entry_;
  entry_ += count;
  if (!handlers_.vertices) return success();
  return handed_on(
      handlers_.vertices({first_vertex, std::span(positions_).first(count),
                          std::span<const Rgb8>(colours_).first(stream_.has_visible() ? count : 0),
                          std::span<const float>(temperatures_).first(stream_.has_temperature() ? count : 0)}));
}

Result<void> PlyBodyReader::convert_colours(std::size_t count) {
  if (!stream_.has_visible()) return success();
  const std::array<std::uint8_t Rgb8::*, 3> members = {&Rgb8::r, &Rgb8::g, &Rgb8::b};
  for (std::size_t channel = 0; channel < 3; ++channel) {
    const PlyProperty& property = element_->properties[*stream_.slot_properties_[PlyStream::kRed + channel]];
    const std::vector<double>& values = colour_values_[channel];
    if (!is_text_ && property.type == PlyScalar::UInt8) {
      for (std::size_t i = 0; i < count; ++i) colours_[i].*members[channel] = static_cast<std::uint8_t>(values[i]);
      continue;
    }
    for (std::size_t i = 0; i < count; ++i) {
      const auto byte = colour_byte(values[i], property.type);
      if (!byte) {
        entry_ += i;
        return failure(ErrorCode::BadValue, where() + " has the colour value " + number_text(values[i]) + " in '" +
                                                property.name + "', which must be " +
                                                (is_floating(property.type) ? "from 0 to 1 for a floating type"
                                                                            : "a whole number from 0 to 255"));
      }
      colours_[i].*members[channel] = *byte;
    }
  }
  return success();
}

Result<void> PlyBodyReader::read_faces(const PlyElement& element) {
  is_referenced_.assign((stream_.vertex_count_ + 63) / 64, 0);
  triangles_.reserve(kBlockTriangles);
  const PlyProperty& list = element.properties[stream_.face_list_property_];
  const bool is_usual =
      !is_text_ && element.properties.size() == 1 && size_bytes(list.count_type) == 1 && size_bytes(list.type) == 4;
  while (entry_ < element.count) {
    if (is_usual) {
      BOOST_OUTCOME_TRY(is_swapped_ ? read_plain_triangles<true>(element) : read_plain_triangles<false>(element));
      if (entry_ == element.count) break;
    }
    BOOST_OUTCOME_TRY(read_face(element));
    ++entry_;
  }
  return flush_triangles();
}

/// Faces of a one-byte count and four-byte indices, as long as they are valid triangles and in the buffer; whatever
/// else comes is left to read_face().
template <bool kSwapped>
Result<void> PlyBodyReader::read_plain_triangles(const PlyElement& element) {
  constexpr std::size_t kTriangleBytes = 13;
  const auto vertex_count = static_cast<std::uint32_t>(stream_.vertex_count_);
  while (entry_ < element.count) {
    const auto bytes = file_.ready(kTriangleBytes);
    auto count = static_cast<std::size_t>(
        std::min<std::uint64_t>({bytes.size() / kTriangleBytes, kBlockTriangles, element.count - entry_}));
    if (triangles_.size() + count > kBlockTriangles) {
      BOOST_OUTCOME_TRY(flush_triangles());
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
    file_.consume(done * kTriangleBytes);
    entry_ += done;
    if (done < count || count == 0) return success();
  }
  return success();
}

Result<void> PlyBodyReader::read_face(const PlyElement& element) {
  BOOST_OUTCOME_TRY(begin_entry(element));
  for (std::size_t p = 0; p < element.properties.size(); ++p) {
    const PlyProperty& property = element.properties[p];
    if (p == stream_.face_list_property_) {
      BOOST_OUTCOME_TRY(read_corners(property));
    } else if (property.is_list) {
      BOOST_OUTCOME_TRY(skip_list(property));
    } else {
      BOOST_OUTCOME_TRY(skip_values(1, property.type));
    }
  }
  return end_entry();
}

Result<void> PlyBodyReader::read_corners(const PlyProperty& property) {
  BOOST_OUTCOME_TRY(const std::uint64_t count, read_list_count(property));
  if (count < 3) {
    ++facts_.incomplete_face_count;
    return skip_values(count, property.type);
  }
  std::uint32_t first = 0;
  std::uint32_t previous = 0;
  for (std::uint64_t corner = 0; corner < count; ++corner) {
    BOOST_OUTCOME_TRY(const std::int64_t value, read_whole_number(property.type));
    BOOST_OUTCOME_TRY(const std::uint32_t index, corner_index(value));
    if (corner == 0) first = index;
    if (corner >= 2) {
      BOOST_OUTCOME_TRY(add_triangle(first, previous, index));
    }
    previous = index;
  }
  if (count > 3) ++facts_.polygon_count;
  return success();
}

Result<std::uint32_t> PlyBodyReader::corner_index(std::int64_t value) const {
  if (value < 0 || static_cast<std::uint64_t>(value) >= stream_.vertex_count_) {
    return failure(ErrorCode::BadValue, where() + " refers to vertex " + std::to_string(value) + ", but there are " +
                                            std::to_string(stream_.vertex_count_) + " vertices, counted from 0");
  }
  return static_cast<std::uint32_t>(value);
}

Result<void> PlyBodyReader::add_triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
  if (a == b || b == c || c == a) {
    ++facts_.degenerate_triangle_count;
    return success();
  }
  triangles_.push_back({a, b, c});
  return triangles_.size() < kBlockTriangles ? success() : flush_triangles();
}

Result<void> PlyBodyReader::flush_triangles() {
  if (triangles_.empty()) return success();
  for (const Triangle& triangle : triangles_) {
    for (const std::uint32_t index : triangle) is_referenced_[index / 64] |= std::uint64_t{1} << (index % 64);
  }
  facts_.triangle_count += triangles_.size();
  if (handlers_.triangles) {
    BOOST_OUTCOME_TRY(handed_on(handlers_.triangles(triangles_)));
  }
  triangles_.clear();
  return success();
}

Result<void> PlyBodyReader::handed_on(Result<void> result) {
  handler_has_failed_ = !result;
  return result;
}

Result<void> PlyBodyReader::skip_element(const PlyElement& element) {
  if (element.properties.empty()) return success();
  if (!is_text_ && has_no_list(element)) {
    // check_size() has seen that they fit into the file.
    file_.skip(element.count * minimum_entry_bytes(element, stream_.header_.format));
    return success();
  }
  for (; entry_ < element.count; ++entry_) {
    BOOST_OUTCOME_TRY(begin_entry(element));
    for (const PlyProperty& property : element.properties) {
      if (property.is_list) {
        BOOST_OUTCOME_TRY(skip_list(property));
      } else {
        BOOST_OUTCOME_TRY(skip_values(1, property.type));
      }
    }
    BOOST_OUTCOME_TRY(end_entry());
  }
  return success();
}

Result<void> PlyBodyReader::skip_list(const PlyProperty& property) {
  BOOST_OUTCOME_TRY(const std::uint64_t count, read_list_count(property));
  return skip_values(count, property.type);
}

Result<void> PlyBodyReader::skip_values(std::uint64_t count, PlyScalar type) {
  if (!is_text_) {
    const std::uint64_t bytes = count * size_bytes(type);
    if (bytes > file_.remaining()) return shortage();
    file_.skip(bytes);
    return success();
  }
  for (std::uint64_t i = 0; i < count; ++i) {
    BOOST_OUTCOME_TRY(next_token());
  }
  return success();
}

/// In a text file every entry stands on a line of its own; empty lines are passed over.
Result<void> PlyBodyReader::begin_entry(const PlyElement& element) {
  if (!is_text_ || element.properties.empty()) return success();
  for (auto bytes = file_.ready(1); !bytes.empty() && is_space(bytes[0]); bytes = file_.ready(1)) {
    file_.consume(1);
  }
  return success();
}

Result<void> PlyBodyReader::end_entry() {
  if (!is_text_) return success();
  for (auto bytes = file_.ready(1); !bytes.empty(); bytes = file_.ready(1)) {
    if (!is_space(bytes[0])) {
      return failure(ErrorCode::BadValue, where() + " has more values on its line than the header says");
    }
    file_.consume(1);
    if (bytes[0] == '\n') break;
  }
  return success();
}

Result<std::string_view> PlyBodyReader::next_token() {
  auto bytes = file_.ready(1);
  while (!bytes.empty() && is_blank(bytes[0])) {
    file_.consume(1);
    bytes = file_.ready(1);
  }
  if (bytes.size() <= kMaxTokenBytes) bytes = file_.ready(kMaxTokenBytes + 1);
  if (bytes.empty()) return shortage();
  if (bytes[0] == '\n') {
    return failure(ErrorCode::BadValue, where() + " has fewer values on its line than the header says");
  }
  std::size_t size = 0;
  while (size < bytes.size() && size <= kMaxTokenBytes && !is_space(bytes[size])) ++size;
  if (size > kMaxTokenBytes) {
    return failure(ErrorCode::BadValue,
                   where() + " has a value of more than " + std::to_string(kMaxTokenBytes) + " characters");
  }
  file_.consume(size);
  return std::string_view(reinterpret_cast<const char*>(bytes.data()), size);
}

Result<double> PlyBodyReader::read_value(PlyScalar type) {
  if (is_text_) {
    BOOST_OUTCOME_TRY(const std::string_view token, next_token());
    const auto value = parse_number(token);
    if (!value) return failure(ErrorCode::BadValue, where() + " has a value that is not a number");
    return *value;
  }
  const std::size_t size = size_bytes(type);
  const auto bytes = file_.ready(size);
  if (bytes.size() < size) return shortage();
  file_.consume(size);
  return is_swapped_ ? load_double<true>(type, bytes.data()) : load_double<false>(type, bytes.data());
}

/// A value of a type that is not floating.
Result<std::int64_t> PlyBodyReader::read_whole_number(PlyScalar type) {
  if (is_text_) {
    BOOST_OUTCOME_TRY(const std::string_view token, next_token());
    const auto value = parse_whole_number(token);
    if (!value) {
      return failure(ErrorCode::BadValue, where() + " has a count or an index that is not a whole number");
    }
    return *value;
  }
  BOOST_OUTCOME_TRY(const double value, read_value(type));
  return static_cast<std::int64_t>(value);
}

Result<std::uint64_t> PlyBodyReader::read_list_count(const PlyProperty& property) {
  BOOST_OUTCOME_TRY(const std::int64_t count, read_whole_number(property.count_type));
  const std::uint64_t value_bytes = is_text_ ? 2 : size_bytes(property.type);
  if (count < 0) {
    return failure(ErrorCode::BadValue, where() + " has a list of " + std::to_string(count) + " values");
  }
  const std::uint64_t left = file_.remaining() + (is_text_ ? 1 : 0);
  if (static_cast<std::uint64_t>(count) > left / value_bytes) {
    return failure(ErrorCode::Truncated, where() + " has a list of " + std::to_string(count) + " values, but only " +
                                             std::to_string(file_.remaining()) + " bytes are left in the file");
  }
  return static_cast<std::uint64_t>(count);
}

Error PlyBodyReader::shortage() const {
  if (file_.read_error() != 0) {
    return {ErrorCode::FileUnreadable, "cannot be read: " + std::generic_category().message(file_.read_error()), {}};
  }
  return {ErrorCode::Truncated, "the file ends at " + where() + ", of " + std::to_string(element_->count), {}};
}

/// "vertex 12", counted from 0.
std::string PlyBodyReader::where() const {
  constexpr std::size_t kMaxShown = 40;
  std::string name;
  for (const char c : element_->name.substr(0, kMaxShown)) name += c >= ' ' && c <= '~' ? c : '?';
  return name + " " + std::to_string(entry_);
}

}  // namespace spectra::fusion
