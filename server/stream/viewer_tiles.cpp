#include "server/stream/viewer_tiles.hpp"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "fusion/base/box.hpp"
#include "server/map/tile_place.hpp"

namespace spectra::stream {

using protocol::TileFrameHeader;
using protocol::TileId;

void TileSlot::forget_held() {
  held = {};
  forget_raw();
}

void TileSlot::forget_raw() {
  for (Raw& layer : raw) {
    layer.held_epoch = 0;
    layer.failed_epoch = 0;
    layer.put_down();
  }
}

void ViewerTiles::adopt(const map::SceneSnapshot& scene, const Demand& demand) {
  for (const auto& slot : slots_) {
    if (!is_to_come(*slot, demand)) slot->shown_revision = scene_revision_;
  }
  tree_ = ViewTree(scene);
  std::map<TileId, std::shared_ptr<TileSlot>> known_slots;
  for (auto& slot : slots_) known_slots.emplace(slot->tile->id, slot);
  slots_.clear();
  for (std::size_t node = 0; node < tree_.nodes().size(); ++node) {
    const auto& tile = tree_.nodes()[node].tile;
    auto slot = std::make_shared<TileSlot>();
    slot->shown_revision = scene_revision_;
    if (const auto known = known_slots.find(tile->id); known != known_slots.end()) {
      if (known->second->tile == tile) {
        slot = known->second;
      } else {
        succeed(*slot, *known->second);
        slot->shown_revision = known->second->shown_revision;
        abandon(*known->second);
      }
      known_slots.erase(known);
    } else if (const auto left = leaving_.find(tile->id); left != leaving_.end()) {
      slot->held = left->second.held;
      slot->shown_revision = left->second.shown_revision;
      leaving_.erase(left);
    }
    slot->tile = tile;
    slot->node = node;
    slots_.push_back(std::move(slot));
  }
  for (const auto& [id, slot] : known_slots) {
    if (slot->held.wire_revision != 0) {
      TileSlot left;
      succeed(left, *slot);
      leaving_.insert_or_assign(id, Leaving{slot->tile->bounds, left.held, slot->shown_revision, std::nullopt});
    }
    abandon(*slot);
  }
  scene_revision_ = scene.revision();
}

void ViewerTiles::succeed(TileSlot& slot, const TileSlot& before) {
  slot.held.revision = before.held.revision;
  slot.held.wire_revision = before.held.wire_revision;
  slot.held.child_mask = before.held.child_mask;
  slot.held.bytes = before.held.bytes;
  slot.held.earlier_colour_epoch = before.is_drawable() ? before.held.colour_epoch : before.held.earlier_colour_epoch;
  slot.held.had_raw_layers = before.has_raw_layers() || before.held.had_raw_layers;
}

void ViewerTiles::clear() {
  for (const auto& slot : slots_) slot->is_gone = true;
  slots_.clear();
  removals_.clear();
  leaving_.clear();
  prepared_bytes_ = 0;
  tree_ = {};
}

void ViewerTiles::make_ready(TileSlot& slot, std::shared_ptr<const EncodedTile> geometry, Payload colours,
                             int colour_bits) {
  slot.work = TileSlot::Work::Ready;
  slot.prepared.geometry = std::move(geometry);
  slot.prepared.colours = std::move(colours);
  slot.prepared.colour_bits = colour_bits;
  count_prepared(slot);
}

void ViewerTiles::put_down(TileSlot& slot) {
  if (slot.work != TileSlot::Work::Ready) return;
  slot.work = TileSlot::Work::Idle;
  slot.prepared.geometry = nullptr;
  slot.prepared.colours = nullptr;
  count_prepared(slot);
}

void ViewerTiles::give_geometry(TileSlot& slot, std::uint32_t name, std::uint64_t geometry_epoch) {
  slot.held.wire_revision = name;
  slot.held.revision = slot.prepared.geometry->revision;
  slot.held.child_mask = slot.tile->child_mask;
  slot.held.bytes = decoded_bytes(*slot.tile);
  slot.held.geometry_epoch = geometry_epoch;
  slot.held.colour_epoch = 0;
  slot.held.picture = {};
  slot.forget_raw();
  count_prepared(slot);
}

void ViewerTiles::give_colours(TileSlot& slot, const Demand& demand, std::uint32_t sequence) {
  slot.held.colour_epoch = demand.colour_epoch;
  slot.held.colour_bits = slot.prepared.colour_bits;
  slot.held.look = slot.look;
  slot.held.earlier_colour_epoch = 0;
  slot.held.picture = demand.picture();
  slot.held.colour_sequence = sequence;
}

std::size_t ViewerTiles::set_looks(const LookRules& rules) {
  std::size_t changed_count = 0;
  next_look_s_ = std::numeric_limits<double>::infinity();
  for (const auto& slot : slots_) {
    TileLook look = look_of(*slot->tile, rules);
    next_look_s_ = std::min(next_look_s_, stream::next_look_s(*slot->tile, rules));
    if (look == slot->look) continue;
    slot->look = std::move(look);
    put_down(*slot);
    if (slot->wish.is_wanted) ++changed_count;
  }
  return changed_count;
}

void ViewerTiles::count_prepared(TileSlot& slot) {
  prepared_bytes_ -= std::exchange(slot.prepared.counted_bytes, 0);
  if (slot.work != TileSlot::Work::Ready) return;
  const bool is_geometry_due = slot.held.revision != slot.prepared.geometry->revision;
  slot.prepared.counted_bytes = (slot.prepared.colours ? slot.prepared.colours->size() : 0) +
                                (is_geometry_due ? slot.prepared.geometry->payload->size() : 0);
  prepared_bytes_ += slot.prepared.counted_bytes;
}

bool ViewerTiles::is_satisfied(const TileSlot& slot, const Demand& demand) const {
  if (slot.failed.geometry_epoch == demand.geometry_epoch) return true;
  if (slot.held.geometry_epoch == demand.geometry_epoch &&
      (slot.has_colours(demand) || slot.failed.colour_epoch == demand.colour_epoch)) {
    return true;
  }
  if (slot.wish.is_target) return false;
  if (slot.is_drawable() && (slot.wish.is_preview ? is_answered_beneath(slot, demand) : are_children_drawable(slot)))
    return true;
  const bool is_of_before = slot.held.wire_revision != 0 && slot.held.geometry_epoch == 0;
  return is_of_before && slot.held.child_mask == slot.tile->child_mask && is_hidden(slot, demand);
}

bool ViewerTiles::is_to_come(const TileSlot& slot, const Demand& demand) const {
  if (!slot.wish.is_wanted || !slot.wish.is_target) return false;
  return !is_satisfied(slot, demand) || (!demand.fused && slot.lacks_raw_layers(demand));
}

std::uint32_t ViewerTiles::shown_revision(const Demand& demand) const {
  std::uint32_t shown = scene_revision_;
  for (const auto& slot : slots_) {
    if (is_to_come(*slot, demand)) shown = std::min(shown, slot->shown_revision);
  }
  for (const auto& [id, leaving] : leaving_) shown = std::min(shown, leaving.shown_revision);
  return shown;
}

template <class IsSo>
bool ViewerTiles::is_made_up_beneath(const TileSlot& slot, const IsSo& is_so) const {
  const auto& children = tree_.nodes()[slot.node].children;
  return !children.empty() && std::all_of(children.begin(), children.end(), [&](std::size_t index) {
    const TileSlot& child = *slots_[index];
    return is_so(child) || is_made_up_beneath(child, is_so);
  });
}

bool ViewerTiles::is_answered_beneath(const TileSlot& slot, const Demand& demand) const {
  return is_made_up_beneath(slot, [&](const TileSlot& tile) { return tile.is_drawable() && tile.has_colours(demand); });
}

bool ViewerTiles::is_hidden(const TileSlot& slot, const Demand& demand) const {
  return is_made_up_beneath(slot, [&](const TileSlot& tile) {
    if (!demand.fused) return tile.has_raw_layers() || tile.held.had_raw_layers;
    return tile.has_newest_colours(demand) || tile.held.earlier_colour_epoch == demand.colour_epoch;
  });
}

bool ViewerTiles::is_covered(const TileSlot& slot, const Demand& demand) const {
  return is_made_up_beneath(slot, [&](const TileSlot& tile) { return tile.has_newest_colours(demand); });
}

bool ViewerTiles::are_children_drawable(const TileSlot& slot) const {
  const auto& children = tree_.nodes()[slot.node].children;
  return std::all_of(children.begin(), children.end(),
                     [this](std::size_t child) { return slots_[child]->is_drawable(); });
}

bool ViewerTiles::is_there(const TileSlot& slot, const Demand& demand) {
  if (slot.is_drawable() || slot.held.earlier_colour_epoch != 0 || slot.held.had_raw_layers) return true;
  if (slot.failed.geometry_epoch == demand.geometry_epoch || slot.failed.colour_epoch == demand.colour_epoch)
    return true;
  return !demand.fused && slot.held.geometry_epoch == demand.geometry_epoch && !slot.lacks_raw_layers(demand);
}

bool ViewerTiles::is_lacking(const TileSlot& slot, const Demand& demand) const {
  return !is_there(slot, demand) &&
         !is_made_up_beneath(slot, [&](const TileSlot& tile) { return is_there(tile, demand); });
}

bool ViewerTiles::is_anything_beneath(const TileSlot& slot) const {
  const auto& children = tree_.nodes()[slot.node].children;
  return std::any_of(children.begin(), children.end(), [&](std::size_t index) {
    const TileSlot& child = *slots_[index];
    return child.held.wire_revision != 0 || is_anything_beneath(child);
  });
}

bool ViewerTiles::is_drawn(const TileSlot& slot, const Demand& demand) const {
  const auto& children = tree_.nodes()[slot.node].children;
  return is_there(slot, demand) && std::any_of(children.begin(), children.end(), [&](std::size_t index) {
           TileId child = slots_[index]->tile->id;
           while (child.level > slot.tile->id.level + 1) child = map::parent_of(child);
           return (slot.held.child_mask >> map::octant_of(child) & 1) != 0 && is_lacking(*slots_[index], demand);
         });
}

bool ViewerTiles::is_waiting(const TileSlot& slot, const Demand& demand) const {
  if (slot.held.geometry_epoch == demand.geometry_epoch) return false;
  const auto is_lacking_of = [&](const std::vector<std::size_t>& nodes) {
    return std::any_of(nodes.begin(), nodes.end(), [&](std::size_t index) {
      return slots_[index]->wish.is_wanted && is_lacking(*slots_[index], demand);
    });
  };
  const ViewTree::Node& node = tree_.nodes()[slot.node];
  if (!slot.wish.is_target && is_lacking_of(node.children) && is_anything_beneath(slot) && !is_drawn(slot, demand)) {
    return true;
  }
  return slot.held.wire_revision != 0 && node.parent && is_lacking_of(tree_.nodes()[*node.parent].children) &&
         !is_lacking(slot, demand);
}

ViewerMemory ViewerTiles::memory() const {
  std::vector<RememberedTile> tiles;
  for (const auto& slot : slots_) {
    const TileSlot::Held& held = slot->held;
    if (held.wire_revision == 0) continue;
    tiles.push_back({.tile = slot->tile->id,
                     .revision = held.revision,
                     .wire_revision = held.wire_revision,
                     .child_mask = held.child_mask,
                     .colour_bits = static_cast<std::uint8_t>(held.colour_bits),
                     .colour_sequence = held.colour_sequence,
                     .bytes = held.bytes,
                     .position_step_m = held.position_step_m,
                     .origin_m = held.origin_m,
                     .picture = held.picture,
                     .look = held.look});
  }
  return ViewerMemory(std::move(tiles));
}

Resumed ViewerTiles::resume(std::span<const ResumedTile> claims, const ViewerMemory& memory, const Demand& demand,
                            int whole_bits, const FrameCache::State& cache) {
  std::map<TileId, TileSlot*> slot_of;
  for (const auto& slot : slots_) slot_of.emplace(slot->tile->id, slot.get());
  std::set<TileId> seen;
  Resumed resumed;
  for (std::size_t place = 0; place < claims.size(); ++place) {
    const ResumedTile& claim = claims[place];
    if (claim.revision == 0 || !seen.insert(claim.tile).second) continue;
    const auto known = slot_of.find(claim.tile);
    if (known == slot_of.end()) {
      push_removal(claim.tile, claim.revision);
      continue;
    }
    TileSlot& slot = *known->second;
    const RememberedTile* remembered = memory.find(claim.tile);
    const bool is_remembered = remembered != nullptr && remembered->wire_revision == claim.revision;
    if (!hold_resumed(slot, claim, is_remembered ? *remembered : RememberedTile(), demand, cache)) continue;
    ++resumed.tile_count;
    if (slot.held.colour_epoch == demand.colour_epoch && slot.held.look == slot.look &&
        slot.held.colour_bits >= whole_bits) {
      resumed.current_colours.push_back(static_cast<std::uint32_t>(place));
    }
    for (std::size_t layer = 0; layer < RawDemand::kLayers.size(); ++layer) {
      const bool has_layer = layer == RawDemand::kSigma ? claim.has_temperature_sigma : claim.has_raw_layers;
      if (has_layer) slot.raw[layer].held_epoch = demand.raw.epoch[layer];
    }
  }
  if (resumed.tile_count == 0) forget_all_held();
  return resumed;
}

// True when that geometry is the one in force. Otherwise it is held under its name alone, so that it is replaced.
bool ViewerTiles::hold_resumed(TileSlot& slot, const ResumedTile& claim, const RememberedTile& before,
                               const Demand& demand, const FrameCache::State& cache) {
  put_down(slot);
  // A claim does not say these; where this stream has given the geometry out before, it knows them.
  const bool says_where = before.position_step_m > 0;
  const float position_step_m = says_where ? before.position_step_m : slot.held.position_step_m;
  const auto origin_m = says_where ? before.origin_m : slot.held.origin_m;
  slot.forget_held();
  slot.held.position_step_m = position_step_m;
  slot.held.origin_m = origin_m;
  slot.held.wire_revision = claim.revision;
  slot.held.revision = before.revision;
  slot.held.child_mask = before.child_mask;
  slot.held.bytes = before.bytes;
  const bool says_colours = before.picture.plan && claim.colour_sequence == before.colour_sequence;
  const std::uint64_t colour_epoch =
      says_colours && before.picture == demand.picture() ? demand.colour_epoch : Demand::kEarlierColourEpoch;
  slot.held.earlier_colour_epoch = colour_epoch;
  slot.held.had_raw_layers = claim.has_raw_layers;
  const std::uint32_t revision = before.revision != 0 ? before.revision : claim.revision;
  const auto issued = cache.issued(demand.geometry_key(slot.tile));
  if (!issued || issued->revision != revision) return false;
  slot.held.revision = revision;
  slot.held.vertex_count = issued->vertex_count;
  slot.held.child_mask = slot.tile->child_mask;
  slot.held.bytes = decoded_bytes(*slot.tile);
  slot.held.geometry_epoch = demand.geometry_epoch;
  slot.held.earlier_colour_epoch = 0;
  slot.held.colour_epoch = colour_epoch;
  slot.held.colour_bits = demand.colour_bits;
  if (says_colours) {
    slot.held.picture = before.picture;
    slot.held.look = before.look;
    slot.held.colour_bits = before.colour_bits;
  }
  return true;
}

void ViewerTiles::keep_colours(std::uint64_t from_epoch, std::uint64_t to_epoch, int least_bits) {
  for (const auto& slot : slots_) {
    if (slot->held.colour_epoch == from_epoch && slot->held.colour_bits >= least_bits) {
      slot->held.colour_epoch = to_epoch;
    }
    if (slot->held.earlier_colour_epoch == from_epoch) slot->held.earlier_colour_epoch = to_epoch;
  }
}

void ViewerTiles::forget_all_held() {
  removals_.clear();
  leaving_.clear();
  for (const auto& slot : slots_) {
    put_down(*slot);
    slot->forget_held();
  }
}

void ViewerTiles::abandon(TileSlot& slot) {
  put_down(slot);
  slot.is_gone = true;
}

void ViewerTiles::push_removal(TileId tile, std::uint32_t revision) {
  TileFrameHeader header;
  header.kind = protocol::FrameKind::Remove;
  header.tile = tile;
  header.revision = revision;
  removals_.push_back(header);
}

void ViewerTiles::remove_from_viewer(TileSlot& slot) {
  if (slot.held.wire_revision != 0) push_removal(slot.tile->id, slot.held.wire_revision);
  slot.forget_held();
  count_prepared(slot);
}

void ViewerTiles::remove_succeeded(std::span<const std::shared_ptr<TileSlot>> wanted, const Demand& demand) {
  if (leaving_.empty()) return;
  std::map<TileId, base::Bounds> to_come;
  std::set<TileId> outdated_masks;
  for (const auto& slot : wanted) {
    if (is_to_come(*slot, demand)) to_come.emplace(slot->tile->id, slot->tile->bounds);
    const bool is_outdated = slot->held.wire_revision != 0 && slot->held.child_mask != slot->tile->child_mask;
    if (is_outdated && slot->failed.geometry_epoch != demand.geometry_epoch) outdated_masks.insert(slot->tile->id);
  }
  // Without it the tile that names it would be drawn instead of its other children.
  const auto is_named = [&](TileId id) {
    while (id.level > 0) {
      id = map::parent_of(id);
      if (outdated_masks.contains(id)) return true;
    }
    return false;
  };
  for (auto left = leaving_.begin(); left != leaving_.end();) {
    auto& [id, leaving] = *left;
    if (!leaving.successors) {
      leaving.successors.emplace();
      for (const auto& [successor, bounds] : to_come) {
        if (base::overlap(bounds, leaving.bounds)) leaving.successors->insert(successor);
      }
    }
    std::erase_if(*leaving.successors, [&](const TileId& successor) { return !to_come.contains(successor); });
    if (leaving.successors->empty() && !is_named(id)) {
      push_removal(id, leaving.held.wire_revision);
      left = leaving_.erase(left);
    } else {
      ++left;
    }
  }
}

void ViewerTiles::remove_leaving() {
  for (const auto& [id, leaving] : leaving_) push_removal(id, leaving.held.wire_revision);
  leaving_.clear();
}

void ViewerTiles::remove_surplus(std::uint64_t most_bytes) {
  std::uint64_t bytes = 0;
  for (const auto& [id, leaving] : leaving_) bytes += leaving.held.bytes;
  std::vector<TileSlot*> unused;
  for (const auto& slot : slots_) {
    bytes += slot->wish.is_wanted ? decoded_bytes(*slot->tile) : slot->held.bytes;
    if (!slot->wish.is_wanted && slot->held.wire_revision != 0) unused.push_back(slot.get());
  }
  if (bytes <= most_bytes) return;
  for (const auto& [id, leaving] : leaving_) bytes -= leaving.held.bytes;
  remove_leaving();
  std::sort(unused.begin(), unused.end(),
            [](const TileSlot* a, const TileSlot* b) { return a->wish.last_wanted < b->wish.last_wanted; });
  for (TileSlot* slot : unused) {
    if (bytes <= most_bytes) break;
    bytes -= slot->held.bytes;
    remove_from_viewer(*slot);
  }
}

void ViewerTiles::remove_outdated_beneath(const TileSlot& slot, const Demand& demand) {
  for (const std::size_t child : tree_.nodes()[slot.node].children) {
    TileSlot& outdated = *slots_[child];
    const bool is_outdated = outdated.held.wire_revision != 0 && outdated.held.colour_epoch != demand.colour_epoch;
    if (is_outdated && !is_covered(outdated, demand)) remove_from_viewer(outdated);
    remove_outdated_beneath(outdated, demand);
  }
}

TileFrameHeader ViewerTiles::take_removal() {
  const TileFrameHeader header = removals_.front();
  removals_.pop_front();
  return header;
}

}  // namespace spectra::stream
