#include "fusion/files/ply_notes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include "fusion/base/distance_text.hpp"
#include "fusion/files/colour_names.hpp"
#include "fusion/files/ply_values.hpp"
#include "fusion/files/scene_origin.hpp"
#include "fusion/files/temperature_doubt.hpp"
#include "fusion/files/temperature_name.hpp"

namespace spectra::files {

namespace {

std::string joined(const std::vector<std::string>& names) {
  constexpr std::size_t kMaxNames = 12;
  std::string text;
  for (std::size_t i = 0; i < std::min(names.size(), kMaxNames); ++i) {
    text += (i == 0 ? "" : ", ") + printable(names[i]);
  }
  if (names.size() > kMaxNames) text += " and " + std::to_string(names.size() - kMaxNames) + " more";
  return text;
}

bool is_used(const PlySlots& slots, std::size_t property) {
  return std::find(slots.begin(), slots.end(), std::optional(property)) != slots.end();
}

/// The properties of an element that are not read.
std::vector<std::string> unused_names(const PlyElement& element, const PlySlots& slots,
                                      std::optional<std::size_t> list) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    if (!is_used(slots, i) && list != i) names.push_back(element.properties[i].name);
  }
  return names;
}

/// Where something was guessed, or is probably not as it was meant, and an option or another file mends it.
constexpr std::array<std::string_view, 15> kNeedAttention = {
    "hole_vertices",    "crowded_place",     "shared_coordinate", "rounded_positions",
    "coarse_positions", "clamped_colours",   "colour_white",      "texture",
    "unused_options",   "no_temperature",    "no_colours",        "implausible_temperatures",
    "absurd_times",     "crossing_polygons", "large_polygons"};

class Notes {
 public:
  Notes(const PlyHeader& header, const PlyInterpretation& interpretation, const ReadOptions& options,
        const PlyBodyFacts& facts)
      : header_(header),
        schema_(interpretation.schema),
        survey_(interpretation.survey),
        options_(options),
        facts_(facts),
        holes_(interpretation.holes),
        vertices_(*header.find("vertex")) {}

  std::vector<Note> take() {
    about_positions();
    about_colours();
    about_temperature_property();
    about_temperatures();
    add("absurd_times", facts_.absurd_time_count,
        counted(facts_.absurd_time_count, "vertex", "vertices") +
            " whose property seen is no Unix time (0 to 1e11 seconds; milliseconds?): taken for not known");
    about_options();
    about_what_is_skipped();
    about_faces();
    add("trailing_bytes", facts_.trailing_byte_count,
        counted(facts_.trailing_byte_count, "byte", "bytes") + " after the last element left out");
    add("trailing_packed_bytes", facts_.packed_trailing_byte_count,
        counted(facts_.packed_trailing_byte_count, "byte", "bytes") + " after the end of the gzip data left out");
    return std::move(notes_);
  }

 private:
  void add(std::string_view id, std::uint64_t count, std::string message) {
    if (count == 0) return;
    const bool needs_attention = std::find(kNeedAttention.begin(), kNeedAttention.end(), id) != kNeedAttention.end();
    notes_.push_back({std::string(id), count, std::move(message), needs_attention});
  }

  void about_positions() {
    const std::uint64_t hole_count =
        std::accumulate(facts_.hole_counts.begin(), facts_.hole_counts.end(), std::uint64_t{0});
    const std::uint64_t nowhere_count = facts_.left_out_vertex_count - hole_count;
    add("left_out_vertices", nowhere_count,
        counted(nowhere_count, "vertex", "vertices") + " without a position (not a number, or beyond 1e30 m) left out");
    add("hole_vertices", hole_count,
        counted(hole_count, "vertex", "vertices") + holes_text() +
            ", taken for holes and left out with their temperatures, like vertices without a position; written as "
            "nan they need no guess");
    add("crowded_place", facts_.crowded_places.size(), crowded_text());
    add("shared_coordinate", facts_.shared_coordinates.size(), shared_text());
    add("left_out_faces", facts_.faces.left_out_face_count,
        counted(facts_.faces.left_out_face_count, "face", "faces") + " of vertices without a position left out");
    about_rounding();
  }

  /// What tells the holes, in the numbers of the file.
  std::string holes_text() const {
    std::string text;
    for (std::size_t i = 0; i < facts_.hole_counts.size(); ++i) {
      const Hole& hole = holes_[i];
      const std::string one = hole.axes == std::array{true, true, true}
                                  ? " in exactly one place, " + place_text(hole.place)
                                  : " whose " + axis_text(hole, " is ");
      if (facts_.hole_counts.size() == 1) return one;
      if (facts_.hole_counts[i] == 0) continue;
      text += (text.empty() ? " (" : "; ") + std::to_string(facts_.hole_counts[i]) + one;
    }
    return text + ')';
  }
  std::string crowded_text() const {
    std::string text;
    for (const bool is_used : {true, false}) {
      std::string places;
      std::size_t count = 0;
      for (const CrowdedPlace& one : facts_.crowded_places) {
        if (one.is_used == is_used) places += (count++ == 0 ? "" : " and in ") + place_text(one.place);
      }
      if (count == 0) continue;
      text += std::string(text.empty() ? "" : "; ") + "many vertices are in exactly one place, " + places +
              (is_used ? ", and faces use them, so that they are kept; where they stand for holes, write nan there or "
                         "leave them out of the faces"
                       : ", among the others, so that they are kept; where they stand for holes, write nan or 0 0 0 "
                         "there");
    }
    return text;
  }
  std::string shared_text() const {
    std::string text;
    for (const auto& [as_hole, share] : facts_.shared_coordinates) {
      constexpr double kPercent = 100;
      text += (text.empty() ? "" : ", and ") + short_number(std::max(0.1, std::round(10 * kPercent * share) / 10)) +
              " % of the vertices share " + axis_text(as_hole, " = ");
    }
    return text + ", far from all others, and are kept; where they stand for holes, write nan or -9999 there";
  }
  std::string axis_text(const Hole& hole, const char* is) const {
    for (const auto& [slot, axis, name] : {std::tuple{kX, 0U, "x"}, std::tuple{kY, 1U, "y"}, std::tuple{kZ, 2U, "z"}}) {
      const double metres = std::array{hole.place.x, hole.place.y, hole.place.z}[axis];
      if (hole.axes[axis]) return std::string(name) + is + coordinate_text(slot, metres);
    }
    return "";
  }
  std::string coordinate_text(std::size_t slot, double metres) const {
    const PlyScalar type = vertices_.properties[*schema_.vertex[slot]].type;
    const double value = metres / options_.scale();
    if (options_.scale() == 1 || type == PlyScalar::Float32) return value_text(value, type);
    // Having been to metres and back, a number may differ in the digits behind these.
    constexpr int kDigits = 15;
    return short_number(value, kDigits);
  }
  std::string place_text(const base::Vec3d& place) const {
    return coordinate_text(kX, place.x) + ' ' + coordinate_text(kY, place.y) + ' ' + coordinate_text(kZ, place.z);
  }

  /// What the file, or keeping positions as floats, has lost of them.
  void about_rounding() {
    if (!facts_.bulk) return;
    const Bulk& bulk = *facts_.bulk;
    const std::array<std::pair<double, double>, 3> axes = {
        {{bulk.min.x, bulk.max.x}, {bulk.min.y, bulk.max.y}, {bulk.min.z, bulk.max.z}}};
    double rounding = 0;
    bool is_all_float = true;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const PlyScalar type = vertices_.properties[*schema_.vertex[kX + axis]].type;
      is_all_float = is_all_float && (type == PlyScalar::Float32 || size_bytes(type) < 4);
      if (type != PlyScalar::Float32) continue;
      const double furthest = std::max(std::abs(axes[axis].first), std::abs(axes[axis].second));
      const auto stored = static_cast<float>(furthest / options_.scale());
      const float next = std::nextafter(stored, 0.0F);
      rounding = std::max(rounding, (static_cast<double>(stored) - static_cast<double>(next)) * options_.scale());
    }
    // Float coordinates far from 0 have been rounded before they came here, unless they are text.
    constexpr double kTooCoarse = 1.0 / 20'000;
    constexpr double kNoticed = 1e-5;  // metres
    if (facts_.origin != base::Vec3d{} && rounding > std::max(kNoticed, kTooCoarse * bulk.extent())) {
      add("rounded_positions", vertices_.count,
          "Positions are declared as floats and far from 0, where floats are rounded to " + short_number(rounding) +
              " m; " +
              (facts_.is_finer_than_declared
                   ? "this text has more digits than that, and all are kept, but other programs will lose them: "
                   : "") +
              "declare them as double, or write them closer to 0");
    }
    constexpr double kMillimetre = 0.001;
    const double kept = largest_rounding(bulk, facts_.origin);
    if ((!is_all_float || facts_.is_finer_than_declared) && kept > kMillimetre) {
      add("coarse_positions", vertices_.count,
          "Positions are kept as floats from " + number_text(facts_.origin.x) + " " + number_text(facts_.origin.y) +
              " " + number_text(facts_.origin.z) + ": the farthest of this large scene are off by up to " +
              base::distance_text(kept) + "; cut it into parts where that matters");
    }
  }

  void about_colours() {
    const PlyElement* const faces = header_.find("face");
    if (schema_.has_face_colours()) {
      add("face_colours", faces->count,
          "Colours of the faces carried to their corners (mean over the faces of a vertex)");
    }
    if (schema_.has_vertex_colours() || schema_.has_face_colours()) {
      const bool is_of_faces = !schema_.has_vertex_colours();
      const PlySlots& slots = is_of_faces ? schema_.face : schema_.vertex;
      const PlyElement& element = is_of_faces ? *faces : vertices_;
      if (schema_.has_unusual_colour_names) {
        const auto name = [&](PlySlot slot) { return element.properties[*slots[slot]].name; };
        const bool is_one = slots[kRed] == slots[kBlue];
        add("colour_properties", element.count,
            is_one ? "The colours are taken from the property " + joined({name(kRed)})
                   : "The colours are taken from the properties " + joined({name(kRed), name(kGreen), name(kBlue)}));
      }
      PlyScalar type = element.properties[*slots[kRed]].type;
      for (std::size_t slot = kRed; slot <= kBlue; ++slot) {
        if (element.properties[*slots[slot]].type != PlyScalar::UInt8) type = element.properties[*slots[slot]].type;
      }
      type = schema_.true_colour_type.value_or(type);
      const std::optional<double> white = options_.colour_white;
      std::string text = conversion_text(schema_.colour_coding, type, survey_.colour_range, white);
      if (schema_.true_colour_type) text = "The header says uchar, but the text has others: c" + text.substr(1);
      if (!text.empty()) add("converted_colours", vertices_.count, text);
      if (const std::string doubt = white_doubt(type, survey_.colour_range);
          schema_.colour_coding == ColourCoding::Channels && !white && !doubt.empty()) {
        add("colour_white", vertices_.count, doubt);
      }
    } else {
      about_textures();
    }
    add("clamped_colours", facts_.clamped_colour_count,
        counted(facts_.clamped_colour_count, "colour", "colours") +
            " out of range taken as black or white, or as grey where there is no number");
  }

  void about_textures() {
    std::string file;
    bool is_textured = false;
    for (const std::string& comment : header_.comments) {
      const std::size_t at = lower_case(comment).find("texturefile");
      if (at == std::string::npos) continue;
      is_textured = true;
      const std::size_t name = comment.find_first_not_of(" \t:=", at + std::string_view("texturefile").size());
      if (file.empty() && name != std::string::npos) file = printable(comment.substr(name));
    }
    const auto is_texture_property = [](const PlyProperty& property) {
      const std::string name = lower_case(property.name);
      return name == "texcoord" || name == "texnumber" || name == "texture_u" || name == "u" || name == "s" ||
             name == "texture_s" || name == "tex_u";
    };
    if (const PlyElement* const faces = header_.find("face")) {
      is_textured = is_textured || std::any_of(faces->properties.begin(), faces->properties.end(), is_texture_property);
    }
    is_textured =
        is_textured || std::any_of(vertices_.properties.begin(), vertices_.properties.end(), is_texture_property);
    if (!is_textured) return about_possible_colours();
    add("texture", vertices_.count,
        "The colours are in a texture" + (file.empty() ? "" : " (" + file + ")") +
            ", which is not read: everything is grey; bake it into the vertices first, in MeshLab with Filters, "
            "Texture, "
            "Transfer Color: Texture to Vertex");
  }

  void about_possible_colours() {
    std::vector<std::string> names;
    const auto look = [&](const PlyElement& element, const PlySlots& slots) {
      for (const std::size_t property : possible_colours(element)) {
        if (!is_used(slots, property)) names.push_back(element.properties[property].name);
      }
    };
    look(vertices_, schema_.vertex);
    if (const PlyElement* const faces = header_.find("face"); names.empty() && faces != nullptr && faces->count > 0) {
      look(*faces, schema_.face);
    }
    add("no_colours", names.size(),
        "No colours found, everything is grey; these could be them: " + joined(names) +
            " (--colour-properties RED,GREEN,BLUE takes them, or one alone that is grey; packed ones call rgb)");
  }

  void about_temperature_property() {
    if (schema_.has_face_temperature()) {
      add("face_temperatures", header_.find("face")->count,
          "Temperatures of the faces carried to their corners (mean over the faces of a vertex)");
    }
    const PlyProperty* const property = temperature_property();
    if (property == nullptr) return about_candidates();
    std::string others;
    for (const PlyProperty& other : vertices_.properties) {
      if (!other.is_list && &other != property && temperature_name(other.name).rank > 0) {
        others += (others.empty() ? "" : ", ") + ("'" + printable(other.name) + "'");
      }
    }
    if (property->name == "temperature" && others.empty()) return;
    add("temperature_property", vertices_.count,
        "The temperature is taken from the property '" + printable(property->name) + "'" +
            (others.empty() ? std::string() : ", not from " + others + " (--temperature-property names another)"));
  }

  const PlyProperty* temperature_property() const {
    if (schema_.has_vertex_temperature()) return &vertices_.properties[*schema_.vertex[kTemperature]];
    if (schema_.has_face_temperature()) return &header_.find("face")->properties[*schema_.face[kTemperature]];
    return nullptr;
  }

  /// No temperature was found: why, and what could be one.
  void about_candidates() {
    std::vector<std::string> names;
    std::string text;
    const auto look = [&](const PlyElement& element, const PlySlots& slots) {
      for (std::size_t i = 0; i < element.properties.size(); ++i) {
        const PlyProperty& property = element.properties[i];
        const TemperatureName name = temperature_name(property.name);
        if (is_used(slots, i)) continue;
        if (!property.is_list && name.is_candidate) names.push_back(property.name);
        if (property.is_list && name.rank > 0) {
          text = "'" + printable(property.name) + "' is a list, and not taken for a temperature, which is one number";
        }
      }
    };
    look(vertices_, schema_.vertex);
    const PlyElement* const faces = header_.find("face");
    const bool has_faces = faces != nullptr && faces->count > 0;
    if (has_faces) look(*faces, schema_.face);
    if (text.empty()) text = about_bare_t(vertices_, names);
    if (text.empty() && has_faces) text = about_bare_t(*faces, names);
    if (text.empty() && names.empty()) return;
    if (text.empty()) text = "No property is called a temperature";
    if (!names.empty()) text += "; --temperature-property NAME takes one of: " + joined(names);
    add("no_temperature", std::max<std::size_t>(1, names.size()), text);
  }

  /// Why a bare t is no temperature; puts it before the names where it may be one nevertheless.
  std::string about_bare_t(const PlyElement& element, std::vector<std::string>& names) const {
    const auto is_bare_t = [](const PlyProperty& one) { return !one.is_list && temperature_name(one.name).is_bare_t; };
    const auto speaks_against = [](const PlyProperty& one) { return temperature_name(one.name).speaks_against_t; };
    const auto& properties = element.properties;
    const auto t = std::find_if(properties.begin(), properties.end(), is_bare_t);
    if (t == properties.end()) return {};
    const auto other = std::find_if(properties.begin(), properties.end(), speaks_against);
    const bool is_of_faces = &element != &vertices_;
    std::string reason;
    bool may_be_one = true;
    if (!is_of_faces && schema_.is_temperature_doubtful) {
      // No sensor of temperatures counts further.
      constexpr double kMostCounts = 65'535;
      may_be_one = survey_.most_doubtful <= kMostCounts;
      reason = "its values (" + number_text(survey_.least_doubtful) + " to " + number_text(survey_.most_doubtful) + ")";
    } else if (other != properties.end()) {
      reason = "'" + printable(other->name) + "' beside it";
    } else if (is_floating(t->type)) {
      reason = "its name, which is not enough for one of the faces";
    } else {
      may_be_one = size_bytes(t->type) < 4;
      reason = "its type, " + std::string(to_string(t->type)) + ": whole numbers of that name count time";
    }
    std::erase(names, t->name);
    if (may_be_one || temperature_name(t->name).is_candidate) names.insert(names.begin(), t->name);
    return "'" + printable(t->name) + "' is not taken for a temperature, because of " + reason;
  }

  void about_temperatures() {
    const TemperatureFacts& facts = facts_.temperature;
    add("missing_temperatures", facts.missing_count,
        counted(facts.missing_count, "vertex", "vertices") + " without a temperature");
    add("impossible_temperatures", facts.impossible_count,
        counted(facts.impossible_count, "temperature", "temperatures") +
            " at or below -273.15 degC (absolute zero) taken as missing");
    add("no_data_temperatures", facts.no_data_count,
        counted(facts.no_data_count, "temperature", "temperatures") + " of a --no-data value taken as missing");
    add("over_range_temperatures", facts.over_range_count,
        counted(facts.over_range_count, "temperature", "temperatures") +
            " over the range of the sensor (infinite), shown as the hottest");
    add("under_range_temperatures", facts.under_range_count,
        counted(facts.under_range_count, "temperature", "temperatures") +
            " under the range of the sensor (-infinite), shown as the coldest");
    if (facts.finite_count == 0) return;
    if (const auto doubt = temperature_doubt(facts, *temperature_property(), options_.celsius_scale())) {
      add("implausible_temperatures", doubt->count, doubt->message);
    }
  }

  /// What was said of the file and has changed nothing.
  void about_options() {
    const bool has_channels =
        (schema_.has_vertex_colours() || schema_.has_face_colours()) && schema_.colour_coding == ColourCoding::Channels;
    std::string of_colours;
    if (options_.colour_white && !has_channels) {
      of_colours = "There are no colours of levels, so this has no effect: --colour-white";
    }
    if (temperature_property() == nullptr) {
      std::vector<std::string> names;
      if (options_.temperature_unit) names.emplace_back("--temperature-unit");
      if (options_.temperature_scale) names.emplace_back("--temperature-scale");
      if (options_.temperature_offset) names.emplace_back("--temperature-offset");
      if (!options_.no_data.empty()) names.emplace_back("--no-data");
      std::string text = names.empty() ? "" : "There is no temperature, so these have no effect: " + joined(names);
      if (!text.empty() && !of_colours.empty()) text += "; ";
      add("unused_options", names.size() + (of_colours.empty() ? 0 : 1), text + of_colours);
      return;
    }
    std::vector<std::string> values;
    for (std::size_t i = 0; i < std::min<std::size_t>(options_.no_data.size(), 64); ++i) {
      const bool is_seen = (facts_.temperature.no_data_seen >> i & 1U) != 0;
      if (!is_seen) values.push_back(number_text(options_.no_data[i]));
    }
    std::string text = values.empty()
                           ? ""
                           : "No temperature of the file, in its own unit, has this --no-data value: " + joined(values);
    if (!text.empty() && !of_colours.empty()) text += "; ";
    add("unused_options", values.size() + (of_colours.empty() ? 0 : 1), text + of_colours);
  }

  void about_what_is_skipped() {
    const auto of = [](std::size_t count) { return counted(count, "property", "properties"); };
    const auto names = unused_names(vertices_, schema_.vertex, std::nullopt);
    add("skipped_vertex_properties", names.size(), of(names.size()) + " of the vertices left out: " + joined(names));
    if (const PlyElement* const faces = header_.find("face"); faces != nullptr && faces->count > 0) {
      const auto face_names = unused_names(*faces, schema_.face, schema_.corner_list);
      add("skipped_face_properties", face_names.size(),
          of(face_names.size()) + " of the faces left out: " + joined(face_names));
    }
    for (const PlyElement& element : header_.elements) {
      const bool is_read =
          &element == &vertices_ || &element == header_.find("face") || &element == header_.find("tristrips");
      if (is_read || element.count == 0) continue;
      add("skipped_elements", element.count,
          "Element '" + printable(element.name) + "' with " + counted(element.count, "entry", "entries") + " left out");
    }
  }

  void about_corners(std::string_view name, const std::optional<std::size_t>& list) {
    if (!list) return;
    const PlyElement& element = *header_.find(name);
    const std::string& property = element.properties[*list].name;
    const std::string lower = lower_case(property);
    if (lower == "vertex_indices" || lower == "vertex_index") return;
    add("corner_list", element.count, "The corners of the faces are taken from the list '" + printable(property) + "'");
  }

  void about_faces() {
    const FaceFacts& faces = facts_.faces;
    about_corners("face", schema_.corner_list);
    about_corners("tristrips", schema_.strip_list);
    add("triangulated_strips", faces.strip_count,
        counted(faces.strip_count, "triangle strip", "triangle strips") + " cut into triangles");
    add("triangulated_polygons", faces.polygon_count,
        counted(faces.polygon_count, "polygon", "polygons") + " of more than three corners cut into triangles");
    add("crossing_polygons", faces.crossing_polygon_count,
        counted(faces.crossing_polygon_count, "polygon crosses itself", "polygons cross themselves") +
            ": cut into fans from the first corner, which may cover what is outside; triangulate such polygons in the "
            "program that made them");
    add("large_polygons", faces.large_polygon_count,
        counted(faces.large_polygon_count, "concave polygon", "concave polygons") + " of more than " +
            std::to_string(mesh::PolygonCutter::kMostCorners) +
            " corners cut into fans from the first corner, which cover what is outside; triangulate such polygons in "
            "the "
            "program that made them");
    add("degenerate_faces", faces.degenerate_triangle_count,
        counted(faces.degenerate_triangle_count, "triangle", "triangles") + " with the same vertex twice left out");
    add("incomplete_faces", faces.incomplete_face_count,
        counted(faces.incomplete_face_count, "face", "faces") + " of fewer than three corners left out");
    add("unreferenced_vertices", facts_.unreferenced_vertex_count,
        counted(facts_.unreferenced_vertex_count, "vertex", "vertices") +
            " of no triangle: not drawn, though kept, and their temperatures count; what is to be seen of them belongs "
            "into a file of points alone");
  }

  const PlyHeader& header_;
  const PlySchema& schema_;
  const PlySurvey& survey_;
  const ReadOptions& options_;
  const PlyBodyFacts& facts_;
  const std::vector<Hole>& holes_;
  const PlyElement& vertices_;
  std::vector<Note> notes_;
};

}  // namespace

std::string counted(std::uint64_t count, std::string_view one, std::string_view many) {
  return std::to_string(count) + " " + std::string(count == 1 ? one : many);
}

std::vector<Note> ply_notes(const PlyHeader& header, const PlyInterpretation& interpretation,
                            const ReadOptions& options, const PlyBodyFacts& facts) {
  return Notes(header, interpretation, options, facts).take();
}

}  // namespace spectra::files
