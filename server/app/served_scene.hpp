#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "server/app/catalogue.hpp"
#include "server/app/session_ids.hpp"
#include "server/net/block_refusal.hpp"
#include "server/scene/scene_store.hpp"
#include "server/scene/worker_pool.hpp"
#include "server/stream/viewer_stream.hpp"

namespace spectra::server {

/// What is being done about the scene, in words; nothing when it is served. Thread-safe.
class LoadingProgress {
 public:
  using Listener = std::function<void(const std::optional<std::string>& message)>;

  /// Sets the message and tells the listeners that are still alive, in this thread.
  void set(std::optional<std::string> message);
  std::optional<std::string> message() const;

  /// `listener` is called while the returned pointer is held; it should only post to its own thread.
  [[nodiscard]] std::shared_ptr<const Listener> subscribe(Listener listener);

 private:
  mutable std::mutex mutex_;
  std::optional<std::string> message_;
  std::vector<std::weak_ptr<const Listener>> listeners_;
};

/// A moment whose temperatures have become the baseline, and the revision of the scene that says so.
struct BaselineMarked {
  double marked_at = 0;  ///< Unix seconds.
  std::uint32_t revision = 0;
};
using BaselineDone = std::function<void(std::variant<BaselineMarked, BlockRefusal>)>;

/// Everything that all sessions and requests of one server share. Outlives them.
struct ServedScene {
  ServedScene(unsigned worker_count, std::size_t cache_capacity_bytes)
      : cache(cache_capacity_bytes), pool(worker_count) {}

  SceneStore scenes;
  LoadingProgress progress;
  const SessionIds session_ids;
  const Catalogue catalogue;
  /// MapKeeper::mark_baseline() of the map; set before there are sessions.
  std::function<void(BaselineDone)> mark_baseline;
  std::atomic<std::uint64_t> viewer_count{0};
  FrameCache cache;
  WorkerPool pool;  ///< Last, so that it stops first: its jobs use the others.
};

/// Priorities on the pool; lower goes first. Tiles have their level, 0 and up, or what ViewerStream gives a viewer who asks for much.
inline constexpr int kAnswerPriority = -1;   ///< Something a person waits for and that takes milliseconds.
inline constexpr int kExportPriority = 100;  ///< Whole files.

}  // namespace spectra::server
