#include "server/mapping/unit_publisher.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "box_world.hpp"
#include "server/mapping/map_ply.hpp"
#include "server/mapping/mapper.hpp"

namespace spectra::mapping {
namespace {

class UnitPublisherTest : public testing::Test {
 protected:
  UnitPublisherTest() {
    settings_.voxel_m = 0.02;
    for (int i = 0; i < 400; ++i) trajectory_.add(0.05 * i, looking_ahead());
  }
  /// One more look at a world, and what is told after it.
  std::vector<PublishedUnit> look(const BoxWorld& world, std::size_t most = UnitPublisher::kAll) {
    Frame frame;
    frame.time_s = 0.05 * ++looks_;
    frame.depth = world.depth(calibration_.depth.camera, looking_ahead());
    frame.thermal = world.thermal(calibration_.thermal->camera, looking_ahead());
    // The shutter is open: no picture repeats the one before.
    frame.thermal.pixels[0] = static_cast<std::uint16_t>(frame.thermal.pixels[0] + looks_ % 2);
    mapper_.fuse(frame, trajectory_, faults_);
    auto units = mapper_.changed_units(publisher_, Eigen::Vector3d::Zero(), pool_, most);
    for (const PublishedUnit& unit : units) told_[unit.id] = unit.mesh;
    return units;
  }
  /// All that was told has the same vertices where units meet.
  void expect_no_cracks() const {
    std::map<std::uint64_t, base::Vec3f> known;
    for (const auto& [id, mesh] : told_) {
      for (std::size_t i = 0; i < mesh.edges.size(); ++i) {
        const auto [entry, is_new] = known.emplace(mesh.edges[i], mesh.positions[i]);
        EXPECT_EQ(entry->second, mesh.positions[i]) << id;
      }
    }
  }

  static WarmBox hand(double celsius) {
    return {{0.25, -0.1, 1.7}, {0.45, 0.1, 2.1}, [celsius](const Eigen::Vector3d&) { return celsius; }};
  }

  Calibration calibration_ = small_cameras();
  MapperSettings settings_;
  Trajectory trajectory_;
  jobs::WorkerPool pool_{1};
  FaultLog faults_;
  Mapper mapper_{calibration_,
                 [] {
                   MapperSettings settings;
                   settings.voxel_m = 0.02;
                   return settings;
                 }(),
                 pool_};
  UnitPublisher publisher_;
  std::map<std::string, UnitMesh> told_;
  int looks_ = 0;
};

TEST(BlockPly, NamesTheUnitOfItsPositions) {
  UnitMesh mesh;
  mesh.positions = {{0, 0, 0}};
  mesh.colours = {{1, 2, 3}};
  mesh.celsius = {20};
  mesh.sigma_kelvin = {1};
  mesh.seen_s = {0};
  EXPECT_NE(block_ply(mesh, 0).value().find("comment positions in metres\n"), std::string::npos);
}

TEST_F(UnitPublisherTest, TellsEverythingOnceAndThenNothing) {
  const BoxWorld world{{wall(20)}};
  EXPECT_GT(look(world).size(), 4U);
  for (int i = 0; i < 5; ++i) look(world);
  EXPECT_TRUE(look(world).empty());
  expect_no_cracks();
}

TEST_F(UnitPublisherTest, TellsOnlyWhatHasChangedAndHeatFirst) {
  for (int i = 0; i < 6; ++i) look(BoxWorld{{wall(20), hand(20)}});
  const std::size_t all = told_.size();
  const auto is_warm = [](const PublishedUnit& unit) {
    return std::any_of(unit.mesh.celsius.begin(), unit.mesh.celsius.end(), [](float t) { return t > 26; });
  };
  std::vector<PublishedUnit> changed;
  for (int i = 0; i < 20 && std::none_of(changed.begin(), changed.end(), is_warm); ++i) {
    changed = look(BoxWorld{{wall(20), hand(34)}});
    EXPECT_LT(changed.size(), all);
  }
  ASSERT_FALSE(changed.empty());
  EXPECT_TRUE(is_warm(changed.front()));
  expect_no_cracks();
}

TEST_F(UnitPublisherTest, MeetsBitForBitWhileSurfacesMove) {
  for (int i = 0; i < 30; ++i) {
    const double shift = 0.002 * i;
    look(BoxWorld{
        {{{-1, -1, 2 + shift}, {1, 1, 2.5}, [](const Eigen::Vector3d& p) { return 20 + p.x(); }}, hand(20 + 0.3 * i)}});
    expect_no_cracks();
  }
}

TEST_F(UnitPublisherTest, WhatIsTooMuchWaitsAndIsToldLater) {
  const BoxWorld world{{wall(20), hand(34)}};
  for (int i = 0; i < 4; ++i) look(world);
  const std::map<std::string, UnitMesh> all = std::exchange(told_, {});
  publisher_ = {};
  // The new publisher has heard of no change: a look at something else tells it everywhere.
  const BoxWorld nearer{{{{-1, -1, 1.9}, {1, 1, 2.5}, [](const Eigen::Vector3d&) { return 25.0; }}, hand(34)}};
  EXPECT_LE(look(nearer, 3).size(), 3U);
  EXPECT_GT(publisher_.waiting_count(), 0U);
  for (std::uint32_t i = 0; i < UnitPublisher::kPatience + 5; ++i) {
    look(nearer, 8);
    if (i % 4 == 0) expect_no_cracks();
  }
  EXPECT_GE(told_.size(), all.size() / 2) << "those that are near have not kept the others out";
  look(nearer);
  EXPECT_EQ(publisher_.waiting_count(), 0U);
  expect_no_cracks();
}

TEST_F(UnitPublisherTest, TellsThatAUnitIsEmpty) {
  const WarmBox before{{-0.1, -0.1, 1.0}, {0.1, 0.1, 1.1}, [](const Eigen::Vector3d&) { return 30.0; }};
  for (int i = 0; i < 3; ++i) look(BoxWorld{{wall(20), before}});
  bool is_emptied = false;
  for (int i = 0; i < 60 && !is_emptied; ++i) {
    for (const PublishedUnit& unit : look(BoxWorld{{wall(20)}})) is_emptied = is_emptied || unit.mesh.triangles.empty();
  }
  EXPECT_TRUE(is_emptied);
}

}  // namespace
}  // namespace spectra::mapping
