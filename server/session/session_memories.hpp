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
  /// Of sessions that have ended, together; those that ended first are forgotten first.
  static constexpr std::size_t kMostBytes = std::size_t{16} << 20U;

  /// As long as the stream lives, its session has what it says: a link that is silently broken is noticed by the viewer first.
  void opened(const std::string& session_id, std::weak_ptr<const stream::ViewerStream> stream);
  /// The session, or its subscription, has ended.
  void ended(const std::string& session_id, stream::ViewerMemory memory, double now_s);

  /// Not null; empty where the session is not known, or no more. Safe on untrusted input.
  std::shared_ptr<const stream::ViewerMemory> of(const std::string& session_id, double now_s);

 private:
  struct Session {
    std::weak_ptr<const stream::ViewerStream> stream;
    std::shared_ptr<const stream::ViewerMemory> memory;  ///< Null: nothing.
    double ended_s = 0;
  };
  using Sessions = std::map<std::string, Session>;

  /// With the lock held; what comes back is to be let go without it.
  [[nodiscard]] Sessions forget(double now_s);
  static std::size_t bytes_of(const Session& session);

  std::mutex mutex_;
  Sessions sessions_;
  std::size_t size_bytes_ = 0;  // Of all memories.
};

}  // namespace spectra::session
