#include "fusion/mesh/ply_stream.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <iterator>
#include <limits>
#include <system_error>
#include <utility>

#include "fusion/mesh/ply_body_reader.hpp"

namespace spectra::fusion {

namespace {

/// ASCII only.
std::string lower_case(std::string_view text) {
  std::string result(text);
  for (char& c : result) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return result;
}

/// The index of the property of that name, or else of the first that has it in another case; scalars only.
std::optional<std::size_t> find_scalar(const PlyElement& element, std::string_view name) {
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    if (!element.properties[i].is_list && element.properties[i].name == name) return i;
  }
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    if (!element.properties[i].is_list && lower_case(element.properties[i].name) == lower_case(name)) return i;
  }
  return std::nullopt;
}

/// "3 faces", "1 face".
std::string counted(std::uint64_t count, std::string_view one, std::string_view many) {
  return std::to_string(count) + " " + std::string(count == 1 ? one : many);
}

/// A name from the file for a message: short, and without anything that a terminal would obey.
std::string printable(std::string_view name) {
  constexpr std::size_t kMaxShown = 40;
  std::string shown;
  for (const char c : name.substr(0, kMaxShown)) shown += c >= ' ' && c <= '~' ? c : '?';
  if (name.size() > kMaxShown) shown += "...";
  return shown;
}

std::string joined(const std::vector<std::string>& names) {
  constexpr std::size_t kMaxNames = 12;
  std::string text;
  for (std::size_t i = 0; i < std::min(names.size(), kMaxNames); ++i) {
    text += (i == 0 ? "" : ", ") + printable(names[i]);
  }
  if (names.size() > kMaxNames) text += " and " + std::to_string(names.size() - kMaxNames) + " more";
  return text;
}

template <class T>
Result<T> located(Result<T> result, const std::string& name) {
  if (result) return result;
  Error error = std::move(result).error();
  error.message = name + ": " + error.message;
  if (error.field.empty()) error.field = name;
  return BOOST_OUTCOME_V2_NAMESPACE::failure(std::move(error));
}

}  // namespace

Result<PlyStream> PlyStream::open(const std::filesystem::path& path, const ReadOptions& options) {
  BOOST_OUTCOME_TRY(check_read_options(options));
  const std::string name = path.filename().empty() ? path.string() : path.filename().string();
  BOOST_OUTCOME_TRY(auto file, located(BlockFile::open(path), name));
  PlyStream stream(std::move(file), name, options);
  BOOST_OUTCOME_TRY(located(stream.interpret_header(), name));
  BOOST_OUTCOME_TRY(located(stream.check_size(), name));
  return stream;
}

Result<void> PlyStream::interpret_header() {
  const auto bytes = file_.ready(kMaxPlyHeaderBytes);
  if (file_.read_error() != 0) {
    return failure(ErrorCode::FileUnreadable, "cannot be read: " + std::generic_category().message(file_.read_error()));
  }
  const std::string text(bytes.begin(),
                         bytes.begin() + static_cast<std::ptrdiff_t>(std::min(bytes.size(), kMaxPlyHeaderBytes)));
  BOOST_OUTCOME_TRY(header_, parse_ply_header(text));

  const PlyElement* const vertices = header_.find("vertex");
  if (vertices == nullptr) return failure(ErrorCode::BadHeader, "the header has no element 'vertex'");
  if (vertices->count == 0) return failure(ErrorCode::BadValue, "the scene is empty: it has 0 vertices");
  vertex_count_ = vertices->count;
  BOOST_OUTCOME_TRY(interpret_vertex_properties(*vertices));
  BOOST_OUTCOME_TRY(find_temperature(*vertices));

  const PlyElement* const strips = header_.find("tristrips");
  if (strips != nullptr && strips->count > 0) {
    return failure(ErrorCode::Unsupported,
                   "triangle strips (element 'tristrips') are not read; save the mesh with plain faces");
  }

  if (const PlyElement* const faces = header_.find("face"); faces != nullptr && faces->count > 0) {
    face_count_ = faces->count;
    const auto is_corner_list = [](const PlyProperty& property) {
      return property.name == "vertex_indices" || property.name == "vertex_index";
    };
    const auto list = std::find_if(faces->properties.begin(), faces->properties.end(), is_corner_list);
    if (list == faces->properties.end() || !list->is_list) {
      return failure(ErrorCode::BadHeader, "element 'face' has no list 'vertex_indices' or 'vertex_index'");
    }
    if (std::find_if(std::next(list), faces->properties.end(), is_corner_list) != faces->properties.end()) {
      return failure(ErrorCode::BadHeader, "element 'face' has both 'vertex_indices' and 'vertex_index'");
    }
    if (is_floating(list->type)) {
      return failure(ErrorCode::BadHeader, "the vertex indices of faces have the type " +
                                               std::string(to_string(list->type)) + ", which is not a whole number's");
    }
    face_list_property_ = static_cast<std::size_t>(list - faces->properties.begin());
    if (faces->properties.size() > 1) {
      std::vector<std::string> names;
      for (const PlyProperty& property : faces->properties) {
        if (!is_corner_list(property)) names.push_back(property.name);
      }
      header_notes_.push_back({"skipped_face_properties", names.size(),
                               counted(names.size(), "property", "properties") +
                                   " of the faces without meaning here left out: " + joined(names)});
    }
  }

  for (const PlyElement& element : header_.elements) {
    if (element.name == "vertex" || element.name == "face" || element.count == 0) continue;
    header_notes_.push_back(
        {"skipped_elements", element.count,
         "Element '" + printable(element.name) + "' with " + counted(element.count, "entry", "entries") + " left out"});
  }
  return success();
}

Result<void> PlyStream::interpret_vertex_properties(const PlyElement& element) {
  constexpr std::array<std::string_view, 3> kAxes = {"x", "y", "z"};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto index = find_scalar(element, kAxes[axis]);
    if (!index) {
      return failure(ErrorCode::BadHeader, "element 'vertex' has no property '" + std::string(kAxes[axis]) + "'");
    }
    const PlyScalar type = element.properties[*index].type;
    if (!is_floating(type)) {
      return failure(ErrorCode::Unsupported, "property '" + std::string(kAxes[axis]) + "' has the type " +
                                                 std::string(to_string(type)) + ", not float or double");
    }
    has_double_positions_ = has_double_positions_ || type == PlyScalar::Float64;
    slot_properties_[kX + axis] = index;
  }

  constexpr std::array<std::array<std::string_view, 3>, 3> kColourNames = {
      {{"red", "green", "blue"}, {"diffuse_red", "diffuse_green", "diffuse_blue"}, {"r", "g", "b"}}};
  for (const auto& names : kColourNames) {
    const std::array<std::optional<std::size_t>, 3> indices = {
        find_scalar(element, names[0]), find_scalar(element, names[1]), find_scalar(element, names[2])};
    if (indices[0] && indices[1] && indices[2]) {
      std::copy(indices.begin(), indices.end(), slot_properties_.begin() + kRed);
      break;
    }
  }
  if (has_visible()) {
    const bool is_bytes =
        std::all_of(slot_properties_.begin() + kRed, slot_properties_.begin() + kBlue + 1,
                    [&](const auto& index) { return element.properties[*index].type == PlyScalar::UInt8; });
    if (!is_bytes) {
      header_notes_.push_back({"converted_colours", vertex_count_,
                               "Colours of type " +
                                   std::string(to_string(element.properties[*slot_properties_[kRed]].type)) +
                                   " converted to 8 bits"});
    }
  }
  return success();
}

Result<void> PlyStream::find_temperature(const PlyElement& element) {
  if (!options_.temperature_property.empty()) {
    slot_properties_[kTemperature] = find_scalar(element, options_.temperature_property);
    if (!has_temperature()) {
      return failure(ErrorCode::Unsupported,
                     "the vertices have no scalar property '" + printable(options_.temperature_property) + "'",
                     "temperature_property");
    }
  }
  constexpr std::array<std::string_view, 5> kNames = {"temperature", "temp", "thermal", "t", "scalar_temperature"};
  std::vector<std::string> skipped;
  for (const std::string_view name : kNames) {
    const auto index = find_scalar(element, name);
    if (!index || has_temperature()) continue;
    const PlyProperty& property = element.properties[*index];
    // Beside an s, t is the second texture coordinate.
    if (name == "t" && (find_scalar(element, "s") || !is_floating(property.type))) continue;
    slot_properties_[kTemperature] = index;
  }
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    const bool is_used =
        std::find(slot_properties_.begin(), slot_properties_.end(), std::optional(i)) != slot_properties_.end();
    if (!is_used) skipped.push_back(element.properties[i].name);
  }
  if (!skipped.empty()) {
    header_notes_.push_back({"skipped_vertex_properties", skipped.size(),
                             counted(skipped.size(), "property", "properties") +
                                 " of the vertices without meaning here left out: " + joined(skipped)});
  }
  return success();
}

Result<void> PlyStream::check_size() const {
  // The last separator of a text file may be missing.
  const bool is_text = header_.format == PlyFormat::Ascii;
  std::uint64_t left = file_.size_bytes() - header_.size_bytes + (is_text ? 1 : 0);
  for (const PlyElement& element : header_.elements) {
    const std::uint64_t entry_bytes = minimum_entry_bytes(element, header_.format);
    if (entry_bytes > 0 && element.count > left / entry_bytes) {
      return failure(ErrorCode::Truncated, "the header promises " + std::to_string(element.count) + " entries of '" +
                                               printable(element.name) + "' of at least " +
                                               counted(entry_bytes, "byte", "bytes") + " each, but " +
                                               counted(left - (is_text ? 1 : 0), "byte", "bytes") +
                                               (left - (is_text ? 1 : 0) == 1 ? " is" : " are") + " left for them");
    }
    left -= element.count * entry_bytes;
  }
  constexpr std::uint64_t kMaxVertices = std::numeric_limits<std::int32_t>::max();
  if (vertex_count_ > kMaxVertices) {
    return failure(ErrorCode::TooLarge,
                   std::to_string(vertex_count_) + " vertices, at most " + std::to_string(kMaxVertices) + " are read");
  }
  return success();
}

std::uint64_t PlyStream::triangle_count_limit() const {
  const PlyElement* const faces = header_.find("face");
  if (faces == nullptr || face_count_ == 0) return 0;
  const bool is_text = header_.format == PlyFormat::Ascii;
  const std::uint64_t corner_bytes = is_text ? 2 : size_bytes(faces->properties[face_list_property_].type);
  const std::uint64_t triangle_bytes = minimum_entry_bytes(*faces, header_.format) + 3 * corner_bytes;
  return std::min(face_count_, (file_.size_bytes() - header_.size_bytes) / triangle_bytes + 1);
}

bool PlyStream::has_faces_first() const {
  const PlyElement* const faces = header_.find("face");
  return faces != nullptr && faces < header_.find("vertex");
}

Result<PlyBodyFacts> PlyStream::read(const PlyHandlers& handlers) {
  file_.seek(header_.size_bytes);
  PlyBodyReader reader(*this, handlers);
  Result<PlyBodyFacts> facts = reader.read();
  return reader.handler_has_failed() ? std::move(facts) : located(std::move(facts), name_);
}

std::vector<Note> PlyStream::notes(const PlyBodyFacts& facts) const {
  std::vector<Note> notes = header_notes_;
  const auto add = [&notes](const char* id, std::uint64_t count, std::string message) {
    if (count > 0) notes.push_back({id, count, std::move(message)});
  };
  add("triangulated_polygons", facts.polygon_count,
      counted(facts.polygon_count, "polygon", "polygons") + " of more than three corners cut into triangles");
  add("degenerate_faces", facts.degenerate_triangle_count,
      counted(facts.degenerate_triangle_count, "triangle", "triangles") + " with the same vertex twice left out");
  add("incomplete_faces", facts.incomplete_face_count,
      counted(facts.incomplete_face_count, "face", "faces") + " of fewer than three corners left out");
  add("unreferenced_vertices", facts.unreferenced_vertex_count,
      counted(facts.unreferenced_vertex_count, "vertex", "vertices") + " of no triangle kept");
  const TemperatureFacts& temperature = facts.temperature;
  add("missing_temperatures", temperature.missing_count,
      counted(temperature.missing_count, "vertex", "vertices") + " without a temperature");
  add("impossible_temperatures", temperature.impossible_count,
      counted(temperature.impossible_count, "temperature", "temperatures") +
          " at or below -273.15 degrees Celsius taken as missing");
  add("no_data_temperatures", temperature.no_data_count,
      counted(temperature.no_data_count, "temperature", "temperatures") + " of a no-data value taken as missing");
  add("over_range_temperatures", temperature.over_range_count,
      counted(temperature.over_range_count, "temperature", "temperatures") +
          " above what the sensor can measure (infinite) shown as the hottest");
  add("under_range_temperatures", temperature.under_range_count,
      counted(temperature.under_range_count, "temperature", "temperatures") +
          " below what the sensor can measure (-infinite) shown as the coldest");
  add("trailing_bytes", facts.trailing_byte_count,
      counted(facts.trailing_byte_count, "byte", "bytes") + " after the last element left out");
  return notes;
}

}  // namespace spectra::fusion
