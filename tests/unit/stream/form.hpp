#pragma once

#include <cstddef>
#include <cstdint>

#include "server/map/scene_snapshot.hpp"

namespace spectra::stream::testing {

/// What rounding positions leaves of the form of a scene, at full detail.
struct FormReport {
  std::size_t piece_count = 0;  ///< Connected by triangles; vertices in one place are one.
  std::size_t patch_count = 0;  ///< Balls around a vertex that hold 50 vertices or more.
  std::size_t flattened_piece_count = 0, flattened_patch_count = 0;  ///< A side of the box is off by more than a tenth.
  std::size_t merged_piece_count = 0, merged_patch_count = 0;        ///< More than a fifth of the points fell together.
  double worst_side_change = 0;                                      ///< Of a patch, a share of the side.
  /// Places that two tiles of any levels round to different points.
  std::size_t torn_count = 0;

  bool is_kept() const {
    return flattened_piece_count + flattened_patch_count + merged_piece_count + merged_patch_count + torn_count == 0;
  }
};

/// Compares every piece, and the balls of 50 to 100 and of 1,000 vertices around `seed_count` evenly taken ones (no smaller than a
/// 20,000th of the scene's diagonal), with what a client decodes at the scene's own steps. A side that is thinner than eight times what floats tell
/// apart there is flat; and one that is thinner than a 4,096th (of a piece a 32,768th) of the second longest, where it is thinner than eight
/// times what floats tell apart on any axis, or than a millionth of the second longest.
FormReport form_of(const map::SceneSnapshot& scene, std::size_t seed_count);

}  // namespace spectra::stream::testing
