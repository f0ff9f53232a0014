#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "server/store/block_record.hpp"
#include "server/store/catalogue.hpp"

namespace spectra::store {

struct StoreOptions {
  /// Bytes that earlier revisions may take, each counted with its bytes and 1,024 more. Oldest go first, current blocks never.
  std::uint64_t history_bytes = std::uint64_t{1} << 30U;
  /// Bytes of blocks that may wait to be written; more are refused with Busy.
  std::uint64_t waiting_bytes = std::uint64_t{256} << 20U;
  /// Nothing is written, and every change is refused with ReadOnly; the file must be there.
  bool is_read_only = false;
  /// The clock; empty: the system's.
  std::function<StoreTime()> now = {};
  /// SQLite's name of the file system to use; empty: the usual one.
  std::string vfs = {};
};

/// For operators: how the store is.
struct StoreStatus {
  Revision last_revision = 0;
  Revision history_floor = 0;  ///< Of what was before, nothing is told any more.
  std::uint64_t block_count = 0;
  std::uint64_t block_bytes = 0;
  std::uint64_t history_bytes = 0;
  std::uint64_t log_bytes = 0;      ///< What waits in FILE-wal to be moved into the file.
  std::uint64_t waiting_count = 0;  ///< Changes that are not written yet.
  std::uint64_t waiting_bytes = 0;
  std::optional<StoreError> trouble;  ///< Why the last writing failed; gone when one succeeds.
};

/// Every block of a map that was acknowledged, in one file, through kill -9 and power cuts.
///
/// All functions may be called from any thread. Changes and reads of bytes are handed to one thread of the store's own and end
/// in a call of `on_done` there, in the order in which they were handed over (reads may be overtaken by changes); `on_done` must
/// be quick, may call the store, and must not throw. Changes that wait together are written together. Lists are answered from
/// memory at once and show what is durable. What is refused at once (InvalidRecord, TooLarge, Busy, ReadOnly of a store opened for
/// reading, Closed) ends before the call returns, on the caller's thread.
///
/// A change that ended with an error may still be found after a crash that follows at once: whole, never half.
class BlockStore {
 public:
  using ChangeDone = std::function<void(StoreResult<Revision>)>;
  using Done = std::function<void(StoreResult<void>)>;
  using ReadDone = std::function<void(StoreResult<StoredBlock>)>;

  /// Opens the file, or makes it. Reads all of it but blocks' bytes: may take seconds. Foreign, NewerVersion, Damaged, Locked,
  /// ReadOnly, NotFound, DiskFull or IoError in one sentence that says the way out.
  static StoreResult<std::unique_ptr<BlockStore>> open(const std::string& file, StoreOptions options);
  /// As close().
  ~BlockStore();
  BlockStore(const BlockStore&) = delete;
  BlockStore& operator=(const BlockStore&) = delete;

  /// Puts a block or replaces it. Errors: InvalidRecord, TooLarge, Busy, ReadOnly, DiskFull, IoError, Closed. The hash and the
  /// time of acceptance are the store's to make.
  void put(BlockRecord block, ChangeDone on_done);
  /// Takes a block out of the map; NotFound when it is not there. A change with a revision, too.
  void remove(std::string id, ChangeDone on_done);
  /// Sets one of the map's constants (an empty value removes it). Has no revision and no history.
  void set_constant(std::string key, std::string value, Done on_done);
  std::optional<std::string> constant(std::string_view key) const;

  /// The blocks of the map in order of id, those after `after` (empty: from the first), at most `limit`.
  BlockPage page(std::string_view after, std::size_t limit) const;
  /// The same as it was at a time, in one state of the map. HistoryGone when it is no longer known.
  StoreResult<BlockPage> page_at(StoreTime time, std::string_view after, std::size_t limit) const;
  /// The facts of the block as it is now.
  std::optional<BlockFacts> find(std::string_view id) const;
  /// The same as it was at a time; nothing when it was not in the map. HistoryGone when that is no longer known.
  StoreResult<std::optional<BlockFacts>> find_at(StoreTime time, std::string_view id) const;

  /// The bytes of a block as listed. NotFound when this revision is no longer kept; Damaged when they are not what was put.
  void read(Revision revision, ReadDone on_done);

  /// Hands over every block of the map as it was at a time (absent: now) in order of id, one by one; waits for the disk. Not
  /// from inside an `on_done`. Ends early with the error of a read, or when `on_block` returns false. Blocks that are replaced
  /// meanwhile are handed over as they were, or left out when the history has no room for them: changes come by other ways.
  StoreResult<void> visit(std::optional<StoreTime> time, const std::function<bool(StoredBlock)>& on_block);

  StoreStatus status() const;

  /// Writes what waits, then refuses everything with Closed. Waits for the disk. The file is then whole without its log.
  void close();

 private:
  struct State;
  explicit BlockStore(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace spectra::store
