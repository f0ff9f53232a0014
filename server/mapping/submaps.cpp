#include "server/mapping/submaps.hpp"

#include <algorithm>
#include <boost/unordered/unordered_flat_set.hpp>
#include <cmath>
#include <optional>

#include "server/mapping/voxel_sums.hpp"

namespace spectra::mapping {
namespace {

constexpr std::size_t kBakedAtOnce = 256;

double turn_between(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return Eigen::AngleAxisd(Eigen::Matrix3d(a.linear().transpose() * b.linear())).angle();
}

/// The told pose of a moment.
struct ToldPose {
  Eigen::Isometry3d pose;
  bool is_exact;  ///< It was told so; else it is between two.
};

/// Nothing before the first, after the last, or in a gap.
std::optional<ToldPose> told_at(const StampedPoses& told, double time_s) {
  constexpr double kSameMoment = 1e-6;
  const auto after = std::lower_bound(told.begin(), told.end(), time_s - kSameMoment,
                                      [](const auto& pose, double time) { return pose.first < time; });
  if (after == told.end()) return std::nullopt;
  if (after->first <= time_s + kSameMoment) return ToldPose{after->second, true};
  if (after == told.begin()) return std::nullopt;
  const auto& [begin_s, begin] = *(after - 1);
  const auto& [end_s, end] = *after;
  if (end_s - begin_s > Submaps::kLongestGapSeconds) return std::nullopt;
  return ToldPose{pose_between(begin, end, (time_s - begin_s) / (end_s - begin_s)), false};
}

/// The placement that the corrected pose nearest to the middle of its time gives; one of a moment at which a pose was told goes before all others.
std::optional<Eigen::Isometry3d> placement(const StampedPoses& told, const StampedPoses& corrected) {
  const double middle_s = 0.5 * (told.front().first + told.back().first);
  std::optional<Eigen::Isometry3d> found;
  std::pair<bool, double> best{true, INFINITY};
  for (const auto& [time_s, pose] : corrected) {
    const auto at = is_in_range(pose) ? told_at(told, time_s) : std::nullopt;
    if (!at) continue;
    const std::pair<bool, double> rank{!at->is_exact, std::abs(time_s - middle_s)};
    if (!(rank < best)) continue;
    best = rank;
    found = pose * at->pose.inverse();
  }
  return found;
}

/// Too little to be worth sampling anew.
bool is_same_place(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, double voxel_m) {
  constexpr double kVoxels = 0.01, kRadians = 2e-5;
  return (a.translation() - b.translation()).norm() < kVoxels * voxel_m && turn_between(a, b) < kRadians;
}

using VoxelBox = Eigen::AlignedBox3d;  ///< In voxels of a grid.

/// What a block of another grid reaches, with the voxel beside it.
VoxelBox reached_box(const Eigen::Isometry3d& to_from, GridPlace block, double voxel_m) {
  const Eigen::Vector3d half = Eigen::Vector3d::Constant(0.5 * kBlockEdge);
  const Eigen::Vector3d centre =
      to_from * (voxel_m * (kBlockEdge * Eigen::Vector3d(block.x, block.y, block.z) + half)) / voxel_m;
  const Eigen::Vector3d reach =
      to_from.linear().cwiseAbs() * (half + Eigen::Vector3d::Ones()) + Eigen::Vector3d::Ones();
  return {centre - reach, centre + reach};
}

/// The blocks that a box has a part in.
template <class Visit>
void for_each_block(const VoxelBox& box, const Visit& visit) {
  const auto block_of = [](double voxel) { return static_cast<std::int32_t>(std::floor(voxel / kBlockEdge)); };
  const Eigen::Vector3d &low = box.min(), &high = box.max();
  for (std::int32_t z = block_of(low.z()); z <= block_of(high.z()); ++z) {
    for (std::int32_t y = block_of(low.y()); y <= block_of(high.y()); ++y) {
      for (std::int32_t x = block_of(low.x()); x <= block_of(high.x()); ++x) visit(GridPlace{x, y, z});
    }
  }
}

/// All units of a map.
VoxelBox box_of(const VoxelMap& map) {
  VoxelBox box;
  for (const MapUnit& unit : map.units()) {
    const Eigen::Vector3d low = kUnitEdge * Eigen::Vector3d(unit.at.x, unit.at.y, unit.at.z);
    box.extend(low);
    box.extend(Eigen::Vector3d(low + Eigen::Vector3d::Constant(kUnitEdge)));
  }
  return box;
}

/// Whatever has changed since was seen to.
void take_back_notes(VoxelMap& map, std::size_t unit_index) {
  MapUnit& unit = map.unit(unit_index);
  unit.moved = 0;
  for (const std::int32_t block : unit.blocks) {
    if (block >= 0) map.head(block).moved = map.head(block).warmed = map.head(block).recoloured = 0;
  }
}

}  // namespace

Submaps::Submaps(double voxel_m, const SubmapRules& rules) : voxel_m_(voxel_m), rules_(rules) {
  begin();
}

void Submaps::begin() {
  Part part;
  part.map = std::make_unique<VoxelMap>(voxel_m_);
  parts_.push_back(std::move(part));
}

bool Submaps::step(double time_s, const Eigen::Isometry3d& world_from_camera, bool may_begin) {
  const StampedPoses& told = parts_.back().told;
  if (!told.empty()) {
    const auto& [key_s, key] = told.front();
    if (parts_.back().has_moved || time_s - key_s >= rules_.seconds ||
        (key.translation() - world_from_camera.translation()).norm() >= rules_.metres ||
        turn_between(key, world_from_camera) >= rules_.radians) {
      if (!may_begin) return is_open();
      begin();
    }
  }
  parts_.back().told.emplace_back(time_s, world_from_camera);
  return true;
}

CorrectionReport Submaps::correct(const StampedPoses& corrected) {
  CorrectionReport report;
  std::optional<Eigen::Isometry3d> last;  // From the world that was told to the corrected one.
  for (Part& part : parts_) {
    if (part.told.empty()) continue;
    std::optional<Eigen::Isometry3d> world_from_grid = placement(part.told, corrected);
    if (world_from_grid) {
      last = *world_from_grid * part.world_from_grid.inverse();
    } else if (last) {
      world_from_grid = *last * part.world_from_grid;
    }
    if (!world_from_grid || is_same_place(*world_from_grid, part.world_from_grid, voxel_m_)) continue;
    // One that goes with another that was turned far away from it.
    if (!is_in_range(*world_from_grid * part.told.front().second)) continue;
    ++report.moved;
    part.world_from_grid = *world_from_grid;
    part.has_moved = true;
  }
  if (last) report.newest = *last;
  return report;
}

void Submaps::bake(VoxelMap& world, bool all, jobs::WorkerPool& pool) {
  std::vector<GridPlace> wanted;
  boost::unordered_flat_set<std::uint64_t> known;
  const auto want = [&](GridPlace at) {
    if (known.insert(VoxelMap::key_of(at)).second) wanted.push_back(at);
  };
  for (Part& part : parts_) {
    VoxelMap& map = *part.map;
    const bool is_elsewhere =
        part.has_moved != part.had_moved || part.baked_from_grid.matrix() != part.world_from_grid.matrix();
    // Nothing is fused into one that another has followed.
    if (part.is_settled && !is_elsewhere && !all) continue;
    part.is_settled = &part != &parts_.back();
    const auto want_of = [&](GridPlace block) {
      if (!part.had_moved) want(block);
      if (part.had_moved) for_each_block(reached_box(part.baked_from_grid, block, voxel_m_), want);
      if (is_elsewhere) for_each_block(reached_box(part.world_from_grid, block, voxel_m_), want);
    };
    for (std::size_t u = 0; u < map.units().size(); ++u) {
      const MapUnit& unit = map.units()[u];
      for (std::size_t i = 0; i < kBlocksOfUnit; ++i) {
        const std::int32_t block = unit.blocks[i];
        const bool is_noted =
            block >= 0 && (map.head(block).moved > 0 || map.head(block).warmed > 0 || map.head(block).recoloured > 0);
        // Of a block that was taken out the unit alone knows.
        if (!is_noted && !((all || is_elsewhere) && block >= 0) && !(unit.moved > 0)) continue;
        const auto k = static_cast<std::int32_t>(i);
        want_of({unit.at.x * kUnitBlocks + (k & 3), unit.at.y * kUnitBlocks + (k >> 2 & 3),
                 unit.at.z * kUnitBlocks + (k >> 4)});
      }
      take_back_notes(map, u);
    }
    part.baked_from_grid = part.world_from_grid;
    part.had_moved = part.has_moved;
    part.baked_bytes = map.block_bytes();
  }
  if (wanted.empty()) return;
  // What is left empty makes room first.
  std::stable_partition(wanted.begin(), wanted.end(), [&](GridPlace at) { return world.find(at) >= 0; });

  std::vector<Eigen::Isometry3d> grids_from_world;
  std::vector<VoxelBox> boxes;  // Only of those that have moved.
  for (const Part& part : parts_) {
    grids_from_world.push_back(part.world_from_grid.inverse());
    boxes.push_back(part.has_moved ? box_of(*part.map) : VoxelBox());
  }
  std::vector<BakedBlock> baked(std::min(kBakedAtOnce, wanted.size()));
  for (std::size_t first = 0; first < wanted.size(); first += kBakedAtOnce) {
    const std::size_t count = std::min(kBakedAtOnce, wanted.size() - first);
    pool.for_each(count, [&](std::size_t i) {
      const GridPlace at = wanted[first + i];
      VoxelSums sums(voxel_m_);
      for (std::size_t p = 0; p < parts_.size(); ++p) {
        const VoxelMap& map = *parts_[p].map;
        if (!parts_[p].has_moved) {
          const std::int32_t block = map.find(at);
          if (block >= 0) sums.add(map, block);
          continue;
        }
        const VoxelBox reached = reached_box(grids_from_world[p], at, voxel_m_);
        // Most submaps are elsewhere altogether.
        if (!boxes[p].intersects(reached)) continue;
        bool is_reached = false;
        for_each_block(reached, [&](GridPlace block) { is_reached = is_reached || map.find(block) >= 0; });
        if (is_reached) sums.add(map, grids_from_world[p], at);
      }
      baked[i] = sums.take();
    });
    for (std::size_t i = 0; i < count; ++i) put(world, wanted[first + i], baked[i]);
  }
}

std::size_t Submaps::block_bytes() const {
  std::size_t sum = 0;
  for (const Part& part : parts_) sum += part.map->block_bytes();
  return sum;
}

std::size_t Submaps::unbaked_bytes() const {
  std::size_t sum = 0;
  for (const Part& part : parts_) sum += part.map->block_bytes() - std::min(part.map->block_bytes(), part.baked_bytes);
  return sum;
}

std::size_t Submaps::size_bytes() const {
  std::size_t sum = 0;
  for (const Part& part : parts_) {
    sum += part.map->size_bytes() + part.told.capacity() * sizeof(StampedPoses::value_type);
  }
  return sum;
}

}  // namespace spectra::mapping
