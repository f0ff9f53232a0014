#include "fusion/files/read_options.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "loaded.hpp"

namespace spectra::files {
namespace {

using test::kXyz;
using test::loaded;
using test::note_count;

/// A point cloud with one more property and these values of it.
std::string cloud(const std::string& property, const std::vector<std::string>& values) {
  std::string text = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(values.size()) + "\n" +
                     std::string(kXyz) + "property " + property + "\nend_header\n";
  for (const std::string& value : values) text += "1000 2 -3 " + value + "\n";
  return text;
}

ReadOptions unit_option(const std::string& name) {
  ReadOptions options;
  options.temperature_unit = temperature_unit(name);
  EXPECT_TRUE(options.temperature_unit.has_value()) << name;
  return options;
}

float first_celsius(const LoadedScene& scene) {
  return scene.mesh.temperature_celsius()[0];
}

TEST(ReadOptions, KnowTheUnitsOfTemperature) {
  EXPECT_EQ(first_celsius(loaded(cloud("float temperature", {"21.5"}), unit_option("celsius"))), 21.5F);
  EXPECT_EQ(first_celsius(loaded(cloud("float temperature", {"291.15"}), unit_option("kelvin"))), 18.0F);
  EXPECT_EQ(first_celsius(loaded(cloud("ushort temperature", {"29115"}), unit_option("centikelvin"))), 18.0F);
  EXPECT_EQ(first_celsius(loaded(cloud("double temperature", {"64.4"}), unit_option("fahrenheit"))), 18.0F);
  EXPECT_FALSE(temperature_unit("Rankine"));
}

TEST(ReadOptions, FindAbsoluteZeroInEveryUnit) {
  const std::vector<std::pair<std::string, std::string>> zeros = {
      {"celsius", "-273.15"}, {"kelvin", "0"}, {"centikelvin", "0"}, {"fahrenheit", "-459.67"}};
  for (const auto& [unit, zero] : zeros) {
    for (const std::string type : {"float", "double"}) {
      const LoadedScene scene = loaded(cloud(type + " temperature", {zero, "300"}), unit_option(unit));
      EXPECT_TRUE(std::isnan(first_celsius(scene))) << unit << " " << type << " " << first_celsius(scene);
      EXPECT_EQ(note_count(scene, "impossible_temperatures"), 1U) << unit << " " << type;
    }
  }
}

TEST(ReadOptions, ScaleTemperatures) {
  ReadOptions options;
  options.temperature_scale = 0.1;
  options.temperature_offset = -40;
  EXPECT_EQ(first_celsius(loaded(cloud("ushort temperature", {"615"}), options)), 21.5F);
  options.temperature_scale.reset();
  EXPECT_EQ(first_celsius(loaded(cloud("short temperature", {"61"}), options)), 21.0F);
  options.temperature_scale = -1;
  const LoadedScene scene = loaded(cloud("float temperature", {"inf", "-inf", "5"}), options);
  EXPECT_EQ(first_celsius(scene), -std::numeric_limits<float>::infinity());
  EXPECT_EQ(note_count(scene, "over_range_temperatures"), 1U);
}

TEST(ReadOptions, NameValuesThatAreNone) {
  ReadOptions options = unit_option("kelvin");
  options.no_data = {-9999.9, 65535, std::numeric_limits<double>::infinity()};
  const LoadedScene scene = loaded(cloud("float temperature", {"-9999.9", "65535", "inf", "300", "nan"}), options);
  EXPECT_EQ(note_count(scene, "no_data_temperatures"), 3U);
  EXPECT_EQ(note_count(scene, "missing_temperatures"), 4U);
  EXPECT_EQ(note_count(scene, "impossible_temperatures"), 0U);
  EXPECT_EQ(note_count(scene, "over_range_temperatures"), 0U);
  EXPECT_FLOAT_EQ(scene.mesh.temperature_celsius()[3], 26.85F);
}

std::string unused_text(const LoadedScene& scene) {
  for (const Note& note : scene.notes) {
    if (note.id == "unused_options") return note.message;
  }
  return {};
}

TEST(ReadOptions, WithoutEffectAreSaid) {
  ReadOptions options;
  options.no_data = {-9999, 65535, 12345.5};
  const std::string file = cloud("float temperature", {"20", "65535", "21"});
  EXPECT_EQ(unused_text(loaded(file, options)),
            "No temperature of the file, in its own unit, has this --no-data value: -9999, 12345.5");
  EXPECT_EQ(unused_text(loaded(cloud("float temperature", {"-9999", "65535", "12345.5"}), options)), "");
  EXPECT_EQ(unused_text(loaded(file)), "");
  options.temperature_offset = 1;
  EXPECT_EQ(unused_text(loaded(cloud("uchar red", {"20"}), options)),
            "There is no temperature, so these have no effect: --temperature-offset, --no-data");
  EXPECT_EQ(unused_text(loaded(cloud("uchar red", {"20"}), unit_option("kelvin"))),
            "There is no temperature, so these have no effect: --temperature-unit");
  options = {};
  options.metres_per_unit = 0.001;
  EXPECT_EQ(unused_text(loaded(cloud("uchar red", {"20"}), options)), "");
}

TEST(ReadOptions, NameThePropertyOfTheTemperature) {
  ReadOptions options;
  options.temperature_property = "Quality";
  EXPECT_EQ(first_celsius(loaded(cloud("float quality", {"20"}), options)), 20.0F);
  EXPECT_EQ(first_celsius(loaded(cloud("uchar quality\nproperty float Quality", {"20 30"}), options)), 30.0F);
  EXPECT_EQ(first_celsius(loaded(cloud("float temperature\nproperty int Quality", {"20 30"}), options)), 30.0F);
  const auto missing = test::read_bytes(cloud("float temperature", {"20"}), options);
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, base::ErrorCode::Unsupported);
  EXPECT_NE(missing.error().message.find("'Quality'"), std::string::npos) << missing.error().message;
}

TEST(ReadOptions, ScalePositions) {
  ReadOptions options;
  options.metres_per_unit = 0.001;
  const LoadedScene scene = loaded(cloud("float temperature", {"20"}), options);
  EXPECT_DOUBLE_EQ(scene.mesh.origin.x + static_cast<double>(scene.mesh.positions()[0].x), 1.0);
  EXPECT_NEAR(scene.mesh.origin.z + static_cast<double>(scene.mesh.positions()[0].z), -0.003, 1e-9);
}

TEST(ReadOptions, AreRefusedWhenTheyCannotBeMeant) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  std::vector<ReadOptions> bad(15);
  bad[0].temperature_scale = 0;
  bad[1].temperature_scale = infinity;
  bad[2].temperature_offset = nan;
  bad[3].no_data = {1, nan};
  bad[4].metres_per_unit = 0;
  bad[5].metres_per_unit = -1;
  bad[6].metres_per_unit = infinity;
  bad[7].temperature_unit = TemperatureUnit::Kelvin;
  bad[7].temperature_offset = 1;
  bad[8].metres_per_unit = nan;
  bad[9].metres_per_unit = 1e300;
  bad[10].metres_per_unit = 1e-300;
  bad[11].temperature_scale = -1e300;
  bad[12].temperature_scale = 1e-300;
  bad[13].temperature_scale = nan;
  bad[14].temperature_offset = -1e308;
  for (std::size_t i = 0; i < bad.size(); ++i) {
    const auto scene = test::read_bytes(cloud("float temperature", {"20"}), bad[i]);
    ASSERT_FALSE(scene) << i;
    EXPECT_LT(static_cast<int>(scene.error().code), static_cast<int>(base::ErrorCode::FileNotFound)) << i;
    EXPECT_FALSE(scene.error().field.empty()) << i;
  }
}

TEST(ReadOptions, LengthsFromAtomsToLightYearsAreTaken) {
  for (const double metres : {1e-10, 9.46e15}) {
    ReadOptions options;
    options.metres_per_unit = metres;
    const LoadedScene scene = loaded(cloud("float temperature", {"20"}), options);
    EXPECT_EQ(scene.mesh.origin.x + static_cast<double>(scene.mesh.positions()[0].x), 1000 * metres);
    EXPECT_TRUE(scene.notes.empty());
  }
}

}  // namespace
}  // namespace spectra::files
