#include "server/stream/first_picture.hpp"

#include <gtest/gtest.h>

#include "fake_scene.hpp"
#include "test_viewer.hpp"

namespace spectra::stream {
namespace {

using testing::plan_with_alpha;
using testing::quadtree_tiles;
using testing::scene_of;
using testing::TestViewer;

TEST(FirstPicture, TheRootIsThereBeforeTheFirstViewer) {
  const auto scene = scene_of(quadtree_tiles(2, 12));
  FrameCache cache(1 << 22);
  encode_first_picture(scene, cache);
  EXPECT_EQ(cache.miss_count(), 1U) << "the root alone";
  encode_first_picture(scene, cache);
  EXPECT_EQ(cache.miss_count(), 1U);

  jobs::WorkerPool pool(1);
  TestViewer viewer(scene, cache, pool);
  viewer.stream().subscribe({});
  viewer.stream().set_plan(plan_with_alpha(*scene, 0.5));
  viewer.complete();
  EXPECT_EQ(cache.miss_count(), 1U + 4U + 5U) << "four leaves, and the colours of five tiles";
}

}  // namespace
}  // namespace spectra::stream
