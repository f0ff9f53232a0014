#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "fusion/base/vertex_types.hpp"
#include "fusion/mesh/simplify.hpp"
#include "fusion/mesh/surface.hpp"
#include "server/map/scene_snapshot.hpp"

namespace spectra::map {

/// The children of a tile as one piece.
struct MergedTiles {
  std::vector<base::Vec3f> positions;
  std::vector<base::Rgb8> visible;
  std::vector<float> temperature_celsius;
  std::vector<std::uint32_t> source_vertex;
  std::vector<std::uint32_t> weight;        ///< How many vertices of the full scene each stands for.
  std::vector<std::uint8_t> sharing_level;  ///< See BorderIndex.
  std::vector<StepHalvings> step_halvings;
  std::vector<base::Triangle> triangles;
  base::Triangle any_triangle{};  ///< For a tile of degenerate triangles alone.
};

struct ThinningOptions {
  std::size_t wanted_count = 0;
  double span_celsius = 1;  ///< See SimplifyInput.
};

/// What becomes of merged vertices.
struct Thinning {
  std::vector<base::Triangle> triangles;      ///< Over the kept vertices.
  std::vector<std::uint32_t> kept;            ///< Merged vertices, ascending.
  std::vector<base::Rgb8> visible;            ///< What each kept vertex shows.
  std::vector<float> temperature_celsius;     ///< The same.
  std::vector<std::uint32_t> weight;          ///< How many vertices of the full scene each stands for.
  std::vector<std::uint32_t> kept_of_merged;  ///< For each merged vertex an index into `kept`, near it.
  double distance_m = 0;                      ///< Farthest that one surface is from the other, with a margin.
};

/// About `wanted_count` vertices of a surface; `fine` is made of `mesh`. Locked ones stay, with what they show. See simplified();
/// where loose pieces, or places where many sheets meet, stop that, vertices near each other are joined.
Thinning thinned_surface(const MergedTiles& mesh, const mesh::Surface& fine, const std::vector<bool>& is_locked,
                         const ThinningOptions& options, mesh::SimplifyMemory& memory);

/// At most about `wanted_count` points of a cloud, chosen so that none is far from one of them; locked ones stay. Each shows the mean of
/// its group. A point that differs from that by a sixteenth of the span or more, the one that differs most, stands for itself.
Thinning thinned_points(const MergedTiles& cloud, const std::vector<bool>& is_locked, const ThinningOptions& options);

}  // namespace spectra::map
