#include "server/session/session_memories.hpp"

#include <iterator>
#include <utility>

namespace spectra::session {

std::size_t SessionMemories::bytes_of(const Session& session) {
  constexpr std::size_t kEntryBytes = 256;  // With its id, as the map holds it.
  return session.memory ? session.memory->size_bytes() + kEntryBytes : 0;
}

void SessionMemories::opened(const std::string& session_id, std::weak_ptr<const stream::ViewerStream> stream) {
  const std::lock_guard lock(mutex_);
  sessions_[session_id].stream = std::move(stream);
}

void SessionMemories::ended(const std::string& session_id, stream::ViewerMemory memory, double now_s) {
  std::shared_ptr<const stream::ViewerMemory> newest;
  if (!memory.empty()) newest = std::make_shared<const stream::ViewerMemory>(std::move(memory));
  Sessions gone;
  const std::lock_guard lock(mutex_);
  const auto place = sessions_.try_emplace(session_id).first;
  Session& session = place->second;
  session.ended_s = now_s;
  if (newest) {
    size_bytes_ -= bytes_of(session);
    session.memory.swap(newest);
    size_bytes_ += bytes_of(session);
  } else if (!session.memory) {  // Who has unsubscribed before has had something all the same.
    sessions_.erase(place);
  }
  gone = forget(now_s);
}

std::shared_ptr<const stream::ViewerMemory> SessionMemories::of(const std::string& session_id, double now_s) {
  Session session;
  {
    Sessions gone;
    const std::lock_guard lock(mutex_);
    gone = forget(now_s);
    const auto known = sessions_.find(session_id);
    if (known != sessions_.end()) session = known->second;
  }
  if (const auto stream = session.stream.lock()) {
    // Of one that has unsubscribed, what it had until then.
    if (auto newest = stream->memory(); !newest.empty()) {
      return std::make_shared<const stream::ViewerMemory>(std::move(newest));
    }
  }
  return session.memory ? session.memory : std::make_shared<const stream::ViewerMemory>();
}

SessionMemories::Sessions SessionMemories::forget(double now_s) {
  Sessions gone;
  const auto drop = [this, &gone](auto place) {
    size_bytes_ -= bytes_of(place->second);
    const auto next = std::next(place);
    if (place->second.stream.expired()) {
      gone.insert(sessions_.extract(place));
    } else {
      gone[place->first].memory.swap(place->second.memory);
    }
    return next;
  };
  for (auto place = sessions_.begin(); place != sessions_.end();) {
    const bool is_kept = now_s <= place->second.ended_s + kKept_s;
    place = is_kept ? std::next(place) : drop(place);
  }
  while (size_bytes_ > kMostBytes) {
    auto oldest = sessions_.end();
    for (auto place = sessions_.begin(); place != sessions_.end(); ++place) {
      const bool is_older = oldest == sessions_.end() || place->second.ended_s < oldest->second.ended_s;
      if (place->second.memory && is_older) oldest = place;
    }
    drop(oldest);
  }
  return gone;
}

}  // namespace spectra::session
