#include "server/mapping/voxel_map.hpp"

#include <algorithm>
#include <limits>

namespace spectra::mapping {

template <class T>
std::int32_t VoxelMap::Pool<T>::take() {
  if (!free_.empty()) {
    const std::int32_t index = free_.back();
    free_.pop_back();
    return index;
  }
  if (used_ == chunks_.size() * kChunk) chunks_.push_back(std::make_unique_for_overwrite<T[]>(kChunk));
  return static_cast<std::int32_t>(used_++);
}

std::uint64_t VoxelMap::key_of(GridPlace at) {
  // 21 bits each: +-1,000,000 units are 335 km at a voxel of 1 cm.
  const auto bits = [](std::int32_t i) { return static_cast<std::uint64_t>(i) & 0x1fffff; };
  return bits(at.x) | bits(at.y) << 21 | bits(at.z) << 42;
}

std::int32_t VoxelMap::find_unit(GridPlace unit) const {
  const auto found = unit_by_place_.find(key_of(unit));
  return found == unit_by_place_.end() ? -1 : found->second;
}

std::int32_t VoxelMap::find(GridPlace block) const {
  const std::int32_t unit = find_unit(coarser(block, 2));
  return unit < 0 ? -1 : units_[static_cast<std::size_t>(unit)].blocks[index_within(block, 2)];
}

std::int32_t VoxelMap::ensure(GridPlace block) {
  const GridPlace place = coarser(block, 2);
  const auto [entry, is_new] = unit_by_place_.try_emplace(key_of(place), static_cast<std::int32_t>(units_.size()));
  if (is_new) {
    units_.push_back({place, {}, 0});
    units_.back().blocks.fill(-1);
  }
  const std::int32_t unit = entry->second;
  std::int32_t& index = units_[static_cast<std::size_t>(unit)].blocks[index_within(block, 2)];
  if (index >= 0) return index;
  index = voxels_.take();
  VoxelBlock& voxels = voxels_.at(index);
  voxels.distance.fill(static_cast<std::int16_t>(kDistanceOne));
  voxels.weight.fill(0);
  for (auto* channel : {&voxels.red, &voxels.green, &voxels.blue}) channel->fill(0);
  voxels.colour_weight.fill(0);
  if (static_cast<std::size_t>(index) >= heads_.size()) heads_.resize(static_cast<std::size_t>(index) + 1);
  head(index) = {};
  head(index).at = block;
  head(index).unit = unit;
  ++block_count_;
  return index;
}

bool VoxelMap::would_be_beyond(GridPlace block, std::uint64_t most_bytes) const {
  return block_bytes() >= most_bytes && find(block) < 0;
}

void VoxelMap::add_heat(std::int32_t block) {
  if (head(block).heat >= 0) return;
  const std::int32_t index = heat_.take();
  head(block).heat = index;
  HeatBlock& heat = heat_.at(index);
  heat.celsius.fill(0);
  heat.variance.fill(std::numeric_limits<float>::infinity());
  heat.seen_s.fill(0);
  ++heat_count_;
}

void VoxelMap::remove(std::int32_t block) {
  BlockHead& gone = head(block);
  if (gone.heat >= 0) {
    heat_.give_back(gone.heat);
    --heat_count_;
  }
  MapUnit& unit = units_[static_cast<std::size_t>(gone.unit)];
  unit.blocks[index_within(gone.at, 2)] = -1;
  unit.moved = std::max(unit.moved, gone.moved);
  gone = {};
  voxels_.give_back(block);
  --block_count_;
}

std::size_t VoxelMap::size_bytes() const {
  return voxels_.size_bytes() + heat_.size_bytes() + heads_.capacity() * sizeof(BlockHead) +
         units_.capacity() * sizeof(MapUnit) +
         unit_by_place_.bucket_count() * (sizeof(std::pair<std::uint64_t, std::int32_t>) + 1);
}

}  // namespace spectra::mapping
