#include "server/mapping/voxel_sums.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "server/mapping/depth_fusion.hpp"

namespace spectra::mapping {
namespace {

/// Of the eight voxels about a place, by their parts: less tells nothing of it.
constexpr float kLeastSeen = 0.5F;
/// Blocks that a turned block may reach each way.
constexpr int kReach = 4;

/// The blocks of a map about a place, found once.
class BlocksAround {
 public:
  BlocksAround(const VoxelMap& map, GridPlace first) : first_(first) {
    for (int i = 0; i < kReach * kReach * kReach; ++i) {
      blocks_[static_cast<std::size_t>(i)] =
          map.find({first.x + i % kReach, first.y + i / kReach % kReach, first.z + i / (kReach * kReach)});
    }
  }

  /// The block of a voxel, and the index within it; -1: there is none.
  std::pair<std::int32_t, std::size_t> at(GridPlace voxel) const {
    const GridPlace block = coarser(voxel, 3);
    const int x = block.x - first_.x, y = block.y - first_.y, z = block.z - first_.z;
    if (x < 0 || y < 0 || z < 0 || x >= kReach || y >= kReach || z >= kReach) return {-1, 0};
    return {blocks_[static_cast<std::size_t>(x + kReach * (y + kReach * z))], index_within(voxel, 3)};
  }

 private:
  const GridPlace first_;
  std::array<std::int32_t, kReach * kReach * kReach> blocks_{};
};

bool differ(const BakedBlock& baked, const VoxelMap& map, std::int32_t block) {
  const VoxelBlock &a = baked.voxels, &b = map.voxels(block);
  if (a.distance != b.distance || a.weight != b.weight || a.red != b.red || a.green != b.green || a.blue != b.blue ||
      a.colour_weight != b.colour_weight)
    return true;
  if (baked.heat.has_value() != (map.head(block).heat >= 0)) return true;
  if (!baked.heat) return false;
  const HeatBlock& heat = map.heat(block);
  return baked.heat->celsius != heat.celsius || baked.heat->variance != heat.variance ||
         baked.heat->seen_s != heat.seen_s;
}

/// More than it takes to be looked at again, in every unit.
constexpr float kNew = 1000;

/// Adds to the notes of a head what its voxels are about to differ by, as fusing would.
void note_surface(const VoxelBlock& before, const VoxelBlock& after, BlockHead& head) {
  constexpr float kPerVoxel = static_cast<float>(kTruncationVoxels) / kDistanceOne;
  float moved = 0, recoloured = 0;
  for (std::size_t v = 0; v < kBlockVoxels; ++v) {
    const auto old = static_cast<float>(before.distance[v]), now = static_cast<float>(after.distance[v]);
    if (std::min(std::abs(old), std::abs(now)) >= 0.5F * kDistanceOne) continue;
    const bool is_new = (before.weight[v] == 0) != (after.weight[v] == 0);
    moved = std::max(moved, is_new ? kNew : kPerVoxel * std::abs(now - old));
    if (before.colour_weight[v] == 0 && after.colour_weight[v] == 0) continue;
    for (const auto channel : {&VoxelBlock::red, &VoxelBlock::green, &VoxelBlock::blue}) {
      recoloured =
          std::max(recoloured,
                   std::abs(static_cast<float>((before.*channel)[v]) - static_cast<float>((after.*channel)[v])) / 256);
    }
  }
  head.moved += moved;
  head.recoloured += recoloured;
}

void note_heat(const HeatBlock* before, const HeatBlock& after, BlockHead& head) {
  float warmed = 0;
  for (std::size_t v = 0; v < kBlockVoxels; ++v) {
    const bool was = before != nullptr && std::isfinite(before->variance[v]), is = std::isfinite(after.variance[v]);
    if (!was && !is) continue;
    if (was && is && before->celsius[v] == after.celsius[v] && before->seen_s[v] == after.seen_s[v]) continue;
    warmed = std::max(warmed, was && is ? std::abs(after.celsius[v] - before->celsius[v]) : kNew);
    if (is) head.hottest = std::max(head.hottest, after.celsius[v]);
  }
  head.warmed += warmed;
}

}  // namespace

void put(VoxelMap& map, GridPlace at, const BakedBlock& block) {
  std::int32_t index = map.find(at);
  if (block.is_empty) {
    if (index < 0) return;
    if (map.head(index).has_surface) map.head(index).moved = kNew;
    map.remove(index);
    return;
  }
  if (index >= 0 && !differ(block, map, index)) return;
  if (index >= 0 && map.head(index).heat >= 0 && !block.heat) {
    map.head(index).moved = kNew;
    map.remove(index);
    index = -1;
  }
  if (index < 0) index = map.ensure(at);
  BlockHead& head = map.head(index);
  BlockHead next = block.head;
  next.at = head.at;
  next.unit = head.unit;
  next.moved = head.moved;
  next.warmed = head.warmed;
  next.recoloured = head.recoloured;
  next.hottest = head.hottest;
  note_surface(map.voxels(index), block.voxels, next);
  if (block.heat) {
    note_heat(head.heat >= 0 ? &map.heat(index) : nullptr, *block.heat, next);
    if (head.heat < 0) map.add_heat(index);
  }
  next.heat = head.heat;
  head = next;
  map.voxels(index) = block.voxels;
  if (block.heat) map.heat(index) = *block.heat;
}

void VoxelSums::add(std::size_t voxel, const Known& known) {
  Sum& sum = (*sums_)[voxel];
  sum.weight += known.weight;
  sum.distance += known.weight * known.distance;
  sum.colour_weight += known.colour_weight;
  sum.red += known.colour_weight * known.red;
  sum.green += known.colour_weight * known.green;
  sum.blue += known.colour_weight * known.blue;
  if (!(known.variance > 0)) return;
  const double information = 1 / static_cast<double>(known.variance);
  sum.seen_s = sum.information > 0 ? std::max(sum.seen_s, known.seen_s) : known.seen_s;
  sum.information += information;
  sum.celsius += information * static_cast<double>(known.celsius);
}

void VoxelSums::add_single() {
  if (!sums_) sums_ = std::make_unique<std::array<Sum, kBlockVoxels>>();
  if (single_map_ == nullptr) return;
  const VoxelBlock& voxels = single_map_->voxels(single_block_);
  const float certainty = single_map_->head(single_block_).heat_certainty();
  const HeatBlock* heat = single_map_->head(single_block_).heat >= 0 ? &single_map_->heat(single_block_) : nullptr;
  for (std::size_t v = 0; v < kBlockVoxels; ++v) {
    Known known;
    known.weight = voxels.weight[v];
    known.distance = voxels.distance[v];
    known.colour_weight = voxels.colour_weight[v];
    known.red = voxels.red[v];
    known.green = voxels.green[v];
    known.blue = voxels.blue[v];
    if (heat != nullptr && std::isfinite(heat->variance[v])) {
      known.variance = certainty * heat->variance[v];
      known.celsius = heat->celsius[v];
      known.seen_s = heat->seen_s[v];
    }
    add(v, known);
  }
  single_map_ = nullptr;
}

void VoxelSums::add(const VoxelMap& map, std::int32_t block) {
  const bool is_first = !sums_ && single_map_ == nullptr;
  if (!is_first) add_single();
  single_map_ = &map;
  single_block_ = block;
  if (!is_first) add_single();
}

void VoxelSums::add(const VoxelMap& map, const Eigen::Isometry3d& grid_from_world, GridPlace block) {
  add_single();
  // In voxels.
  const Eigen::Matrix3d turn = grid_from_world.linear();
  const Eigen::Vector3d corner =
      turn * (kBlockEdge * Eigen::Vector3d(block.x, block.y, block.z)) + grid_from_world.translation() / voxel_m_;
  const Eigen::Vector3d low = corner + (kBlockEdge - 1) * turn.cwiseMin(0.0).rowwise().sum();
  const auto block_of = [](double voxel) { return static_cast<std::int32_t>(std::floor(voxel / kBlockEdge)); };
  const BlocksAround around(map, {block_of(low.x()), block_of(low.y()), block_of(low.z())});
  for (std::size_t v = 0; v < kBlockVoxels; ++v) {
    const auto i = static_cast<int>(v);
    const Eigen::Vector3d at = corner + turn * Eigen::Vector3d(i & 7, i >> 3 & 7, i >> 6);
    const Eigen::Vector3d floor = at.array().floor();
    const Eigen::Vector3f share = (at - floor).cast<float>();
    const GridPlace base{static_cast<std::int32_t>(floor.x()), static_cast<std::int32_t>(floor.y()),
                         static_cast<std::int32_t>(floor.z())};
    Known known;
    float seen = 0, coloured = 0, warm = 0;
    for (int c = 0; c < 8; ++c) {
      const float part = ((c & 1) != 0 ? share.x() : 1 - share.x()) * ((c & 2) != 0 ? share.y() : 1 - share.y()) *
                         ((c & 4) != 0 ? share.z() : 1 - share.z());
      if (part <= 0) continue;
      const auto [from, k] = around.at({base.x + (c & 1), base.y + (c >> 1 & 1), base.z + (c >> 2)});
      if (from < 0 || map.voxels(from).weight[k] == 0) continue;
      seen += part;
      const VoxelBlock& voxels = map.voxels(from);
      known.weight += part * static_cast<float>(voxels.weight[k]);
      known.distance += part * static_cast<float>(voxels.distance[k]);
      if (voxels.colour_weight[k] > 0) {
        coloured += part;
        known.colour_weight += part * static_cast<float>(voxels.colour_weight[k]);
        known.red += part * static_cast<float>(voxels.red[k]);
        known.green += part * static_cast<float>(voxels.green[k]);
        known.blue += part * static_cast<float>(voxels.blue[k]);
      }
      if (map.head(from).heat < 0) continue;
      const HeatBlock& heat = map.heat(from);
      if (!std::isfinite(heat.variance[k])) continue;
      warm += part;
      known.variance += part * map.head(from).heat_certainty() * heat.variance[k];
      known.celsius += part * heat.celsius[k];
      known.seen_s = std::max(known.seen_s, heat.seen_s[k]);
    }
    if (seen < kLeastSeen) continue;
    known.distance /= seen;
    if (coloured > 0) {
      for (float* channel : {&known.red, &known.green, &known.blue}) *channel /= coloured;
    }
    if (warm > 0) {
      known.variance /= warm;
      known.celsius /= warm;
    }
    add(v, known);
  }
}

BakedBlock VoxelSums::take() {
  BakedBlock baked;
  if (single_map_ != nullptr) {
    baked.is_empty = false;
    baked.head = single_map_->head(single_block_);
    baked.voxels = single_map_->voxels(single_block_);
    if (baked.head.heat >= 0) baked.heat = single_map_->heat(single_block_);
    return baked;
  }
  if (!sums_) return baked;
  bool has_heat = false;
  baked.head.has_surface = false;
  baked.head.is_free = true;
  baked.voxels = {};
  baked.voxels.distance.fill(static_cast<std::int16_t>(kDistanceOne));
  HeatBlock heat;
  heat.celsius.fill(0);
  heat.variance.fill(std::numeric_limits<float>::infinity());
  heat.seen_s.fill(0);
  for (std::size_t v = 0; v < kBlockVoxels; ++v) {
    const Sum& sum = (*sums_)[v];
    if (sum.weight <= 0) continue;
    baked.is_empty = false;
    const auto rounded = [](float value, float most) { return std::clamp(std::round(value), -most, most); };
    const float distance = rounded(sum.distance / sum.weight, kDistanceOne);
    baked.voxels.distance[v] = static_cast<std::int16_t>(distance);
    baked.voxels.weight[v] = static_cast<std::uint16_t>(std::max(1.0F, rounded(sum.weight, kWeightMost)));
    if (distance < kDistanceOne) {
      baked.head.is_free = false;
      baked.head.has_surface = baked.head.has_surface || distance > -kDistanceOne;
    }
    if (sum.colour_weight > 0) {
      const auto channel = [&](float value) {
        return static_cast<std::uint16_t>(rounded(value / sum.colour_weight, 65535.0F));
      };
      baked.voxels.red[v] = channel(sum.red);
      baked.voxels.green[v] = channel(sum.green);
      baked.voxels.blue[v] = channel(sum.blue);
      baked.voxels.colour_weight[v] =
          static_cast<std::uint8_t>(std::clamp(std::round(sum.colour_weight), 1.0F, 255.0F));
    }
    if (sum.information > 0) {
      has_heat = true;
      heat.celsius[v] = static_cast<float>(sum.celsius / sum.information);
      heat.variance[v] = static_cast<float>(1 / sum.information);
      heat.seen_s[v] = sum.seen_s;
    }
  }
  if (has_heat) baked.heat = heat;
  return baked;
}

}  // namespace spectra::mapping
