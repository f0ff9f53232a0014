#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <limits>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <variant>
#include <vector>

#include "fusion/files/read_options.hpp"
#include "server/jobs/worker_pool.hpp"
#include "server/map/scene_store.hpp"
#include "server/net/block_refusal.hpp"
#include "server/sources/baseline_marked.hpp"
#include "server/store/block_store.hpp"

namespace spectra::sources {

/// What the map knows of a block beside its mesh.
struct BlockEntry {
  std::string id;
  std::uint64_t revision = 0;
  std::optional<double> observed_at;  ///< Unix seconds.
  std::uint64_t vertex_count = 0, triangle_count = 0;
  store::BlockBounds bounds;  ///< In the coordinates of the file, metres.
  std::string sha256;         ///< Of the bytes as they came; empty for the scene that was served from the start.
};

/// A block that comes in.
struct IncomingBlock {
  std::string id;
  std::optional<double> observed_at;
  std::optional<base::Vec3d> sensor;
  files::ReadOptions read;
  std::string read_text;  ///< The same as text, for the store.
  std::shared_ptr<const std::string> ply;
};

/// The one who writes the map: takes blocks from wherever they come, keeps them in a store where there is one, and publishes the
/// versions of the map. Blocks that wait together become one version. All functions are thread-safe.
class MapKeeper {
 public:
  struct Taken {
    BlockEntry entry;
    std::vector<files::Note> notes;
  };
  using PutDone = std::function<void(std::variant<Taken, net::BlockRefusal>)>;
  using RemoveDone = std::function<void(std::variant<store::Revision, net::BlockRefusal>)>;

  /// What becomes of a change when too much waits.
  enum class WhenFull {
    Refuse,  ///< Busy.
    Take,    ///< For callers who bound themselves what they hand over.
  };

  /// `store` may be null: then the map is gone with the program. With a time the map is that of the store as it was then, and every
  /// change is refused (409, as_it_was). A block that would take the map beyond `most_bytes`, as bytes_of() counts them, is refused
  /// (507, map_full).
  MapKeeper(map::SceneStore& scenes, jobs::WorkerPool& pool, std::unique_ptr<store::BlockStore> store,
            const std::optional<store::StoreTime>& at = std::nullopt,
            std::uint64_t most_bytes = std::numeric_limits<std::uint64_t>::max());
  ~MapKeeper();  ///< As end().
  MapKeeper(const MapKeeper&) = delete;
  MapKeeper& operator=(const MapKeeper&) = delete;

  /// Called when the store begins to take nothing, with a sentence for operators, and with nothing when it does again; from the thread of
  /// the keeper. To be set before there are changes.
  std::function<void(std::optional<std::string>)> on_store_trouble;
  /// Changes that the store did not take.
  std::uint64_t store_failure_count() const { return store_failure_count_; }

  /// Opens the map: everything that the store holds, or an empty one. Error: what is wrong, in a sentence.
  std::optional<std::string> restore();
  /// Opens the map that the store of scenes has: the scene that is served from the start.
  void open_with_file();

  /// Finishes what is being read and written, refuses what waits and what comes. Answers nobody afterwards.
  void end();

  /// `done` is called once, from any thread, when the block is part of the map and durable where there is a store. Refused with
  /// Busy (503) before the map is open. Changes of one block take effect in the order of the calls; those of others may overtake.
  void put(IncomingBlock block, PutDone done, WhenFull when_full = WhenFull::Refuse);
  void remove(std::string id, RemoveDone done, WhenFull when_full = WhenFull::Refuse);

  /// Makes the temperatures of all that was taken before the baseline of the map. `done` is called once, from any thread, when the
  /// version that says so is published and the mark is durable where there is a store. Refused as the others.
  void mark_baseline(BaselineDone done);

  /// Blocks in order of id, and whether there are more behind them.
  struct Page {
    std::vector<BlockEntry> blocks;
    bool has_more = false;
  };
  /// Those after `after`, at most `limit`.
  Page page(std::string_view after, std::size_t limit) const;
  bool has(const std::string& id) const;
  /// False until restore() or open_with_file() is through: nothing is known of the map before.
  bool is_open() const;

  /// The same as it was at a time. Refused where there is no store (409, no_history) and where the time is no longer kept (410,
  /// history_gone).
  std::variant<Page, net::BlockRefusal> page_at(store::StoreTime time, std::string_view after, std::size_t limit) const;
  /// One of them, read from the store: `done` is called once, in another thread. Refused in the same way.
  using PastDone = std::function<void(std::variant<files::LoadedScene, net::BlockRefusal>)>;
  void read_at(store::StoreTime time, const std::string& id, PastDone done) const;

  /// Bytes of blocks that may wait at a time.
  static constexpr std::size_t kWaitingBytes = 256u << 20;
  /// About what a served scene takes of memory, all levels of detail included.
  static constexpr std::uint64_t bytes_of(std::uint64_t vertex_count, std::uint64_t triangle_count) {
    return 100 * vertex_count + 70 * triangle_count;
  }

  /// Changes that may wait at a time.
  static constexpr std::size_t kWaitingChanges = 4096;
  /// Bytes of blocks that become one version, beside the first.
  static constexpr std::size_t kBatchBytes = 64u << 20;

 private:
  struct Put {
    IncomingBlock block;
    files::LoadedScene scene;
    PutDone done;
    map::BlockBaseline baseline = {};
  };
  struct Remove {
    std::string id;
    RemoveDone done;
  };
  struct Mark {
    BaselineDone done;
  };
  using Change = std::variant<Put, Remove, Mark>;

  /// A change in its place in the queue, where it waits from the call on, so that reading does not change the order.
  struct Waiting {
    Change change;
    bool is_reading = false;  ///< Its job is on the pool: only that may touch the change.
    bool is_ready = false;
  };
  using Queue = std::list<Waiting>;

  /// The shape of what a batch puts, and the names of what it takes out.
  struct Shapes {
    std::vector<map::BlockShape> put;
    std::vector<std::string> removed;
    std::uint64_t put_bytes = 0;  ///< As bytes_of() counts.
  };

  void enqueue(Change change, std::size_t bytes, WhenFull when_full);
  /// Hands a block that waits to the pool; as long as the map has no origin one at a time, for what blocks share is the same only
  /// relative to the same one. Under the lock.
  void begin_reading(Queue::iterator waiting);
  void read(Queue::iterator waiting);
  /// After the block that may have given the map its origin: reads what waited for it. Under the lock.
  void read_next();
  void run();
  /// Makes coarse tiles when nobody else needs the processor; see SceneStore::make_coarse().
  void make_coarse();
  std::vector<Change> next_batch();
  void take(std::vector<Change> batch);
  /// Why the map may not have a batch; nothing when it may.
  std::optional<net::BlockRefusal> why_not(const Shapes& shapes) const;
  std::vector<store::StoreResult<store::Revision>> stored(const std::vector<Change>& batch);
  /// Tells of a store that begins or ceases to fail.
  void note_store(const std::vector<store::StoreResult<store::Revision>>& outcomes);
  void publish(std::vector<Change> batch, const std::vector<store::Revision>& revisions);
  /// Publishes the map with a change; its coarse tiles follow.
  void change_map(map::MapChange change);
  /// After a change up to that revision: the map has constants, or, empty, none any more.
  void keep_constants(store::Revision revision);
  /// Those that the map had when a revision was made. There is a store.
  std::optional<map::MapConstants> constants_at(store::Revision revision) const;
  void mark(const Mark& wanted);
  static void refuse(Change& change, const net::BlockRefusal& refusal);
  static const std::string& id_of(const Change& change);
  static Shapes shapes_of(const std::vector<Change>& batch);

  map::SceneStore& scenes_;
  jobs::WorkerPool& pool_;
  const std::unique_ptr<store::BlockStore> store_;
  const std::optional<store::StoreTime> at_;
  const std::uint64_t most_bytes_;
  bool is_store_failing_ = false;  ///< Of the keeper's thread.
  std::atomic<std::uint64_t> store_failure_count_{0};

  mutable std::mutex mutex_;
  std::condition_variable has_work_;
  Queue waiting_;
  std::size_t waiting_bytes_ = 0;    ///< Of all that is under way.
  std::size_t reading_count_ = 0;    ///< Jobs on the pool.
  std::condition_variable is_read_;  ///< A job has ended.
  bool is_open_ = false;
  bool is_ending_ = false;
  std::optional<map::MapConstants> constants_;  ///< Of the map, as long as there is anything in it.
  bool is_first_under_way_ = false;             ///< The block that may give the map its origin.
  std::map<std::string, BlockEntry, std::less<>> entries_;
  std::uint64_t last_revision_ = 0;

  std::condition_variable has_coarse_work_;
  bool is_behind_ = false;  ///< Coarse tiles may have to be made.

  // Last: they use the others.
  std::thread writer_;
  std::thread coarse_maker_;
};

}  // namespace spectra::sources
