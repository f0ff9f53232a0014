#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "fusion/base/vertex_types.hpp"
#include "fusion/mesh/surface.hpp"
#include "server/map/scene_snapshot.hpp"
#include "server/map/thinning.hpp"

namespace spectra::map {

/// A point of the full mesh and what is seen there.
struct FullSample {
  base::Vec3f position;
  float weight = 1;  ///< The area for which it stands.
  base::Rgb8 visible;
  float celsius = 0;       ///< NaN = none.
  std::uint32_t near = 0;  ///< A vertex near it, of the tile for which it is kept.
};

/// Points spread evenly over the triangles of a leaf; of a point cloud, every so many.
std::vector<FullSample> leaf_samples(const Tile& leaf);

/// Leaves out every other until there are few enough.
void thin_out(std::vector<FullSample>& samples);

/// What a surface shows at a point: between its vertices it is mixed as a screen does.
struct Shown {
  std::array<double, 3> channels{};
  double celsius = 0;  ///< NaN where no corner has a temperature.
};

/// Sets the colour and the temperature error of a tile: 95th percentiles of the tile or of that part of it (an eighth or a 64th, by place) where
/// they are the largest, with a margin for having looked at samples only. `surface` is that of the tile; empty for a point cloud.
void measure_seen_error(Tile& tile, const mesh::Surface& surface, std::span<const FullSample> samples);

/// What difference of colour or temperature catches the eye.
struct SeenContrast {
  double levels = 24;
  double celsius = 1;
};

/// The size (metres) of the largest detail that `tile` does not show, or shows where there is none: the edge of the largest
/// square that a wrong patch fills, by a difference that catches the eye, when its excess of colour or
/// temperature is spread evenly over it. 0 when there is none. Noise that evens out has no size.
double lost_detail_m(const Tile& tile, const mesh::Surface& surface, const MergedTiles& mesh, const mesh::Surface& fine,
                     const Thinning& thinning, const SeenContrast& contrast);

}  // namespace spectra::map
