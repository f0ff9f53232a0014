#include "fusion/mesh/scene_survey.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>

#include "fusion/mesh/stray_points.hpp"

namespace spectra::fusion {

namespace {

/// A distance to three digits, in the unit that people would use.
std::string distance_text(double metres) {
  const bool is_far = metres >= 1000;
  const double value = is_far ? metres / 1000 : metres;
  const int decimals = value > 0 ? std::clamp(2 - static_cast<int>(std::floor(std::log10(value))), 0, 6) : 0;
  std::array<char, 400> text{};
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return std::string(text.data()) + (is_far ? " km" : " m");
}

void find_strays(LoadedScene& scene) {
  const StrayPoints strays = stray_points(scene.mesh.positions(), scene.mesh.triangles());
  scene.core_bounds = strays.core;
  if (strays.count == 0) return;
  const bool is_one = strays.count == 1;
  scene.notes.push_back({"stray_points", strays.count,
                         (is_one ? "1 stray vertex lies" : std::to_string(strays.count) + " stray vertices lie") +
                             " far from everything else, up to " + distance_text(strays.farthest_m) + " away: " +
                             (is_one ? "it stays" : "they stay") + " in the scene, and views are fitted to the rest"});
}

}  // namespace

void survey(LoadedScene& scene) {
  find_strays(scene);
}

}  // namespace spectra::fusion
