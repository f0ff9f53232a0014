#include "fusion/settings.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <tuple>

#include "fusion/registry.hpp"

namespace spectra::fusion {
namespace {

FusionChange to_method(const std::string& id, ParameterValues params = {}) {
  FusionChange change;
  change.method = id;
  change.params = std::move(params);
  return change;
}

TEST(FusionSettings, DefaultsAreABlendInIron) {
  const FusionSettings settings = default_settings();
  EXPECT_EQ(settings.method, "thermal_visible_blend");
  EXPECT_EQ(settings.params, (ParameterValues{{"alpha", 0.5}}));
  EXPECT_EQ(settings.palette, "iron");
  EXPECT_EQ(settings.range, RangeSetting{});
  EXPECT_EQ(settings.missing, std::nullopt);
}

TEST(FusionSettings, EveryMethodStartsAtCompleteValidDefaults) {
  for (const Method* method : all_methods()) {
    const auto settings = with_change(default_settings(), to_method(method->id));
    ASSERT_TRUE(settings.has_value()) << method->id;
    EXPECT_EQ(settings.value().params.size(), method->parameters.size());
    for (const Parameter& parameter : method->parameters) {
      EXPECT_EQ(validated(parameter, settings.value().params.at(parameter.name)).value(), parameter.default_value)
          << method->id << " " << parameter.name;
      EXPECT_FALSE(parameter.label.empty());
      EXPECT_FALSE(parameter.help.empty());
    }
  }
}

TEST(FusionSettings, ParametersMergeAndANewMethodStartsAtItsDefaults) {
  FusionSettings settings =
      with_change(default_settings(), to_method("monochrome_threshold", {{"hue", 120.0}})).value();
  settings = with_change(settings, to_method("monochrome_threshold", {{"alpha", 0.25}})).value();
  EXPECT_EQ(settings.params.at("hue"), ParameterValue{120.0});
  EXPECT_EQ(settings.params.at("alpha"), ParameterValue{0.25});
  settings = with_change(settings, to_method("colour_mapped_threshold")).value();
  EXPECT_EQ(settings.params.at("alpha"), ParameterValue{0.85});
  EXPECT_FALSE(settings.params.contains("hue"));
}

TEST(FusionSettings, AnEmptyChangeChangesNothing) {
  EXPECT_EQ(with_change(default_settings(), {}).value(), default_settings());
}

TEST(FusionSettings, RefusalsNameTheField) {
  const auto expect_error = [](const FusionChange& change, base::ErrorCode code, const std::string& field) {
    const auto result = with_change(default_settings(), change);
    ASSERT_TRUE(result.has_error()) << field;
    EXPECT_EQ(result.error().code, code) << result.error().message;
    EXPECT_EQ(result.error().field, field);
  };
  expect_error(to_method("nothing"), base::ErrorCode::UnknownMethod, "method");
  expect_error(to_method("thermal_visible_blend", {{"hue", 1.0}}), base::ErrorCode::UnknownParameter, "hue");
  expect_error(to_method("thermal_visible_blend", {{"alpha", 1.5}}), base::ErrorCode::OutOfRange, "alpha");
  expect_error(to_method("thermal_visible_blend", {{"alpha", true}}), base::ErrorCode::WrongType, "alpha");
  FusionChange palette;
  palette.palette = "grey";
  expect_error(palette, base::ErrorCode::UnknownPalette, "palette");
  FusionChange range;
  range.range = RangeSetting::manual(30, 20);
  expect_error(range, base::ErrorCode::Inconsistent, "range");
  range.range = RangeSetting::manual(std::nan(""), 20);
  expect_error(range, base::ErrorCode::OutOfRange, "range");
  range.range = RangeSetting::manual(0, std::numeric_limits<double>::infinity());
  expect_error(range, base::ErrorCode::OutOfRange, "range");
}

TEST(FusionSettings, LowAboveHighIsAnErrorOnlyWhenBothSidesAreOn) {
  const ParameterValues crossed = {{"low", 30.0}, {"high", 20.0}};
  const auto both = with_change(default_settings(), to_method("thermal_highlighting", crossed));
  ASSERT_TRUE(both.has_error());
  EXPECT_EQ(both.error().code, base::ErrorCode::Inconsistent);
  EXPECT_EQ(both.error().field, "low");
  ParameterValues hot = crossed;
  hot["sides"] = std::string("hot");
  const auto one_side = with_change(default_settings(), to_method("thermal_highlighting", hot));
  ASSERT_TRUE(one_side.has_value());
  FusionChange back;
  back.params["sides"] = std::string("both");
  EXPECT_TRUE(with_change(one_side.value(), back).has_error());
  EXPECT_TRUE(
      with_change(default_settings(), to_method("thermal_highlighting", {{"low", 20.0}, {"high", 20.0}})).has_value());
}

TEST(FusionSettings, PercentilesAreSharesInOrder) {
  const auto changed = [](double low, double high) {
    FusionChange change;
    change.range = RangeSetting::percentile(low, high);
    return with_change(default_settings(), change);
  };
  EXPECT_EQ(changed(0.5, 99.5).value().range, RangeSetting::percentile(0.5, 99.5));
  EXPECT_TRUE(changed(0, 100).has_value());
  for (const auto& [low, high, field] :
       {std::tuple(-1.0, 99.0, "range.low"), std::tuple(1.0, 100.5, "range.high"),
        std::tuple(std::nan(""), 99.0, "range.low"), std::tuple(50.0, 50.0, "range.low"),
        std::tuple(60.0, 40.0, "range.low"), std::tuple(1.0, std::nan(""), "range.high")}) {
    const auto refused = changed(low, high);
    ASSERT_TRUE(refused.has_error()) << low << " " << high;
    EXPECT_EQ(refused.error().field, field);
    EXPECT_NE(refused.error().message.find("100"), std::string::npos) << refused.error().message;
  }
}

TEST(FusionSettings, TheFirstViewShowsOutliersOrWhatThereIs) {
  TemperatureSummary scene;
  EXPECT_EQ(first_view_settings(scene).method, "visible_only");
  scene.finite_count = 10;
  const FusionSettings first = first_view_settings(scene);
  EXPECT_EQ(first.method, "histogram_distribution");
  EXPECT_EQ(first.range, RangeSetting::percentile(0.5, 99.5));
  EXPECT_EQ(with_change(first, {}).value(), first) << "complete and valid";
}

TEST(FusionSettings, AutomaticRangeForgetsHandSetValues) {
  FusionChange manual;
  manual.range = RangeSetting::manual(10, 40);
  const FusionSettings by_hand = with_change(default_settings(), manual).value();
  EXPECT_EQ(by_hand.range.minimum_celsius, 10);
  FusionChange automatic;
  automatic.range = RangeSetting{.mode = RangeMode::Auto, .minimum_celsius = 1, .maximum_celsius = 2};
  EXPECT_EQ(with_change(by_hand, automatic).value(), default_settings());
}

TEST(FusionSettings, AgePartsMergeAndAHalfLifeHasItsLimits) {
  FusionChange change;
  change.age = {AgeMode::Fade, 60};
  const FusionSettings minute = with_change(default_settings(), change).value();
  change.age = {AgeMode::Off, std::nullopt};
  const FusionSettings off = with_change(minute, change).value();
  EXPECT_EQ(off.age.half_life_s, 60) << "what was set comes back with the fade";
  EXPECT_EQ(off, default_settings()) << "while it is off it shows nothing";
  for (const double wrong : {0.0, -1.0, 0.999, 1e300, std::nan(""), std::numeric_limits<double>::infinity()}) {
    change.age = {std::nullopt, wrong};
    const auto refused = with_change(minute, change);
    ASSERT_FALSE(refused.has_value()) << wrong;
    EXPECT_EQ(refused.error().code, base::ErrorCode::OutOfRange);
    EXPECT_EQ(refused.error().field, "age.half_life_s");
    EXPECT_NE(refused.error().message.find("at least 1 and of at most 10000000"), std::string::npos);
  }
}

TEST(FusionSettings, CacheKeysAreEqualExactlyForEqualSettings) {
  std::vector<FusionSettings> all = {default_settings()};
  for (const Method* method : all_methods()) {
    if (method->id != "thermal_visible_blend")
      all.push_back(with_change(default_settings(), to_method(method->id)).value());
  }
  FusionChange change;
  change.params["alpha"] = std::nextafter(0.4, 1);
  all.push_back(with_change(default_settings(), change).value());
  change = {};
  change.age.mode = AgeMode::Fade;
  all.push_back(with_change(default_settings(), change).value());
  change.age.half_life_s = 60;
  all.push_back(with_change(default_settings(), change).value());
  change = {};
  change.palette = "rainbow";
  all.push_back(with_change(default_settings(), change).value());
  change = {};
  change.range = RangeSetting::percentile();
  all.push_back(with_change(default_settings(), change).value());
  change.range = RangeSetting::percentile(1, 98);
  all.push_back(with_change(default_settings(), change).value());
  change.range = RangeSetting::manual(0, 0);
  all.push_back(with_change(default_settings(), change).value());
  change = {};
  change.missing = MissingDisplay{base::Rgb8{0, 0, 0}};
  all.push_back(with_change(default_settings(), change).value());
  for (std::size_t a = 0; a < all.size(); ++a) {
    for (std::size_t b = 0; b < all.size(); ++b) {
      EXPECT_EQ(cache_key(all[a]) == cache_key(all[b]), a == b) << cache_key(all[a]);
    }
  }
  change = {};
  change.range = RangeSetting::manual(-0.0, 0.0);
  EXPECT_EQ(cache_key(with_change(default_settings(), change).value()), cache_key(all[all.size() - 2]));
}

}  // namespace
}  // namespace spectra::fusion
