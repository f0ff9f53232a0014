#include <gtest/gtest.h>

#include <limits>

#include "fusion/colour/palette.hpp"
#include "fusion/registry.hpp"
#include "tests/unit/fusion/scene.hpp"

namespace spectra::fusion {
namespace {

using test::fused;
using test::scene_of;
using test::settings_with;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

TEST(FusionPlan, AutomaticTemperaturesFollowTheDistributionWhateverTheRange) {
  const SceneTemperature scene = scene_of({2, 4, 4, 4, 5, 5, 7, 9});  // mean 5, sigma 2
  for (const auto& range : {RangeSetting{}, RangeSetting::manual(0, 100), RangeSetting::percentile(10, 20)}) {
    const auto plan = FusionPlan::prepare(settings_with("thermal_highlighting", {}, range), scene).value();
    EXPECT_EQ(plan.params_in_force().at("low"), ParameterValue{2.0});
    EXPECT_EQ(plan.params_in_force().at("high"), ParameterValue{8.0});
    EXPECT_EQ(plan.settings().params.at("low"), ParameterValue{Automatic{}});
    const auto threshold = FusionPlan::prepare(settings_with("colour_mapped_threshold", {}, range), scene).value();
    EXPECT_EQ(threshold.params_in_force().at("threshold"), ParameterValue{8.0});
    const auto inverted =
        FusionPlan::prepare(settings_with("monochrome_threshold", {{"invert", true}}, range), scene).value();
    EXPECT_EQ(inverted.params_in_force().at("threshold"), ParameterValue{2.0});
  }
}

TEST(FusionPlan, AutomaticTemperaturesStayWithinTheExtremes) {
  const SceneTemperature scene = scene_of({10, 10, 30, 30});  // mean 20, sigma 10
  const auto plan = FusionPlan::prepare(settings_with("thermal_highlighting"), scene).value();
  EXPECT_EQ(plan.params_in_force().at("low"), ParameterValue{10.0});
  EXPECT_EQ(plan.params_in_force().at("high"), ParameterValue{30.0});
}

TEST(FusionPlan, APercentileRangeLeavesTheOutermostOut) {
  std::vector<float> temperature;
  for (int i = 0; i <= 1000; ++i) temperature.push_back(static_cast<float>(i) / 10);
  const auto plan =
      FusionPlan::prepare(settings_with("thermal_only", {}, RangeSetting::percentile(2, 90)), scene_of(temperature));
  EXPECT_NEAR(plan.value().range_minimum(), 2, 100.0 / 4096);
  EXPECT_NEAR(plan.value().range_maximum(), 90, 100.0 / 4096);
}

TEST(HistogramBin, AutomaticallyShowsAtMostATenth) {
  std::vector<float> temperature(80, 5.5F);
  temperature.insert(temperature.end(), 13, 3.5F);
  for (const float rare : {0.0F, 10.0F, 8.5F, 8.6F, 9.2F, 9.4F, 9.6F}) temperature.push_back(rare);
  const auto plan =
      FusionPlan::prepare(settings_with("histogram_bin", {{"bins", std::int64_t{10}}}), scene_of(temperature)).value();
  // Bin 0 has 1, bin 8 has 2, bin 9 has 4, bin 3 has 13 and bin 5 has 80.
  EXPECT_EQ(plan.params_in_force().at("n"), ParameterValue{std::int64_t{3}});
  const auto inverted = FusionPlan::prepare(
      settings_with("histogram_bin", {{"bins", std::int64_t{10}}, {"invert", true}}), scene_of(temperature));
  EXPECT_EQ(inverted.value().params_in_force().at("n"), ParameterValue{std::int64_t{0}});
  EXPECT_TRUE(inverted.value().highlighted().empty());
}

TEST(MonochromeThreshold, AutomaticHueIsTheOneTheSceneHasLeastOf) {
  SceneTemperature scene = scene_of({10, 20, 50});
  const auto hue_among = [&](std::vector<base::Rgb8> colours) {
    scene.hues = [colours] {
      Hues hues;
      add_to_hues(colours, hues);
      return hues;
    };
    const auto plan = FusionPlan::prepare(settings_with("monochrome_threshold"), scene).value();
    return std::get<double>(plan.params_in_force().at("hue"));
  };
  EXPECT_EQ(hue_among({}), 0);
  EXPECT_EQ(hue_among({{90, 90, 90}, {0, 0, 0}}), 0) << "grey leaves the choice to red";
  const double beside_brick = hue_among({{170, 60, 50}, {150, 70, 50}});
  EXPECT_GT(beside_brick, 90);
  EXPECT_LT(beside_brick, 290);
  const double beside_grass = hue_among({{60, 160, 50}, {90, 90, 90}});
  EXPECT_TRUE(beside_grass < 30 || beside_grass > 200) << beside_grass;
  scene.hues = {};
  const auto without = FusionPlan::prepare(settings_with("monochrome_threshold"), scene).value();
  EXPECT_EQ(without.params_in_force().at("hue"), ParameterValue{0.0});
  const auto by_hand = FusionPlan::prepare(settings_with("monochrome_threshold", {{"hue", 77.0}}), scene).value();
  EXPECT_EQ(by_hand.params_in_force().at("hue"), ParameterValue{77.0});
}

TEST(FusionPlan, WhatIsBeyondTheSensorsRangeIsNotMissing) {
  const std::vector<float> temperature = {10, 12, 20, 28, 30, kInfinity, -kInfinity};
  const std::vector<base::Rgb8> visible(temperature.size(), base::Rgb8{9, 90, 200});
  SceneTemperature scene = scene_of(temperature);
  EXPECT_EQ(scene.summary.finite_count, 5U);
  EXPECT_EQ(scene.summary.missing_count, 0U);
  EXPECT_EQ(scene.summary.over_range_count, 1U);
  EXPECT_EQ(scene.summary.under_range_count, 1U);
  EXPECT_EQ(scene.summary.maximum, 30);
  const base::Rgb8 violet{200, 0, 255};
  const auto colours_of = [&](const std::string& method, ParameterValues params = {}) {
    return fused(FusionPlan::prepare(settings_with(method, std::move(params), {}, violet), scene).value(), temperature,
                 visible);
  };
  const auto thermal = colours_of("thermal_only");
  EXPECT_EQ(thermal[5], thermal[4]) << "t = 1, as the hottest";
  EXPECT_EQ(thermal[6], thermal[0]) << "t = 0, as the coldest";
  const auto hot = colours_of("colour_mapped_threshold", {{"threshold", 1000.0}, {"alpha", 1.0}});
  EXPECT_EQ(hot[5], thermal[5]) << "hotter than any threshold";
  EXPECT_EQ(hot[4], visible[4]);
  EXPECT_EQ(hot[6], visible[6]);
  const auto sides = colours_of("thermal_highlighting", {{"low", 11.0}, {"high", 29.0}, {"k", 0.25}});
  EXPECT_EQ(sides[5], thermal[5]) << "W = 1 beyond a threshold";
  EXPECT_EQ(sides[6], thermal[6]);
  EXPECT_NE(sides[4], thermal[4]);
  const auto bins = colours_of("histogram_bin", {{"bins", std::int64_t{2}}, {"n", std::int64_t{1}}});
  EXPECT_EQ(bins[6], thermal[6]) << "bin 0 of 10 and 12, the rarer one";
  EXPECT_EQ(bins[5], visible[5]);
  const auto unusual = colours_of("histogram_distribution", {{"k", 3.0}});
  EXPECT_EQ(unusual[5], thermal[5]);
  EXPECT_EQ(unusual[6], thermal[6]);
  EXPECT_EQ(unusual[4], visible[4]);
  // Even where there is nothing else: a range of one point, or none.
  const std::vector<float> alone = {kInfinity, -kInfinity};
  for (const auto& others : {std::vector<float>{21.5F, 21.5F}, std::vector<float>{}}) {
    std::vector<float> all = others;
    all.insert(all.end(), alone.begin(), alone.end());
    const auto plan = FusionPlan::prepare(settings_with("thermal_only"), scene_of(all)).value();
    const auto ends = fused(plan, alone, std::span(visible).first(2));
    const PaletteTable& iron = find_palette("iron")->table;
    EXPECT_EQ(int{ends[0].r}, static_cast<int>(iron[255][0] + 0.5));
    EXPECT_EQ(int{ends[1].b}, static_cast<int>(iron[0][2] + 0.5));
  }
}

TEST(FusionPlan, LowAboveAutomaticHighIsAnErrorWhenItBecomesKnown) {
  const FusionSettings settings = settings_with("thermal_highlighting", {{"low", 48.0}});
  const auto plan = FusionPlan::prepare(settings, scene_of({10, 20, 20, 50}));  // high = 47.5
  ASSERT_TRUE(plan.has_error());
  EXPECT_EQ(plan.error().code, base::ErrorCode::Inconsistent);
  EXPECT_EQ(plan.error().field, "low");
  EXPECT_EQ(plan.error().message, "low (48 degC) must not be above high (47.5 degC) when both sides are highlighted");
  EXPECT_TRUE(FusionPlan::prepare(settings, scene_of({10, 90})).has_value());
}

TEST(FusionPlan, MissingTemperatureShowsVisibleOrTheFixedColourInEveryMethod) {
  const std::vector<float> temperature = {10, kNan, -kNan, kNan, 50};
  const std::vector<base::Rgb8> visible = {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}, {0, 0, 0}, {255, 255, 255}};
  const SceneTemperature scene = scene_of(temperature);
  const base::Rgb8 violet{200, 0, 255};
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
  const std::vector<base::Rgb8> visible = {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}};
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
  const std::vector<base::Rgb8> visible(3, base::Rgb8{9, 9, 9});
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
  const std::vector<base::Rgb8> visible(2);
  FusionChange change;
  change.method = "thermal_only";
  change.palette = "white_hot";
  const auto plan = FusionPlan::prepare(with_change(default_settings(), change).value(), scene_of(temperature)).value();
  EXPECT_EQ(fused(plan, temperature, visible)[0], (base::Rgb8{128, 128, 128}));
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
    EXPECT_EQ(calls > 0, method->id == "histogram_bin") << method->id;
  }
}

TEST(FusionPlan, EmptySpansAreAllowed) {
  for (const Method* method : all_methods()) {
    EXPECT_TRUE(fused(FusionPlan::prepare(settings_with(method->id), scene_of({1, 2})).value(), {}, {}).empty());
  }
}

TEST(HistogramDistribution, ZeroSigmaHighlightsNothingEvenInverted) {
  const std::vector<float> temperature(4, 30.0F);
  const std::vector<base::Rgb8> visible(4, base::Rgb8{10, 20, 30});
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
  const std::vector<base::Rgb8> visible(temperature.size(), base::Rgb8{1, 1, 1});
  const auto settings =
      settings_with("histogram_bin", {{"bins", std::int64_t{4}}, {"n", std::int64_t{1}}}, RangeSetting::manual(0, 10));
  const auto colours = fused(FusionPlan::prepare(settings, scene_of(temperature)).value(), temperature, visible);
  EXPECT_EQ(colours.front(), visible.front());
  EXPECT_NE(colours.back(), visible.back());
}

}  // namespace
}  // namespace spectra::fusion
