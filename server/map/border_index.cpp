#include "server/map/border_index.hpp"

#include <bit>

#include "server/map/tile_place.hpp"

namespace spectra::map {

using base::Vec3f;
using protocol::TileId;

std::size_t BorderIndex::Hash::operator()(const base::Vec3f& p) const {
  std::uint64_t hash = 0;
  for (const float c : {p.x, p.y, p.z}) {
    hash = (hash ^ std::bit_cast<std::uint32_t>(c + 0.0f)) * 0x9e3779b97f4a7c15;  // -0 + 0 = 0
    hash ^= hash >> 29;
  }
  return hash;
}

void BorderIndex::Change::add(const TileId& leaf, std::span<const base::Vec3f> positions) {
  for (const base::Vec3f& position : positions) {
    std::uint32_t e = index_.free_;
    if (e == kNone) {
      e = static_cast<std::uint32_t>(index_.entries_.size());
      index_.entries_.emplace_back();
    } else {
      index_.free_ = index_.entries_[e].next;
    }
    const auto [first, is_new] = index_.first_.try_emplace(position, kNone);
    index_.entries_[e] = {leaf, first->second};
    first->second = e;
  }
}

void BorderIndex::Change::remove(const TileId& leaf, std::span<const base::Vec3f> positions) {
  for (const base::Vec3f& position : positions) {
    const auto first = index_.first_.find(position);
    if (first == index_.first_.end()) continue;
    std::uint32_t* link = &first->second;
    while (*link != kNone && index_.entries_[*link].leaf != leaf) link = &index_.entries_[*link].next;
    if (*link == kNone) continue;
    const std::uint32_t e = *link;
    *link = index_.entries_[e].next;
    index_.entries_[e].next = index_.free_;
    index_.free_ = e;
    if (first->second == kNone) index_.first_.erase(first);
  }
}

std::uint8_t BorderIndex::sharing_level(const base::Vec3f& position) const {
  const auto found = first_.find(position);
  if (found == first_.end()) return kUnshared;
  TileId common = entries_[found->second].leaf;
  for (std::uint32_t e = entries_[found->second].next; e != kNone; e = entries_[e].next) {
    common = common_ancestor(common, entries_[e].leaf);
  }
  return common.level;
}

std::vector<std::uint8_t> BorderIndex::sharing_levels(std::span<const base::Vec3f> positions) const {
  std::vector<std::uint8_t> levels;
  levels.reserve(positions.size());
  const std::shared_lock lock(mutex_);
  for (const base::Vec3f& position : positions) levels.push_back(sharing_level(position));
  return levels;
}

}  // namespace spectra::map
