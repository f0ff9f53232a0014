#include "fusion/mesh/scene_survey.hpp"

#include <string>

#include "fusion/mesh/distance_text.hpp"
#include "fusion/mesh/stray_points.hpp"

namespace spectra::fusion {

namespace {

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
