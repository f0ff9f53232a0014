// Each method at the settings that a person sees first marks the person in the demo scene and the hottest things of real ones, and leaves the rest alone.

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <utility>
#include <vector>

#include "fusion/demo/demo_scene.hpp"
#include "fusion/files/ply_reader.hpp"
#include "fusion/registry.hpp"
#include "tests/finding/finding.hpp"

namespace spectra::fusion {
namespace {

void expect_found(const test::Surface& surface, const std::vector<test::Thing>& things) {
  for (const fusion::Method* method : fusion::all_methods()) {
    if (!method->needs_temperature) continue;
    // Of a scene that has no past it shows nothing.
    if (method->compares_with_baseline) continue;
    const std::vector<test::Finding> all = test::findings(surface, test::first_view_plan(surface, method->id), things);
    for (const test::Finding& found : all) {
      if (method->highlights) {
        EXPECT_GE(found.thing_changed, test::kLeastOfTheThing) << method->id;
        EXPECT_LE(found.rest_changed, test::kMostOfTheRest) << method->id;
      } else {
        EXPECT_GE(found.difference_from_ring, test::kLeastDifference) << method->id;
      }
    }
  }
}

class FindsThePerson : public testing::TestWithParam<std::uint64_t> {};
INSTANTIATE_TEST_SUITE_P(Demo, FindsThePerson, testing::Values(1U, 2U, 3U, 4U, 5U));

TEST_P(FindsThePerson, InEveryMethodAtItsDefaults) {
  demo::LabelledDemoScene scene = demo::labelled_demo_scene({.vertex_count = 40'000, .seed = GetParam()});
  const test::Surface surface(std::move(scene.mesh));
  ASSERT_EQ(scene.is_skin.size(), surface.mesh.vertex_count());
  const std::vector<test::Thing> things = {test::thing_from(surface, "person", std::move(scene.is_skin))};
  ASSERT_GT(std::ranges::count(things[0].is_part, 1), 200);
  expect_found(surface, things);
}

/// A scene and how many of its hottest things are to be found.
class FindsTheHottest : public testing::TestWithParam<std::pair<const char*, std::size_t>> {};

INSTANTIATE_TEST_SUITE_P(RealScenes, FindsTheHottest,
                         testing::Values(std::pair("mm5_256.ply", 1U), std::pair("mm5_098.ply", 2U),
                                         std::pair("arco_castle_250k.ply", 1U)));

TEST_P(FindsTheHottest, InEveryMethodAtItsDefaults) {
  const char* const data = std::getenv("SPECTRA_TEST_DATA");
  if (data == nullptr) GTEST_SKIP() << "SPECTRA_TEST_DATA does not name a folder with the real scenes";
  auto loaded = files::read_ply(std::filesystem::path(data) / GetParam().first);
  ASSERT_TRUE(loaded) << loaded.error().message;
  const test::Surface surface(std::move(loaded.value().mesh));
  const std::vector<test::Thing> things = test::hottest_things(surface, GetParam().second);
  ASSERT_EQ(things.size(), GetParam().second);
  expect_found(surface, things);
}

}  // namespace
}  // namespace spectra::fusion
