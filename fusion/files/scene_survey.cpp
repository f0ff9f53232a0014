#include "fusion/files/scene_survey.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "fusion/base/distance_text.hpp"
#include "fusion/files/told_coordinates.hpp"
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
  const auto& told = scene.mesh.told.up;
  if (wanted) {
    scene.mesh.up = *wanted;
    return;
  }
  const auto seen = told ? std::nullopt : up_seen(scene.mesh, *scene.core_bounds);
  scene.mesh.up = told.value_or(seen.value_or(base::UpAxis::Z));
  if (scene.mesh.up == base::UpAxis::Z) return;
  const std::string name(to_string(scene.mesh.up));
  scene.notes.push_back({"up_found", 1,
                         name + " is taken for up, as " +
                             (told ? "the file's comments say" : "this is a map that is flat in that direction") +
                             "; --up z takes z"});
}

/// True when there was something to say.
bool judge_unit(LoadedScene& scene) {
  const LengthUnit* const unit = scene.mesh.is_metric ? nullptr : length_unit(scene.mesh.told.unit);
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
  scene.mesh.told = told_coordinates(scene.comments, options);
  find_up(scene, options.up);
  scene.mesh.is_metric = scene.mesh.is_metric || scene.mesh.told.unit == kMetres;
  if (!judge_unit(scene)) judge_size(scene);
}

}  // namespace spectra::files
