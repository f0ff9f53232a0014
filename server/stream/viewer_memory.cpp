#include "server/stream/viewer_memory.hpp"

#include <algorithm>
#include <set>
#include <utility>

namespace spectra::stream {
namespace {

/// A picture that is kept known: an entry of FrameCache, with the settings as a text.
constexpr std::size_t kPictureBytes = 1024;

std::size_t bytes_beside(const TileLook& look) {
  static const std::size_t kInPlace = TileLook().capacity();
  return look.capacity() > kInPlace ? look.capacity() + 1 : 0;
}

}  // namespace

ViewerMemory::ViewerMemory(std::vector<RememberedTile> tiles) : tiles_(std::move(tiles)) {
  tiles_.shrink_to_fit();
  std::sort(tiles_.begin(), tiles_.end(),
            [](const RememberedTile& a, const RememberedTile& b) { return a.tile < b.tile; });
  std::set<const PlanIdentity*> pictures;
  for (const RememberedTile& tile : tiles_) {
    size_bytes_ += bytes_beside(tile.look);
    if (tile.picture.plan) pictures.insert(tile.picture.plan.get());
  }
  size_bytes_ += tiles_.capacity() * sizeof(RememberedTile) + pictures.size() * kPictureBytes;
}

const RememberedTile* ViewerMemory::find(protocol::TileId tile) const {
  const auto place = std::lower_bound(tiles_.begin(), tiles_.end(), tile,
                                      [](const RememberedTile& a, const protocol::TileId& id) { return a.tile < id; });
  return place != tiles_.end() && place->tile == tile ? &*place : nullptr;
}

}  // namespace spectra::stream
