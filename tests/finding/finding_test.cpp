// Each method at the settings that a person sees first marks the person in the demo scene, and leaves the rest alone.

#include <gtest/gtest.h>

#include <memory>

#include "fusion/demo/demo_scene.hpp"
#include "fusion/registry.hpp"
#include "tests/finding/finding.hpp"

namespace spectra::fusion {
namespace {

class FindsThePerson : public testing::TestWithParam<std::uint64_t> {};
INSTANTIATE_TEST_SUITE_P(Demo, FindsThePerson, testing::Values(1U, 2U, 3U, 4U, 5U));

TEST_P(FindsThePerson, InEveryMethodAtItsDefaults) {
  demo::LabelledDemoScene scene = demo::labelled_demo_scene({.vertex_count = 40'000, .seed = GetParam()});
  const test::Surface surface(std::move(scene.mesh));
  ASSERT_EQ(scene.is_skin.size(), surface.mesh.vertex_count());
  const std::vector<test::Thing> things = {test::thing_from(surface, "person", std::move(scene.is_skin))};
  ASSERT_GT(std::ranges::count(things[0].is_part, 1), 200);
  for (const fusion::Method* method : fusion::all_methods()) {
    if (!method->needs_temperature) continue;
    // Of a scene that has no past it shows nothing.
    if (method->compares_with_baseline) continue;
    const test::Finding found = test::findings(surface, test::first_view_plan(surface, method->id), things)[0];
    if (method->highlights) {
      EXPECT_GE(found.thing_changed, test::kLeastOfTheThing) << method->id;
      EXPECT_LE(found.rest_changed, test::kMostOfTheRest) << method->id;
    } else {
      EXPECT_GE(found.difference_from_ring, test::kLeastDifference) << method->id;
    }
  }
}

}  // namespace
}  // namespace spectra::fusion
