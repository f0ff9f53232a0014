#include "server/session/settings_text.hpp"

#include <gtest/gtest.h>

#include "fusion/registry.hpp"

namespace spectra::session {
namespace {

TEST(SettingsText, OfNothingAreTheDefaults) {
  EXPECT_EQ(settings_from_text({}).value(), fusion::default_settings());
}

TEST(SettingsText, SetsEverythingThatIsWritten) {
  SettingsText text;
  text.method = "thermal_highlighting";
  text.params = {{"low", "12.5"}, {"high", "auto"}, {"sides", "hot"}, {"k", "2"}};
  text.palette = "turbo";
  text.range = "-10:40.5";
  text.missing = "#Ff8000";
  const auto settings = settings_from_text(text).value();
  EXPECT_EQ(settings.method, "thermal_highlighting");
  EXPECT_EQ(std::get<double>(settings.params.at("low")), 12.5);
  EXPECT_TRUE(std::holds_alternative<fusion::Automatic>(settings.params.at("high")));
  EXPECT_EQ(std::get<std::string>(settings.params.at("sides")), "hot");
  EXPECT_EQ(settings.palette, "turbo");
  EXPECT_EQ(settings.range, (fusion::RangeSetting::manual(-10, 40.5)));
  EXPECT_EQ(settings.missing, (base::Rgb8{255, 128, 0}));
}

TEST(SettingsText, ReadsPercentiles) {
  EXPECT_EQ(range_from_text("percentile").value(), fusion::RangeSetting::percentile(1, 99));
  EXPECT_EQ(range_from_text("percentile:0.5:99.5").value(), fusion::RangeSetting::percentile(0.5, 99.5));
  SettingsText text;
  text.range = "percentile:0:100";
  EXPECT_EQ(settings_from_text(text).value().range, fusion::RangeSetting::percentile(0, 100));
  for (const auto* wrong : {"percentile:", "percentile:1", "percentiles", "percentile:a:b", "percent:1:99"}) {
    text.range = wrong;
    const auto refused = settings_from_text(text);
    ASSERT_FALSE(refused) << wrong;
    EXPECT_EQ(refused.error().field, "range");
    EXPECT_NE(refused.error().message.find("percentile:LO:HI"), std::string::npos) << refused.error().message;
  }
  for (const auto* wrong : {"percentile:-1:50", "percentile:60:40", "percentile:50:50"}) {
    text.range = wrong;
    EXPECT_EQ(settings_from_text(text).error().field, "range.low") << wrong;
  }
  text.range = "percentile:1:101";
  EXPECT_EQ(settings_from_text(text).error().field, "range.high");
}

TEST(SettingsText, TakesTheDefaultOfEveryParameterOfEveryMethod) {
  for (const fusion::Method* method : fusion::all_methods()) {
    SettingsText text;
    text.method = method->id;
    const auto settings = settings_from_text(text);
    ASSERT_TRUE(settings) << method->id;
    EXPECT_EQ(settings.value().params.size(), method->parameters.size());
  }
}

TEST(SettingsText, NamesWhatIsWrong) {
  const auto field = [](const SettingsText& text) {
    const auto settings = settings_from_text(text);
    return settings ? std::string("nothing") : settings.error().field;
  };
  EXPECT_EQ(field({.method = "no_such"}), "method");
  EXPECT_EQ(field({.method = "no_such", .params = {{"alpha", "1"}}}), "method");
  EXPECT_NE(field({.params = {{"gamma", "1"}}}).find("gamma"), std::string::npos);
  EXPECT_NE(field({.params = {{"alpha", "1x"}}}).find("alpha"), std::string::npos);
  EXPECT_NE(field({.params = {{"alpha", "nan"}}}).find("alpha"), std::string::npos);
  EXPECT_NE(field({.params = {{"alpha", ""}}}).find("alpha"), std::string::npos);
  EXPECT_EQ(field({.palette = "mauve"}), "palette");
  for (const auto* range : {"", "1", "1:", ":1", "1:2:3", "a:b", "nan:1", "1:inf", "2:1", "Auto", "1e999:2"}) {
    EXPECT_EQ(field({.range = range}), "range") << range;
  }
  for (const auto* missing : {"", "#", "#12345", "#1234567", "#12345g", "red", "#-12345", "ff0000"}) {
    EXPECT_EQ(field({.missing = missing}), "missing") << missing;
  }
}

TEST(MissingText, ComesBackAsItWas) {
  for (const auto* text : {"visible", "#000000", "#ff00ff", "#0a0b0c"}) {
    EXPECT_EQ(missing_to_text(missing_from_text(text).value()), text);
  }
}

}  // namespace
}  // namespace spectra::session
