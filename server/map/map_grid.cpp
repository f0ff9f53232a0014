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
/// How often a cell may be halved, the cube with it, and what filled it is still within the cube.
constexpr double kMostHalvingsOfCell = 11;

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

/// The part of it that is not far beyond a side of the core.
Interval within(const Interval& interval, double core_low, double core_high) {
  const double margin = kMargin * (core_high - core_low);
  const Interval part{std::max(interval.low, core_low - margin), std::min(interval.high, core_high + margin)};
  return part.low <= part.high ? part : interval;
}

/// A third of the way along, in binary 0.0101..: near no border of any level.
double cells_before(int level) {
  double count = 0;
  for (int l = 1; l < level; l += 2) count = 4 * count + 1;
  return count;
}

}  // namespace

MapGrid MapGrid::around(std::span<const base::Vec3f> positions, const std::optional<base::Bounds>& core, int level) {
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
  if (core) {
    box[0] = within(box[0], double{core->min.x}, double{core->max.x});
    box[1] = within(box[1], double{core->min.y}, double{core->max.y});
    box[2] = within(box[2], double{core->min.z}, double{core->max.z});
  }
  double extent = 0;
  for (const Interval& side : box) extent = std::max(extent, side.high - side.low);
  const double cell_m = extent > 0 ? extent : 1;
  MapGrid grid;
  grid.edge_m_ = std::ldexp(cell_m, level);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    // What is thin along an axis is not cut along it soon; elsewhere cuts begin at the side, because many maps have a raster.
    const bool is_thin = box[axis].high - box[axis].low < cell_m / 3;
    const double middle = box[axis].low + (box[axis].high - box[axis].low) / 2;
    grid.corner_m_[axis] = (is_thin ? middle - cell_m / 3 : box[axis].low) - cell_m * cells_before(level);
  }
  return grid;
}

MapGrid MapGrid::with_cells_of(double most_m, int level) const {
  const double cell_m = std::ldexp(edge_m_, -level);
  const double halvings = std::clamp(std::ceil(std::log2(cell_m / most_m)), 0.0, kMostHalvingsOfCell);
  MapGrid grid = *this;
  grid.edge_m_ = std::ldexp(edge_m_, -static_cast<int>(halvings));
  for (double& corner : grid.corner_m_) corner += (cell_m - std::ldexp(grid.edge_m_, -level)) * cells_before(level);
  return grid;
}

MapGrid MapGrid::from(const base::Vec3f& low, double cell_m, int level) {
  MapGrid grid;
  grid.edge_m_ = std::ldexp(cell_m, level);
  const double before_m = cell_m * cells_before(level);
  grid.corner_m_ = {double{low.x} - before_m, double{low.y} - before_m, double{low.z} - before_m};
  return grid;
}

std::array<double, 3> MapGrid::middle_of(const protocol::TileId& cell) const {
  const double edge_m = std::ldexp(edge_m_, -int{cell.level});
  return {corner_m_[0] + (static_cast<double>(cell.x) + 0.5) * edge_m,
          corner_m_[1] + (static_cast<double>(cell.y) + 0.5) * edge_m,
          corner_m_[2] + (static_cast<double>(cell.z) + 0.5) * edge_m};
}

}  // namespace spectra::map
