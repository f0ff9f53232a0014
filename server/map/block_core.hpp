#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fusion/base/bounds.hpp"
#include "fusion/files/ply_reader.hpp"
#include "server/map/map_version.hpp"

namespace spectra::map {

/// Where nearly all of a map lies.
struct BlockCore {
  std::optional<base::Bounds> bounds;  ///< Of the cores of its blocks; nothing: no block has one.
  std::optional<files::Note> note;     ///< "stray_blocks": the blocks that were left out.
};

/// Leaves out blocks as strays of a file are (mesh::stray_points): those that are farther from the others than all of the others are
/// large, as long as they have at most a tenth of the vertices together. The blocks alone decide.
BlockCore core_of(const BlocksByName& blocks);

}  // namespace spectra::map
