#include "server/app/settings_text.hpp"

#include <gtest/gtest.h>

#include "fusion/registry.hpp"

namespace spectra::server {
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
  EXPECT_EQ(settings.range, (fusion::RangeSetting{false, -10, 40.5}));
  EXPECT_EQ(settings.missing, (fusion::Rgb8{255, 128, 0}));
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
}  // namespace spectra::server
