#include "server/sources/unit_hand_over.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <limits>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace spectra::sources {
namespace {

using namespace std::chrono_literals;

class UnitHandOverTest : public testing::Test {
 protected:
  UnitHandOverTest() { EXPECT_FALSE(map_.restore()); }
  ~UnitHandOverTest() override {
    map_.end();
    pool_.stop();
  }

  static mapping::PublishedUnit triangle() {
    mapping::PublishedUnit unit;
    unit.id = "unit_0_0_0";
    unit.mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    unit.mesh.colours.resize(3);
    unit.mesh.celsius = {20, 21, 22};
    unit.mesh.sigma_kelvin = {1, 1, 1};
    unit.mesh.seen_s = {0, 0, 0};
    unit.mesh.triangles = {{0, 1, 2}};
    return unit;
  }
  void put(const mapping::PublishedUnit& unit, const FeedMoment& moment = {}) {
    hand_over_(std::vector{unit}, moment, mapping_pool_);
  }
  /// What a hand-over that fails says.
  std::string failure_of(const mapping::PublishedUnit& unit, const FeedMoment& moment = {}) {
    try {
      put(unit, moment);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }
  bool is_in_map() {
    while (hand_over_.room() < UnitHandOver::kUnderWay) std::this_thread::sleep_for(1ms);
    return scenes_.current()->block_mesh("unit_0_0_0").has_value();
  }

  map::SceneStore scenes_;
  jobs::WorkerPool pool_{2}, mapping_pool_{1};
  MapKeeper map_{scenes_, pool_, nullptr};
  UnitHandOver hand_over_{map_, ""};
};

TEST_F(UnitHandOverTest, PutsAUnitAndTakesItOutWhenItHasNoSurface) {
  put(triangle());
  EXPECT_TRUE(is_in_map());
  mapping::PublishedUnit empty = triangle();
  empty.mesh = {};
  put(empty);
  EXPECT_FALSE(is_in_map());
}

TEST_F(UnitHandOverTest, AUnitThatCannotBeWrittenIsAnErrorAndStays) {
  put(triangle());
  for (const int kind : {0, 1, 2}) {
    mapping::PublishedUnit broken = triangle();
    if (kind == 0) broken.mesh.colours.pop_back();
    if (kind == 1) broken.mesh.celsius.pop_back();
    if (kind == 2) broken.mesh.seen_s.clear();
    EXPECT_NE(failure_of(broken).find("unit_0_0_0: the vertices to write have 3 positions"), std::string::npos)
        << failure_of(broken);
  }
  EXPECT_TRUE(is_in_map());
}

TEST_F(UnitHandOverTest, APlaceThatIsNoneIsAnError) {
  FeedMoment moment;
  moment.eye.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(failure_of(triangle(), moment).find("sensor"), std::string::npos) << failure_of(triangle(), moment);
  EXPECT_FALSE(is_in_map());
}

TEST_F(UnitHandOverTest, PutsNothingWhenItIsOver) {
  hand_over_.end();
  put(triangle());
  EXPECT_FALSE(is_in_map());
}

}  // namespace
}  // namespace spectra::sources
