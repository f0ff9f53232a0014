#include "fusion/files/told_coordinates.hpp"

#include <algorithm>
#include <array>
#include <vector>

#include "fusion/files/comment_words.hpp"
#include "fusion/files/up_search.hpp"

namespace spectra::files {

namespace {

/// "1 unit = 1 mm".
bool is_of_one_unit(const std::vector<std::string>& words, std::size_t at) {
  return at > 2 && words[at - 1] == "1" && words[at - 2] == "=" && words[at - 3].starts_with("unit");
}

/// Whether a short name of a unit, which is a word or a letter elsewhere, is all that is said of it: "units: m", not "in m, ...".
bool is_whole_unit(const std::vector<std::string>& words, std::size_t at) {
  return at > 0 && (is_of_one_unit(words, at) || words[at - 1] == "=" || words[at - 1].starts_with("unit")) &&
         (at + 1 == words.size() || words[at + 1] == ",");
}

/// "Not in metres", and "1000 units per metre" or "points per square metre".
bool is_denied(const std::vector<std::string>& words, std::size_t at) {
  const auto word_before = [&words, at](std::size_t count) {
    return at >= count ? std::string_view(words[at - count]) : std::string_view();
  };
  const std::string_view before = word_before(1);
  const std::string_view second = word_before(2);
  return before == "not" || before == "per" || (before == "in" && second == "not") ||
         ((before == "square" || before == "cubic") && second == "per");
}

/// The one word of a comment that says nothing but a unit: "mm", "in inches", "everything is in mm". What may be the name of
/// what was measured, or a mere letter, wants an "in" before it. Empty: it says something else.
std::string lone_word(const std::vector<std::string>& words) {
  constexpr std::array<std::string_view, 8> kBeside = {"in", "all", "everything", "is", "are", "unit", "units", "="};
  constexpr std::array<std::string_view, 4> kAmbiguous = {"m", "um", "foot", "feet"};
  const auto is_beside = [&kBeside](const std::string& word) {
    return std::find(kBeside.begin(), kBeside.end(), word) != kBeside.end();
  };
  const auto word = std::find_if_not(words.begin(), words.end(), is_beside);
  if (word == words.end() || !std::all_of(word + 1, words.end(), is_beside)) return {};
  const bool is_ambiguous = std::find(kAmbiguous.begin(), kAmbiguous.end(), *word) != kAmbiguous.end();
  return !is_ambiguous || (word != words.begin() && *(word - 1) == "in") ? *word : std::string();
}

bool speaks_of_metres(std::span<const std::string> comments) {
  return std::any_of(comments.begin(), comments.end(), [](const std::string& comment) {
    const std::vector<std::string> words = comment_words(comment);
    if (lone_word(words) == "m") return true;
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

/// A unit and the words for it.
struct UnitWords {
  LengthUnit unit;
  std::array<std::string_view, 6> words;
};

constexpr std::array<UnitWords, 5> kUnits = {
    {{{"millimetres", "0.001"}, {"mm", "millimetre", "millimetres", "millimeter", "millimeters", "millimetric"}},
     {{"centimetres", "0.01"}, {"cm", "centimetre", "centimetres", "centimeter", "centimeters", "centimetric"}},
     {{"inches", "0.0254"}, {"inch", "inches", "in"}},
     {{"feet", "0.3048"}, {"foot", "feet", "ft"}},
     {{"micrometres", "0.000001"}, {"um", "micrometre", "micrometres", "micrometer", "micrometers", "microns"}}}};

/// The unit that a comment says and nothing else, where no other says another.
std::string_view lone_unit(std::span<const std::string> comments) {
  std::string_view told;
  for (const std::string& comment : comments) {
    const std::string word = lone_word(comment_words(comment));
    for (const auto& [unit, unit_words] : kUnits) {
      if (word.empty() || std::find(unit_words.begin(), unit_words.end(), word) == unit_words.end()) continue;
      if (!told.empty() && told != unit.name) return {};
      told = unit.name;
    }
  }
  return told;
}

/// The unit of length that a comment gives the positions. A bare "2 mm" may be the accuracy of a scanner.
std::string_view unit_told(std::span<const std::string> comments) {
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
      if (word != words.begin() && is_number(*(word - 1)) && !is_of_one_unit(words, at)) continue;
      for (const auto& [unit, unit_words] : kUnits) {
        if (std::find(unit_words.begin(), unit_words.end(), *word) != unit_words.end()) return unit.name;
      }
    }
  }
  return lone_unit(comments);
}

}  // namespace

const LengthUnit* length_unit(std::string_view name) {
  const auto known =
      std::find_if(kUnits.begin(), kUnits.end(), [&](const UnitWords& one) { return one.unit.name == name; });
  return known == kUnits.end() ? nullptr : &known->unit;
}

mesh::ToldCoordinates told_coordinates(std::span<const std::string> comments, const ReadOptions& options) {
  mesh::ToldCoordinates told;
  told.up = options.up ? options.up : up_told(comments);
  told.unit = options.metres_per_unit || speaks_of_metres(comments) ? kMetres : unit_told(comments);
  return told;
}

std::string comment_of(const mesh::ToldCoordinates& told) {
  std::string text;
  if (told.up) text += "up " + std::string(to_string(*told.up));
  if (!told.unit.empty()) text += (text.empty() ? "" : "; ") + ("positions in " + told.unit);
  return text;
}

}  // namespace spectra::files
