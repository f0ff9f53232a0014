#include "server/map/scene_store.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "tests/unit/map/generated_scene.hpp"

namespace spectra::map {
namespace {

TEST(SceneStore, StartsEmptyAndHoldsTheNewestScene) {
  jobs::WorkerPool pool(1);
  SceneStore store;
  EXPECT_EQ(store.current(), nullptr);
  const auto first = store.replace(testing::point_cloud(10, 1), pool);
  EXPECT_EQ(first->revision(), 1u);
  EXPECT_EQ(store.current(), first);
  const auto second = store.replace(testing::point_cloud(20, 2), pool);
  EXPECT_EQ(second->revision(), 2u);
  EXPECT_EQ(store.current(), second);
  EXPECT_EQ(first->vertex_count(), 10u) << "a reader keeps what it holds";
}

TEST(SceneStore, TellsSubscribersUntilTheyLeave) {
  jobs::WorkerPool pool(1);
  SceneStore store;
  std::vector<std::uint32_t> told;
  auto subscription = store.subscribe([&](const auto& scene) {
    EXPECT_EQ(store.current(), scene);
    told.push_back(scene->revision());
  });
  store.replace(testing::point_cloud(10, 1), pool);
  store.replace(testing::point_cloud(10, 2), pool);
  subscription = {};
  store.replace(testing::point_cloud(10, 3), pool);
  EXPECT_EQ(told, (std::vector<std::uint32_t>{1, 2}));
}

TEST(SceneStore, ListenerMayLeaveWhileItIsTold) {
  jobs::WorkerPool pool(1);
  SceneStore store;
  int calls = 0;
  SceneStore::Subscription subscription;
  subscription = store.subscribe([&](const auto&) {
    ++calls;
    subscription = {};
  });
  store.replace(testing::point_cloud(10, 1), pool);
  store.replace(testing::point_cloud(10, 2), pool);
  EXPECT_EQ(calls, 1);
}

}  // namespace
}  // namespace spectra::map
