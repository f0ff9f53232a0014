#include "fusion/files/temperature_name.hpp"

#include <algorithm>
#include <array>
#include <span>
#include <string>
#include <vector>

#include "fusion/files/name_words.hpp"

namespace spectra::files {

namespace {

struct Key {
  std::string_view word;
  int rank;
};

constexpr std::array<Key, 5> kKeys = {
    {{"temperature", 100}, {"temperatures", 100}, {"temp", 90}, {"thermal", 80}, {"therm", 70}}};
constexpr int kUnitAloneRank = 50;
constexpr int kFurtherWordsCost = 5;

struct Unit {
  std::string_view word;
  std::optional<TemperatureUnit> unit;
};

constexpr std::array<Unit, 14> kUnits = {{{"c", TemperatureUnit::Celsius},
                                          {"degc", TemperatureUnit::Celsius},
                                          {"celsius", TemperatureUnit::Celsius},
                                          {"centigrade", TemperatureUnit::Celsius},
                                          {"k", TemperatureUnit::Kelvin},
                                          {"degk", TemperatureUnit::Kelvin},
                                          {"kelvin", TemperatureUnit::Kelvin},
                                          {"ck", TemperatureUnit::Centikelvin},
                                          {"centikelvin", TemperatureUnit::Centikelvin},
                                          {"f", TemperatureUnit::Fahrenheit},
                                          {"degf", TemperatureUnit::Fahrenheit},
                                          {"fahrenheit", TemperatureUnit::Fahrenheit},
                                          {"mk", std::nullopt},
                                          {"millikelvin", std::nullopt}}};

/// Words that leave a temperature a temperature.
constexpr std::array<std::string_view, 30> kHarmless = {
    "scalar", "field", "value",    "values",  "surface", "mean",   "average", "avg",    "object",   "skin",
    "body",   "deg",   "degree",   "degrees", "in",      "map",    "image",   "camera", "sensor",   "ir",
    "lwir",   "raw",   "infrared", "data",    "channel", "vertex", "point",   "face",   "measured", "apparent"};

constexpr std::array<std::string_view, 9> kAgainstT = {"u",    "v",     "s",       "time",   "timestamp",
                                                       "ring", "stamp", "gpstime", "texture"};

/// Words of properties that are known to be something else.
constexpr std::array<std::string_view, 50> kOthers = {
    "x",        "y",       "z",     "nx",      "ny",      "nz",      "normal",    "normals", "red",       "green",
    "blue",     "alpha",   "rgb",   "rgba",    "r",       "g",       "b",         "a",       "diffuse",   "ambient",
    "specular", "u",       "v",     "s",       "texture", "tex",     "texnumber", "time",    "timestamp", "ring",
    "flags",    "id",      "label", "opacity", "scale",   "rot",     "rest",      "dc",      "t",         "stamp",
    "times",    "gpstime", "sec",   "secs",    "second",  "seconds", "nanosec",   "nsec",    "ns",        "epoch"};

bool has(std::span<const std::string_view> words, std::string_view word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

const Unit* find_unit(std::string_view word) {
  const auto found = std::find_if(kUnits.begin(), kUnits.end(), [word](const Unit& unit) { return unit.word == word; });
  return found == kUnits.end() ? nullptr : &*found;
}

/// "mK" and "cK" are one word, though the change of case has cut them in two: also of "tempmK".
void join_units(std::vector<std::string>& words) {
  for (std::size_t i = 0; i + 1 < words.size(); ++i) {
    const std::string& word = words[i];
    if (words[i + 1] != "k" || (!word.ends_with('m') && !word.ends_with('c'))) continue;
    const std::string_view rest = std::string_view(word).substr(0, word.size() - 1);
    const bool is_key = std::any_of(kKeys.begin(), kKeys.end(), [rest](const Key& key) { return key.word == rest; });
    if (!rest.empty() && !is_key) continue;
    words[i] += 'k';
    words.erase(words.begin() + static_cast<std::ptrdiff_t>(i) + 1);
  }
}

/// A word such as "tempc" or "temperaturekelvin" cut in two.
void cut_units_off(std::vector<std::string>& words) {
  for (std::size_t i = 0; i < words.size(); ++i) {
    for (const Key& key : kKeys) {
      if (words[i].size() > key.word.size() && words[i].starts_with(key.word) &&
          find_unit(std::string_view(words[i]).substr(key.word.size())) != nullptr) {
        words.push_back(words[i].substr(key.word.size()));
        words[i].resize(key.word.size());
        break;
      }
    }
  }
}

}  // namespace

TemperatureName temperature_name(std::string_view name) {
  std::vector<std::string> words = name_words(name);
  join_units(words);
  cut_units_off(words);
  TemperatureName result;
  bool is_plain = true;
  bool has_t = false;
  bool has_unit = false;
  int rank = 0;
  for (const std::string& word : words) {
    const auto key = std::find_if(kKeys.begin(), kKeys.end(), [&word](const Key& one) { return one.word == word; });
    const Unit* const unit = find_unit(word);
    if (key != kKeys.end()) {
      rank = std::max(rank, key->rank);
    } else if (unit != nullptr) {
      has_unit = true;
      if (unit->unit) result.unit = unit->unit;
    } else if (word == "t") {
      has_t = true;
    } else if (!has(kHarmless, word)) {
      is_plain = false;
    }
    result.speaks_against_t = result.speaks_against_t || has(kAgainstT, word);
  }
  if (is_plain && rank == 0 && !has_t && result.unit) {
    // "celsius" says what it is; "c" and "deg" do not.
    const bool is_said = std::any_of(words.begin(), words.end(), [](const std::string& word) {
      return word.size() > 3 && find_unit(word) != nullptr;
    });
    rank = is_said ? kUnitAloneRank : 0;
  }
  result.rank = is_plain && rank > 0 ? rank - (words.size() > 1 ? kFurtherWordsCost : 0) : 0;
  result.is_bare_t = is_plain && rank == 0 && has_t;
  // A word that says temperature makes up for any that says something else, and so does a unit behind a t.
  result.is_candidate =
      rank > 0 || (result.is_bare_t && has_unit) ||
      std::none_of(words.begin(), words.end(), [](const std::string& word) { return has(kOthers, word); });
  if (result.rank == 0 && !result.is_bare_t) result.unit.reset();
  return result;
}

}  // namespace spectra::files
