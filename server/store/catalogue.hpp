#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/store/stored_row.hpp"

namespace spectra::store {

/// A page of blocks in order of id.
struct BlockPage {
  std::vector<BlockFacts> blocks;
  std::optional<std::string> next;  ///< To be handed on as `after`; absent on the last page.
};

/// What the store file holds, in memory, without the bytes of blocks: current blocks and earlier revisions. Knows no file and
/// no clock. About 400 bytes of memory a revision.
class Catalogue {
 public:
  /// What a row of the history counts beside the bytes of its block.
  static constexpr std::uint64_t kRowCostBytes = 1024;

  /// A row that only the history needs: its revision, and when it ended.
  struct Past {
    Revision revision = 0;
    Revision end = 0;
    StoreTime end_at;
    std::uint64_t cost_bytes = 0;
  };

  /// What a transaction is to write, and what is true once it is written.
  struct Plan {
    std::vector<Change> added;      ///< In order of revision; only those whose row is to be written.
    std::vector<Revision> dropped;  ///< Rows that are there and have to go.
    Revision last_revision = 0;
    Revision history_floor = 0;
    StoreTime history_floor_at;
    std::vector<Past> new_past;    ///< What becomes history, oldest end first.
    std::size_t dropped_past = 0;  ///< How many of the history, with the new, go.
    std::uint64_t history_bytes = 0;
  };

  Catalogue() = default;
  /// From the rows of a file, in any order.
  Catalogue(std::vector<Change> changes, Revision last_revision, Revision history_floor, StoreTime history_floor_at);

  /// Whether the block is in the map now.
  bool contains(std::string_view id) const;

  /// Works out what has to be written for these changes (of rising revisions above last_revision()) and dropped for the history
  /// to stay within `history_bytes`. Changes nothing.
  Plan plan(std::vector<Change> changes, std::uint64_t history_bytes) const;
  void apply(const Plan& plan);

  /// The blocks after the id `after`, at most `limit` (at least one), as they were at revision `at`.
  BlockPage page(Revision at, std::string_view after, std::size_t limit) const;
  /// The revision that the map had at a time. HistoryGone when the history does not reach back so far.
  StoreResult<Revision> revision_at(StoreTime time) const;
  /// The facts of a revision that is kept; null for deletions and what is not there.
  const BlockFacts* find(Revision revision) const;
  /// The facts of a block that is in the map now, or null.
  const BlockFacts* find(std::string_view id) const;
  /// The same as it was at revision `at`.
  const BlockFacts* find(std::string_view id, Revision at) const;

  Revision last_revision() const { return last_revision_; }
  Revision history_floor() const { return history_floor_; }
  StoreTime history_floor_at() const { return history_floor_at_; }
  std::uint64_t history_bytes() const { return history_bytes_; }
  std::uint64_t block_count() const { return block_count_; }
  std::uint64_t block_bytes() const { return block_bytes_; }
  std::uint64_t row_count() const { return changes_.size(); }
  const std::map<Revision, Change>& changes() const { return changes_; }

 private:
  const Change* newest(std::string_view id) const;
  /// Of a block's revisions: what was in the map at `at`, or null.
  const BlockFacts* newest_of(const std::vector<Revision>& timeline, Revision at) const;
  /// What becomes history when `next` follows `before` (null: nothing does) at the same id.
  template <class Pasts>
  static void append_past(Pasts& past, const Change* before, const Change& next);
  /// Makes it the newest of its id.
  void add(Change change);
  void drop(Revision revision);
  /// No longer current.
  void uncount(const Change& change);

  std::map<Revision, Change> changes_;
  std::map<std::string, std::vector<Revision>, std::less<>> timelines_;  ///< By id, each rising.
  std::deque<Past> history_;                                             ///< Oldest end first.
  Revision last_revision_ = 0;
  Revision history_floor_ = 0;
  StoreTime history_floor_at_;
  std::uint64_t history_bytes_ = 0;
  std::uint64_t block_count_ = 0;
  std::uint64_t block_bytes_ = 0;
};

}  // namespace spectra::store
