#include "server/sources/block_options.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace spectra::sources {
namespace {

TEST(BlockOptions, AreThoseOfTheCommandLine) {
  const auto block = incoming_block("a", {{"observed_at", "1700000000.5"},
                                          {"sensor", "1,-2.5,3e2"},
                                          {"temperature_property", "heat"},
                                          {"colour_properties", "a,b,c"},
                                          {"colour_white", "4095"},
                                          {"temperature_unit", "kelvin"},
                                          {"no_data", "-9999"},
                                          {"no_data", "inf"},
                                          {"scale", "0.001"},
                                          {"up", "-y"}});
  ASSERT_TRUE(block) << block.error().message;
  EXPECT_EQ(block.value().observed_at, 1700000000.5);
  EXPECT_EQ(block.value().sensor, (base::Vec3d{1, -2.5, 300}));
  EXPECT_EQ(block.value().read.temperature_property, "heat");
  EXPECT_EQ(block.value().read.colour_properties, (std::vector<std::string>{"a", "b", "c"}));
  EXPECT_EQ(block.value().read.colour_white, 4095);
  EXPECT_EQ(block.value().read.temperature_unit, files::TemperatureUnit::Kelvin);
  EXPECT_EQ(block.value().read.no_data.size(), 2U);
  EXPECT_EQ(block.value().read.metres_per_unit, 0.001);
  EXPECT_EQ(block.value().read.up, base::UpAxis::MinusY);
}

TEST(BlockOptions, UpMayBeWrittenAsPeopleDo) {
  for (const char* up : {"Y", "+y", "+Y", "y"}) {
    const auto block = incoming_block("a", {{"up", up}});
    ASSERT_TRUE(block) << block.error().message;
    EXPECT_EQ(block.value().read.up, base::UpAxis::Y) << up;
  }
  EXPECT_EQ(incoming_block("a", {{"up", "-Z"}}).value().read.up, base::UpAxis::MinusZ);
  EXPECT_FALSE(incoming_block("a", {{"up", "+-z"}}));
}

TEST(BlockOptions, TimesThatCannotBeMeantAreRefused) {
  for (const std::string text : {"0", "1700000000.5", "1e11"}) {
    EXPECT_TRUE(incoming_block("a", {{"observed_at", text}})) << text;
  }
  for (const std::string text : {"1e300", "-5", "-0.001", "1700000000000", "1.1e11"}) {
    const auto block = incoming_block("a", {{"observed_at", text}});
    ASSERT_FALSE(block) << text;
    EXPECT_EQ(block.error().field, "observed_at");
    EXPECT_EQ(block.error().message.find("milliseconds") != std::string::npos,
              text == "1700000000000" || text == "1.1e11")
        << block.error().message;
  }
  EXPECT_EQ(limits_of("observed_at"), "0 to 1e11 seconds since 1970");
}

TEST(BlockOptions, ComeBackFromTheTextThatIsKept) {
  const auto block = incoming_block(
      "a",
      {{"temperature_property", "a=b"}, {"temperature_scale", "2"}, {"temperature_offset", "-3"}, {"no_data", "7"}});
  ASSERT_TRUE(block);
  const auto back = incoming_block("a", block.value().read_text);
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(back.value().read.temperature_property, "a=b");
  EXPECT_EQ(back.value().read.temperature_scale, 2);
  EXPECT_EQ(back.value().read.temperature_offset, -3);
  EXPECT_EQ(back.value().read.no_data, std::vector<double>{7});
  EXPECT_EQ(back.value().read_text, block.value().read_text);
}

TEST(BlockOptions, AreWrittenAsAQueryThatIsReadBack) {
  files::ReadOptions read;
  EXPECT_TRUE(query_of(read).empty());
  read.temperature_property = "heat";
  read.colour_properties = {"r0", "g0", "b0"};
  read.colour_white = 1023;
  read.temperature_scale = 0.1;
  read.temperature_offset = -273.15;
  read.no_data = {-9999, std::numeric_limits<double>::infinity()};
  read.metres_per_unit = 1e-3;
  read.up = base::UpAxis::MinusZ;
  const auto block = incoming_block("a", query_of(read));
  ASSERT_TRUE(block) << block.error().message;
  const files::ReadOptions& back = block.value().read;
  EXPECT_EQ(back.temperature_property, "heat");
  EXPECT_EQ(back.colour_properties, read.colour_properties);
  EXPECT_EQ(back.colour_white, 1023);
  EXPECT_EQ(back.temperature_scale, 0.1);
  EXPECT_EQ(back.temperature_offset, -273.15);
  EXPECT_EQ(back.no_data, read.no_data);
  EXPECT_EQ(back.metres_per_unit, 1e-3);
  EXPECT_EQ(back.up, read.up);
  files::ReadOptions unit;
  unit.temperature_unit = files::TemperatureUnit::Centikelvin;
  EXPECT_EQ(incoming_block("a", query_of(unit)).value().read.temperature_unit, unit.temperature_unit);
}

TEST(BlockOptions, NameTheFieldThatCannotBeMeant) {
  const auto field = [](const std::string& name, const std::string& value) {
    const auto block = incoming_block("a", {{name, value}});
    return block ? std::string() : block.error().field;
  };
  for (const char* name : {"observed_at", "sensor", "temperature_unit", "temperature_scale", "temperature_offset",
                           "no_data", "scale", "up", "colour"}) {
    EXPECT_EQ(field(name, "what"), name);
  }
  EXPECT_EQ(field("observed_at", "nan"), "observed_at");
  EXPECT_EQ(field("colour_white", "white"), "colour_white");
  EXPECT_EQ(field("colour_properties", "a,b"), "colour_properties");
  EXPECT_EQ(field("colour_properties", "a,,b"), "colour_properties");
  EXPECT_EQ(field("sensor", "1,2,3,4"), "sensor");
  EXPECT_EQ(field("temperature_property", "two\nlines"), "temperature_property");
  EXPECT_NE(field("scale", "0"), "");
}

}  // namespace
}  // namespace spectra::sources
