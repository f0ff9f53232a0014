#include "server/sources/stored_constants.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace spectra::sources {
namespace {

/// What a store keeps of one constant is bounded.
constexpr std::size_t kMostEarlier = 200;

}  // namespace

std::string text_of(const map::MapConstants& constants) {
  char text[256];
  const auto& corner = constants.grid.corner_m();
  std::snprintf(text, sizeof text, "%a %a %a %a %a %a %a %a", constants.origin.x, constants.origin.y,
                constants.origin.z, corner[0], corner[1], corner[2], constants.grid.edge_m(),
                double{constants.position_step_m});
  return text;
}

std::optional<map::MapConstants> constants_of(const std::string& text) {
  std::array<double, 8> v{};
  if (std::sscanf(text.c_str(), "%la %la %la %la %la %la %la %la", &v[0], &v[1], &v[2], &v[3], &v[4], &v[5], &v[6],
                  &v[7]) != 8) {
    return std::nullopt;
  }
  const bool is_finite = std::all_of(v.begin(), v.end(), [](double value) { return std::isfinite(value); });
  if (!is_finite || !(v[6] > 0) || !(static_cast<float>(v[7]) > 0)) return std::nullopt;
  return map::MapConstants{.origin = {v[0], v[1], v[2]},
                           .grid = map::MapGrid({v[3], v[4], v[5]}, v[6]),
                           .position_step_m = static_cast<float>(v[7])};
}

std::string text_of(const std::vector<EarlierConstants>& earlier) {
  std::string text;
  for (std::size_t i = earlier.size() - std::min(earlier.size(), kMostEarlier); i < earlier.size(); ++i) {
    text += std::to_string(earlier[i].until_revision) + ' ' + text_of(earlier[i].constants) + '\n';
  }
  return text;
}

std::vector<EarlierConstants> earlier_constants_of(const std::string& text) {
  std::vector<EarlierConstants> earlier;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string line = text.substr(begin, end - begin);
    begin = end + 1;
    const std::size_t space = std::min(line.find(' '), line.size());
    const auto constants = constants_of(line.substr(space));
    const std::uint64_t until = std::strtoull(line.c_str(), nullptr, 10);
    if (constants && until > 0) earlier.push_back({until, *constants});
  }
  return earlier;
}

}  // namespace spectra::sources
