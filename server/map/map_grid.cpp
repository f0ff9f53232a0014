#include "server/map/map_grid.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace spectra::map {
namespace {

constexpr std::size_t kSampleSize = 4096;
/// The part of the positions at either end of an axis that may be far from all others, and how much is added beyond the rest.
constexpr double kFarShare = 0.002;
constexpr double kMargin = 0.25;

struct Interval {
  double low = 0, high = 0;
};

/// Where most of them lie along an axis.
Interval most_of(std::vector<double>& values) {
  std::sort(values.begin(), values.end());
  const auto at = [&](double share) {
    return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1) + 0.5)];
  };
  const double low = at(kFarShare), high = at(1 - kFarShare);
  const double margin = kMargin * (high - low);
  return {std::max(values.front(), low - margin), std::min(values.back(), high + margin)};
}

}  // namespace

MapGrid MapGrid::around(std::span<const base::Vec3f> positions, int level) {
  std::array<Interval, 3> box{};
  if (!positions.empty()) {
    const std::size_t stride = (positions.size() + kSampleSize - 1) / kSampleSize;
    std::array<std::vector<double>, 3> sample;
    for (std::size_t i = 0; i < positions.size(); i += stride) {
      sample[0].push_back(double{positions[i].x});
      sample[1].push_back(double{positions[i].y});
      sample[2].push_back(double{positions[i].z});
    }
    for (std::size_t axis = 0; axis < 3; ++axis) box[axis] = most_of(sample[axis]);
  }
  double extent = 0;
  for (const Interval& side : box) extent = std::max(extent, side.high - side.low);
  const double cell_m = extent > 0 ? extent : 1;
  MapGrid grid;
  grid.edge_m_ = std::ldexp(cell_m, level);
  // A third of the way along, in binary 0.0101..: near no border of any level.
  double cells_before = 0;
  for (int l = 1; l < level; l += 2) cells_before = 4 * cells_before + 1;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    // What is thin along an axis is not cut along it soon; elsewhere cuts begin at the side, because many maps have a raster.
    const bool is_thin = box[axis].high - box[axis].low < cell_m / 3;
    const double middle = box[axis].low + (box[axis].high - box[axis].low) / 2;
    grid.corner_m_[axis] = (is_thin ? middle - cell_m / 3 : box[axis].low) - cell_m * cells_before;
  }
  return grid;
}

std::array<double, 3> MapGrid::middle_of(const protocol::TileId& cell) const {
  const double edge_m = std::ldexp(edge_m_, -int{cell.level});
  return {corner_m_[0] + (static_cast<double>(cell.x) + 0.5) * edge_m,
          corner_m_[1] + (static_cast<double>(cell.y) + 0.5) * edge_m,
          corner_m_[2] + (static_cast<double>(cell.z) + 0.5) * edge_m};
}

}  // namespace spectra::map
