#include "server/sources/map_feed.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <memory>
#include <stdexcept>
#include <string>

namespace spectra::sources {
namespace {

/// What is said when mapping ends by itself.
std::string why_mapping_ends(FrameStream frames) {
  map::SceneStore scenes;
  jobs::WorkerPool pool{1};
  MapKeeper keeper{scenes, pool, nullptr};
  EXPECT_FALSE(keeper.restore());
  RobotTrack robot;
  frames.is_paced = false;
  mapping::MapperSettings settings;
  settings.voxel_m = 0.05;
  std::promise<std::string> ended;
  auto why = ended.get_future();
  MapFeed feed(
      std::move(frames), settings, keeper, robot, [] { return true; },
      [&ended](const std::string& text) { ended.set_value(text); });
  return why.wait_for(std::chrono::seconds(20)) == std::future_status::ready ? why.get() : "nothing";
}

TEST(MapFeed, SaysWhyMappingHasEnded) {
  const FrameStream drive = demo_drive_stream();
  FrameStream failing = drive;
  failing.load = [](std::size_t, mapping::FaultLog&) -> mapping::Frame { throw std::runtime_error("no memory"); };
  EXPECT_NE(why_mapping_ends(failing).find("no memory"), std::string::npos);
  // Units that no map takes.
  FrameStream askew = drive;
  askew.up = "askew";
  const std::string why = why_mapping_ends(askew);
  EXPECT_NE(why.find("up is \"askew\""), std::string::npos) << why;
}

}  // namespace
}  // namespace spectra::sources
