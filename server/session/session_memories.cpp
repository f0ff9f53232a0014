#include "server/session/session_memories.hpp"

#include <iterator>
#include <utility>

namespace spectra::session {

void SessionMemories::opened(const std::string& session_id, std::weak_ptr<const stream::ViewerStream> stream) {
  const std::lock_guard lock(mutex_);
  sessions_[session_id].stream = std::move(stream);
}

void SessionMemories::ended(const std::string& session_id, stream::ViewerMemory memory, double now_s) {
  const std::lock_guard lock(mutex_);
  Session& session = sessions_[session_id];
  session.ended_s = now_s;
  // Who has unsubscribed before has had something all the same.
  if (!memory.empty()) {
    tile_count_ += memory.size();
    tile_count_ -= session.memory.size();
    session.memory = std::move(memory);
  }
  forget(now_s);
}

stream::ViewerMemory SessionMemories::of(const std::string& session_id, double now_s) {
  std::shared_ptr<const stream::ViewerStream> stream;
  stream::ViewerMemory memory;
  {
    const std::lock_guard lock(mutex_);
    forget(now_s);
    const auto known = sessions_.find(session_id);
    if (known == sessions_.end()) return {};
    stream = known->second.stream.lock();
    memory = known->second.memory;
  }
  if (!stream) return memory;
  // Of one that has unsubscribed, what it had until then.
  auto newest = stream->memory();
  return newest.empty() ? memory : newest;
}

void SessionMemories::forget(double now_s) {
  const auto drop = [this](auto place) {
    tile_count_ -= place->second.memory.size();
    place->second.memory.clear();
    return place->second.stream.expired() ? sessions_.erase(place) : std::next(place);
  };
  for (auto place = sessions_.begin(); place != sessions_.end();) {
    const bool is_kept = now_s <= place->second.ended_s + kKept_s;
    place = is_kept ? std::next(place) : drop(place);
  }
  while (tile_count_ > kMostTiles) {
    auto oldest = sessions_.end();
    for (auto place = sessions_.begin(); place != sessions_.end(); ++place) {
      const bool is_older = oldest == sessions_.end() || place->second.ended_s < oldest->second.ended_s;
      if (!place->second.memory.empty() && is_older) oldest = place;
    }
    drop(oldest);
  }
}

}  // namespace spectra::session
