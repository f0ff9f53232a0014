#include "server/scene/scene_store.hpp"

#include <utility>

namespace spectra::server {

std::shared_ptr<const SceneSnapshot> SceneStore::current() const {
  const std::lock_guard lock(mutex_);
  return current_;
}

std::shared_ptr<const SceneSnapshot> SceneStore::replace(fusion::LoadedScene scene, WorkerPool& pool,
                                                         LevelsOfDetail levels, const Listener& before,
                                                         const fusion::Progress& progress) {
  const std::lock_guard replacing(replace_mutex_);
  const auto previous = current();
  const std::uint32_t revision = previous ? previous->revision() + 1 : 1;
  const auto snapshot = SceneSnapshot::build(std::move(scene), revision, pool, kLeafVertexCount, levels, progress);
  if (before) before(snapshot);
  std::vector<std::shared_ptr<Listener>> listeners;
  {
    const std::lock_guard lock(mutex_);
    current_ = snapshot;
    std::erase_if(listeners_, [&](const std::weak_ptr<Listener>& weak) {
      auto listener = weak.lock();
      if (!listener) return true;
      listeners.push_back(std::move(listener));
      return false;
    });
  }
  for (const auto& listener : listeners) (*listener)(snapshot);
  return snapshot;
}

SceneStore::Subscription SceneStore::subscribe(Listener listener) {
  auto shared = std::make_shared<Listener>(std::move(listener));
  const std::lock_guard lock(mutex_);
  // A store whose scene never changes must not collect the dead.
  std::erase_if(listeners_, [](const std::weak_ptr<Listener>& weak) { return weak.expired(); });
  listeners_.push_back(shared);
  return Subscription(std::move(shared));
}

}  // namespace spectra::server
