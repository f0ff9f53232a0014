#include "server/scene/border_index.hpp"

#include <bit>

#include "server/scene/tile_place.hpp"

namespace spectra::server {

using fusion::Vec3f;
using protocol::TileId;

std::size_t BorderIndex::Hash::operator()(const Vec3f& p) const {
  std::uint64_t hash = 0;
  for (const float c : {p.x, p.y, p.z}) {
    hash = (hash ^ std::bit_cast<std::uint32_t>(c + 0.0f)) * 0x9e3779b97f4a7c15;  // -0 + 0 = 0
    hash ^= hash >> 29;
  }
  return hash;
}

void BorderIndex::add(const TileId& leaf, std::span<const Vec3f> positions) {
  for (const Vec3f& position : positions) {
    std::uint32_t e = free_;
    if (e == kNone) {
      e = static_cast<std::uint32_t>(entries_.size());
      entries_.emplace_back();
    } else {
      free_ = entries_[e].next;
    }
    const auto [first, is_new] = first_.try_emplace(position, kNone);
    entries_[e] = {leaf, first->second};
    first->second = e;
  }
}

void BorderIndex::remove(const TileId& leaf, std::span<const Vec3f> positions) {
  for (const Vec3f& position : positions) {
    const auto first = first_.find(position);
    if (first == first_.end()) continue;
    std::uint32_t* link = &first->second;
    while (*link != kNone && entries_[*link].leaf != leaf) link = &entries_[*link].next;
    if (*link == kNone) continue;
    const std::uint32_t e = *link;
    *link = entries_[e].next;
    entries_[e].next = free_;
    free_ = e;
    if (first->second == kNone) first_.erase(first);
  }
}

std::uint8_t BorderIndex::sharing_level(const Vec3f& position) const {
  const auto found = first_.find(position);
  if (found == first_.end()) return kUnshared;
  TileId common = entries_[found->second].leaf;
  for (std::uint32_t e = entries_[found->second].next; e != kNone; e = entries_[e].next) {
    common = common_ancestor(common, entries_[e].leaf);
  }
  return common.level;
}

}  // namespace spectra::server
