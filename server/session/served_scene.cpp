#include "server/session/served_scene.hpp"

#include <utility>

namespace spectra::session {

void SharedMessage::set(std::optional<std::string> message) {
  std::vector<std::shared_ptr<const Listener>> alive;
  {
    const std::lock_guard lock(mutex_);
    message_ = message;
    std::erase_if(listeners_, [&alive](const std::weak_ptr<const Listener>& weak) {
      auto listener = weak.lock();
      if (!listener) return true;
      alive.push_back(std::move(listener));
      return false;
    });
  }
  for (const auto& listener : alive) (*listener)(message);
}

std::optional<std::string> SharedMessage::message() const {
  const std::lock_guard lock(mutex_);
  return message_;
}

std::shared_ptr<const SharedMessage::Listener> SharedMessage::subscribe(Listener listener) {
  auto held = std::make_shared<const Listener>(std::move(listener));
  const std::lock_guard lock(mutex_);
  std::erase_if(listeners_, [](const auto& weak) { return weak.expired(); });
  listeners_.push_back(held);
  return held;
}

}  // namespace spectra::session
