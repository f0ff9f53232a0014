#include "server/session/conversions.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "fusion/registry.hpp"

namespace spectra::session {
namespace {

fusion::SceneTemperature scene_from(float low, float high) {
  fusion::SceneTemperature scene;
  scene.summary.finite_count = 2;
  scene.summary.minimum = low;
  scene.summary.maximum = high;
  scene.summary.mean = (double{low} + double{high}) / 2;
  scene.summary.sigma = (double{high} - double{low}) / 2;
  scene.histogram = [low, high](std::uint32_t bins) {
    fusion::Histogram histogram{low, high, std::vector<std::uint64_t>(bins)};
    histogram.counts.front() += 1;
    histogram.counts.back() += 1;
    return histogram;
  };
  return scene;
}

/// A value of the parameter that differs from its default wherever the schema leaves a choice.
fusion::ParameterValue other_value(const fusion::Parameter& parameter) {
  switch (parameter.kind) {
    case fusion::ParameterKind::Toggle:
      return !std::get<bool>(parameter.default_value);
    case fusion::ParameterKind::Choice:
      return parameter.options.back();
    case fusion::ParameterKind::Integer:
      return static_cast<std::int64_t>(parameter.max);
    case fusion::ParameterKind::Temperature:
      return parameter.name == "low" ? 16.25 : 21.75;
    case fusion::ParameterKind::Number:
      return std::isfinite(parameter.max) ? parameter.max : 3.5;
  }
  return fusion::Automatic{};
}

fusion::FusionSettings settings_of(const std::string& method) {
  fusion::FusionChange change;
  change.method = method;
  return fusion::with_change(fusion::default_settings(), change).value();
}

/// What a client would send to bring about a state it was told of.
protocol::FusionChange change_to(const protocol::FusionState& state) {
  protocol::FusionChange change;
  change.method = state.method;
  change.params = state.params;
  change.palette = state.palette;
  change.range =
      protocol::RangeChange{state.range.mode, state.range.min, state.range.max, state.range.low, state.range.high};
  change.missing = state.missing;
  return change;
}

TEST(FusionMessages, BringEverySettingOfEveryMethodThroughTheWire) {
  const auto scene = scene_from(15, 25);
  for (const fusion::Method* method : fusion::all_methods()) {
    fusion::FusionChange wanted;
    wanted.method = method->id;
    wanted.palette = "turbo";
    wanted.range = fusion::RangeSetting::manual(14.5, 26.25);
    wanted.missing = fusion::MissingDisplay{base::Rgb8{1, 2, 255}};
    for (const auto& parameter : method->parameters) wanted.params.emplace(parameter.name, other_value(parameter));
    const auto settings = fusion::with_change(fusion::default_settings(), wanted);
    ASSERT_TRUE(settings) << method->id << ": " << settings.error().message;
    const auto plan = fusion::FusionPlan::prepare(settings.value(), scene).value();

    const auto text = protocol::to_json(change_to(to_message(plan, scene.summary))).dump();
    const auto received = protocol::from_json<protocol::FusionChange>(nlohmann::json::parse(text));
    ASSERT_TRUE(received) << method->id << ": " << received.error().message;
    const auto change = from_message(received.value());
    ASSERT_TRUE(change) << method->id;
    EXPECT_EQ(fusion::with_change(fusion::default_settings(), change.value()).value(), settings.value()) << method->id;
  }
}

TEST(FusionMessages, TellAutomaticTemperaturesAndWhatTheyAmountTo) {
  const auto scene = scene_from(10, 30);
  const auto settings = settings_of("colour_mapped_threshold");
  const auto plan = fusion::FusionPlan::prepare(settings, scene).value();
  const auto state = to_message(plan, scene.summary);
  EXPECT_TRUE(std::holds_alternative<std::nullptr_t>(state.params.at("threshold")));
  EXPECT_EQ(std::get<double>(state.params_in_force.at("threshold")), 30)
      << "mean 20 and 1.5 sigma of 10, within the data";
  EXPECT_EQ(state.range.mode, protocol::RangeMode::Auto);
  EXPECT_EQ(state.range.min, 10);
  EXPECT_EQ(state.range.max, 30);
  EXPECT_EQ(state.missing, "visible");
}

TEST(FusionMessages, BringPercentilesThroughTheWireWithWhatTheyAmountTo) {
  const auto scene = scene_from(10, 30);
  auto settings = settings_of("thermal_only");
  settings.range = fusion::RangeSetting::percentile(0.5, 100);
  const auto state = to_message(fusion::FusionPlan::prepare(settings, scene).value(), scene.summary);
  EXPECT_EQ(state.range.mode, protocol::RangeMode::Percentile);
  EXPECT_EQ(state.range.low, 0.5);
  EXPECT_EQ(state.range.high, 100);
  EXPECT_NEAR(*state.range.min, 10, 20.0 / 4096);
  EXPECT_EQ(state.range.max, 30);
  const auto change = from_message(change_to(state)).value();
  EXPECT_EQ(change.range, settings.range);
  const auto usual = protocol::from_json<protocol::RangeChange>(nlohmann::json{{"mode", "percentile"}}).value();
  protocol::FusionChange wish;
  wish.range = usual;
  EXPECT_EQ(from_message(wish).value().range, fusion::RangeSetting::percentile(1, 99));
}

TEST(FusionMessages, TellAReadingBeyondTheSensorsRange) {
  map::Probe probe;
  const auto told = [&] { return protocol::to_json(to_message(probe, {})); };
  EXPECT_TRUE(told()["temperature"].is_null());
  EXPECT_FALSE(told().contains("temperature_range"));
  probe.temperature_celsius = std::numeric_limits<float>::infinity();
  EXPECT_TRUE(told()["temperature"].is_null());
  EXPECT_EQ(told()["temperature_range"], "over");
  probe.temperature_celsius = -std::numeric_limits<float>::infinity();
  EXPECT_EQ(told()["temperature_range"], "under");
  probe.temperature_celsius = 21.5F;
  EXPECT_EQ(told()["temperature"], 21.5);
  EXPECT_FALSE(told().contains("temperature_range"));
  fusion::TemperatureSummary summary;
  summary.over_range_count = 3;
  summary.under_range_count = 2;
  EXPECT_EQ(to_message(summary).over_range_count, 3U);
  EXPECT_EQ(to_message(summary).under_range_count, 2U);
}

TEST(FusionMessages, TellWhatIsHighlightedWhereAMethodHighlights) {
  const auto scene = scene_from(10, 30);
  EXPECT_EQ(to_message({}, scene.summary, {{20, 30}}, 0.25).highlighted_share, 0.25);
  EXPECT_FALSE(protocol::to_json(to_message({}, scene.summary, {}, std::nullopt)).contains("highlighted_share"));
}

TEST(FusionMessages, WarnOfAPaletteByWhatMethodAndPaletteSayOfThemselves) {
  fusion::Method method;
  method.id = "of_this_test";
  method.label = "A method of this test";
  const auto& palettes = fusion::all_palettes();
  const auto safe = std::ranges::find_if(palettes, [](const auto& p) { return p.fusion_safe; });
  const auto unsafe = std::ranges::find_if(palettes, [](const auto& p) { return !p.fusion_safe; });
  EXPECT_FALSE(palette_warning(method, &*unsafe));
  method.wants_fusion_safe_palette = true;
  const auto warning = palette_warning(method, &*unsafe);
  ASSERT_TRUE(warning);
  EXPECT_NE(warning->find(method.label), std::string::npos) << *warning;
  EXPECT_NE(warning->find(unsafe->label), std::string::npos) << *warning;
  EXPECT_FALSE(palette_warning(method, &*safe));
  EXPECT_FALSE(palette_warning(method, nullptr));
  EXPECT_TRUE(to_message(method).wants_fusion_safe_palette);
}

TEST(FusionMessages, WarnOfAPaletteWithoutAMiddleWhereTwoDirectionsAreShown) {
  fusion::Method method;
  method.label = "A method of this test";
  EXPECT_FALSE(direction_warning(method, fusion::find_palette("iron")));
  method.wants_diverging_palette = true;
  const auto warning = direction_warning(method, fusion::find_palette("iron"));
  ASSERT_TRUE(warning);
  EXPECT_NE(warning->find("Iron"), std::string::npos) << *warning;
  EXPECT_FALSE(direction_warning(method, fusion::find_palette("blue_red")));
  EXPECT_FALSE(direction_warning(method, nullptr));
  EXPECT_EQ(to_message(method).wants_diverging_palette, true);
  EXPECT_EQ(to_message(*fusion::find_palette("blue_red")).diverging, true);
  EXPECT_FALSE(to_message(*fusion::find_palette("iron")).diverging) << "said only where it is true";
}

TEST(FusionMessages, TellWhatThePaletteStandsForWhereItIsChanges) {
  const auto scene = scene_from(10, 30);
  const auto state = [&](const char* method) {
    return to_message(fusion::FusionPlan::prepare(settings_of(method), scene).value(), scene.summary);
  };
  ASSERT_TRUE(state("thermal_change").change_scale);
  EXPECT_EQ(state("thermal_change").change_scale->min, -5);
  EXPECT_EQ(state("thermal_change").change_scale->max, 5);
  EXPECT_FALSE(state("thermal_only").change_scale);
}

TEST(FusionMessages, TellNothingOfTemperaturesThatAreNotThere) {
  const fusion::SceneTemperature none;
  const auto settings = settings_of("thermal_highlighting");
  const auto state = to_message(fusion::FusionPlan::prepare(settings, none).value(), none.summary);
  EXPECT_FALSE(state.range.min);
  EXPECT_FALSE(state.range.max);
  EXPECT_TRUE(std::holds_alternative<std::nullptr_t>(state.params_in_force.at("low")));
  const auto temperature = to_message(none.summary);
  EXPECT_FALSE(temperature.min);
  EXPECT_FALSE(temperature.sigma);
}

TEST(FusionMessages, DescribeEveryMethodByItsSchema) {
  const auto messages = method_messages();
  const auto methods = fusion::all_methods();
  ASSERT_EQ(messages.size(), methods.size());
  for (std::size_t m = 0; m < messages.size(); ++m) {
    EXPECT_EQ(messages[m].id, methods[m]->id);
    ASSERT_EQ(messages[m].params.size(), methods[m]->parameters.size());
    for (std::size_t p = 0; p < messages[m].params.size(); ++p) {
      const auto& told = messages[m].params[p];
      const auto& parameter = methods[m]->parameters[p];
      EXPECT_EQ(told.name, parameter.name);
      EXPECT_EQ(told.min.has_value(), std::isfinite(parameter.min));
      EXPECT_EQ(told.max.has_value(), std::isfinite(parameter.max));
      EXPECT_EQ(told.options, parameter.options);
      EXPECT_EQ(told.automatic.value_or(false), parameter.automatic);
    }
    const auto json = protocol::to_json(messages[m]);
    EXPECT_TRUE(protocol::from_json<protocol::MethodDescription>(json)) << json;
  }
}

TEST(FusionMessages, KeepTheDecimalsOfPalettes) {
  const auto messages = palette_messages();
  const auto palettes = fusion::all_palettes();
  ASSERT_EQ(messages.size(), palettes.size());
  for (std::size_t i = 0; i < messages.size(); ++i) {
    const auto text = protocol::to_json(messages[i]).dump();
    const auto read = protocol::from_json<protocol::PaletteDescription>(nlohmann::json::parse(text)).value();
    EXPECT_TRUE(
        std::equal(read.colours.begin(), read.colours.end(), palettes[i].table.begin(), palettes[i].table.end()))
        << palettes[i].id;
  }
}

TEST(RpcErrors, NameTheFieldWithinTheRequest) {
  const auto field_of = [](const auto& alter) {
    fusion::FusionChange change;
    alter(change);
    return to_rpc_error(fusion::with_change(fusion::default_settings(), change).error()).field;
  };
  EXPECT_EQ(field_of([](auto& change) { change.params["alpha"] = 7.0; }), "params.alpha");
  EXPECT_EQ(field_of([](auto& change) { change.params["nothing"] = 7.0; }), "params.nothing");
  EXPECT_EQ(field_of([](auto& change) { change.method = "nothing"; }), "method");
  EXPECT_EQ(field_of([](auto& change) { change.palette = "nothing"; }), "palette");
  EXPECT_EQ(field_of([](auto& change) { change.range = fusion::RangeSetting::manual(2, 1); }), "range");
  EXPECT_EQ(field_of([](auto& change) { change.range = fusion::RangeSetting::percentile(2, 101); }), "range.high");
}

TEST(QualityMessages, RoundTheStepDownAndKeepTheRest) {
  protocol::QualityChange change;
  change.position_step_mm = 3;
  change.colour_bits = 5;
  const auto changed = with_change(stream::StreamQuality{}, change).value();
  EXPECT_EQ(changed.position_step_m, stream::lattice_step(0.003));
  EXPECT_EQ(changed.colour_bits, 5);
  EXPECT_EQ(changed.encoder_speed, stream::StreamQuality{}.encoder_speed);
  EXPECT_FALSE(to_message(changed).marks);
  change.marks = true;
  EXPECT_TRUE(to_message(with_change(changed, change).value()).marks);
  EXPECT_LE(to_message(changed).position_step_mm, 3);
}

TEST(QualityMessages, SwitchAutomaticQualityOnAndOff) {
  protocol::QualityChange change;
  change.mode = protocol::QualityMode::Auto;
  change.latency_target_ms = 120;
  const auto automatic = with_change(stream::StreamQuality{}, change).value();
  EXPECT_TRUE(automatic.automatic);
  EXPECT_EQ(automatic.latency_target_ms, 120);
  EXPECT_EQ(to_message(automatic).mode, protocol::QualityMode::Auto);
  protocol::QualityChange bits;
  bits.colour_bits = 6;
  EXPECT_TRUE(with_change(automatic, bits).value().automatic) << "what is absent stays";
  change.mode = protocol::QualityMode::Manual;
  EXPECT_FALSE(with_change(automatic, change).value().automatic);
}

}  // namespace
}  // namespace spectra::session
