#include "fusion/files/colour_names.hpp"

#include <algorithm>
#include <string>
#include <string_view>
#include <unordered_map>

#include "fusion/files/name_words.hpp"

namespace spectra::files {

namespace {

using Words = std::vector<std::string>;
using Channels = std::array<std::string_view, 3>;

constexpr Channels kShortFloats = {"rf", "gf", "bf"};
constexpr std::array<Channels, 3> kChannels = {{{"red", "green", "blue"}, {"r", "g", "b"}, kShortFloats}};
/// Words that leave a colour the colour of the vertex.
constexpr std::array<std::string_view, 11> kPlain = {"colour", "color", "colours", "colors", "col",    "vertex",
                                                     "vert",   "point", "scalar",  "rgb",    "channel"};
constexpr std::array<std::string_view, 11> kAlone = {"rgb",  "rgba", "colour",    "color",     "colours",  "colors",
                                                     "gray", "grey", "intensity", "luminance", "grayscale"};

template <std::size_t kCount>
bool has(const std::array<std::string_view, kCount>& words, std::string_view word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

struct Triple {
  std::array<std::size_t, 3> properties{};
  bool is_plain = false;
};

std::string joined(const Words& words) {
  std::string name;
  for (const std::string& word : words) name += word + ' ';
  return name;
}

/// Those whose names differ in the channel alone; in time of the header's length.
std::vector<Triple> triples_of(const PlyElement& element) {
  std::vector<Words> names;
  std::unordered_map<std::string, std::size_t> first_of_name;
  for (const PlyProperty& property : element.properties) {
    names.push_back(property.is_list ? Words{} : name_words(property.name));
    first_of_name.try_emplace(joined(names.back()), names.size() - 1);
  }
  std::vector<Triple> triples;
  for (std::size_t i = 0; i < names.size(); ++i) {
    for (const Channels& channels : kChannels) {
      const auto red = std::find(names[i].begin(), names[i].end(), channels[0]);
      if (red == names[i].end()) continue;
      const auto at = static_cast<std::size_t>(red - names[i].begin());
      Triple triple{{i, i, i}, channels != kShortFloats};
      bool is_whole = true;
      for (std::size_t channel = 1; channel < 3; ++channel) {
        Words wanted = names[i];
        wanted[at] = channels[channel];
        const auto found = first_of_name.find(joined(wanted));
        is_whole = is_whole && found != first_of_name.end();
        if (is_whole) triple.properties[channel] = found->second;
      }
      for (std::size_t word = 0; word < names[i].size(); ++word) {
        triple.is_plain = triple.is_plain && (word == at || has(kPlain, names[i][word]));
      }
      if (is_whole) triples.push_back(triple);
    }
  }
  return triples;
}

}  // namespace

std::optional<std::array<std::size_t, 3>> plain_colour_channels(const PlyElement& element) {
  const std::vector<Triple> triples = triples_of(element);
  const auto plain = std::find_if(triples.begin(), triples.end(), [](const Triple& one) { return one.is_plain; });
  if (plain == triples.end()) return std::nullopt;
  return plain->properties;
}

std::vector<std::size_t> possible_colours(const PlyElement& element) {
  std::vector<std::size_t> properties;
  for (const Triple& triple : triples_of(element)) {
    properties.insert(properties.end(), triple.properties.begin(), triple.properties.end());
  }
  if (!properties.empty()) return properties;
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    const Words words = name_words(element.properties[i].name);
    const bool is_one =
        std::any_of(words.begin(), words.end(), [](const std::string& word) { return has(kAlone, word); });
    if (is_one && !element.properties[i].is_list) properties.push_back(i);
  }
  return properties;
}

}  // namespace spectra::files
