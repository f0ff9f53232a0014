#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "server/jobs/worker_pool.hpp"
#include "server/map/scene_store.hpp"
#include "server/session/catalogue.hpp"
#include "server/session/session_ids.hpp"
#include "server/session/session_memories.hpp"
#include "server/sources/baseline_marked.hpp"
#include "server/sources/robot_track.hpp"
#include "server/stream/frame_cache.hpp"

namespace spectra::session {

/// Something that whoever watches is to know, in words; nothing when there is nothing to say. Thread-safe.
class SharedMessage {
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

/// Everything that all sessions and requests of one server share. Outlives them.
struct ServedScene {
  ServedScene(unsigned worker_count, std::size_t cache_capacity_bytes)
      : cache(cache_capacity_bytes), pool(worker_count) {}

  map::SceneStore scenes;
  SharedMessage progress;         ///< What is being done about the scene; nothing when it is served.
  SharedMessage store_trouble;    ///< Why the store takes nothing; for operators, for it may name the file.
  SharedMessage mapping_trouble;  ///< Why nothing is mapped any more; for operators.
  sources::RobotTrack robot;      ///< Of the robot that maps the scene, if one does.
  const SessionIds session_ids;
  SessionMemories memories;
  const Catalogue catalogue;
  /// MapKeeper::mark_baseline() of the map; whoever makes the keeper sets it before there are sessions.
  std::function<void(sources::BaselineDone)> mark_baseline;
  std::atomic<std::uint64_t> viewer_count{0};
  stream::FrameCache cache;
  jobs::WorkerPool pool;  ///< Last, so that it stops first: its jobs use the others.
};

}  // namespace spectra::session
