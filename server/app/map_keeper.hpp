#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <variant>
#include <vector>

#include "fusion/mesh/read_options.hpp"
#include "server/app/served_scene.hpp"
#include "server/store/block_store.hpp"

namespace spectra::server {

/// What the map knows of a block beside its mesh.
struct BlockEntry {
  std::string id;
  std::uint64_t revision = 0;
  std::optional<double> observed_at;  ///< Unix seconds.
  std::uint64_t vertex_count = 0, triangle_count = 0;
  store::BlockBounds bounds;  ///< In the coordinates of the file, metres.
  std::string sha256;         ///< Of the bytes as they came; empty for the scene that was served from the start.
};

/// Why a block, or taking one out, was refused; nothing has changed then.
struct BlockRefusal {
  unsigned status = 400;  ///< Of HTTP.
  std::string code;       ///< snake_case, stable.
  std::string field;
  std::string reason;  ///< One sentence for a person.
  std::string limits;  ///< May be empty.
};

/// A block that comes in.
struct IncomingBlock {
  std::string id;
  std::optional<double> observed_at;
  std::optional<fusion::Vec3d> sensor;
  fusion::ReadOptions read;
  std::string read_text;  ///< The same as text, for the store.
  std::shared_ptr<const std::string> ply;
};

/// The one who writes the map: takes blocks from wherever they come, keeps them in a store where there is one, and publishes the
/// versions of the map. Blocks that wait together become one version. All functions are thread-safe.
class MapKeeper {
 public:
  struct Taken {
    BlockEntry entry;
    std::vector<fusion::Note> notes;
  };
  using PutDone = std::function<void(std::variant<Taken, BlockRefusal>)>;
  using RemoveDone = std::function<void(std::optional<BlockRefusal>)>;

  /// `store` may be null: then the map is gone with the program.
  MapKeeper(ServedScene& served, std::unique_ptr<store::BlockStore> store);
  ~MapKeeper();  ///< Finishes what is being written, and drops what waits.
  MapKeeper(const MapKeeper&) = delete;
  MapKeeper& operator=(const MapKeeper&) = delete;

  /// Everything that the store holds, or an empty map. Before anything is put. Error: what is wrong, in a sentence.
  std::optional<std::string> restore();
  /// The scene that was served from the start, as a block.
  void add_file_block(const SceneSnapshot& scene);

  /// `done` is called once, from any thread, when the block is part of the map and durable where there is a store.
  void put(IncomingBlock block, PutDone done);
  void remove(std::string id, RemoveDone done);

  /// In order of id, those after `after`, at most `limit`.
  std::vector<BlockEntry> page(std::string_view after, std::size_t limit) const;
  bool has(const std::string& id) const;

  /// Bytes of blocks that may wait at a time.
  static constexpr std::size_t kWaitingBytes = 256u << 20;

 private:
  struct Put {
    IncomingBlock block;
    fusion::LoadedScene scene;
    PutDone done;
  };
  struct Remove {
    std::string id;
    RemoveDone done;
  };
  using Change = std::variant<Put, Remove>;

  void read(IncomingBlock block, PutDone done);
  void enqueue(Change change);
  void run();
  void take(std::vector<Change> batch);
  static MapChange map_change_of(std::vector<Change>& batch);

  ServedScene& served_;
  const std::unique_ptr<store::BlockStore> store_;

  mutable std::mutex mutex_;
  std::condition_variable has_work_;
  std::deque<Change> waiting_;
  std::size_t waiting_bytes_ = 0;  ///< Of all that is under way.
  bool is_ending_ = false;
  std::map<std::string, BlockEntry, std::less<>> entries_;
  std::uint64_t last_revision_ = 0;

  std::thread writer_;  ///< Last: it uses the others.
};

}  // namespace spectra::server
