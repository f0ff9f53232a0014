#include "server/map/scene_store.hpp"

#include <utility>

namespace spectra::map {
namespace {

/// A map may double the extent of its first block so often.
constexpr int kFirstLevel = 12;

LivingMap::Options live_options() {
  return {.levels = LevelsOfDetail::All,
          .leaf_vertex_count = kLiveLeafVertexCount,
          .first_level = kFirstLevel,
          .is_live = true,
          .name = "live map",
          .remembers = true};
}

}  // namespace

std::shared_ptr<const SceneSnapshot> SceneStore::current() const {
  const std::lock_guard lock(mutex_);
  return current_;
}

std::shared_ptr<const SceneSnapshot> SceneStore::replace(files::LoadedScene scene, jobs::WorkerPool& pool,
                                                         LevelsOfDetail levels, const Listener& before,
                                                         const base::Progress& progress) {
  const std::lock_guard replacing(replace_mutex_);
  const auto previous = current();
  map_ = std::make_shared<LivingMap>(
      LivingMap::Options{.levels = levels, .settled_block = std::string(kFileBlock), .first_level = kFirstLevel});
  MapChange change;
  change.put.push_back({.id = std::string(kFileBlock), .scene = std::move(scene), .observed_at = {}});
  return publish(map_->apply(std::move(change), previous ? previous->revision() + 1 : 1, pool, progress), before);
}

std::shared_ptr<const SceneSnapshot> SceneStore::change(MapChange change, jobs::WorkerPool& pool) {
  const std::lock_guard replacing(replace_mutex_);
  const auto previous = current();
  if (!map_) {
    map_ = std::make_shared<LivingMap>(live_options());
  }
  return publish(map_->apply(std::move(change), previous ? previous->revision() + 1 : 1, pool), {});
}

bool SceneStore::make_coarse() {
  std::shared_ptr<LivingMap> map;
  std::optional<CoarseWork> work;
  {
    const std::lock_guard replacing(replace_mutex_);
    map = map_;
    if (map) work = map->next_coarse();
  }
  if (!work) return false;
  work->run();
  const std::lock_guard replacing(replace_mutex_);
  if (map != map_) return true;
  if (auto next = map_->take_coarse(*work, current()->revision() + 1)) publish(std::move(next), {});
  return true;
}

void SceneStore::rest() {
  const std::lock_guard replacing(replace_mutex_);
  if (map_) map_->rest();
}

void SceneStore::begin(const std::optional<MapConstants>& constants, const std::optional<std::string>& past_name,
                       const BaselineMark& mark) {
  LivingMap::Options options = live_options();
  options.mark = mark;
  if (past_name) {
    options.is_live = false;
    options.name = *past_name;
  }
  const std::lock_guard replacing(replace_mutex_);
  map_ = std::make_shared<LivingMap>(options, constants);
}

std::optional<MapConstants> SceneStore::constants() const {
  const std::lock_guard replacing(replace_mutex_);
  return map_ ? map_->constants() : std::nullopt;
}

std::shared_ptr<const SceneSnapshot> SceneStore::mark_baseline(double marked_at) {
  const std::lock_guard replacing(replace_mutex_);
  if (!map_) return nullptr;
  const auto previous = current();
  return publish(map_->mark_baseline(marked_at, previous ? previous->revision() + 1 : 1), {});
}

BlockBaseline SceneStore::handed_on(std::string_view id, const mesh::MultispectralMesh& mesh,
                                    std::optional<double> observed_at) const {
  const std::lock_guard replacing(replace_mutex_);
  return map_ ? map_->handed_on(id, mesh, observed_at) : BlockBaseline{};
}

std::optional<base::Error> SceneStore::refusal_of(std::span<const BlockShape> put,
                                                  std::span<const std::string> removed) const {
  const std::lock_guard replacing(replace_mutex_);
  return map_ ? map_->refusal_of(put, removed) : std::nullopt;
}

std::shared_ptr<const SceneSnapshot> SceneStore::publish(std::shared_ptr<const SceneSnapshot> snapshot,
                                                         const Listener& before) {
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

}  // namespace spectra::map
