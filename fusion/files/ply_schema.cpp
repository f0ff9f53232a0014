#include "fusion/files/ply_schema.hpp"

#include <algorithm>
#include <iterator>

#include "fusion/files/colour_names.hpp"
#include "fusion/files/name_words.hpp"
#include "fusion/files/temperature_name.hpp"

namespace spectra::files {

namespace {

/// The index of the property of that name, or else of the first that has it in another case; scalars only.
std::optional<std::size_t> find_scalar(const PlyElement& element, std::string_view name) {
  std::optional<std::size_t> found;
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    const PlyProperty& property = element.properties[i];
    if (property.is_list) continue;
    if (property.name == name) return i;
    if (!found && lower_case(property.name) == lower_case(name)) found = i;
  }
  return found;
}

/// For a message.
std::string scalar_names(const PlyElement& element) {
  std::string names;
  for (const PlyProperty& property : element.properties) {
    if (!property.is_list && names.size() < 120) names += (names.empty() ? "" : ", ") + printable(property.name);
  }
  return names.empty() ? "none" : names;
}

base::Result<void> find_positions(const PlyElement& element, PlySlots& slots) {
  constexpr std::array<std::string_view, 3> kAxes = {"x", "y", "z"};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    slots[kX + axis] = find_scalar(element, kAxes[axis]);
    if (!slots[kX + axis]) {
      return base::failure(base::ErrorCode::BadHeader, "element 'vertex' has no property '" + std::string(kAxes[axis]) +
                                                           "' (it has " + scalar_names(element) + ")");
    }
  }
  return base::success();
}

/// The coding of colours with customary names, nullopt when there are none.
std::optional<ColourCoding> find_customary_colours(const PlyElement& element, PlySlots& slots) {
  struct Names {
    std::array<std::string_view, 3> names;
    ColourCoding coding;
  };
  constexpr std::array<Names, 11> kNames = {{{{"red", "green", "blue"}, ColourCoding::Channels},
                                             {{"diffuse_red", "diffuse_green", "diffuse_blue"}, ColourCoding::Channels},
                                             {{"r", "g", "b"}, ColourCoding::Channels},
                                             {{"scalar_red", "scalar_green", "scalar_blue"}, ColourCoding::Channels},
                                             {{"scalar_r", "scalar_g", "scalar_b"}, ColourCoding::Channels},
                                             {{"rgb", "rgb", "rgb"}, ColourCoding::Packed},
                                             {{"rgba", "rgba", "rgba"}, ColourCoding::Packed},
                                             {{"f_dc_0", "f_dc_1", "f_dc_2"}, ColourCoding::Splat},
                                             {{"gray", "gray", "gray"}, ColourCoding::Channels},
                                             {{"grey", "grey", "grey"}, ColourCoding::Channels},
                                             {{"luminance", "luminance", "luminance"}, ColourCoding::Channels}}};
  for (const auto& [names, coding] : kNames) {
    const std::array<std::optional<std::size_t>, 3> indices = {
        find_scalar(element, names[0]), find_scalar(element, names[1]), find_scalar(element, names[2])};
    if (!indices[0] || !indices[1] || !indices[2]) continue;
    std::copy(indices.begin(), indices.end(), slots.begin() + kRed);
    return coding;
  }
  return std::nullopt;
}

/// The coding of the colours, nullopt when there are none. Three channels with plain names go before a single number.
std::optional<ColourCoding> find_colours(const PlyElement& element, PlySlots& slots, bool& has_unusual_names) {
  const auto coding = find_customary_colours(element, slots);
  if (coding && slots[kRed] != slots[kGreen]) return coding;
  const auto channels = plain_colour_channels(element);
  if (!channels) return coding;
  std::copy(channels->begin(), channels->end(), slots.begin() + kRed);
  has_unusual_names = true;
  return ColourCoding::Channels;
}

/// Colours that the options name, in the element if it has them.
std::optional<ColourCoding> find_named_colours(const PlyElement& element, const std::vector<std::string>& names,
                                               PlySlots& slots) {
  std::array<std::optional<std::size_t>, 3> indices;
  for (std::size_t channel = 0; channel < 3; ++channel) {
    indices[channel] = find_scalar(element, names[names.size() == 3 ? channel : 0]);
    if (!indices[channel]) return std::nullopt;
  }
  std::copy(indices.begin(), indices.end(), slots.begin() + kRed);
  const std::vector<std::string> words = name_words(names[0]);
  const bool is_packed =
      std::any_of(words.begin(), words.end(), [](const std::string& word) { return word == "rgb" || word == "rgba"; });
  if (names.size() == 1) return is_packed ? ColourCoding::Packed : ColourCoding::Channels;
  return lower_case(names[0]) == "f_dc_0" ? ColourCoding::Splat : ColourCoding::Channels;
}

base::Result<void> find_colours(const PlyElement& vertices, const PlyElement* faces, const ReadOptions& options,
                                PlySchema& schema) {
  const std::vector<std::string>& wanted = options.colour_properties;
  std::optional<ColourCoding> coding;
  if (wanted.empty()) {
    coding = find_colours(vertices, schema.vertex, schema.has_unusual_colour_names);
    if (!coding && faces != nullptr) coding = find_colours(*faces, schema.face, schema.has_unusual_colour_names);
  } else {
    coding = find_named_colours(vertices, wanted, schema.vertex);
    if (!coding && faces != nullptr) coding = find_named_colours(*faces, wanted, schema.face);
    schema.has_unusual_colour_names = true;
    if (!coding) {
      const auto missing = std::find_if(wanted.begin(), wanted.end(),
                                        [&](const std::string& name) { return !find_scalar(vertices, name); });
      return base::failure(base::ErrorCode::Unsupported,
                           "there is no scalar property '" + printable(*missing) + "' (the vertices have " +
                               scalar_names(vertices) + ")",
                           "colour_properties");
    }
  }
  schema.colour_coding = coding.value_or(ColourCoding::Channels);
  return base::success();
}

/// The property whose name says temperature most plainly.
std::optional<std::size_t> find_temperature(const PlyElement& element) {
  std::optional<std::size_t> best;
  int best_rank = 0;
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    const PlyProperty& property = element.properties[i];
    const int rank = property.is_list ? 0 : temperature_name(property.name).rank;
    if (rank > best_rank) {
      best = i;
      best_rank = rank;
    }
  }
  return best;
}

/// A floating property called t, unless one beside it tells that it is something else.
std::optional<std::size_t> find_bare_t(const PlyElement& element) {
  std::optional<std::size_t> found;
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    const PlyProperty& property = element.properties[i];
    const TemperatureName name = temperature_name(property.name);
    if (name.speaks_against_t) return std::nullopt;
    if (!found && name.is_bare_t && !property.is_list && is_floating(property.type)) found = i;
  }
  return found;
}

base::Result<void> find_temperatures(const PlyElement& vertices, const PlyElement* faces, const ReadOptions& options,
                                     PlySchema& schema) {
  const std::string& wanted = options.temperature_property;
  if (!wanted.empty()) {
    schema.vertex[kTemperature] = find_scalar(vertices, wanted);
    if (!schema.has_vertex_temperature() && faces != nullptr) schema.face[kTemperature] = find_scalar(*faces, wanted);
    if (schema.has_vertex_temperature() || schema.has_face_temperature()) return base::success();
    return base::failure(
        base::ErrorCode::Unsupported,
        "there is no scalar property '" + printable(wanted) + "' (the vertices have " + scalar_names(vertices) + ")",
        "temperature_property");
  }
  schema.vertex[kTemperature] = find_temperature(vertices);
  if (!schema.has_vertex_temperature() && faces != nullptr) schema.face[kTemperature] = find_temperature(*faces);
  if (!schema.has_vertex_temperature() && !schema.has_face_temperature()) {
    schema.vertex[kTemperature] = find_bare_t(vertices);
    schema.is_temperature_doubtful = schema.has_vertex_temperature();
  }
  return base::success();
}

/// How sure the temperatures of the vertices are, as Spectra writes it, and when they were looked at.
void find_confidence(const PlyElement& vertices, PlySlots& slots) {
  if (!slots[kTemperature]) return;
  const auto sigma = find_scalar(vertices, "temperature_sigma");
  if (!sigma || sigma == slots[kTemperature] || !is_floating(vertices.properties[*sigma].type)) return;
  slots[kSigma] = sigma;
  const auto seen = find_scalar(vertices, "seen");
  if (seen && seen != slots[kTemperature]) slots[kSeen] = seen;
}

/// Whether a list may hold vertices, whatever its name: whole numbers, and none of a texture.
bool may_hold_corners(const PlyProperty& property) {
  const std::string name = lower_case(property.name);
  const bool is_of_texture = name.starts_with("tex") || name.find("_tex") != std::string::npos ||
                             name.find("texture") != std::string::npos || name.find("uv") != std::string::npos;
  return property.is_list && !is_floating(property.type) && !is_of_texture;
}

/// The list of vertices that an element of faces or strips has.
base::Result<std::size_t> find_corner_list(const PlyElement& element) {
  const auto is_corner_list = [](const PlyProperty& property) {
    const std::string name = lower_case(property.name);
    return name == "vertex_indices" || name == "vertex_index";
  };
  const auto list = std::find_if(element.properties.begin(), element.properties.end(), is_corner_list);
  const std::string subject = "element '" + printable(element.name) + "' has ";
  if (list == element.properties.end() || !list->is_list) {
    const auto only = std::find_if(element.properties.begin(), element.properties.end(), may_hold_corners);
    if (list == element.properties.end() && only != element.properties.end() &&
        std::none_of(std::next(only), element.properties.end(), may_hold_corners)) {
      return static_cast<std::size_t>(only - element.properties.begin());
    }
    return base::failure(base::ErrorCode::BadHeader, subject +
                                                         "no list 'vertex_indices' or 'vertex_index': give the list of "
                                                         "its corners that name");
  }
  if (std::find_if(std::next(list), element.properties.end(), is_corner_list) != element.properties.end()) {
    return base::failure(base::ErrorCode::BadHeader, subject + "both 'vertex_indices' and 'vertex_index'");
  }
  if (is_floating(list->type)) {
    return base::failure(base::ErrorCode::BadHeader, "the vertex indices of faces have the type " +
                                                         std::string(to_string(list->type)) +
                                                         ", which is not a whole number's");
  }
  return static_cast<std::size_t>(list - element.properties.begin());
}

base::Error no_vertices(const PlyHeader& header) {
  std::string names;
  for (const PlyElement& element : header.elements) {
    if (names.size() < 120) names += (names.empty() ? "'" : ", '") + printable(element.name) + "'";
  }
  return {base::ErrorCode::BadHeader,
          "the header has no element 'vertex'" +
              (names.empty() ? "" : " (it has " + names + "): give the one with the positions that name"),
          {}};
}

const PlyElement* with_entries(const PlyHeader& header, std::string_view name) {
  const PlyElement* const element = header.find(name);
  return element != nullptr && element->count > 0 ? element : nullptr;
}

}  // namespace

base::Result<PlySchema> ply_schema(const PlyHeader& header, const ReadOptions& options) {
  const PlyElement* const vertices = header.find("vertex");
  if (vertices == nullptr) return no_vertices(header);
  if (vertices->count == 0) return base::failure(base::ErrorCode::BadValue, "the scene is empty: it has 0 vertices");
  PlySchema schema;
  BOOST_OUTCOME_TRY(find_positions(*vertices, schema.vertex));
  const PlyElement* const faces = with_entries(header, "face");
  if (faces != nullptr) {
    BOOST_OUTCOME_TRY(schema.corner_list, find_corner_list(*faces));
  }
  if (const PlyElement* const strips = with_entries(header, "tristrips")) {
    BOOST_OUTCOME_TRY(schema.strip_list, find_corner_list(*strips));
  }
  BOOST_OUTCOME_TRYV(find_colours(*vertices, faces, options, schema));
  BOOST_OUTCOME_TRY(find_temperatures(*vertices, faces, options, schema));
  find_confidence(*vertices, schema.vertex);
  return schema;
}

}  // namespace spectra::files
