#include <gtest/gtest.h>

#include <limits>

#include "fusion/registry.hpp"
#include "tests/unit/fusion/scene.hpp"

namespace spectra::fusion {
namespace {

using test::fused;
using test::scene_of;
using test::settings_with;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

TEST(FusionPlan, AutomaticTemperaturesFollowTheActiveRange) {
  const SceneTemperature scene = scene_of({10, 20, 50});
  const auto plan = FusionPlan::prepare(settings_with("thermal_highlighting"), scene).value();
  EXPECT_EQ(plan.range_minimum(), 10);
  EXPECT_EQ(plan.range_maximum(), 50);
  EXPECT_EQ(plan.params_in_force().at("low"), ParameterValue{16.0});
  EXPECT_EQ(plan.params_in_force().at("high"), ParameterValue{44.0});
  EXPECT_EQ(plan.settings().params.at("low"), ParameterValue{Automatic{}});

  const RangeSetting manual{false, 0, 100};
  const auto threshold = FusionPlan::prepare(settings_with("colour_mapped_threshold", {}, manual), scene).value();
  EXPECT_EQ(threshold.params_in_force().at("threshold"), ParameterValue{75.0});
  const auto inverted =
      FusionPlan::prepare(settings_with("monochrome_threshold", {{"invert", true}}, manual), scene).value();
  EXPECT_EQ(inverted.params_in_force().at("threshold"), ParameterValue{25.0});
}

TEST(FusionPlan, LowAboveAutomaticHighIsAnErrorWhenItBecomesKnown) {
  const FusionSettings settings = settings_with("thermal_highlighting", {{"low", 48.0}});
  const auto plan = FusionPlan::prepare(settings, scene_of({10, 50}));
  ASSERT_TRUE(plan.has_error());
  EXPECT_EQ(plan.error().code, ErrorCode::Inconsistent);
  EXPECT_EQ(plan.error().field, "low");
  EXPECT_TRUE(FusionPlan::prepare(settings, scene_of({10, 90})).has_value());
}

TEST(FusionPlan, MissingTemperatureShowsVisibleOrTheFixedColourInEveryMethod) {
  const std::vector<float> temperature = {10, kNan, kInfinity, -kInfinity, 50};
  const std::vector<Rgb8> visible = {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}, {0, 0, 0}, {255, 255, 255}};
  const SceneTemperature scene = scene_of(temperature);
  const Rgb8 violet{200, 0, 255};
  for (const Method* method : all_methods()) {
    SCOPED_TRACE(method->id);
    for (const bool invert : {false, true}) {
      ParameterValues params;
      for (const Parameter& parameter : method->parameters) {
        if (parameter.name == "invert") params["invert"] = invert;
      }
      const auto as_visible =
          fused(FusionPlan::prepare(settings_with(method->id, params), scene).value(), temperature, visible);
      const auto as_violet = fused(FusionPlan::prepare(settings_with(method->id, params, {}, violet), scene).value(),
                                   temperature, visible);
      for (const std::size_t i : {1U, 2U, 3U}) {
        EXPECT_EQ(as_visible[i], visible[i]);
        EXPECT_EQ(as_violet[i], method->id == "visible_only" ? visible[i] : violet);
      }
      EXPECT_EQ(as_visible[0], as_violet[0]);
      EXPECT_EQ(as_visible[4], as_violet[4]);
    }
  }
}

TEST(FusionPlan, SceneWithoutTemperatureShowsTheVisiblePicture) {
  const std::vector<float> temperature(3, kNan);
  const std::vector<Rgb8> visible = {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}};
  const SceneTemperature scene = scene_of(temperature);
  for (const Method* method : all_methods()) {
    const auto plan = FusionPlan::prepare(settings_with(method->id), scene);
    ASSERT_TRUE(plan.has_value()) << method->id;
    EXPECT_EQ(fused(plan.value(), temperature, visible), visible) << method->id;
    EXPECT_TRUE(plan.value().highlighted().empty()) << method->id;
    EXPECT_EQ(plan.value().range_minimum(), 0);
    EXPECT_EQ(plan.value().range_maximum(), 0);
  }
  const auto contradicting = settings_with("thermal_highlighting", {{"high", -5.0}});
  EXPECT_TRUE(FusionPlan::prepare(contradicting, scene).has_value());
  EXPECT_TRUE(FusionPlan::prepare(settings_with("histogram_bin"), SceneTemperature{}).has_value());
}

TEST(FusionPlan, ThresholdsAreComparedInTheStorageType) {
  // float(30.1) lies above the double 30.1; in float32 they are equal, and equality shows the visible colour.
  const std::vector<float> temperature = {30.1F, 20, 40};
  const std::vector<Rgb8> visible(3, Rgb8{9, 9, 9});
  for (const char* method : {"colour_mapped_threshold", "monochrome_threshold"}) {
    for (const bool invert : {false, true}) {
      const auto settings = settings_with(method, {{"threshold", 30.1}, {"alpha", 1.0}, {"invert", invert}});
      const auto colours = fused(FusionPlan::prepare(settings, scene_of(temperature)).value(), temperature, visible);
      EXPECT_EQ(colours[0], visible[0]);
      EXPECT_EQ(colours[1] == visible[1], !invert);
      EXPECT_EQ(colours[2] == visible[2], invert);
    }
  }
}

TEST(FusionPlan, UniformSceneTakesTheMiddleOfThePalette) {
  const std::vector<float> temperature(2, 21.5F);
  const std::vector<Rgb8> visible(2);
  FusionChange change;
  change.method = "thermal_only";
  change.palette = "white_hot";
  const auto plan = FusionPlan::prepare(with_change(default_settings(), change).value(), scene_of(temperature)).value();
  EXPECT_EQ(fused(plan, temperature, visible)[0], (Rgb8{128, 128, 128}));
}

TEST(FusionPlan, HistogramIsAskedForOnlyByTheMethodThatNeedsOne) {
  SceneTemperature scene = scene_of({1, 2, 3});
  int calls = 0;
  scene.histogram = [&calls](std::uint32_t bins) {
    ++calls;
    return Histogram{1, 3, std::vector<std::uint64_t>(bins, 1)};
  };
  for (const Method* method : all_methods()) {
    calls = 0;
    ASSERT_TRUE(FusionPlan::prepare(settings_with(method->id), scene).has_value());
    EXPECT_EQ(calls, method->id == "histogram_bin" ? 1 : 0) << method->id;
  }
}

TEST(FusionPlan, EmptySpansAreAllowed) {
  for (const Method* method : all_methods()) {
    EXPECT_TRUE(fused(FusionPlan::prepare(settings_with(method->id), scene_of({1, 2})).value(), {}, {}).empty());
  }
}

TEST(HistogramDistribution, ZeroSigmaHighlightsNothingEvenInverted) {
  const std::vector<float> temperature(4, 30.0F);
  const std::vector<Rgb8> visible(4, Rgb8{10, 20, 30});
  for (const bool invert : {false, true}) {
    const auto plan =
        FusionPlan::prepare(settings_with("histogram_distribution", {{"invert", invert}}), scene_of(temperature))
            .value();
    EXPECT_EQ(fused(plan, temperature, visible), visible);
    EXPECT_TRUE(plan.highlighted().empty());
  }
}

TEST(HistogramBin, StatisticsIgnoreTheHandSetRange) {
  std::vector<float> temperature(100, 20.0F);
  temperature.push_back(60.0F);
  const std::vector<Rgb8> visible(temperature.size(), Rgb8{1, 1, 1});
  const auto settings =
      settings_with("histogram_bin", {{"bins", std::int64_t{4}}, {"n", std::int64_t{1}}}, RangeSetting{false, 0, 10});
  const auto colours = fused(FusionPlan::prepare(settings, scene_of(temperature)).value(), temperature, visible);
  EXPECT_EQ(colours.front(), visible.front());
  EXPECT_NE(colours.back(), visible.back());
}

}  // namespace
}  // namespace spectra::fusion
