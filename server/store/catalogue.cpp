#include "server/store/catalogue.hpp"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <set>

#include "server/store/time_text.hpp"

namespace spectra::store {
Catalogue::Catalogue(std::vector<Change> changes, Revision last_revision, Revision history_floor,
                     StoreTime history_floor_at)
    : last_revision_(last_revision), history_floor_(history_floor), history_floor_at_(history_floor_at) {
  std::sort(changes.begin(), changes.end(),
            [](const Change& a, const Change& b) { return a.facts.revision < b.facts.revision; });
  for (Change& change : changes) {
    append_past(history_, newest(change.facts.description.id), change);
    add(std::move(change));
  }
  for (const Past& past : history_) history_bytes_ += past.cost_bytes;
}

const Change* Catalogue::newest(std::string_view id) const {
  const auto timeline = timelines_.find(id);
  return timeline == timelines_.end() ? nullptr : &changes_.at(timeline->second.back());
}

bool Catalogue::contains(std::string_view id) const {
  return find(id) != nullptr;
}

const BlockFacts* Catalogue::find(std::string_view id) const {
  const Change* change = newest(id);
  return change == nullptr || change->is_removal ? nullptr : &change->facts;
}

template <class Pasts>
void Catalogue::append_past(Pasts& past, const Change* before, const Change& next) {
  const Revision end = next.facts.revision;
  const StoreTime end_at = next.facts.accepted_at;
  if (before != nullptr && !before->is_removal) {
    past.push_back({before->facts.revision, end, end_at, before->facts.body_bytes() + kRowCostBytes});
  }
  if (next.is_removal) past.push_back({end, end, end_at, kRowCostBytes});
}

void Catalogue::uncount(const Change& change) {
  if (change.is_removal) return;
  --block_count_;
  block_bytes_ -= change.facts.size_bytes;
}

void Catalogue::add(Change change) {
  const std::string& id = change.facts.description.id;
  if (const Change* before = newest(id)) uncount(*before);
  if (!change.is_removal) {
    ++block_count_;
    block_bytes_ += change.facts.size_bytes;
  }
  timelines_[id].push_back(change.facts.revision);
  changes_.emplace(change.facts.revision, std::move(change));
}

void Catalogue::drop(Revision revision) {
  const auto found = changes_.find(revision);
  const auto timeline = timelines_.find(found->second.facts.description.id);
  // Where the deletion after it is not kept either, this was the newest of its id.
  if (timeline->second.back() == revision) uncount(found->second);
  std::erase(timeline->second, revision);
  if (timeline->second.empty()) timelines_.erase(timeline);
  changes_.erase(found);
}

Catalogue::Plan Catalogue::plan(std::vector<Change> changes, std::uint64_t history_bytes) const {
  Plan plan;
  plan.last_revision = last_revision_;
  plan.history_floor = history_floor_;
  plan.history_floor_at = history_floor_at_;
  std::map<std::string_view, const Change*> newest_here;
  for (const Change& change : changes) {
    const auto [here, is_first] = newest_here.try_emplace(change.facts.description.id, nullptr);
    append_past(plan.new_past, is_first ? newest(change.facts.description.id) : here->second, change);
    here->second = &change;
    plan.last_revision = change.facts.revision;
  }
  plan.history_bytes = history_bytes_;
  for (const Past& past : plan.new_past) plan.history_bytes += past.cost_bytes;
  std::set<Revision> unwritten;
  for (std::size_t& next = plan.dropped_past; plan.history_bytes > history_bytes; ++next) {
    const Past& past = next < history_.size() ? history_[next] : plan.new_past[next - history_.size()];
    plan.history_bytes -= past.cost_bytes;
    plan.history_floor = past.end;
    plan.history_floor_at = past.end_at;
    if (past.revision > last_revision_) {
      unwritten.insert(past.revision);
    } else {
      plan.dropped.push_back(past.revision);
    }
  }
  std::copy_if(std::make_move_iterator(changes.begin()), std::make_move_iterator(changes.end()),
               std::back_inserter(plan.added),
               [&unwritten](const Change& change) { return !unwritten.contains(change.facts.revision); });
  return plan;
}

void Catalogue::apply(const Plan& plan) {
  for (const Change& change : plan.added) add(change);
  for (const Revision revision : plan.dropped) drop(revision);
  history_.insert(history_.end(), plan.new_past.begin(), plan.new_past.end());
  history_.erase(history_.begin(), history_.begin() + static_cast<std::ptrdiff_t>(plan.dropped_past));
  history_bytes_ = plan.history_bytes;
  last_revision_ = plan.last_revision;
  history_floor_ = plan.history_floor;
  history_floor_at_ = plan.history_floor_at;
}

BlockPage Catalogue::page(Revision at, std::string_view after, std::size_t limit) const {
  BlockPage page;
  limit = std::max<std::size_t>(limit, 1);
  for (auto timeline = timelines_.upper_bound(after); timeline != timelines_.end(); ++timeline) {
    const BlockFacts* facts = newest_of(timeline->second, at);
    if (facts == nullptr) continue;
    if (page.blocks.size() == limit) {
      page.next = page.blocks.back().description.id;
      break;
    }
    page.blocks.push_back(*facts);
  }
  return page;
}

StoreResult<Revision> Catalogue::revision_at(StoreTime time) const {
  // A clock that was set back leaves later changes with earlier times: the newest change that was not later decides.
  Revision revision = time >= history_floor_at_ ? history_floor_ : 0;
  for (auto change = changes_.rbegin(); change != changes_.rend() && change->first > revision; ++change) {
    if (change->second.facts.accepted_at <= time) revision = change->first;
  }
  if (revision < history_floor_) {
    return failure(StoreErrorCode::HistoryGone,
                   "the history reaches back to " +
                       // Rounded up: what is said can be asked for.
                       utc_text(std::chrono::ceil<std::chrono::seconds>(history_floor_at_)) +
                       "; what was before is no longer kept (--history BYTES keeps more)");
  }
  return revision;
}

const BlockFacts* Catalogue::newest_of(const std::vector<Revision>& timeline, Revision at) const {
  const auto beyond = std::upper_bound(timeline.begin(), timeline.end(), at);
  if (beyond == timeline.begin()) return nullptr;
  const Change& change = changes_.at(*std::prev(beyond));
  return change.is_removal ? nullptr : &change.facts;
}

const BlockFacts* Catalogue::find(std::string_view id, Revision at) const {
  const auto timeline = timelines_.find(id);
  return timeline == timelines_.end() ? nullptr : newest_of(timeline->second, at);
}

const BlockFacts* Catalogue::find(Revision revision) const {
  const auto found = changes_.find(revision);
  return found == changes_.end() || found->second.is_removal ? nullptr : &found->second.facts;
}

}  // namespace spectra::store
