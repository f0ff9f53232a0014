#include "server/sources/map_feed.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <memory>
#include <stdexcept>
#include <string>

namespace spectra::sources {
namespace {

TEST(MapFeed, SaysWhyMappingHasEnded) {
  map::SceneStore scenes;
  jobs::WorkerPool pool{1};
  MapKeeper keeper{scenes, pool, nullptr};
  RobotTrack robot;
  FrameStream frames = demo_drive_stream();
  frames.is_paced = false;
  frames.load = [](std::size_t, mapping::FaultLog&) -> mapping::Frame { throw std::runtime_error("no memory"); };
  std::promise<std::string> ended;
  auto why = ended.get_future();
  MapFeed feed(
      std::move(frames), {}, keeper, robot, [] { return true; },
      [&ended](const std::string& text) { ended.set_value(text); });
  ASSERT_EQ(why.wait_for(std::chrono::seconds(10)), std::future_status::ready);
  EXPECT_NE(why.get().find("no memory"), std::string::npos);
}

}  // namespace
}  // namespace spectra::sources
