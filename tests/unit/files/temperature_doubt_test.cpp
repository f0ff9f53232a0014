// Which unit temperatures may be in that are hard to believe as degrees Celsius.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "loaded.hpp"

namespace spectra::files {
namespace {

using test::kXyz;
using test::loaded;
using test::note_count;
using test::note_text;

/// What is said of `count` values from `low` on in even steps, then of the others.
std::string said(std::string_view type, double low, double step, int count, const std::vector<std::string>& others = {},
                 const std::string& name = "temperature") {
  std::string body;
  for (int i = 0; i < count; ++i) body += std::to_string(i) + " 0 0 " + std::to_string(low + step * i) + "\n";
  for (const std::string& other : others) body += "0 1 0 " + other + "\n";
  const std::string head = "ply\nformat ascii 1.0\nelement vertex " +
                           std::to_string(static_cast<std::size_t>(count) + others.size()) + "\n" + std::string(kXyz) +
                           "property " + std::string(type) + " " + name + "\nend_header\n";
  return note_text(loaded(head + body), "implausible_temperatures");
}

void expect_in(const std::string& part, const std::string& text) {
  EXPECT_NE(text.find(part), std::string::npos) << "'" << part << "' is not in: " << text;
}

TEST(TemperatureDoubt, SeveralJustAboveWhatCanBeAreHundredthsAndNoMissingOnes) {
  for (const char* type : {"short", "int", "float", "double"}) {
    for (const std::vector<std::string>& warm :
         {std::vector<std::string>{"3601", "3644", "3620"}, {"3001", "3100"}, {"4400", "4500", "3100"}}) {
      const std::string text = said(type, 1800, 6, 100, warm);
      expect_in("hundredths of a degree (18 to ", text);
      expect_in("--temperature-scale 0.01", text);
      EXPECT_EQ(text.find("no-data"), std::string::npos) << text;
    }
  }
  // Means of hundredths are not whole.
  expect_in("hundredths of a degree", said("float", 1800.5, 6.25, 100, {"3601.5", "3644.25"}));
  expect_in("hundredths of a degree (5 to 59.45 degC): --temperature-scale 0.01, or like counts of a sensor",
            said("int", 500, 55, 100));
  // One of them may be above what can be, and none.
  for (const char* type : {"short", "float", "double"}) {
    for (const double step : {7.0, 7.25}) {
      if (step != 7 && type == std::string_view("short")) continue;
      const std::string all = said(type, 1800, step, 150);
      expect_in("hundredths", all);
      expect_in("--temperature-scale 0.01", all);
      EXPECT_EQ(all.find("no-data"), std::string::npos) << all;
      const std::string one = said(type, 1800, step, 150, {"3168"});
      expect_in("--temperature-scale 0.01", one);
      expect_in("; if 3168 stands for no data, --no-data 3168", one);
    }
  }
  // A fire is none, nor a kiln with something colder beside it.
  EXPECT_EQ(said("float", 151.5, 3.25, 100), "");
  EXPECT_EQ(said("float", 900.5, 3.25, 100), "");
  // One value that stands alone, beside degrees or hundredths.
  expect_in("--no-data 9999", said("int", 18, 1, 30, {"9999", "9999"}));
  expect_in("--no-data 9999", said("int", 18, 1, 30, {"9999", "9000"}));
}

TEST(TemperatureDoubt, SeveralBelowAbsoluteZeroAreHundredths) {
  for (const char* type : {"short", "float"}) {
    const std::string text = said(type, -500, 40, 100, {"3590"});
    expect_in("hundredths of a degree (-5 to 35.9 degC): --temperature-scale 0.01", text);
    EXPECT_EQ(text.find("no-data"), std::string::npos) << text;
  }
  EXPECT_EQ(said("float", 15, 1, 40, {"-9999", "-999", "-9999"}), "");
}

TEST(TemperatureDoubt, NoReadingHasDegreesBelowAbsoluteZero) {
  for (const char* none : {"-9999", "-10000", "-9999.9"}) {
    for (const char* type : {"float", "double"}) {
      const std::string kelvin = said(type, 290, 1, 40, {none, none});
      expect_in("tenths of a degree (29 to 32.9 degC): --temperature-scale 0.1, or like kelvin (16.85 to 55.85 degC)",
                kelvin);
      EXPECT_EQ(kelvin.find("no-data"), std::string::npos) << kelvin;
      const std::string tenths = said(type, 2800, 10, 40, {none, none});
      expect_in("hundredths of a degree (28 to 31.9 degC): --temperature-scale 0.01 --no-data " + std::string(none) +
                    " where that stands for none, or like tenths of kelvin (6.85 to 45.85 degC)",
                tenths);
      // Also beside those that are cold themselves.
      expect_in("hundredths of a degree (-5 to 35.9 degC): --temperature-scale 0.01 --no-data " + std::string(none),
                said(type, -500, 40, 100, {none, "3590", none}));
    }
  }
  expect_in("(which would make them 226.85 to 324.85 degC)",
            said("int", 500, 2, 50, {"-300", "-400"}, "temperature_kelvin"));
  // One number may stand for none.
  expect_in("tenths of a degree (29 to 32.9 degC)", said("int", 290, 1, 40, {"-999", "-999"}));
}

TEST(TemperatureDoubt, TenthsAreNamedBesideKelvin) {
  for (const char* type : {"short", "float"}) {
    expect_in("tenths of a degree (18 to 35.7 degC): --temperature-scale 0.1", said(type, 180, 3, 60));
    const std::string both = said(type, 200, 2, 60, {"2499"});
    expect_in("tenths of a degree (20 to 249.9 degC): --temperature-scale 0.1, or like kelvin (-73.15 to 2225.85 degC)",
              both);
    expect_in("--temperature-unit kelvin", both);
  }
  // No fractions of a kelvin are known to have tenths of a degree; and degrees are degrees.
  EXPECT_EQ(said("float", 290.05, 0.1, 60).find("tenths"), std::string::npos);
  EXPECT_EQ(said("short", 18, 3, 60), "");
}

/// 600 values from 15 to 27 degC as they are measured, every third of which is this.
LoadedScene third_of(double number, double low = 15, double range = 12, const ReadOptions& options = {},
                     bool is_whole = false) {
  std::string body;
  for (int i = 0; i < 600; ++i) {
    const double own = low + range * std::fmod(i * 0.618, 1);
    body += std::to_string(i) + " 0 0 " + std::to_string(i % 3 == 0 ? number : is_whole ? std::round(own) : own) + "\n";
  }
  return loaded("ply\nformat ascii 1.0\nelement vertex 600\n" + std::string(kXyz) +
                    "property float temperature\nend_header\n" + body,
                options);
}

TEST(TemperatureDoubt, ANumberThatManyShareFarFromAllOthersIsAskedAbout) {
  for (const char* text : {"999", "1000", "2000", "3000", "-99", "-99.99", "-100", "500", "99.9", "327.67"}) {
    const double number = std::stod(text);
    const LoadedScene scene = third_of(number);
    EXPECT_EQ(note_count(scene, "implausible_temperatures"), 200U) << text;
    expect_in("200 are exactly " + std::string(text), note_text(scene, "implausible_temperatures"));
    expect_in("if " + std::string(text) + " stands for no data, --no-data " + text,
              note_text(scene, "implausible_temperatures"));
    EXPECT_EQ(scene.mesh.temperature_celsius()[0], static_cast<float>(number)) << "kept";
    ReadOptions named;
    named.no_data = {number};
    EXPECT_EQ(note_text(third_of(number, 15, 12, named), "implausible_temperatures"), "") << text;
  }
  for (const double number : {999.0, 1000.0, -99.0, -100.0, 400.0}) {
    expect_in("200 are exactly", note_text(third_of(number, 15, 14, {}, true), "implausible_temperatures"));
  }
  // Beside another unit, which is asked about first.
  expect_in("look like kelvin: --temperature-unit kelvin; if 999 stands for no data, --no-data 999",
            note_text(third_of(999, 288.5, 12), "implausible_temperatures"));
  ReadOptions kelvin;
  kelvin.temperature_unit = TemperatureUnit::Kelvin;
  expect_in(
      "200 temperatures are exactly 999 in the file, far from all others: if that stands for no data, --no-data 999",
      note_text(third_of(999, 288.5, 12, kelvin), "implausible_temperatures"));
  EXPECT_EQ(note_text(third_of(300, 288.5, 12, kelvin), "implausible_temperatures"), "");
}

TEST(TemperatureDoubt, TwoNumbersForNoneAreAskedAboutBoth) {
  const auto beside = [](std::vector<const char*> numbers, const char* type = "float") {
    std::vector<std::string> others;
    for (const char* number : numbers) others.insert(others.end(), 30, number);
    return said(type, 18, 0.25, 60, others);
  };
  for (const auto& [none, other] : std::vector<std::pair<const char*, const char*>>{{"-99", "99"},
                                                                                    {"-99.99", "999"},
                                                                                    {"0", "65535"},
                                                                                    {"0", "9999"},
                                                                                    {"0", "99"},
                                                                                    {"-200", "9999"},
                                                                                    {"-100", "1000"}}) {
    const std::string text = beside({none, other});
    expect_in(std::string("if ") + none + " stands for no data, --no-data " + none, text);
    expect_in(std::string("if ") + other + " stands for no data, --no-data " + other, text);
  }
  // Also where the unit is in doubt, and where it is told.
  std::vector<std::string> others(30, "65535");
  others.resize(60, "-99");
  const std::string kelvin = said("float", 290, 0.25, 60, others);
  expect_in("look like kelvin", kelvin);
  expect_in("--no-data 65535; if -99 stands for no data, --no-data -99", kelvin);
  ReadOptions options;
  options.temperature_unit = TemperatureUnit::Celsius;
  std::string body =
      "ply\nformat ascii 1.0\nelement vertex 120\n" + std::string(kXyz) + "property float temperature\nend_header\n";
  for (int i = 0; i < 120; ++i)
    body += std::to_string(i) + " 0 0 " + (i < 60 ? std::to_string(20 + 0.1 * i) : i < 90 ? "-99" : "99") + "\n";
  const LoadedScene scene = loaded(body, options);
  EXPECT_EQ(note_count(scene, "implausible_temperatures"), 60U);
  expect_in("--no-data 99; 30 temperatures are exactly -99 in the file", note_text(scene, "implausible_temperatures"));
  // Room temperatures between two plateaus are nothing of the kind.
  EXPECT_EQ(beside({"10", "60"}), "");
}

TEST(TemperatureDoubt, PlateausAreNoQuestion) {
  EXPECT_EQ(note_text(third_of(40), "implausible_temperatures"), "") << "a warm thing";
  EXPECT_EQ(note_text(third_of(27.5), "implausible_temperatures"), "") << "the end of a range";
  EXPECT_EQ(note_text(third_of(150, 15, 134), "implausible_temperatures"), "") << "a sensor that is full";
  EXPECT_EQ(note_text(third_of(60, 15, 1), "implausible_temperatures"), "")
      << "one that has been given its temperature";
  EXPECT_EQ(note_text(third_of(-40, 15, 1), "implausible_temperatures"), "");
  // Things that have been given one temperature each.
  std::string body;
  for (int i = 0; i < 600; ++i)
    body += std::to_string(i) + " 0 0 " + (i % 9 == 0 ? "80\n" : i % 2 == 0 ? "19\n" : "21\n");
  EXPECT_EQ(note_text(loaded("ply\nformat ascii 1.0\nelement vertex 600\n" + std::string(kXyz) +
                             "property float temperature\nend_header\n" + body),
                      "implausible_temperatures"),
            "");
  // Eleven of a number may be by chance.
  EXPECT_EQ(said("float", 15.01, 0.01, 600, std::vector<std::string>(11, "999")), "");
  expect_in("12 are exactly 999", said("float", 15.01, 0.01, 600, std::vector<std::string>(12, "999")));
}

TEST(TemperatureDoubt, KelvinMayHaveAFire) {
  for (const int fire : {20, 200, 400}) {
    std::vector<std::string> hot;
    for (int i = 0; i < fire; ++i) hot.push_back(std::to_string(401.3 + i));
    expect_in("look like kelvin: --temperature-unit kelvin", said("float", 288.1, 0.05, 300, hot));
  }
  // A fire in degrees has cooler things about.
  std::vector<std::string> hot;
  for (int i = 0; i < 400; ++i) hot.push_back(std::to_string(250.3 + i));
  EXPECT_EQ(said("float", 15.1, 0.05, 300, hot), "");
}

}  // namespace
}  // namespace spectra::files
