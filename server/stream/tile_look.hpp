#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "fusion/age.hpp"
#include "fusion/fusion_plan.hpp"
#include "server/map/scene_snapshot.hpp"

namespace spectra::stream {

/// What the picture of a tile depends on beside its geometry and the plan: how fresh its parts are, and which baseline they have. Of
/// one tile equal looks are equal pictures. Empty: all is fresh, and no baseline is asked for.
using TileLook = std::string;

/// What decides the looks of tiles.
struct LookRules {
  std::optional<fusion::AgeSteps> age;  ///< Nothing: age is not shown.
  double now_s = 0;                     ///< Unix seconds.
  bool compares_with_baseline = false;
  std::optional<std::uint32_t> baseline_mark;  ///< Of the scene.
};

TileLook look_of(const map::Tile& tile, const LookRules& rules);

/// When the look of a tile will be another, Unix seconds; infinite: never by time alone.
double next_look_s(const map::Tile& tile, const LookRules& rules);

/// Fused colours of a tile's vertices under a look of it.
std::vector<base::Rgb8> fused_colours(const map::Tile& tile, const fusion::FusionPlan& plan, const TileLook& look);
/// What the plan highlights of them.
std::vector<std::uint8_t> highlight_marks(const map::Tile& tile, const fusion::FusionPlan& plan, const TileLook& look);

}  // namespace spectra::stream
