#include "server/stream/sending_order.hpp"

namespace spectra::stream {

void SendingOrder::choose(ViewerTiles& tiles, const std::vector<SelectedTile>& selected, double most_preview_vertices) {
  ++choice_count_;
  for (const auto& slot : tiles.slots()) slot->wish.is_wanted = false;
  slots_.clear();
  for (const SelectedTile& tile : selected) {
    const auto& slot = tiles.slots()[tile.node];
    if (slot->wish.is_target != tile.is_target) tiles.put_down(*slot);
    slot->wish.is_wanted = true;
    slot->wish.is_target = tile.is_target;
    slot->wish.last_wanted = choice_count_;
    slots_.push_back(slot);
  }
  for (const auto& slot : tiles.slots()) {
    if (!slot->wish.is_wanted) tiles.put_down(*slot);
  }
  choose_previews(tiles.tree(), most_preview_vertices);
  rewind();
}

void SendingOrder::choose_previews(const ViewTree& tree, double most_vertices) {
  double preview_vertices = 0;
  std::size_t index = 0;
  while (index < slots_.size()) {
    const auto level = slots_[index]->tile->id.level;
    std::size_t end = index;
    for (; end < slots_.size() && slots_[end]->tile->id.level == level; ++end) {
      if (!slots_[end]->wish.is_target) preview_vertices += static_cast<double>(slots_[end]->tile->positions.size());
    }
    for (; index < end; ++index) {
      slots_[index]->wish.is_preview = !tree.nodes()[slots_[index]->node].parent || preview_vertices <= most_vertices;
    }
  }
}

void SendingOrder::clear() {
  slots_.clear();
  rewind();
}

TileSlot* SendingOrder::head(const ViewerTiles& tiles, const Demand& demand) {
  const auto is_due = [&](std::size_t i) {
    return !tiles.is_satisfied(*slots_[i], demand) && !tiles.is_waiting(*slots_[i], demand);
  };
  if (head_ < slots_.size() && is_due(head_)) return slots_[head_].get();
  while (first_ < slots_.size() && tiles.is_satisfied(*slots_[first_], demand)) ++first_;
  // What waits may have waited for the last one.
  head_ = slots_.size();
  for (std::size_t i = first_; i < slots_.size(); ++i) {
    if (!is_due(i)) continue;
    if (head_ == slots_.size()) head_ = i;
    if (!is_turn_of_lacking_) break;
    if (!tiles.is_there(*slots_[i], demand)) {
      head_ = i;
      break;
    }
  }
  return head_ < slots_.size() ? slots_[head_].get() : nullptr;
}

std::uint64_t target_vertex_count(const ViewTree& tree, const std::vector<SelectedTile>& selected) {
  std::uint64_t count = 0;
  for (const SelectedTile& tile : selected) {
    if (tile.is_target) count += tree.nodes()[tile.node].tile->positions.size();
  }
  return count;
}

}  // namespace spectra::stream
