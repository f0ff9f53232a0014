#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/map/living_map.hpp"
#include "server/map/scene_snapshot.hpp"

namespace spectra::map {

/// Holds the map that is served, and its version of now. Thread-safe; readers take the pointer and never wait for a build.
class SceneStore {
 public:
  using Listener = std::function<void(const std::shared_ptr<const SceneSnapshot>&)>;

  /// Ends a subscription when destroyed; may outlive the store. A call that is under way in another thread is not waited
  /// for, so a listener holds what it needs by weak pointer.
  class Subscription {
   public:
    Subscription() = default;

   private:
    friend class SceneStore;
    explicit Subscription(std::shared_ptr<Listener> listener) : listener_(std::move(listener)) {}
    std::shared_ptr<Listener> listener_;
  };

  /// The newest scene; null while there is none.
  std::shared_ptr<const SceneSnapshot> current() const;

  /// Begins another map, of one block named kFileBlock: builds a snapshot with the next revision (from 1), makes it current, then tells the subscribers in this thread. Calls
  /// from several threads are served one after the other, so that revisions only rise. Must not be called from a job of
  /// the pool or from a listener. `before` is called with the snapshot before it becomes current, `progress` as by build().
  std::shared_ptr<const SceneSnapshot> replace(files::LoadedScene scene, jobs::WorkerPool& pool,
                                               LevelsOfDetail levels = LevelsOfDetail::LeavesOnly,
                                               const Listener& before = {}, const base::Progress& progress = {});
  /// The same for a mesh of which nothing has to be said.
  std::shared_ptr<const SceneSnapshot> replace(mesh::MultispectralMesh mesh, jobs::WorkerPool& pool,
                                               LevelsOfDetail levels = LevelsOfDetail::LeavesOnly,
                                               const Listener& before = {}) {
    return replace(files::LoadedScene{std::move(mesh), {}, {}}, pool, levels, before);
  }

  /// Changes the map (an empty one begins with this), in the same way; there is no refusal_of() it.
  std::shared_ptr<const SceneSnapshot> change(MapChange change, jobs::WorkerPool& pool);

  /// Makes one of the coarse tiles that do not show yet what has changed beneath them, beside all changes, and publishes the map with
  /// it. False when there is none. One thread at a time.
  bool make_coarse();
  /// See LivingMap::rest().
  void rest();

  /// `listener` is called with every scene that becomes current from now on; it should only post to its own thread.
  [[nodiscard]] Subscription subscribe(Listener listener);

  /// Begins an empty map; what is served stays until the first change(). Constants as LivingMap; a map with a name is one of the past,
  /// which does not grow.
  void begin(const std::optional<MapConstants>& constants, const std::optional<std::string>& past_name = std::nullopt,
             const BaselineMark& mark = {});
  /// See LivingMap::mark_baseline(). Null where there is no map yet.
  std::shared_ptr<const SceneSnapshot> mark_baseline(double marked_at);
  /// See LivingMap::handed_on().
  BlockBaseline handed_on(std::string_view id, const mesh::MultispectralMesh& mesh,
                          std::optional<double> observed_at) const;
  /// Of the map, once it had a block.
  std::optional<MapConstants> constants() const;
  /// See LivingMap::refusal_of().
  std::optional<base::Error> refusal_of(std::span<const BlockShape> put, std::span<const std::string> removed) const;

  /// The block that a file becomes.
  static constexpr std::string_view kFileBlock = "scene";

 private:
  std::shared_ptr<const SceneSnapshot> publish(std::shared_ptr<const SceneSnapshot> snapshot, const Listener& before);

  mutable std::mutex replace_mutex_;  // held while a scene is built and told of; taken before mutex_
  std::shared_ptr<LivingMap> map_;
  mutable std::mutex mutex_;
  std::shared_ptr<const SceneSnapshot> current_;
  std::vector<std::weak_ptr<Listener>> listeners_;
};

}  // namespace spectra::map
