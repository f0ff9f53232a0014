#include "fusion/files/ply_body_reader.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "fusion/files/ply_values.hpp"
#include "fusion/files/scene_origin.hpp"

namespace spectra::files {

namespace {

/// Metres. Beyond it stand numbers for "none", such as the lowest float.
constexpr double kLargestCoordinate = 1e30;

bool is_face_element(const PlyElement& element) {
  const std::string name = lower_case(element.name);
  return element.count > 0 && (name == "face" || name == "tristrips");
}

struct Box {
  base::Vec3d min, max;

  void add(const base::Vec3d& p) {
    min = {std::min(min.x, p.x), std::min(min.y, p.y), std::min(min.z, p.z)};
    max = {std::max(max.x, p.x), std::max(max.y, p.y), std::max(max.z, p.z)};
  }
};

bool is_position(const base::Vec3d& p) {
  return std::abs(p.x) <= kLargestCoordinate && std::abs(p.y) <= kLargestCoordinate &&
         std::abs(p.z) <= kLargestCoordinate;
}

bool is_float(double coordinate) {
  return static_cast<double>(static_cast<float>(coordinate)) == coordinate;
}

}  // namespace

PlyBodyReader::PlyBodyReader(BlockFile& file, const PlyHeader& header, const PlyInterpretation& interpretation,
                             const PlyHandlers& handlers, std::vector<base::Vec3f>& polygon_positions)
    : file_(file),
      header_(header),
      interpretation_(interpretation),
      handlers_(handlers),
      polygon_positions_(polygon_positions),
      sample_(header.find("vertex")->count) {}

base::Result<PlyBodyFacts> PlyBodyReader::read() {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  facts_.min = {kInfinity, kInfinity, kInfinity};
  facts_.max = {-kInfinity, -kInfinity, -kInfinity};
  facts_.temperature = interpretation_.survey.face_temperature;
  // Those are of faces.
  facts_.temperature.missing_count = facts_.temperature.over_range_count = facts_.temperature.under_range_count = 0;
  facts_.clamped_colour_count = interpretation_.survey.clamped_colour_count;

  const PlyElement* const vertices = header_.find("vertex");
  const bool has_faces_first = std::any_of(header_.elements.data(), vertices,
                                           [](const PlyElement& element) { return is_face_element(element); });
  PlyCursor cursor(file_, header_);
  const auto positions = [this] { return polygon_positions(); };
  if (has_faces_first) {
    // Which faces are left out is known once the vertices are.
    PlyCursor first(file_, header_);
    PlyFaceReader none(first, vertices->count, is_left_out_, handlers_.triangles, positions);
    BOOST_OUTCOME_TRY(read_part(Part::Vertices, none, first));
    file_.seek(header_.size_bytes);
  }
  PlyFaceReader faces(cursor, vertices->count, is_left_out_, handlers_.triangles, positions);
  const auto result = read_part(has_faces_first ? Part::Faces : Part::Everything, faces, cursor);
  handler_has_failed_ = handler_has_failed_ || faces.sink_has_failed();
  BOOST_OUTCOME_TRY(result);

  facts_.faces = faces.facts();
  conclude_positions(faces);
  if (facts_.faces.triangle_count > 0) {
    facts_.unreferenced_vertex_count =
        vertices->count - facts_.left_out_vertex_count - facts_.faces.referenced_vertex_count;
  }
  facts_.trailing_byte_count = cursor.trailing_bytes();
  facts_.packed_trailing_byte_count = file_.packed_trailing_bytes();
  return facts_;
}

base::Result<void> PlyBodyReader::read_part(Part part, PlyFaceReader& faces, PlyCursor& cursor) {
  const PlySchema& schema = interpretation_.schema;
  const PlyElement* const vertices = header_.find("vertex");
  const PlyElement* const polygons = header_.find("face");
  const PlyElement* const strips = header_.find("tristrips");
  for (const PlyElement& element : header_.elements) {
    cursor.begin_element(element);
    if (&element == vertices && part != Part::Faces) {
      BOOST_OUTCOME_TRY(read_vertices(cursor, element));
    } else if (&element == polygons && schema.corner_list && part != Part::Vertices) {
      BOOST_OUTCOME_TRY(faces.read_faces(element, *schema.corner_list));
    } else if (&element == strips && schema.strip_list && part != Part::Vertices) {
      BOOST_OUTCOME_TRY(faces.read_strips(element, *schema.strip_list));
    } else {
      BOOST_OUTCOME_TRY(cursor.skip_element(element));
    }
  }
  return base::success();
}

base::Result<void> PlyBodyReader::read_vertices(PlyCursor& cursor, const PlyElement& element) {
  PlyVertexReader reader(cursor, element, interpretation_.schema);
  for (;;) {
    BOOST_OUTCOME_TRY(const PlyRawVertices raw, reader.next());
    if (raw.positions.empty()) break;
    BOOST_OUTCOME_TRY(hand_on(raw, element));
  }
  if (facts_.left_out_vertex_count == element.count) {
    return base::failure(base::ErrorCode::BadValue, "no vertex has a position (a finite one, within 1e30 m)");
  }
  return base::success();
}

/// Told from the first of them: read once more, since few files have polygons, and kept for the next reading.
base::Result<std::span<const base::Vec3f>> PlyBodyReader::polygon_positions() {
  if (!polygon_positions_.empty()) return std::span<const base::Vec3f>(polygon_positions_);
  const std::uint64_t place = file_.position();
  auto watcher = file_.set_watcher({});
  const auto read = [&]() -> base::Result<void> {
    PlyCursor cursor(file_, header_);
    const PlyElement* const vertices = header_.find("vertex");
    for (const PlyElement* element = header_.elements.data(); element != vertices; ++element) {
      cursor.begin_element(*element);
      BOOST_OUTCOME_TRY(cursor.skip_element(*element));
    }
    cursor.begin_element(*vertices);
    PlyVertexReader reader(cursor, *vertices, interpretation_.schema);
    std::vector<base::Vec3f> positions;
    positions.reserve(static_cast<std::size_t>(vertices->count));
    std::optional<base::Vec3d> origin;
    for (;;) {
      BOOST_OUTCOME_TRY(const PlyRawVertices raw, reader.next());
      if (raw.positions.empty()) break;
      for (const base::Vec3d& in_file : raw.positions) {
        const double metres = interpretation_.metres_per_unit;
        const base::Vec3d p = {in_file.x * metres, in_file.y * metres, in_file.z * metres};
        if (!origin && is_position(p)) origin = p;
        positions.push_back(is_position(p) ? relative_to(*origin, p) : base::Vec3f{});
      }
    }
    polygon_positions_ = std::move(positions);
    return base::success();
  };
  const base::Result<void> result = read();
  file_.seek(place);
  file_.set_watcher(std::move(watcher));
  BOOST_OUTCOME_TRY(result);
  return std::span<const base::Vec3f>(polygon_positions_);
}

base::Result<void> PlyBodyReader::hand_on(PlyRawVertices raw, const PlyElement& element) {
  judge_positions(raw.positions, raw.first_vertex);
  const std::size_t count = raw.positions.size();
  const PlySchema& schema = interpretation_.schema;
  PlyVertexBlock block;
  block.first_vertex = raw.first_vertex;
  block.positions = raw.positions;
  block.left_out = left_out_;
  if (schema.has_vertex_colours()) {
    BOOST_OUTCOME_TRY(convert_colours(raw, element));
    block.visible = colours_;
  } else if (schema.has_face_colours()) {
    block.visible =
        std::span(interpretation_.survey.face_colours).subspan(static_cast<std::size_t>(raw.first_vertex), count);
  }
  if (schema.has_vertex_temperature()) {
    convert_temperatures(raw);
    block.temperature_celsius = temperatures_;
    if (schema.has_confidence()) {
      convert_confidence(raw);
      block.sigma_kelvin = sigmas_;
      block.looked_at = looked_at_;
    }
  } else if (schema.has_face_temperature()) {
    block.temperature_celsius = std::span(interpretation_.survey.face_temperature_celsius)
                                    .subspan(static_cast<std::size_t>(raw.first_vertex), count);
    count_carried_temperatures(block);
  }
  if (!handlers_.vertices) return base::success();
  auto result = handlers_.vertices(block);
  handler_has_failed_ = !result;
  return result;
}

void PlyBodyReader::conclude_positions(const PlyFaceReader& faces) {
  sample_.conclude(interpretation_.metres_per_unit,
                   [&faces](std::uint64_t vertex) { return faces.is_referenced(vertex); });
  facts_.bulk = sample_.bulk();
  facts_.origin = interpretation_.origin.value_or(scene_origin(facts_.min, facts_.max, facts_.bulk));
  // Near 0 every number of a text has more digits than a float, and loses nothing that can be seen.
  const std::array<double, 3> origin = {facts_.origin.x, facts_.origin.y, facts_.origin.z};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    facts_.is_finer_than_declared = facts_.is_finer_than_declared || (origin[axis] != 0 && has_more_digits_[axis]);
  }
  facts_.shared_coordinates = sample_.shared_coordinates();
  facts_.holes = sample_.coordinate_holes();
  const std::vector<Hole>& known = interpretation_.holes;
  for (const HolePlace& hole : sample_.holes()) {
    if (std::any_of(known.begin(), known.end(), [&](const Hole& one) { return one.has(hole.place); })) continue;
    // What is left out is settled.
    if (hole.is_certain && known.empty()) {
      facts_.holes.push_back({hole.place});
    } else if (hole.is_suspect) {
      facts_.crowded_places.push_back({hole.place, hole.is_used});
    }
  }
}

/// Brings the positions to metres, and finds those that are none.
void PlyBodyReader::judge_positions(std::span<base::Vec3d> positions, std::uint64_t first_vertex) {
  if (header_.format == PlyFormat::Ascii) {
    for (const base::Vec3d& p : positions) {
      if (!is_position(p)) continue;
      has_more_digits_[0] = has_more_digits_[0] || !is_float(p.x);
      has_more_digits_[1] = has_more_digits_[1] || !is_float(p.y);
      has_more_digits_[2] = has_more_digits_[2] || !is_float(p.z);
    }
  }
  if (const double metres = interpretation_.metres_per_unit; metres != 1) {
    for (base::Vec3d& p : positions) p = {p.x * metres, p.y * metres, p.z * metres};
  }
  left_out_.clear();
  sample_.add(first_vertex, positions);
  Box box{facts_.min, facts_.max};
  bool all_good = true;
  const std::vector<Hole>& holes = interpretation_.holes;
  facts_.hole_counts.resize(holes.size());
  for (const Hole& hole : holes) {
    for (const base::Vec3d& p : positions) all_good = all_good && !hole.has(p);
  }
  for (const base::Vec3d& p : positions) {
    all_good = all_good && is_position(p);
    box.add(p);
  }
  if (!all_good) {
    box = {facts_.min, facts_.max};
    if (is_left_out_.is_empty()) is_left_out_.resize(header_.find("vertex")->count);
    for (std::size_t i = 0; i < positions.size(); ++i) {
      const auto hole =
          std::find_if(holes.begin(), holes.end(), [&](const Hole& one) { return one.has(positions[i]); });
      if (is_position(positions[i]) && hole == holes.end()) {
        box.add(positions[i]);
      } else {
        if (hole != holes.end()) ++facts_.hole_counts[static_cast<std::size_t>(hole - holes.begin())];
        left_out_.push_back(static_cast<std::uint32_t>(i));
        is_left_out_.set(first_vertex + i);
      }
    }
    facts_.left_out_vertex_count += left_out_.size();
  }
  facts_.min = box.min;
  facts_.max = box.max;
}

base::Result<void> PlyBodyReader::convert_colours(const PlyRawVertices& raw, const PlyElement& element) {
  const ColourConversion& conversion = interpretation_.colours;
  if (header_.format == PlyFormat::Ascii && interpretation_.schema.colour_coding == ColourCoding::Channels &&
      !interpretation_.schema.true_colour_type) {
    // In a text file a number may be larger than its type.
    for (std::size_t channel = 0; channel < 3; ++channel) {
      const PlyProperty& property = element.properties[*interpretation_.schema.vertex[kRed + channel]];
      if (property.type != PlyScalar::UInt8) continue;
      const auto& values = raw.colours[channel];
      const auto bad =
          std::find_if(values.begin(), values.end(), [](double value) { return value < 0 || value > 255; });
      if (bad == values.end()) continue;
      return base::failure(base::ErrorCode::BadValue,
                           "vertex " +
                               std::to_string(raw.first_vertex + static_cast<std::uint64_t>(bad - values.begin())) +
                               " has the colour value " + number_text(*bad) + " in '" + printable(property.name) +
                               "', which must be a whole number from 0 to 255 for the type uchar");
    }
  }
  colours_.resize(raw.positions.size());
  conversion.convert({raw.colours[0], raw.colours[1], raw.colours[2]}, colours_, facts_.clamped_colour_count);
  return base::success();
}

void PlyBodyReader::convert_temperatures(const PlyRawVertices& raw) {
  temperatures_.resize(raw.positions.size());
  const TemperatureConversion& conversion = interpretation_.temperature;
  if (left_out_.empty()) return conversion.convert(raw.temperatures, temperatures_, facts_.temperature);
  // What is left out is not counted.
  TemperatureFacts ignored;
  auto next = left_out_.begin();
  for (std::size_t i = 0; i < raw.temperatures.size(); ++i) {
    const bool is_left_out = next != left_out_.end() && *next == i;
    if (is_left_out) ++next;
    conversion.convert(raw.temperatures.subspan(i, 1), std::span(temperatures_).subspan(i, 1),
                       is_left_out ? ignored : facts_.temperature);
  }
  facts_.temperature.no_data_seen |= ignored.no_data_seen;
}

/// As those of vertices are counted; several may have the temperature of one face.
void PlyBodyReader::count_carried_temperatures(const PlyVertexBlock& block) {
  auto next = left_out_.begin();
  for (std::size_t i = 0; i < block.temperature_celsius.size(); ++i) {
    if (next != left_out_.end() && *next == i) {
      ++next;
      continue;
    }
    const float celsius = block.temperature_celsius[i];
    facts_.temperature.missing_count += std::isnan(celsius) ? 1U : 0U;
    if (!std::isinf(celsius)) continue;
    ++(celsius > 0 ? facts_.temperature.over_range_count : facts_.temperature.under_range_count);
  }
}

/// What has no temperature has no deviation.
void PlyBodyReader::convert_confidence(const PlyRawVertices& raw) {
  sigmas_.resize(raw.sigmas.size());
  looked_at_.assign(raw.sigmas.size(), std::numeric_limits<double>::quiet_NaN());
  const double factor = std::abs(interpretation_.temperature.kelvin_per_unit());
  for (std::size_t i = 0; i < raw.sigmas.size(); ++i) {
    const auto kelvin = static_cast<float>(raw.sigmas[i] * factor);
    const bool is_known = std::isfinite(temperatures_[i]) && std::isfinite(kelvin) && kelvin >= 0;
    sigmas_[i] = is_known ? kelvin : std::numeric_limits<float>::quiet_NaN();
    if (!is_known || raw.seen.empty() || std::isnan(raw.seen[i])) continue;
    if (is_unix_time(raw.seen[i])) {
      looked_at_[i] = raw.seen[i];
    } else {
      ++facts_.absurd_time_count;
    }
  }
}

}  // namespace spectra::files
