#include "fusion/files/ply_survey.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "fusion/files/ply_cursor.hpp"
#include "fusion/files/ply_face_reader.hpp"
#include "fusion/files/ply_notes.hpp"
#include "fusion/files/ply_vertex_reader.hpp"

namespace spectra::files {

namespace {

/// Looks whether a property that is called no more than "t" is a temperature: nearly all values (but those of no data) could be one, they are not
/// mere shares of 1, and they do not only rise as a clock does.
class DoubtfulTemperature {
 public:
  explicit DoubtfulTemperature(const ReadOptions& options)
      : scale_(options.celsius_scale().value_or(CelsiusScale{})), conversion_(options) {}

  void add(std::span<const double> values) {
    for (const double value : values) {
      if (!std::isfinite(value)) continue;
      least_of_all_ = std::min(least_of_all_, value);
      most_of_all_ = std::max(most_of_all_, value);
      if (is_missing(value)) continue;
      ++count_;
      least_ = std::min(least_, value);
      most_ = std::max(most_, value);
      const double celsius = scale_.factor * value + scale_.offset;
      constexpr double kColdest = -100;
      constexpr double kHottest = 2000;
      plausible_count_ += celsius > kColdest && celsius < kHottest ? 1U : 0U;
      fall_count_ += value < last_ ? 1U : 0U;
      last_ = value;
    }
  }

  void conclude(PlySurvey& survey) const {
    survey.least_doubtful = least_of_all_;
    survey.most_doubtful = most_of_all_;
    constexpr std::uint64_t kFewest = 16;
    const bool is_clock = count_ >= kFewest && fall_count_ == 0 && most_ > least_;
    const bool is_share = count_ >= kFewest && least_ >= 0 && most_ <= 1;
    const bool are_mostly_none = facts_.impossible_count > count_;
    survey.is_temperature_plausible =
        plausible_count_ * 10 >= count_ * 9 && count_ > 0 && !are_mostly_none && !is_clock && !is_share;
  }

 private:
  bool is_missing(double value) {
    float celsius = 0;
    conversion_.convert({&value, 1}, {&celsius, 1}, facts_);
    return std::isnan(celsius);
  }

  CelsiusScale scale_;
  TemperatureConversion conversion_;
  TemperatureFacts facts_;
  std::uint64_t count_ = 0;
  std::uint64_t plausible_count_ = 0;
  std::uint64_t fall_count_ = 0;
  double least_of_all_ = std::numeric_limits<double>::infinity();
  double most_of_all_ = -std::numeric_limits<double>::infinity();
  double least_ = std::numeric_limits<double>::infinity();
  double most_ = -std::numeric_limits<double>::infinity();
  double last_ = -std::numeric_limits<double>::infinity();
};

/// Sums over the faces of every vertex.
class FaceSums {
 public:
  FaceSums(const PlySchema& schema, PlyScalar colour_type, std::uint64_t vertex_count, const ReadOptions& options)
      : schema_(schema), colour_type_(colour_type), white_(options.colour_white), conversion_(options) {
    const auto count = static_cast<std::size_t>(vertex_count);
    if (schema.has_face_colours()) colours_.resize(count);
    if (schema.has_face_temperature()) temperatures_.resize(count);
  }

  void add(std::span<const std::uint32_t> corners, std::array<double, kSlotCount> values, PlySurvey& survey) {
    if (!colours_.empty()) add_colour(corners, values, survey);
    if (temperatures_.empty()) return;
    float celsius = 0;
    conversion_.convert({&values[kTemperature], 1}, {&celsius, 1}, survey.face_temperature);
    if (std::isnan(celsius)) return;
    for (const std::uint32_t corner : corners) {
      temperatures_[corner].sum += static_cast<double>(celsius);
      ++temperatures_[corner].count;
    }
  }

  base::Result<void> conclude(PlySurvey& survey) {
    if (!colours_.empty()) {
      // Packed colours were unpacked before they were added.
      const bool is_packed = schema_.colour_coding == ColourCoding::Packed;
      BOOST_OUTCOME_TRY(const ColourConversion conversion,
                        is_packed
                            ? base::Result<ColourConversion>(ColourConversion{})
                            : colour_conversion(schema_.colour_coding, colour_type_, survey.colour_range, white_));
      survey.face_colours.resize(colours_.size());
      for (std::size_t v = 0; v < colours_.size(); ++v) {
        std::array<double, 3> means{};
        std::array<std::span<const double>, 3> values;
        for (std::size_t channel = 0; channel < 3; ++channel) {
          means[channel] = mean(static_cast<double>(colours_[v].sums[channel]), colours_[v].count);
          values[channel] = {&means[channel], 1};
        }
        std::uint64_t ignored = 0;
        conversion.convert(values, std::span(survey.face_colours).subspan(v, 1),
                           colours_[v].count == 0 ? ignored : survey.clamped_colour_count);
      }
      colours_ = {};
    }
    survey.face_temperature_celsius.reserve(temperatures_.size());
    for (const Temperature& temperature : temperatures_) {
      survey.face_temperature_celsius.push_back(static_cast<float>(mean(temperature.sum, temperature.count)));
    }
    return base::success();
  }

 private:
  /// NaN for what has no face.
  static double mean(double sum, std::uint32_t count) {
    return count > 0 ? sum / static_cast<double>(count) : std::numeric_limits<double>::quiet_NaN();
  }

  void add_colour(std::span<const std::uint32_t> corners, const std::array<double, kSlotCount>& values,
                  PlySurvey& survey) {
    std::array<double, 3> channels = {values[kRed], values[kGreen], values[kBlue]};
    if (schema_.colour_coding == ColourCoding::Packed) {
      ColourConversion unpacking;
      unpacking.is_packed = true;
      unpacking.is_packed_floating = is_floating(colour_type_);
      base::Rgb8 colour;
      std::uint64_t outside_count = 0;
      unpacking.convert({std::span<const double>(&channels[0], 1), {}, {}}, {&colour, 1}, outside_count);
      channels = {static_cast<double>(colour.r), static_cast<double>(colour.g), static_cast<double>(colour.b)};
      if (outside_count > 0) channels.fill(std::numeric_limits<double>::quiet_NaN());
    }
    if (colour_type_ == PlyScalar::Int8) {
      for (double& channel : channels) channel += channel < 0 ? 256 : 0;
    }
    survey.colour_range.add(channels);
    for (const std::uint32_t corner : corners) {
      for (std::size_t channel = 0; channel < 3; ++channel) {
        colours_[corner].sums[channel] += static_cast<float>(channels[channel]);
      }
      ++colours_[corner].count;
    }
  }

  struct Colour {
    std::array<float, 3> sums{};
    std::uint32_t count = 0;
  };
  struct Temperature {
    double sum = 0;
    std::uint32_t count = 0;
  };

  const PlySchema& schema_;
  const PlyScalar colour_type_;
  const std::optional<double> white_;
  const TemperatureConversion conversion_;
  std::vector<Colour> colours_;
  std::vector<Temperature> temperatures_;
};

/// Reads the faces for what they carry.
base::Result<void> survey_faces(PlyCursor& cursor, const PlyElement& element, const PlySchema& schema,
                                std::uint64_t vertex_count, FaceSums& sums, PlySurvey& survey) {
  std::vector<std::uint32_t> corners;
  std::array<double, kSlotCount> values{};
  for (; cursor.entry < element.count; ++cursor.entry) {
    BOOST_OUTCOME_TRY(cursor.begin_entry(element));
    for (std::size_t p = 0; p < element.properties.size(); ++p) {
      const PlyProperty& property = element.properties[p];
      if (p == *schema.corner_list) {
        BOOST_OUTCOME_TRY(read_corners(cursor, property, vertex_count, corners));
      } else if (property.is_list) {
        BOOST_OUTCOME_TRY(cursor.skip_list(property));
      } else if (std::find(schema.face.begin(), schema.face.end(), std::optional(p)) == schema.face.end()) {
        BOOST_OUTCOME_TRY(cursor.skip_values(1, property.type));
      } else {
        // The bits of a packed colour, as PlyVertexReader reads them.
        const bool is_bits = schema.colour_coding == ColourCoding::Packed && schema.face[kRed] == p &&
                             !cursor.is_text() && property.type == PlyScalar::Float32;
        BOOST_OUTCOME_TRY(const double value, cursor.read_value(is_bits ? PlyScalar::UInt32 : property.type));
        for (std::size_t slot = 0; slot < kSlotCount; ++slot) {
          if (schema.face[slot] == p) values[slot] = value;
        }
      }
    }
    BOOST_OUTCOME_TRY(cursor.end_entry());
    sums.add(corners, values, survey);
  }
  return base::success();
}

/// How many bytes of the body, up to 8, are blanks and ends of lines.
std::size_t leading_blanks(BlockFile& file, const PlyHeader& header) {
  constexpr std::size_t kMost = 8;
  file.seek(header.size_bytes);
  auto bytes = file.ready(kMost);
  if (bytes.size() > kMost) bytes = bytes.first(kMost);
  const auto is_blank = [](unsigned char byte) { return byte == ' ' || byte == '\t' || byte == '\n' || byte == '\r'; };
  return static_cast<std::size_t>(std::find_if_not(bytes.begin(), bytes.end(), is_blank) - bytes.begin());
}

}  // namespace

std::string misplaced_positions(BlockFile& file, const PlyHeader& header, const PlySchema& schema) {
  const PlyElement& vertices = *header.find("vertex");
  // Behind lists the vertices would not even be found.
  if (header.format == PlyFormat::Ascii || &vertices != header.elements.data() || !has_no_list(vertices)) return {};
  for (std::size_t slot = kX; slot <= kZ; ++slot) {
    if (!is_floating(vertices.properties[*schema.vertex[slot]].type)) return {};
  }
  struct Sense {
    std::size_t all = 0, sensible = 0;
  };
  const auto sense_of = [&](const PlyHeader& tried) {
    constexpr double kLeast = 1e-9;
    constexpr double kMost = 1e12;
    Sense sense;
    PlyCursor cursor(file, tried);
    cursor.begin_element(vertices);
    PlyVertexReader reader(cursor, vertices, schema);
    const auto block = reader.next();
    if (!block) return sense;
    for (const base::Vec3d& p : block.value().positions) {
      for (const double coordinate : {std::abs(p.x), std::abs(p.y), std::abs(p.z)}) {
        if (coordinate == 0 || std::isnan(coordinate)) continue;
        ++sense.all;
        if (coordinate >= kLeast && coordinate <= kMost) ++sense.sensible;
      }
    }
    return sense;
  };
  constexpr std::size_t kFewest = 12;
  const Sense as_told = sense_of(header);
  if (as_told.all < kFewest || as_told.sensible * 2 > as_told.all) return {};
  const auto is_right = [&](const PlyHeader& tried) {
    const Sense sense = sense_of(tried);
    return sense.sensible >= kFewest && sense.sensible * 20 > sense.all * 19;
  };
  // An empty line, say, which no position begins with. A byte off, those with their bytes the other way round may make sense, too.
  const std::size_t blank_count = leading_blanks(file, header);
  PlyHeader other = header;
  for (std::size_t count = 1; count <= blank_count; ++count) {
    other.size_bytes = header.size_bytes + count;
    if (!is_right(other)) continue;
    return counted(count, "byte", "bytes") +
           " too many between end_header and the first position, a blank or the end of a line: "
           "take out what stands there";
  }
  other = header;
  const bool is_big = header.format == PlyFormat::BinaryBigEndian;
  other.format = is_big ? PlyFormat::BinaryLittleEndian : PlyFormat::BinaryBigEndian;
  if (!is_right(other)) return {};
  return std::string(
             "the positions make sense only with their bytes the other way round: give the header's format line ") +
         (is_big ? "binary_little_endian" : "binary_big_endian");
}

std::optional<PlyScalar> true_colour_type(BlockFile& file, const PlyHeader& header, const PlySchema& schema) {
  if (header.format != PlyFormat::Ascii || !schema.has_vertex_colours() ||
      schema.colour_coding != ColourCoding::Channels) {
    return std::nullopt;
  }
  const PlyElement& vertices = *header.find("vertex");
  for (std::size_t slot = kRed; slot <= kBlue; ++slot) {
    if (vertices.properties[*schema.vertex[slot]].type != PlyScalar::UInt8) return std::nullopt;
  }
  PlyCursor cursor(file, header);
  for (const PlyElement* element = header.elements.data(); element != &vertices; ++element) {
    cursor.begin_element(*element);
    if (!cursor.skip_element(*element)) return std::nullopt;
  }
  cursor.begin_element(vertices);
  PlyVertexReader reader(cursor, vertices, schema);
  const auto block = reader.next();
  if (!block) return std::nullopt;
  std::optional<PlyScalar> type;
  for (const auto& channel : block.value().colours) {
    for (const double value : channel) {
      if (!std::isfinite(value)) continue;
      if (value != std::floor(value)) return PlyScalar::Float32;
      constexpr double kHair = 8;
      if (value > 255 + kHair) type = PlyScalar::UInt16;
    }
  }
  return type;
}

bool needs_survey(const PlyHeader& header, const PlySchema& schema) {
  if (schema.true_colour_type) return true;
  if (schema.has_face_colours() || schema.has_face_temperature() || schema.is_temperature_doubtful) return true;
  if (!schema.has_vertex_colours() || schema.colour_coding != ColourCoding::Channels) return false;
  const PlyElement& vertices = *header.find("vertex");
  return std::any_of(schema.vertex.begin() + kRed, schema.vertex.begin() + kBlue + 1,
                     [&](const auto& index) { return vertices.properties[*index].type != PlyScalar::UInt8; });
}

base::Result<PlySurvey> ply_survey(BlockFile& file, const PlyHeader& header, const PlySchema& schema,
                                   const ReadOptions& options) {
  PlySurvey survey;
  const PlyElement* const vertices = header.find("vertex");
  const PlyElement* const faces = header.find("face");
  const bool surveys_faces = schema.has_face_colours() || schema.has_face_temperature();
  DoubtfulTemperature doubtful(options);
  const PlyScalar face_colour_type =
      schema.has_face_colours() ? faces->properties[*schema.face[kRed]].type : PlyScalar::UInt8;
  FaceSums sums(schema, face_colour_type, surveys_faces ? vertices->count : 0, options);
  PlyCursor cursor(file, header);
  for (const PlyElement& element : header.elements) {
    cursor.begin_element(element);
    if (&element == vertices) {
      PlyVertexReader reader(cursor, element, schema);
      for (;;) {
        BOOST_OUTCOME_TRY(const PlyRawVertices block, reader.next());
        if (block.positions.empty()) break;
        if (schema.colour_coding != ColourCoding::Packed) {
          for (const auto& channel : block.colours) survey.colour_range.add(channel);
        }
        if (schema.is_temperature_doubtful) doubtful.add(block.temperatures);
      }
    } else if (&element == faces && surveys_faces) {
      BOOST_OUTCOME_TRY(survey_faces(cursor, element, schema, vertices->count, sums, survey));
    } else {
      BOOST_OUTCOME_TRY(cursor.skip_element(element));
    }
  }
  if (schema.is_temperature_doubtful) doubtful.conclude(survey);
  if (surveys_faces) {
    BOOST_OUTCOME_TRY(sums.conclude(survey));
  }
  return survey;
}

}  // namespace spectra::files
