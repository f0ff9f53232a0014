#include "fusion/files/scene_survey.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "fusion/base/distance_text.hpp"
#include "fusion/files/comment_words.hpp"
#include "fusion/files/up_search.hpp"
#include "fusion/mesh/stray_points.hpp"

namespace spectra::files {

namespace {

/// Scenes this large and larger are maps, or count in millimetres.
constexpr double kRoomInMillimetres = 1000;
/// A map is flatter: its height is a smaller share of its width.
constexpr double kFlat = 0.1;

std::array<double, 3> extents_of(const base::Bounds& box) {
  return {static_cast<double>(box.max.x) - static_cast<double>(box.min.x),
          static_cast<double>(box.max.y) - static_cast<double>(box.min.y),
          static_cast<double>(box.max.z) - static_cast<double>(box.min.z)};
}

void find_strays(LoadedScene& scene) {
  const mesh::StrayPoints strays = mesh::stray_points(scene.mesh.positions(), scene.mesh.triangles());
  scene.core_bounds = strays.core;
  if (strays.count == 0) return;
  const bool is_one = strays.count == 1;
  scene.notes.push_back({"stray_points", strays.count,
                         (is_one ? "1 stray vertex lies" : std::to_string(strays.count) + " stray vertices lie") +
                             " far from everything else, up to " + base::distance_text(strays.farthest_m) + " away: " +
                             (is_one ? "it stays" : "they stay") + " in the scene, and views are fitted to the rest"});
}

void find_up(LoadedScene& scene, const std::optional<base::UpAxis>& wanted) {
  if (wanted) {
    scene.mesh.up = *wanted;
    return;
  }
  const auto told = up_told(scene.comments);
  const auto seen = told ? std::nullopt : up_seen(scene.mesh, *scene.core_bounds);
  scene.mesh.up = told.value_or(seen.value_or(base::UpAxis::Z));
  if (scene.mesh.up == base::UpAxis::Z) return;
  const std::string name(to_string(scene.mesh.up));
  scene.notes.push_back({"up_found", 1,
                         name + " is taken for up, as " +
                             (told ? "the file's comments say" : "this is a map that is flat in that direction") +
                             "; --up z takes z"});
}

/// Whether a short name of a unit, which is a word or a letter elsewhere, is all that is said of it: "units: m", not "in m, ...".
bool is_whole_unit(const std::vector<std::string>& words, std::size_t at) {
  return at > 0 && (words[at - 1] == "=" || words[at - 1].starts_with("unit")) &&
         (at + 1 == words.size() || words[at + 1] == ",");
}

bool is_denied(const std::vector<std::string>& words, std::size_t at) {
  return (at > 0 && words[at - 1] == "not") || (at > 1 && words[at - 1] == "in" && words[at - 2] == "not");
}

bool speaks_of_metres(const LoadedScene& scene) {
  return std::any_of(scene.comments.begin(), scene.comments.end(), [](const std::string& comment) {
    const std::vector<std::string> words = comment_words(comment);
    for (std::size_t i = 0; i < words.size(); ++i) {
      const std::string& word = words[i];
      const bool is_metre = word.starts_with("metre") || word.starts_with("meter");
      const bool is_letter =
          word == "m" && is_whole_unit(words, i) &&
          std::any_of(words.begin(), words.end(), [](const std::string& other) { return other.starts_with("unit"); });
      if ((is_metre || is_letter) && !is_denied(words, i)) return true;
    }
    return false;
  });
}

struct LengthUnit {
  std::string_view name;
  std::string_view metres;  ///< In one of it.
  std::array<std::string_view, 6> words;
};

constexpr std::array<LengthUnit, 5> kLengthUnits = {
    {{"millimetres", "0.001", {"mm", "millimetre", "millimetres", "millimeter", "millimeters", "millimetric"}},
     {"centimetres", "0.01", {"cm", "centimetre", "centimetres", "centimeter", "centimeters", "centimetric"}},
     {"inches", "0.0254", {"inch", "inches", "in"}},
     {"feet", "0.3048", {"foot", "feet", "ft"}},
     {"micrometres", "0.000001", {"um", "micrometre", "micrometres", "micrometer", "micrometers", "microns"}}}};

/// The unit of length that a comment gives the positions. A bare "2 mm" may be the accuracy of a scanner.
const LengthUnit* unit_told(const std::vector<std::string>& comments) {
  const auto is_about_all = [](const std::string& word) {
    constexpr std::array<std::string_view, 12> kWords = {"unit",     "units",      "values", "coordinates",
                                                         "coords",   "positions",  "points", "lengths",
                                                         "vertices", "dimensions", "xyz",    "distances"};
    return std::find(kWords.begin(), kWords.end(), word) != kWords.end();
  };
  const auto is_number = [](const std::string& word) { return word.find_first_of("0123456789") != std::string::npos; };
  for (const std::string& comment : comments) {
    const std::vector<std::string> words = comment_words(comment);
    const auto about = std::find_if(words.begin(), words.end(), is_about_all);
    for (auto word = about; word != words.end(); ++word) {
      // "in" is an inch only where it is all that is said of the unit.
      const auto at = static_cast<std::size_t>(word - words.begin());
      if (*word == "in" && (word == about || !is_whole_unit(words, at))) continue;
      if (is_denied(words, at)) continue;
      if (word != words.begin() && is_number(*(word - 1))) continue;
      for (const LengthUnit& unit : kLengthUnits) {
        if (std::find(unit.words.begin(), unit.words.end(), *word) != unit.words.end()) return &unit;
      }
    }
  }
  return nullptr;
}

/// True when there was something to say.
bool judge_unit(LoadedScene& scene) {
  const LengthUnit* const unit = scene.mesh.is_metric ? nullptr : unit_told(scene.comments);
  if (unit == nullptr) return false;
  scene.notes.push_back({"unit_told", 1,
                         "The file's comments speak of " + std::string(unit->name) + ": --scale " +
                             std::string(unit->metres) + " makes metres of them",
                         true});
  return true;
}

/// Rooms and machines measured in millimetres look like mountains. Maps are flatter, or lie at map coordinates (then
/// there is an origin), or say what they count in.
void judge_size(LoadedScene& scene) {
  const auto extents = extents_of(*scene.core_bounds);
  const double largest = *std::max_element(extents.begin(), extents.end());
  const double smallest = *std::min_element(extents.begin(), extents.end());
  const bool is_at_map_coordinates = scene.mesh.origin != base::Vec3d{};
  if (scene.mesh.is_metric || largest < kRoomInMillimetres || smallest < kFlat * largest || is_at_map_coordinates) {
    return;
  }
  scene.notes.push_back({"may_be_millimetres", 1,
                         "The scene is " + base::distance_text(largest) +
                             " across: if its file counts in millimetres, --scale 0.001 gives it its true size",
                         true});
}

}  // namespace

void survey(LoadedScene& scene, const ReadOptions& options) {
  find_strays(scene);
  find_up(scene, options.up);
  scene.mesh.is_metric = scene.mesh.is_metric || options.metres_per_unit || speaks_of_metres(scene);
  if (!judge_unit(scene)) judge_size(scene);
}

}  // namespace spectra::files
