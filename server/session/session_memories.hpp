#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "server/stream/viewer_stream.hpp"

namespace spectra::session {

/// What the viewers of sessions had been given, for a while after they are gone: who comes back is spared what has not changed. The tiles
/// themselves are not kept. Thread-safe. `now_s` is a steady clock.
class SessionMemories {
 public:
  static constexpr double kKept_s = 60;
  /// Of tiles of sessions that have ended; those that ended first are forgotten first.
  static constexpr std::size_t kMostTiles = 100'000;

  /// As long as the stream lives, its session has what it says: a link that is silently broken is noticed by the viewer first.
  void opened(const std::string& session_id, std::weak_ptr<const stream::ViewerStream> stream);
  /// The session, or its subscription, has ended.
  void ended(const std::string& session_id, stream::ViewerMemory memory, double now_s);

  /// Nothing where the session is not known, or no more. Safe on untrusted input.
  stream::ViewerMemory of(const std::string& session_id, double now_s);

 private:
  struct Session {
    std::weak_ptr<const stream::ViewerStream> stream;
    stream::ViewerMemory memory;
    double ended_s = 0;
  };

  void forget(double now_s);

  std::mutex mutex_;
  std::map<std::string, Session> sessions_;
  std::size_t tile_count_ = 0;  // Of all memories.
};

}  // namespace spectra::session
