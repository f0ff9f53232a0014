#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <mutex>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "fusion/files/ply_reader.hpp"
#include "loaded.hpp"

namespace spectra::files {
namespace {

using test::note_count;
using test::note_text;

std::string visible_file(const std::string& positions, int count) {
  return "ply\nformat ascii 1.0\nelement vertex " + std::to_string(count) + "\n" + std::string(test::kXyz) +
         "end_header\n" + positions;
}

std::string thermal_file(const std::string& lines, int count) {
  return "ply\nformat ascii 1.0\nelement vertex " + std::to_string(count) + "\n" + std::string(test::kXyz) +
         "property float temperature\nend_header\n" + lines;
}

/// The same lines, each with something more.
std::string visible_with(std::string lines, const std::string& more) {
  for (std::size_t at = lines.find('\n'); at != std::string::npos; at = lines.find('\n', at + more.size() + 1)) {
    lines.insert(at, more);
  }
  return lines;
}

base::Result<LoadedScene> joined(const std::string& visible, const std::string& thermal, double distance = 0) {
  const test::TemporaryFolder folder;
  return read_ply_with_thermal(folder.write("v.ply", visible), folder.write("t.ply", thermal), {}, distance);
}

TEST(ThermalJoin, TakesTheSameNumberInOrder) {
  const auto scene =
      joined(visible_file("0 0 0\n1 0 0\n2 0 0\n", 3), thermal_file("0 0 0 20\n1 0 0 nan\n2 0 0 22\n", 3));
  ASSERT_TRUE(scene);
  EXPECT_TRUE(scene.value().mesh.has_temperature);
  EXPECT_EQ(scene.value().mesh.temperature_celsius()[0], 20);
  EXPECT_TRUE(std::isnan(scene.value().mesh.temperature_celsius()[1]));
  EXPECT_EQ(scene.value().mesh.temperature_celsius()[2], 22);
  EXPECT_EQ(note_count(scene.value(), "thermal_joined_in_order"), 3U);
  EXPECT_EQ(note_count(scene.value(), "missing_temperatures"), 1U);
  EXPECT_EQ(note_count(scene.value(), "thermal_positions_differ"), 0U);
}

TEST(ThermalJoin, TakesTheSameNumberByPlaceWhereTheOrderDiffers) {
  const auto scene =
      joined(visible_file("0 0 0\n1 0 0\n0 3 0\n", 3), thermal_file("1 0 0 20\n0 3 0 22\n0 0 0 21\n", 3));
  ASSERT_TRUE(scene);
  EXPECT_EQ(scene.value().mesh.temperature_celsius()[0], 21);
  EXPECT_EQ(scene.value().mesh.temperature_celsius()[1], 20);
  EXPECT_EQ(scene.value().mesh.temperature_celsius()[2], 22);
  EXPECT_EQ(note_count(scene.value(), "thermal_joined_in_order"), 0U);
  EXPECT_EQ(note_count(scene.value(), "thermal_joined_nearest"), 3U);
}

TEST(ThermalJoin, BearsTheRoundingOfFiles) {
  // Floats of such a size are 0.5 m apart.
  const auto scene = joined(visible_file("412345.6 5461234.5 0\n412346.6 5461236.4 0\n412345.1 5461240.9 0\n", 3),
                            thermal_file("412345.625 5461234.5 0 1\n412346.59 5461236 0 2\n412345.1 5461241 0 3\n", 3));
  ASSERT_TRUE(scene);
  EXPECT_EQ(note_count(scene.value(), "thermal_joined_in_order"), 3U);
}

TEST(ThermalJoin, TakesSmallThingsInALargeSceneByPlaceWhereTheirOrderDiffers) {
  // A map of 4 km, a ten-thousandth of which is larger than a label of 6 cm with four vertices in it.
  std::string visible, thermal, label = "2000 2000 5 31\n2000.02 2000 5 32\n2000.04 2000 5 33\n2000.06 2000 5 34\n";
  for (int i = 0; i < 100; ++i) {
    const std::string place = std::to_string(400 * (i % 10)) + ' ' + std::to_string(400 * (i / 10)) + " 0";
    visible += place + '\n';
    thermal += place + " 20\n";
  }
  visible += "2000.06 2000 5\n2000.02 2000 5\n2000 2000 5\n2000.04 2000 5\n";
  const auto scene = joined(visible_file(visible, 104), thermal_file(thermal + label, 104));
  ASSERT_TRUE(scene);
  EXPECT_EQ(note_count(scene.value(), "thermal_joined_in_order"), 0U);
  const auto celsius = scene.value().mesh.temperature_celsius();
  EXPECT_EQ((std::vector<float>(celsius.begin() + 100, celsius.end())), (std::vector<float>{34, 32, 31, 33}));
  // Moved as a whole, less than neighbours are apart, it is the same order.
  const auto moved = joined(visible_file("0 0 0\n100 0 0\n100.02 0 0\n", 3),
                            thermal_file("0 0 0 1\n100.004 0 0 2\n100.024 0 0 3\n", 3));
  ASSERT_TRUE(moved);
  EXPECT_EQ(note_count(moved.value(), "thermal_joined_in_order"), 3U);
}

TEST(ThermalJoin, TellsHowFarItIs) {
  const auto grid = [](int side, double step, const char* more) {
    std::string lines;
    for (int i = 0; i < side * side; ++i) {
      lines += std::to_string(step * (i % side)) + ' ' + std::to_string(step * (i / side)) + " 0" + more + '\n';
    }
    return lines;
  };
  const test::TemporaryFolder folder;
  std::vector<double> shares;
  std::mutex mutex;
  ReadOptions options;
  options.progress = [&](std::string_view phase, double share) {
    const std::lock_guard lock(mutex);
    if (phase == base::kJoiningPhase) shares.push_back(share);
  };
  ASSERT_TRUE(read_ply_with_thermal(folder.write("v.ply", visible_file(grid(150, 1, ""), 22'500)),
                                    folder.write("t.ply", thermal_file(grid(75, 2, " 20"), 5625)), options, 0));
  EXPECT_GE(shares.size(), 5U);
  EXPECT_EQ(shares.front(), 0);
  EXPECT_GT(*std::max_element(shares.begin(), shares.end()), 0.9);
  EXPECT_LE(*std::max_element(shares.begin(), shares.end()), 1);
}

TEST(ThermalJoin, TellsThatAHotReadingFoundNoVertex) {
  std::string visible, thermal;
  for (int i = 0; i < 100; ++i) visible += std::to_string(i % 10) + ' ' + std::to_string(i / 10) + " 0\n";
  for (int i = 0; i < 361; ++i) {
    thermal +=
        std::to_string(0.5 * (i % 19)) + ' ' + std::to_string(0.5 * (i / 19)) + (i == 181 ? " 0 500\n" : " 0 20\n");
  }
  const auto scene = joined(visible_file(visible, 100), thermal_file(thermal, 361));
  ASSERT_TRUE(scene);
  EXPECT_EQ(note_count(scene.value(), "thermal_extremes_lost"), 1U);
  EXPECT_NE(note_text(scene.value(), "thermal_extremes_lost").find("500 degC"), std::string::npos);
  thermal.replace(thermal.find(" 0 500\n"), 7, " 0 inf\n");
  const auto saturated = joined(visible_file(visible, 100), thermal_file(thermal, 361));
  ASSERT_TRUE(saturated);
  EXPECT_NE(note_text(saturated.value(), "thermal_extremes_lost").find("one over the range of the sensor"),
            std::string::npos);
  EXPECT_NE(note_text(saturated.value(), "thermal_extremes_lost").find("give the finer file"), std::string::npos);
  const auto outside =
      joined(visible_file(visible, 100), thermal_file(visible_with(visible, " 20") + "20 4 0 500\n", 101));
  ASSERT_TRUE(outside);
  EXPECT_EQ(note_text(outside.value(), "thermal_extremes_lost").find("give the finer file"), std::string::npos);
  EXPECT_NE(note_text(outside.value(), "thermal_extremes_lost").find("the scene has nothing within"),
            std::string::npos);
  const auto kept = joined(visible_file(visible, 100), thermal_file(visible_with(visible, " 20"), 100));
  ASSERT_TRUE(kept);
  EXPECT_EQ(note_count(kept.value(), "thermal_extremes_lost"), 0U);
}

TEST(ThermalJoin, TakesTheNearestWithinTheDistance) {
  const std::string visible = visible_file("1000.1 0 0\n1001.2 0 0\n1009 0 0\n", 3);
  const std::string thermal = thermal_file("1000 0 0 20\n1001 0 0 21\n1002 0 0 22\n1003 0 0 nan\n", 4);
  const auto automatic = joined(visible, thermal);
  ASSERT_TRUE(automatic);
  EXPECT_EQ(automatic.value().mesh.temperature_celsius()[0], 20);
  EXPECT_EQ(automatic.value().mesh.temperature_celsius()[1], 21);
  EXPECT_TRUE(std::isnan(automatic.value().mesh.temperature_celsius()[2]));
  EXPECT_EQ(note_count(automatic.value(), "thermal_joined_nearest"), 2U);
  EXPECT_EQ(note_text(automatic.value(), "thermal_not_reached").substr(0, 36), "1 vertex has no thermal place within");
  EXPECT_EQ(note_text(automatic.value(), "missing_temperatures"), "1 vertex without a temperature");

  const auto near = joined(visible, thermal, 0.15);
  ASSERT_TRUE(near);
  EXPECT_EQ(note_count(near.value(), "thermal_joined_nearest"), 1U);
  const auto far = joined(visible, thermal, 100);
  ASSERT_TRUE(far);
  EXPECT_EQ(note_count(far.value(), "thermal_joined_nearest"), 3U);
  EXPECT_TRUE(std::isnan(far.value().mesh.temperature_celsius()[2])) << "the nearest has none, which is an answer";
}

TEST(ThermalJoin, ReplacesTheTemperaturesOfTheFirstFile) {
  const auto scene = joined(thermal_file("0 0 0 5\n", 1), thermal_file("0 0 0 20\n", 1));
  ASSERT_TRUE(scene);
  EXPECT_EQ(scene.value().mesh.temperature_celsius()[0], 20);
  EXPECT_EQ(note_count(scene.value(), "replaced_temperatures"), 1U);
}

TEST(ThermalJoin, RefusesWhatCannotBeJoined) {
  const std::string good = visible_file("0 0 0\n", 1);
  const auto no_temperature = joined(good, good);
  ASSERT_FALSE(no_temperature);
  EXPECT_EQ(no_temperature.error().code, base::ErrorCode::Unsupported);
  EXPECT_EQ(no_temperature.error().message,
            "t.ply: the thermal file has no temperature: none of its properties can be one");
  const auto other_name = joined(good, "ply\nformat ascii 1.0\nelement vertex 1\n" + std::string(test::kXyz) +
                                           "property float quality\nend_header\n0 0 0 1\n");
  ASSERT_FALSE(other_name);
  EXPECT_EQ(other_name.error().message,
            "t.ply: the thermal file has no temperature: No property is called a temperature; --temperature-property "
            "NAME takes one of: quality");
  for (const double distance :
       {-1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    const auto bad = joined(good, thermal_file("0 0 0 1\n", 1), distance);
    ASSERT_FALSE(bad);
    EXPECT_EQ(bad.error().code, base::ErrorCode::OutOfRange);
  }
  const test::TemporaryFolder folder;
  const auto missing = read_ply_with_thermal(folder.write("v.ply", good), folder.path() / "t.ply");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, base::ErrorCode::FileNotFound);
}

/// A bumpy square, seen as a mesh; `count` vertices a side, `metres_per_unit`, moved by `shift`.
std::string square_file(int side, double size, double scale, base::Vec3d shift, bool has_temperature, bool has_faces) {
  std::string text = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(side * side) + "\n" +
                     std::string(test::kXyz) + (has_temperature ? "property float temperature\n" : "");
  if (has_faces) {
    text += "element face " + std::to_string(2 * (side - 1) * (side - 1)) + "\n" + std::string(test::kFaces);
  }
  text += "end_header\n";
  for (int row = 0; row < side; ++row) {
    for (int column = 0; column < side; ++column) {
      const double x = size * column / (side - 1);
      const double y = size * row / (side - 1);
      const double z = 0.2 * std::sin(2 * x) * std::cos(y);
      for (const double c : {x + shift.x, y + shift.y, z + shift.z}) text += std::to_string(c * scale) + " ";
      text += has_temperature ? std::to_string(20 + x + 2 * y) + "\n" : "\n";
    }
  }
  for (int row = 0; has_faces && row + 1 < side; ++row) {
    for (int column = 0; column + 1 < side; ++column) {
      const int a = row * side + column;
      text += "3 " + std::to_string(a) + " " + std::to_string(a + 1) + " " + std::to_string(a + side) + "\n";
      text += "3 " + std::to_string(a + 1) + " " + std::to_string(a + side + 1) + " " + std::to_string(a + side) + "\n";
    }
  }
  return text;
}

std::string refusal(const std::string& visible, const std::string& thermal) {
  const auto scene = joined(visible, thermal);
  if (scene) return "not refused";
  EXPECT_EQ(scene.error().code, base::ErrorCode::Unsupported);
  return scene.error().message;
}

TEST(ThermalJoin, ReadsTheSurfaceBetweenThermalVertices) {
  const auto scene = joined(square_file(61, 3, 1, {}, false, true), square_file(13, 3, 1, {}, true, true));
  ASSERT_TRUE(scene) << scene.error().message;
  const auto& mesh = scene.value().mesh;
  EXPECT_EQ(note_count(scene.value(), "thermal_joined_nearest"), mesh.vertex_count());
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
    const base::Vec3f& p = mesh.positions()[v];
    // A nearest vertex would be off by up to half a spacing in both directions: 0.37 degrees.
    ASSERT_NEAR(mesh.temperature_celsius()[v], 20 + p.x + 2 * p.y, 0.12) << v;
  }
}

TEST(ThermalJoin, ReachesASurfaceThatIsDisplaced) {
  // Six times as far as its vertices are apart, as when two programs rebuild one thing.
  const auto scene = joined(square_file(40, 3, 1, {}, false, true), square_file(300, 3, 1, {0, 0, 0.06}, true, true));
  ASSERT_TRUE(scene) << scene.error().message;
  EXPECT_EQ(note_count(scene.value(), "thermal_joined_nearest"), 1600U);
}

/// A square of 3 m with hills.
std::string hilly_file(int side, bool is_thermal) {
  std::string text = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(side * side) + "\n" +
                     std::string(test::kXyz) + (is_thermal ? "property float temperature\n" : "") + "element face " +
                     std::to_string((side - 1) * (side - 1)) + "\n" + std::string(test::kFaces) + "end_header\n";
  for (int v = 0; v < side * side; ++v) {
    const double x = 3.0 * (v % side) / (side - 1);
    const double y = 3.0 * (v / side) / (side - 1);
    text += std::to_string(x) + " " + std::to_string(y) + " " +
            std::to_string(0.2 * std::sin(3 * x) * std::cos(3 * y)) + (is_thermal ? " " + std::to_string(20 + x) : "") +
            "\n";
  }
  for (int v = 0; v < side * (side - 1); ++v) {
    if (v % side == side - 1) continue;
    text += "4 " + std::to_string(v) + " " + std::to_string(v + 1) + " " + std::to_string(v + side + 1) + " " +
            std::to_string(v + side) + "\n";
  }
  return text;
}

TEST(ThermalJoin, ReachesTheHillsThatACoarserSurfaceCutsOff) {
  for (const auto& [visible, thermal] : {std::pair{24, 8}, std::pair{60, 9}, std::pair{8, 24}}) {
    const auto scene = joined(hilly_file(visible, false), hilly_file(thermal, true));
    ASSERT_TRUE(scene) << scene.error().message;
    EXPECT_EQ(note_count(scene.value(), "missing_temperatures"), 0U) << visible << " on " << thermal;
    const auto& mesh = scene.value().mesh;
    for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
      ASSERT_NEAR(mesh.temperature_celsius()[v], 20 + mesh.positions()[v].x, 0.06) << v;
    }
  }
}

/// Holes of either file that are written as a number lend and take nothing.
TEST(ThermalJoin, PassesOverHolesWrittenAsANumber) {
  std::string visible;
  std::string thermal;
  for (int i = 0; i < 100; ++i) {
    const std::string place = i % 3 == 0 ? "0 0 0" : std::to_string(i % 10) + " " + std::to_string(i / 10) + " 50";
    visible += place + "\n";
    thermal += place + (i % 3 == 0 ? " 0\n" : " 2" + std::to_string(i % 10) + "\n");
  }
  const auto scene = joined(visible_file(visible, 100), thermal_file(thermal, 100));
  ASSERT_TRUE(scene) << scene.error().message;
  EXPECT_EQ(scene.value().mesh.vertex_count(), 66U);
  EXPECT_EQ(note_count(scene.value(), "hole_vertices"), 34U);
  EXPECT_EQ(note_count(scene.value(), "thermal_hole_vertices"), 34U);
  EXPECT_EQ(scene.value().mesh.temperature_celsius()[1], 22);
}

TEST(ThermalJoin, DoesNotReachBeyondTheBorderOfTheThermalSurface) {
  const auto scene = joined(square_file(61, 3, 1, {}, false, true), square_file(41, 2, 1, {}, true, true));
  ASSERT_TRUE(scene) << scene.error().message;
  const auto& mesh = scene.value().mesh;
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
    const base::Vec3f& p = mesh.positions()[v];
    const float beyond = std::max(p.x, p.y) - 2;
    if (beyond < 1e-3F) {
      EXPECT_TRUE(std::isfinite(mesh.temperature_celsius()[v])) << v;
    } else if (beyond > 0.09F) {
      EXPECT_TRUE(std::isnan(mesh.temperature_celsius()[v])) << v;
    }
  }
  EXPECT_EQ(note_count(scene.value(), "missing_temperatures"), note_count(scene.value(), "thermal_not_reached"));
}

TEST(ThermalJoin, MissesWhatTheThermalSurfaceMisses) {
  const std::string thermal = "ply\nformat ascii 1.0\nelement vertex 4\n" + std::string(test::kXyz) +
                              "property float temperature\nelement face 2\n" + std::string(test::kFaces) +
                              "end_header\n0 0 0 20\n10 0 0 30\n10 10 0 nan\n0 10 0 40\n3 0 1 2\n3 0 2 3\n";
  const auto scene = joined(visible_file("2 1 0\n9 8 0\n0 0 0\n5 0 0\n0 10 0\n", 5), thermal);
  ASSERT_TRUE(scene) << scene.error().message;
  const auto celsius = scene.value().mesh.temperature_celsius();
  EXPECT_EQ(celsius[0], 20) << "of the nearest corner: another one has none";
  EXPECT_TRUE(std::isnan(celsius[1]));
  EXPECT_EQ(celsius[2], 20);
  EXPECT_EQ(celsius[3], 25) << "between two that have one";
  EXPECT_EQ(celsius[4], 40);
}

TEST(ThermalJoin, RefusesAnotherUnit) {
  for (const bool has_faces : {true, false}) {
    const std::string metres = square_file(12, 3, 1, {}, true, has_faces);
    const std::string millimetres = square_file(12, 3, 1000, {}, true, has_faces);
    EXPECT_NE(refusal(metres, millimetres).find("t.ply is 1000 times as large"), std::string::npos);
    EXPECT_NE(refusal(millimetres, metres).find("v.ply is 1000 times as large"), std::string::npos);
    EXPECT_NE(refusal(millimetres, metres).find("--scale 0.001"), std::string::npos);
    const std::string inches = square_file(30, 3, 39.3700787, {1, 2, 3}, true, has_faces);
    EXPECT_NE(refusal(metres, inches).find("39.37 times"), std::string::npos);
  }
  // With one point astray the sizes are still those of the rest.
  std::string astray = square_file(12, 3, 1, {}, true, false) + "9e6 0 0 20\n";
  astray.replace(astray.find("vertex 144"), 10, "vertex 145");
  EXPECT_NE(refusal(astray, square_file(12, 3, 1000, {}, true, false)).find("1000 times"), std::string::npos);
}

TEST(ThermalJoin, RefusesWhatIsElsewhere) {
  const std::string here = square_file(12, 3, 1, {}, false, true);
  EXPECT_NE(refusal(here, square_file(14, 3, 1, {412345, 5461234, 0}, true, true)).find("5477 km apart"),
            std::string::npos);
  const std::string message = refusal(here, square_file(14, 3, 1, {0, 0, 1.5}, true, true));
  EXPECT_NE(message.find("apart"), std::string::npos) << message;
  EXPECT_NE(message.find("--scale"), std::string::npos) << message;
  // Their boxes meet, their surfaces do not.
  std::string around = "ply\nformat ascii 1.0\nelement vertex 4\n" + std::string(test::kXyz) +
                       "property float temperature\nelement face 2\n" + std::string(test::kFaces) +
                       "end_header\n-1 -1 -2 20\n4 -1 -2 30\n4 4 2 20\n-1 4 2 40\n3 0 1 2\n3 0 2 3\n";
  EXPECT_NE(refusal(square_file(40, 3, 1, {0, 0, -1}, false, true), around).find("vertices have a thermal place"),
            std::string::npos);
}

TEST(ThermalJoin, ScalesOneFileOnlyWhereTheSizesThenAgree) {
  const test::TemporaryFolder folder;
  const auto scaled = [&](double scene_units, double thermal_units, double scale, base::Vec3d shift) {
    ReadOptions options;
    options.metres_per_unit = scale;
    return read_ply_with_thermal(folder.write("v.ply", square_file(12, 3, scene_units, shift, false, true)),
                                 folder.write("t.ply", square_file(14, 3, thermal_units, shift, true, false)), options);
  };
  for (const double far : {0.0, 412345.0}) {
    for (const auto& [scene_units, thermal_units, of] :
         {std::tuple{1000.0, 1.0, "taken for v.ply alone"}, std::tuple{1.0, 1000.0, "taken for t.ply alone"}}) {
      const auto one = scaled(scene_units, thermal_units, 0.001, {far, far, 0});
      ASSERT_TRUE(one) << one.error().message;
      EXPECT_NE(note_text(one.value(), "scaled_one_file").find(of), std::string::npos);
      EXPECT_GT(note_count(one.value(), "thermal_joined_nearest"), 140U);
    }
    // Of neither is 0.001 the unit, and whichever is scaled alone, they are a thousand times apart or more.
    for (const auto& [scene_units, thermal_units, larger] :
         {std::tuple{100.0, 1000.0, "t.ply is 10 times"}, std::tuple{1000.0, 100.0, "v.ply is 10 times"}}) {
      for (const double wrong : {0.001, 0.0254, 0.05, 0.3048}) {
        const auto scene = scaled(scene_units, thermal_units, wrong, {far, far, 0});
        ASSERT_FALSE(scene) << wrong;
        EXPECT_EQ(scene.error().code, base::ErrorCode::Unsupported);
        EXPECT_NE(scene.error().message.find(larger), std::string::npos) << scene.error().message;
        EXPECT_NE(scene.error().message.find("--scale"), std::string::npos);
      }
    }
  }
  EXPECT_NE(refusal(square_file(12, 3, 100, {}, false, true), square_file(12, 3, 1 / 0.0254, {}, true, false))
                .find("v.ply is 2.54 times"),
            std::string::npos);
}

TEST(ThermalJoin, PointsOfACloudReachATenthOfTheSceneAtMost) {
  const auto scene = joined(square_file(12, 1, 1, {}, false, true), square_file(4, 3, 1, {}, true, false));
  ASSERT_TRUE(scene) << scene.error().message;
  const auto& mesh = scene.value().mesh;
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
    const base::Vec3f& p = mesh.positions()[v];
    // Points 1 m apart, of which the scene holds four at its corners, but for their height.
    const bool is_near = std::hypot(std::min(p.x, 1 - p.x), std::min(p.y, 1 - p.y)) < 0.15F;
    EXPECT_TRUE(is_near || std::isnan(mesh.temperature_celsius()[v])) << v;
  }
}

/// A wall of 4 x 2 m and 5 cm thickness: 2 x 41 x 21 vertices and the triangles of both sides, which face away from each other.
std::string thin_wall() {
  constexpr int kColumns = 41, kRows = 21;
  std::string lines, faces;
  for (int side = 0; side < 2; ++side) {
    for (int i = 0; i < kColumns * kRows; ++i) {
      lines += std::to_string(0.1 * (i % kColumns)) + (side == 0 ? " 0 " : " 0.05 ") +
               std::to_string(0.1 * (i / kColumns)) + '\n';
      if (i % kColumns + 1 == kColumns || i / kColumns + 1 == kRows) continue;
      const int a = side * kColumns * kRows + i;
      for (const auto& [b, c] : {std::pair(a + 1, a + kColumns + 1), {a + kColumns + 1, a + kColumns}}) {
        faces += "3 " + std::to_string(a) + ' ' + std::to_string(side == 0 ? b : c) + ' ' +
                 std::to_string(side == 0 ? c : b) + '\n';
      }
    }
  }
  return "ply\nformat ascii 1.0\nelement vertex " + std::to_string(2 * kColumns * kRows) + "\n" +
         std::string(test::kXyz) + "element face " + std::to_string(4 * (kColumns - 1) * (kRows - 1)) + "\n" +
         std::string(test::kFaces) + "end_header\n" + lines + faces;
}

TEST(ThermalJoin, PointsOfACloudKeepToTheirSideOfAThinWall) {
  // Points 40 cm apart, 1 cm off the wall, which is warm on one side; those of the other side lie between them.
  std::string lines;
  int count = 0;
  const auto add = [&](double first, const char* rest, const char* celsius) {
    for (int i = 0; i < 66; ++i, ++count) {
      lines += std::to_string(first + 0.4 * (i % 11)) + rest + std::to_string(first + 0.4 * (i / 11)) + celsius + '\n';
    }
  };
  add(0, " 0.01 ", " 35");
  const auto one_side = joined(thin_wall(), thermal_file(lines, count));
  ASSERT_TRUE(one_side) << one_side.error().message;
  EXPECT_NE(note_text(one_side.value(), "thermal_sides").find("861 vertices take one of the other"), std::string::npos)
      << note_text(one_side.value(), "thermal_sides");
  add(0.2, " 0.06 ", " 10");
  const auto both = joined(thin_wall(), thermal_file(lines, count));
  ASSERT_TRUE(both) << both.error().message;
  const auto celsius = both.value().mesh.temperature_celsius();
  EXPECT_EQ(std::count(celsius.begin(), celsius.begin() + 861, 35.0F), 861);
  EXPECT_EQ(std::count(celsius.begin() + 861, celsius.end(), 10.0F), 861);
  EXPECT_NE(note_text(both.value(), "thermal_sides").find("of the own side, 0 vertices take one of the other"),
            std::string::npos)
      << note_text(both.value(), "thermal_sides");
}

TEST(ThermalJoin, RefusesWhatIsAllInOnePlace) {
  const std::string scene = square_file(36, 3, 1, {}, false, true);
  const auto in_one_place = [](int count, const std::string& place) {
    std::string lines;
    for (int i = 0; i < count; ++i) lines += place + " 20\n";
    return thermal_file(lines, count);
  };
  for (const char* const place : {"0 0 0", "1 1 0.1"}) {
    EXPECT_NE(refusal(scene, in_one_place(1296, place)).find("all positions of the thermal file are in one place"),
              std::string::npos);
    EXPECT_NE(refusal(scene, in_one_place(7, place)).find("in one place"), std::string::npos);
    EXPECT_NE(refusal(scene, in_one_place(1, place)).find("one point only"), std::string::npos);
  }
  // Of 0.1 m, where the vertices are 0.09 m apart, it is a patch; of 5 mm it is not.
  EXPECT_EQ(refusal(scene, square_file(8, 0.1, 1, {}, true, true)), "not refused");
  const std::string message = refusal(scene, square_file(8, 0.005, 1, {}, true, true));
  EXPECT_NE(message.find("it spans only"), std::string::npos) << message;
  EXPECT_NE(message.find("--scale"), std::string::npos) << message;
  const auto told = joined(scene, square_file(8, 0.005, 1, {}, true, true), 0.2);
  ASSERT_TRUE(told) << "whoever tells the distance may";
  EXPECT_EQ(note_count(told.value(), "thermal_joined_nearest"), 1U);
}

TEST(ThermalJoin, RefusesAThermalFileWithoutAnyTemperature) {
  const std::string places = "0 0 0\n1 0 0\n2 0 0\n";
  EXPECT_EQ(refusal(visible_file(places, 3), thermal_file(visible_with(places, " nan"), 3)),
            "t.ply: the thermal file has no temperature in it: none of its 3 vertices has one");
  EXPECT_EQ(refusal(visible_file(places, 3), thermal_file(visible_with(places, " inf"), 3)), "not refused");
}

TEST(ThermalJoin, TakesAThermalPatchOfALargeScene) {
  const auto scene = joined(square_file(120, 30, 1, {}, false, true), square_file(20, 2, 1, {}, true, true));
  ASSERT_TRUE(scene) << scene.error().message;
  EXPECT_GE(note_count(scene.value(), "thermal_joined_nearest"), 64U);
  EXPECT_LT(note_count(scene.value(), "thermal_joined_nearest"), 120U);
}

TEST(ThermalJoin, JoinsTwoReconstructionsOfOneCastle) {
  const char* const folder = std::getenv("SPECTRA_TEST_DATA");
  if (folder == nullptr) GTEST_SKIP() << "SPECTRA_TEST_DATA names no folder with scenes";
  const std::filesystem::path fine = std::filesystem::path(folder) / "arco_castle_1m.ply";
  const auto own = read_ply(fine);
  const auto scene = read_ply_with_thermal(fine, std::filesystem::path(folder) / "arco_castle_250k.ply");
  ASSERT_TRUE(own && scene);
  std::vector<float> errors;
  for (std::size_t v = 0; v < own.value().mesh.vertex_count(); ++v) {
    const float error =
        std::abs(own.value().mesh.temperature_celsius()[v] - scene.value().mesh.temperature_celsius()[v]);
    if (std::isfinite(error)) errors.push_back(error);
  }
  std::sort(errors.begin(), errors.end());
  EXPECT_GT(static_cast<double>(errors.size()), 0.995 * static_cast<double>(own.value().mesh.vertex_count()));
  EXPECT_LT(errors[errors.size() / 2], 0.05F);
  EXPECT_LT(errors[errors.size() * 95 / 100], 0.2F);
}

}  // namespace
}  // namespace spectra::files
