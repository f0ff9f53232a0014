// The kinds of trouble that files of the field have, each in more forms than one file shows.
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include "allocation_meter.hpp"
#include "fusion/files/block_file.hpp"
#include "fusion/files/gzip_file.hpp"
#include "fusion/files/ply_reader.hpp"
#include "fusion/files/temperature_name.hpp"
#include "loaded.hpp"

namespace spectra::files {
namespace {

using test::kFaces;
using test::kRgb;
using test::kXyz;
using test::loaded;
using test::note_count;
using test::note_text;
using test::PlyBytes;

/// A text file of vertices with more properties than x, y, z.
std::string text_file(const std::string& properties, const std::vector<std::string>& lines,
                      const std::string& faces = {}, const std::string& face_lines = {}) {
  std::string text = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(lines.size()) + "\n" +
                     std::string(kXyz) + properties + faces + "end_header\n";
  for (const std::string& line : lines) text += line + "\n";
  return text + face_lines;
}

TEST(FieldKinds, NanHasManySpellings) {
  for (const char* nan :
       {"nan",       "NaN",     "-nan",  "-nan(ind)", "nan(snan)", "1.#QNAN", "-1.#QNAN", "1.#QNAN0", "-1.#IND",
        "-1.#IND00", "1.#SNAN", "1.#J",  "NaNQ",      "NaNS",      "qnan",    "null",     "NULL",     "None",
        "NA",        "N/A",     "#N/A",  "<NA>",      "undefined", "-",       "--",       "*",        "?",
        "missing",   "nodata",  "#QNAN", "no_data",   "#NaN",      "---"}) {
    const LoadedScene scene = loaded(text_file(
        "property float temperature\n", {"0 0 0 20", std::string("1 0 0 ") + nan, std::string(nan) + " 0 0 30"}));
    EXPECT_EQ(scene.mesh.vertex_count(), 2U) << nan;
    EXPECT_EQ(note_count(scene, "missing_temperatures"), 1U) << nan;
    EXPECT_EQ(note_count(scene, "left_out_vertices"), 1U) << nan;
  }
  for (const char* bad : {"nothing", "1.2.3", "12abc", "--1", "0x10", "1..5", "e5", "d5", "***"}) {
    EXPECT_FALSE(test::read_bytes(text_file("property float temperature\n", {std::string("1 0 0 ") + bad}))) << bad;
  }
}

TEST(FieldKinds, InfinityAndFortranHaveSpellings) {
  const LoadedScene scene =
      loaded(text_file("property double temperature\n", {"0 0 0 1.#INF", "1 0 0 -1.#INF", "2 0 0 Infinity",
                                                         "3 0 0 1.5D+01", "4 0 0 -1.5d1", "5 0 0 .25Q2", "6 0 0 2E1"}));
  const auto celsius = scene.mesh.temperature_celsius();
  EXPECT_EQ(celsius[0], std::numeric_limits<float>::infinity());
  EXPECT_EQ(celsius[1], -std::numeric_limits<float>::infinity());
  EXPECT_EQ(celsius[2], std::numeric_limits<float>::infinity());
  EXPECT_EQ(celsius[3], 15.0F);
  EXPECT_EQ(celsius[4], -15.0F);
  EXPECT_EQ(celsius[5], 25.0F);
  EXPECT_EQ(celsius[6], 20.0F);
}

TEST(FieldKinds, HolesTakeTheirFacesWithThem) {
  const std::string faces = "element face 5\n" + std::string(kFaces);
  const std::string face_lines = "3 0 1 2\n3 1 2 3\n4 0 2 4 1\n3 2 4 5\n3 0 2 4\n";
  for (const bool faces_first : {false, true}) {
    const std::string vertices = "element vertex 6\n" + std::string(kXyz) +
                                 "property uchar red\nproperty uchar green\n" + "property uchar blue\n";
    const std::string lines = "0 0 0 1 1 1\n1 0 0 2 2 2\n0 1 0 3 3 3\ninf 1 0 4 4 4\n0 0 1 5 5 5\n1 1 nan 6 6 6\n";
    const LoadedScene scene = loaded("ply\nformat ascii 1.0\n" + (faces_first ? faces + vertices : vertices + faces) +
                                     "end_header\n" + (faces_first ? face_lines + lines : lines + face_lines));
    EXPECT_EQ(scene.mesh.vertex_count(), 4U);
    EXPECT_EQ(note_count(scene, "left_out_vertices"), 2U);
    EXPECT_EQ(note_count(scene, "left_out_faces"), 2U);
    EXPECT_EQ(note_count(scene, "unreferenced_vertices"), 0U);
    EXPECT_EQ(scene.mesh.triangles(), (std::vector<base::Triangle>{{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {0, 2, 3}}));
    EXPECT_EQ(scene.mesh.visible()[3], (base::Rgb8{5, 5, 5}));
    EXPECT_EQ(scene.mesh.positions()[3], (base::Vec3f{0, 0, 1}));
  }
}

TEST(FieldKinds, HolesOfDoublePositionsKeepTheOthersExact) {
  PlyBytes file;
  file.text(
      "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double "
      "z\n"
      "element face 1\n" +
      std::string(kFaces) + "end_header\n");
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double x : {nan, 412345.625, 412346.125, 412347.25}) file.le(x).le(5461234.5).le(3.0);
  file.le(std::uint8_t{3}).le(1U).le(2U).le(3U);
  const LoadedScene scene = loaded(file.bytes());
  ASSERT_EQ(scene.mesh.vertex_count(), 3U);
  EXPECT_EQ(scene.mesh.triangles(), (std::vector<base::Triangle>{{0, 1, 2}}));
  EXPECT_EQ(scene.mesh.origin.x + static_cast<double>(scene.mesh.positions()[1].x), 412346.125);
}

/// A bumpy square of 20 x 20 double points at map coordinates, and more points.
std::string map_square(const std::vector<base::Vec3d>& more, const std::string& faces = {},
                       const std::string& lines = {}) {
  std::string text = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(400 + more.size()) +
                     "\nproperty double x\nproperty double y\nproperty double z\nproperty float temperature\n" + faces +
                     "end_header\n";
  std::vector<base::Vec3d> points;
  for (int i = 0; i < 400; ++i) {
    points.push_back({500'000.123 + 0.15 * (i % 20), 4'200'000.456 + 0.15 * (i / 20), 100.01 * (1 + 1e-4 * (i % 7))});
  }
  points.insert(points.end(), more.begin(), more.end());
  char line[120];
  for (const base::Vec3d& p : points) {
    std::snprintf(line, sizeof line, "%.17g %.17g %.17g %d\n", p.x, p.y, p.z, p.x > 1000 ? 20 : 0);
    text += line;
  }
  return text + lines;
}

double place_x(const LoadedScene& scene, std::size_t vertex) {
  return scene.mesh.origin.x + static_cast<double>(scene.mesh.positions()[vertex].x);
}

TEST(FieldKinds, AStrayDoesNotTakeTheOriginAwayFromTheScene) {
  for (const base::Vec3d& stray : {base::Vec3d{}, base::Vec3d{500'000, 4'200'000, -1e7}, base::Vec3d{1e30, 0, 0}}) {
    const LoadedScene scene = loaded(map_square({stray}));
    ASSERT_EQ(scene.mesh.vertex_count(), 401U);
    EXPECT_NEAR(place_x(scene, 3), 500'000.573, 1e-6) << stray.x;
    EXPECT_NEAR(place_x(scene, 400), stray.x, 1e-7 * stray.x) << stray.x;
    EXPECT_EQ(note_count(scene, "hole_vertices"), 0U);
    EXPECT_EQ(note_count(scene, "coarse_positions"), 0U);
  }
}

TEST(FieldKinds, HolesWrittenAsANumberAreHoles) {
  const double largest = static_cast<double>(std::numeric_limits<float>::max());
  for (const base::Vec3d& place :
       {base::Vec3d{}, base::Vec3d{-9999, -9999, -9999}, base::Vec3d{largest, largest, largest}}) {
    for (const bool are_most : {false, true}) {
      const LoadedScene scene = loaded(map_square(std::vector<base::Vec3d>(are_most ? 2000 : 20, place)));
      ASSERT_EQ(scene.mesh.vertex_count(), 400U) << place.x;
      EXPECT_NEAR(place_x(scene, 3), 500'000.573, 1e-6) << place.x;
      EXPECT_EQ(*std::min_element(scene.mesh.temperature_celsius().begin(), scene.mesh.temperature_celsius().end()),
                20);
      EXPECT_EQ(note_count(scene, "hole_vertices"), are_most ? 2000U : 20U);
      EXPECT_EQ(note_count(scene, "left_out_vertices"), 0U);
      EXPECT_EQ(scene.mesh.left_out.size(), are_most ? 2000U : 20U);
    }
  }
  EXPECT_NE(note_text(loaded(map_square(std::vector<base::Vec3d>(20, {-9999, 0.1, 7}))), "hole_vertices")
                .find("-9999 0.1 7,"),
            std::string::npos);
  ReadOptions millimetres;
  millimetres.metres_per_unit = 0.001;
  const LoadedScene small = loaded(map_square(std::vector<base::Vec3d>(20, {-9999, 0, 0})), millimetres);
  EXPECT_EQ(note_count(small, "hole_vertices"), 20U);
  EXPECT_NE(note_text(small, "hole_vertices").find("-9999 0 0,"), std::string::npos);
}

TEST(FieldKinds, HolesOfTwoKindsAreHoles) {
  for (const std::size_t other_count : {100U, 90U, 14U, 700U}) {
    std::vector<base::Vec3d> places(100);
    places.resize(100 + other_count, {-9999, -9999, -9999});
    const LoadedScene scene = loaded(map_square(places));
    ASSERT_EQ(scene.mesh.vertex_count(), 400U) << other_count;
    EXPECT_NEAR(place_x(scene, 3), 500'000.573, 1e-6);
    EXPECT_EQ(note_count(scene, "hole_vertices"), 100 + other_count);
    const std::string said = note_text(scene, "hole_vertices");
    EXPECT_NE(said.find("100 in exactly one place, 0 0 0"), std::string::npos) << said;
    EXPECT_NE(said.find(std::to_string(other_count) + " in exactly one place, -9999 -9999 -9999"), std::string::npos)
        << said;
  }
  // A place and a coordinate.
  std::vector<base::Vec3d> places(100, {-1, -1, -1});
  for (int i = 0; i < 100; ++i) places.push_back({500'000 + 0.1 * i, 4'200'000 + 0.07 * (i * 37 % 100), -9999});
  const LoadedScene scene = loaded(map_square(places));
  EXPECT_EQ(scene.mesh.vertex_count(), 400U);
  const std::string said = note_text(scene, "hole_vertices");
  EXPECT_NE(said.find("200 vertices ("), std::string::npos) << said;
  EXPECT_NE(said.find("100 in exactly one place, -1 -1 -1"), std::string::npos) << said;
  EXPECT_NE(said.find("100 whose z is -9999"), std::string::npos) << said;
}

TEST(FieldKinds, WhatNobodyCanMeasureIsNoRounding) {
  // A speck of half a millimetre, 3 m from 0: floats are a quarter of a micrometre apart there.
  std::vector<std::string> lines;
  for (int i = 0; i < 40; ++i)
    lines.push_back("3.000" + std::to_string(i % 7) + " 2.001 1.000" + std::to_string(i % 3));
  EXPECT_EQ(note_count(loaded(text_file("", lines)), "rounded_positions"), 0U);
}

TEST(FieldKinds, WhatIsProbablyNotMeantNeedsAttention) {
  const auto needs = [](const LoadedScene& scene, const std::string& id) {
    for (const Note& note : scene.notes) {
      if (note.id == id) return note.needs_attention;
    }
    ADD_FAILURE() << id << " is not there";
    return false;
  };
  const auto temperatures = [](const char* type, const std::vector<std::string>& values) {
    std::vector<std::string> lines;
    for (const std::string& value : values) lines.push_back("0 0 0 " + value);
    return loaded(text_file(std::string("property ") + type + " temperature\n", lines));
  };
  EXPECT_TRUE(needs(temperatures("float", {"291", "293", "295"}), "implausible_temperatures"));
  const LoadedScene hundredths = temperatures("short", {"1750", "2150", "2656"});
  EXPECT_TRUE(needs(hundredths, "implausible_temperatures"));
  EXPECT_NE(note_text(hundredths, "implausible_temperatures").find("--temperature-scale 0.01"), std::string::npos);
  EXPECT_EQ(note_text(temperatures("short", {"18", "25", "900"}), "implausible_temperatures"), "");
  EXPECT_TRUE(needs(loaded(text_file("property float scalar_value\n", {"0 0 0 1"})), "no_temperature"));
  EXPECT_FALSE(needs(temperatures("float", {"20", "nan"}), "missing_temperatures"));
}

/// 50 x 50 cells of 60 m with 900 m relief; one in twenty has this height.
LoadedScene terrain(const std::string& height) {
  std::vector<std::string> lines;
  for (int i = 0; i < 2500; ++i) {
    const std::string own = std::to_string(450 + 450 * std::sin(i * 0.01));
    lines.push_back(std::to_string(60 * (i % 50)) + ' ' + std::to_string(60 * (i / 50)) + ' ' +
                    (i % 20 == 7 ? height : own) + " 20");
  }
  return loaded(
      text_file("property float temperature\n", lines, "element face 1\n" + std::string(kFaces), "3 0 1 50\n"));
}

TEST(FieldKinds, HeightsWrittenAsANumberForNoneAreHoles) {
  for (const char* none : {"-9999", "-32768", "-3.4028234663852886e38", "99999", "-10000", "10000", "-9999.9",
                           "-32767.5", "-999999", "1e20", "-1e10", "-2147483648", "-1000000", "-12345.5", "-3.4e25"}) {
    const LoadedScene scene = terrain(none);
    EXPECT_EQ(scene.mesh.vertex_count(), 2500U - 125U) << none;
    EXPECT_EQ(note_count(scene, "hole_vertices") + note_count(scene, "left_out_vertices"), 125U) << none;
    EXPECT_EQ(note_text(scene, "shared_coordinate"), "") << none;
  }
  EXPECT_NE(note_text(terrain("-9999"), "hole_vertices").find("125 vertices whose z is -9999"), std::string::npos);
  EXPECT_NE(note_text(terrain("1e20"), "hole_vertices").find("125 vertices whose z is 1e+20"), std::string::npos);
  // A height that could be one is kept: among the others, or not as far away as the scene is large, and no customary number.
  EXPECT_EQ(terrain("999").mesh.vertex_count(), 2500U);
  EXPECT_EQ(note_text(terrain("999"), "shared_coordinate"), "");
  const LoadedScene kept = terrain("-5000");
  EXPECT_EQ(kept.mesh.vertex_count(), 2500U);
  EXPECT_NE(note_text(kept, "shared_coordinate")
                .find("5 % of the vertices share z = -5000, far from all others, and are kept"),
            std::string::npos)
      << note_text(kept, "shared_coordinate");
}

TEST(FieldKinds, NumbersOfTheFileAreSaidAsItHasThem) {
  std::vector<std::string> lines;
  for (int i = 0; i < 400; ++i) {
    const std::string z = i % 4 == 0 ? "65535" : std::to_string(900 + 300 * std::sin(i));
    lines.push_back(std::to_string(i % 20 * 150) + ' ' + std::to_string(i / 20 * 150) + ' ' + z);
  }
  ReadOptions millimetres;
  millimetres.metres_per_unit = 0.001;
  std::string text = text_file("", lines);
  EXPECT_NE(note_text(loaded(text, millimetres), "hole_vertices").find("whose z is 65535,"), std::string::npos);
  text.replace(text.find("float z"), 7, "double z");
  EXPECT_NE(note_text(loaded(text, millimetres), "hole_vertices").find("whose z is 65535,"), std::string::npos)
      << note_text(loaded(text, millimetres), "hole_vertices");
}

TEST(FieldKinds, AFloorFarBelowIsNoHole) {
  // A floor of 5 m at z = 0 and a lamp or a table above it.
  for (const bool is_flat : {false, true}) {
    std::vector<std::string> lines;
    for (int i = 0; i < 400; ++i)
      lines.push_back(std::to_string(i % 20 * 0.25) + ' ' + std::to_string(i / 20 * 0.25) + " 0");
    for (int i = 0; i < 100; ++i) {
      const std::string z = std::to_string(is_flat ? 3 : 3 + 0.3 * std::sin(i));
      lines.push_back(std::to_string(2 + i % 10 * 0.02) + ' ' + std::to_string(2 + i / 10 * 0.02) + ' ' + z);
    }
    const LoadedScene scene = loaded(text_file("", lines));
    EXPECT_EQ(scene.mesh.vertex_count(), 500U);
    EXPECT_EQ(note_text(scene, "shared_coordinate").empty(), is_flat);
  }
}

TEST(FieldKinds, ASpotThatIsMeasuredOftenIsNoHole) {
  for (const base::Vec3d& place :
       {base::Vec3d{500'001.5, 4'200'001.25, 100.02}, base::Vec3d{500'004, 4'200'004, 100}}) {
    const LoadedScene scene = loaded(map_square(std::vector<base::Vec3d>(20, place)));
    EXPECT_EQ(scene.mesh.vertex_count(), 420U) << place.x;
  }
}

TEST(FieldKinds, ACrowdedPlaceAmongTheOthersIsKeptAndSaid) {
  const auto scene_of = [](int count) {
    std::vector<std::string> lines;
    for (int i = 0; i < 400; ++i)
      lines.push_back(std::to_string(i % 20 - 10) + ".5 " + std::to_string(i / 20 - 10) + ".5 " +
                      std::to_string(i % 7 - 3));
    lines.resize(static_cast<std::size_t>(400 + count), "-1 -1 -1");
    return loaded(text_file("", lines));
  };
  const LoadedScene scene = scene_of(100);
  EXPECT_EQ(scene.mesh.vertex_count(), 500U);
  EXPECT_NE(note_text(scene, "crowded_place").find("exactly one place, -1 -1 -1, among the others"), std::string::npos);
  EXPECT_EQ(note_text(scene_of(5), "crowded_place"), "");
}

TEST(FieldKinds, TwoCrowdedPlacesAreSaidBoth) {
  std::vector<std::string> lines;
  for (int i = 0; i < 400; ++i)
    lines.push_back(std::to_string(i % 20 - 10) + ".5 " + std::to_string(i / 20 - 10) + ".5 " +
                    std::to_string(i % 7 - 3));
  lines.resize(500, "-1 -1 -1");
  lines.resize(600, "1 1 1");
  EXPECT_NE(note_text(loaded(text_file("", lines)), "crowded_place").find("-1 -1 -1 and in 1 1 1, among the others"),
            std::string::npos);
  // What one reading leaves out does not hide what is kept.
  lines.resize(700, "-9999 -9999 -9999");
  const LoadedScene scene = loaded(text_file("", lines));
  EXPECT_EQ(note_count(scene, "hole_vertices"), 100U);
  EXPECT_NE(note_text(scene, "crowded_place").find("-1 -1 -1 and in 1 1 1, among the others"), std::string::npos);
}

TEST(FieldKinds, TheEndsOfATankThatSharesNoVerticesAreNoHoles) {
  std::vector<std::string> lines;
  std::string faces;
  constexpr int kFacets = 100;
  const auto rim = [](int i, int z) {
    const double angle = 2 * std::numbers::pi * i / kFacets;
    return std::to_string(std::cos(angle)) + ' ' + std::to_string(std::sin(angle)) + ' ' + std::to_string(z);
  };
  for (const int z : {1, 4}) {
    for (int i = 0; i < kFacets; ++i) {
      faces += "3 " + std::to_string(lines.size()) + ' ' + std::to_string(lines.size() + 1) + ' ' +
               std::to_string(lines.size() + 2) + '\n';
      lines.insert(lines.end(), {"0 0 " + std::to_string(z), rim(i, z), rim(i + 1, z)});
    }
  }
  const LoadedScene scene =
      loaded(text_file("", lines, "element face " + std::to_string(2 * kFacets) + "\n" + std::string(kFaces), faces));
  EXPECT_EQ(scene.mesh.vertex_count(), 600U);
  EXPECT_EQ(note_text(scene, "crowded_place") + note_text(scene, "hole_vertices"), "");
}

TEST(FieldKinds, ACrowdedPlaceThatFacesUseIsSaid) {
  std::vector<std::string> lines;
  for (int i = 0; i < 400; ++i) lines.push_back(std::to_string(i % 20 - 10) + ' ' + std::to_string(i / 20 - 10) + " 5");
  lines.resize(600, "0 0 0");
  std::string face = "203";
  for (int i = 397; i < 600; ++i) face += ' ' + std::to_string(i);
  const LoadedScene scene = loaded(text_file("", lines, "element face 1\n" + std::string(kFaces), face + '\n'));
  EXPECT_EQ(scene.mesh.vertex_count(), 600U);
  EXPECT_NE(note_text(scene, "crowded_place").find("exactly one place, 0 0 0, and faces use them"), std::string::npos);
}

TEST(FieldKinds, HolesWrittenAsANumberTakeTheirFacesWithThem) {
  const std::string faces = "element face 2\n" + std::string(kFaces);
  const LoadedScene scene =
      loaded(map_square(std::vector<base::Vec3d>(20, {-1, -1, -1}), faces, "3 0 1 20\n4 1 2 400 20\n"));
  EXPECT_EQ(scene.mesh.vertex_count(), 400U);
  EXPECT_EQ(scene.mesh.triangles(), (std::vector<base::Triangle>{{0, 1, 20}}));
  EXPECT_EQ(note_count(scene, "left_out_faces"), 1U);
}

/// The tip of a cone whose triangles share no vertices is a corner of its surface; and where every place is there often, none
/// is a hole.
TEST(FieldKinds, ManyVerticesInOnePlaceNeedNotBeAHole) {
  std::vector<std::string> lines;
  std::string faces;
  for (int i = 0; i < 40; ++i) {
    for (const int rim : {i, i + 1}) {
      lines.push_back(std::to_string(std::cos(rim * 0.157)) + " " + std::to_string(std::sin(rim * 0.157) + i * 1e-4) +
                      " 0");
    }
    lines.push_back("0 0 1");
    faces += "3 " + std::to_string(3 * i) + " " + std::to_string(3 * i + 1) + " " + std::to_string(3 * i + 2) + "\n";
  }
  const LoadedScene cone = loaded(text_file("", lines, "element face 40\n" + std::string(kFaces), faces));
  EXPECT_EQ(cone.mesh.vertex_count(), 120U);
  EXPECT_EQ(cone.mesh.triangle_count(), 40U);

  for (const auto& [tip, is_hole] :
       {std::pair("0 0 3.5", false), std::pair("0 0 40", false), std::pair("-1 -1 -20", false),
        std::pair("-1 -1 -9999", true), std::pair("-1000 -1000 -1000", true), std::pair("0 0 -9999.9", true)}) {
    for (std::size_t i = 2; i < lines.size(); i += 3) lines[i] = tip;
    const LoadedScene far = loaded(text_file("", lines, "element face 40\n" + std::string(kFaces), faces));
    EXPECT_EQ(far.mesh.vertex_count(), is_hole ? 80U : 120U) << tip;
    EXPECT_EQ(far.mesh.triangle_count(), is_hole ? 0U : 40U) << tip;
    EXPECT_EQ(note_count(far, "crowded_place"), is_hole ? 0U : 1U) << tip;
    EXPECT_EQ(loaded(text_file("", lines)).mesh.vertex_count(), 80U) << "as a cloud: " << tip;
  }

  lines.clear();
  for (int i = 0; i < 400; ++i) lines.push_back(std::to_string(i % 10) + " 0 0");
  EXPECT_EQ(loaded(text_file("", lines)).mesh.vertex_count(), 400U);
  EXPECT_EQ(loaded(text_file("", std::vector<std::string>(400, "3 4 5"))).mesh.vertex_count(), 400U);
}

TEST(FieldKinds, PositionsThatAFloatRoundsByMoreThanAMillimetreAreSaid) {
  EXPECT_EQ(note_count(loaded(map_square({{510'000, 4'200'000, 100}, {500'000, 4'210'000, 100}})), "coarse_positions"),
            0U);
  std::string text =
      "ply\nformat ascii 1.0\nelement vertex 100\nproperty double x\nproperty double y\nproperty double "
      "z\nend_header\n";
  for (int i = 0; i < 100; ++i) {
    text += std::to_string(500'000 + 600.123 * i) + " " + std::to_string(4'200'000 + 613.01 * (i * 37 % 100)) + " 7\n";
  }
  const LoadedScene wide = loaded(text);
  EXPECT_EQ(note_count(wide, "coarse_positions"), 100U);
  EXPECT_NE(note_text(wide, "coarse_positions").find("0.00195 m"), std::string::npos)
      << note_text(wide, "coarse_positions");
}

TEST(FieldKinds, ColoursOfAnyTypeAreScaledByTheirLargest) {
  struct Case {
    std::string type;
    std::string values;
    base::Rgb8 colour;
  };
  const std::vector<Case> cases = {{"ushort", "65535 257 128", {255, 1, 0}}, {"uint16", "255 254 0", {255, 254, 0}},
                                   {"int", "256 257 25700", {1, 1, 100}},    {"uint64", "65535 0 32896", {255, 0, 128}},
                                   {"float", "1.01 0 0.5", {255, 0, 128}},   {"double", "1 -0.001 0.25", {255, 0, 64}},
                                   {"float", "254.6 12.4 0", {255, 12, 0}},  {"float", "65535 2570 0", {255, 10, 0}}};
  for (const auto& [type, values, colour] : cases) {
    std::string properties;
    for (const char* name : {"red", "green", "blue"}) properties += "property " + type + " " + name + "\n";
    const LoadedScene scene = loaded(text_file(properties, {"0 0 0 " + values, "1 0 0 0 0 0"}));
    EXPECT_EQ(scene.mesh.visible()[0], colour) << type << " " << values;
    EXPECT_EQ(scene.mesh.visible()[1], (base::Rgb8{0, 0, 0})) << type << " " << values;
    EXPECT_EQ(note_count(scene, "converted_colours"), 2U) << type << " " << values;
    EXPECT_EQ(note_count(scene, "clamped_colours"), 0U) << type << " " << values;
  }
  const LoadedScene odd = loaded(text_file("property float red\nproperty float green\nproperty float blue\n",
                                           {"0 0 0 nan 1 0", "1 0 0 -1 0.5 1"}));
  EXPECT_EQ(odd.mesh.visible()[0], (base::Rgb8{128, 255, 0}));
  EXPECT_EQ(odd.mesh.visible()[1], (base::Rgb8{0, 128, 255}));
  EXPECT_EQ(note_count(odd, "clamped_colours"), 2U);
}

TEST(FieldKinds, PackedColoursAreUnpacked) {
  const LoadedScene whole = loaded(text_file("property int rgb\n", {"0 0 0 3957840", "1 0 0 -12819376"}));
  EXPECT_EQ(whole.mesh.visible()[0], (base::Rgb8{60, 100, 80}));
  EXPECT_EQ(whole.mesh.visible()[1], (base::Rgb8{60, 100, 80}));  // With an opaque alpha.
  for (const std::uint32_t bits : {0x003C6450U, 0xFF3C6450U, 0xFFBC6450U, 0x7FBC6450U}) {
    PlyBytes file;
    file.text("ply\nformat binary_little_endian 1.0\nelement vertex 1\n" + std::string(kXyz) +
              "property float rgb\nend_header\n");
    file.le(0.0F).le(0.0F).le(0.0F).le(bits);
    const LoadedScene scene = loaded(file.bytes());
    EXPECT_EQ(scene.mesh.visible()[0], (base::Rgb8{static_cast<std::uint8_t>(bits >> 16), 0x64, 0x50})) << bits;
  }
  EXPECT_EQ(loaded(text_file("property float rgba\n", {"0 0 0 5.5461155e-39"})).mesh.visible()[0],
            (base::Rgb8{60, 100, 80}));
}

TEST(FieldKinds, PackedNumbersThatAreNoColourAreGreyAndSaid) {
  const base::Rgb8 grey{128, 128, 128};
  for (const auto& [type, value] : {std::pair("float", "nan"), std::pair("float", "-nan"), std::pair("float", "inf"),
                                    std::pair("float", "1e39"), std::pair("uint", "nan"), std::pair("uint", "3.5"),
                                    std::pair("uint", "5000000000"), std::pair("int", "-inf")}) {
    const std::string property = std::string("property ") + type + " rgb\n";
    const LoadedScene scene = loaded(text_file(property, {std::string("0 0 0 ") + value, "1 0 0 3957840"}));
    EXPECT_EQ(scene.mesh.visible()[0], grey) << value;
    EXPECT_EQ(scene.mesh.visible()[1], (base::Rgb8{60, 100, 80})) << value;
    EXPECT_EQ(note_count(scene, "clamped_colours"), 1U) << value;
    const LoadedScene faces =
        loaded(text_file("", {"0 0 0", "1 0 0", "0 1 0"}, "element face 1\n" + std::string(kFaces) + property,
                         std::string("3 0 1 2 ") + value + "\n"));
    EXPECT_EQ(faces.mesh.visible()[0], grey) << value;
    EXPECT_EQ(note_count(faces, "clamped_colours"), 3U) << value;
  }
  // With its bits, NaN is a colour, and so is a large float: opaque black.
  EXPECT_EQ(loaded(text_file("property float rgb\n", {"0 0 0 -1.7014118e+38"})).mesh.visible()[0],
            (base::Rgb8{0, 0, 0}));
  for (const std::uint32_t bits : {0x7FC00000U, 0xFFC00000U, 0xFF800000U, 0xFFBC6450U}) {
    PlyBytes file;
    file.text("ply\nformat binary_little_endian 1.0\nelement vertex 3\n" + std::string(kXyz) + "element face 1\n" +
              std::string(kFaces) + "property float rgb\nend_header\n");
    for (const float value : {0.0F, 0.0F, 0.0F, 1.0F, 0.0F, 0.0F, 0.0F, 1.0F, 0.0F}) file.le(value);
    file.le(std::uint8_t{3}).le(0).le(1).le(2).le(bits);
    const LoadedScene scene = loaded(file.bytes());
    EXPECT_EQ(scene.mesh.visible()[0],
              (base::Rgb8{static_cast<std::uint8_t>(bits >> 16), static_cast<std::uint8_t>(bits >> 8),
                          static_cast<std::uint8_t>(bits)}))
        << bits;
    EXPECT_EQ(note_count(scene, "clamped_colours"), 0U) << bits;
  }
}

TEST(FieldKinds, FacesLendColoursAndTemperatureToTheirCorners) {
  const std::string faces =
      "element face 3\nproperty uchar red\nproperty list uchar int vertex_indices\n"
      "property uchar green\nproperty uchar blue\nproperty float temperature\n";
  const LoadedScene scene = loaded(text_file("", {"0 0 0", "1 0 0", "1 1 0", "0 1 0", "9 9 9"}, faces,
                                             "10 3 0 1 2 20 30 20\n21 3 0 2 3 40 50 30\n30 3 1 2 3 60 70 nan\n"));
  const auto colours = scene.mesh.visible();
  const auto celsius = scene.mesh.temperature_celsius();
  EXPECT_EQ(colours[0], (base::Rgb8{16, 30, 40}));  // 15.5 is rounded up.
  EXPECT_EQ(colours[2], (base::Rgb8{20, 40, 50}));
  EXPECT_EQ(colours[4], (base::Rgb8{128, 128, 128}));
  EXPECT_EQ(celsius[0], 25.0F);
  EXPECT_EQ(celsius[1], 20.0F);
  EXPECT_EQ(celsius[3], 30.0F);
  EXPECT_TRUE(std::isnan(celsius[4]));
  EXPECT_EQ(note_count(scene, "face_colours"), 3U);
  EXPECT_EQ(note_count(scene, "face_temperatures"), 3U);
  EXPECT_EQ(note_count(scene, "missing_temperatures"), 1U);
  EXPECT_EQ(note_count(scene, "skipped_face_properties"), 0U);

  ReadOptions options;
  options.temperature_property = "quality";
  options.temperature_unit = TemperatureUnit::Kelvin;
  const LoadedScene named = loaded(
      text_file("", {"0 0 0", "1 0 0", "1 1 0"},
                "element face 1\nproperty list uchar int vertex_indices\nproperty float quality\n", "3 0 1 2 300\n"),
      options);
  EXPECT_FLOAT_EQ(named.mesh.temperature_celsius()[0], 26.85F);
}

TEST(FieldKinds, NamesThatSayTemperature) {
  for (const char* name : {"temperature",
                           "Temperature",
                           "TEMP",
                           "thermal",
                           "therm",
                           "scalar_temperature",
                           "scalar_Temp",
                           "temperature_c",
                           "temperature_degC",
                           "Temp_Celsius",
                           "temp (C)",
                           "temperature_K",
                           "tempC",
                           "TemperatureKelvin",
                           "temp_f",
                           "surfaceTemperature",
                           "surface_temp",
                           "thermal_value",
                           "celsius",
                           "scalar_kelvin",
                           "temperature [\xc2\xb0"
                           "C]"}) {
    EXPECT_GT(temperature_name(name).rank, 0) << name;
    EXPECT_FALSE(temperature_name(name).is_bare_t) << name;
  }
  for (const char* name : {"t", "T", "scalar_T", "scalar_t", "t_c"}) {
    EXPECT_EQ(temperature_name(name).rank, 0) << name;
    EXPECT_TRUE(temperature_name(name).is_bare_t) << name;
  }
  for (const char* name :
       {"quality", "intensity", "scalar", "value", "scalar_Scalar_field", "thermal_intensity", "temperature_gradient",
        "temporal", "temperature_error", "attempt", "template", "confidence", "c", "k", "thermal_id"}) {
    EXPECT_EQ(temperature_name(name).rank, 0) << name;
    EXPECT_FALSE(temperature_name(name).is_bare_t) << name;
  }
  EXPECT_EQ(temperature_name("temp_f").unit, TemperatureUnit::Fahrenheit);
  EXPECT_EQ(temperature_name("scalar_temperature_K").unit, TemperatureUnit::Kelvin);
  EXPECT_EQ(temperature_name("temperature_ck").unit, TemperatureUnit::Centikelvin);
  EXPECT_EQ(temperature_name("temperature").unit, std::nullopt);
}

std::vector<std::string> lines_of(double first, double step, int count, const std::string& rest = {}) {
  std::vector<std::string> lines;
  for (int i = 0; i < count; ++i) {
    // Not only rising, as a clock would.
    lines.push_back(std::to_string(i) + " 0 0 " + std::to_string(first + step * (i % 10)) + rest);
  }
  return lines;
}

TEST(FieldKinds, UnitsOfTwoLettersAreOneWord) {
  for (const char* name : {"temperature_mK", "temp_mK", "tempmK", "temp_MK", "temperature_mk", "scalar_Temp_mK"}) {
    EXPECT_TRUE(
        loaded(text_file(std::string("property float ") + name + "\n", lines_of(293'150, 10, 40))).mesh.has_temperature)
        << name;
  }
  for (const char* name : {"temp_cK", "tempcK", "temperature_ck"}) {
    const LoadedScene scene = loaded(text_file(std::string("property float ") + name + "\n", lines_of(15, 1, 40)));
    EXPECT_NE(note_text(scene, "implausible_temperatures").find("--temperature-unit centikelvin"), std::string::npos)
        << name;
  }
}

TEST(FieldKinds, ABareTMustLookLikeATemperature) {
  const LoadedScene good = loaded(text_file("property float t\n", lines_of(15, 1, 40)));
  EXPECT_TRUE(good.mesh.has_temperature);
  EXPECT_EQ(note_count(good, "temperature_property"), 40U);
  EXPECT_TRUE(loaded(text_file("property float T\n", lines_of(291, 1, 40))).mesh.has_temperature);

  std::vector<std::string> clock;
  for (int i = 0; i < 40; ++i) clock.push_back(std::to_string(i) + " 0 0 " + std::to_string(i * 0.1));
  const std::vector<std::pair<std::string, std::vector<std::string>>> others = {
      {"property double t\n", lines_of(1.7e9, 0.001, 40)},
      {"property float t\n", clock},
      {"property float t\n", lines_of(0, 0.1, 40)},
      {"property float t\nproperty float u\n", lines_of(15, 1, 40, " 0")},
      {"property float t\nproperty float V\n", lines_of(15, 1, 40, " 0")},
      {"property float t\nproperty float s\n", lines_of(15, 1, 40, " 0")},
      {"property float t\nproperty double time\n", lines_of(15, 1, 40, " 0")},
      {"property float t\nproperty uint timestamp\n", lines_of(15, 1, 40, " 0")},
      {"property float t\nproperty ushort ring\n", lines_of(15, 1, 40, " 0")}};
  for (const auto& [properties, lines] : others) {
    const LoadedScene scene = loaded(text_file(properties, lines));
    EXPECT_FALSE(scene.mesh.has_temperature) << properties;
    EXPECT_EQ(note_count(scene, "no_temperature"), 1U) << properties;
  }
  const LoadedScene both = loaded(text_file("property float t\nproperty float temp\n", lines_of(5, 1, 40, " 21")));
  EXPECT_EQ(both.mesh.temperature_celsius()[0], 21.0F);
}

TEST(FieldKinds, WhatIsNotTakenForATemperatureIsSaidWithTheTrueReason) {
  const auto said = [](const std::string& property, const std::string& value) {
    std::vector<std::string> lines;
    for (int i = 0; i < 40; ++i) lines.push_back(std::to_string(i) + " 0 0 " + value);
    const LoadedScene scene = loaded(text_file(property, lines));
    EXPECT_FALSE(scene.mesh.has_temperature) << property;
    return note_text(scene, "no_temperature");
  };
  for (const char* name : {"s_temperature", "time_temp", "temp_id", "thermal_red", "label_temperature", "quality"}) {
    EXPECT_EQ(said("property float " + std::string(name) + "\n", "20"),
              "No property is called a temperature; --temperature-property NAME takes one of: " + std::string(name));
  }
  EXPECT_EQ(said("property list uchar float temperature\n", "1 20"),
            "'temperature' is a list, and not taken for a temperature, which is one number");
  EXPECT_EQ(said("property uint t\n", "20"),
            "'t' is not taken for a temperature, because of its type, uint: whole numbers of that name count time");
  EXPECT_NE(said("property ushort t\n", "20")
                .find("because of its type, ushort: whole numbers of that name count time; "
                      "--temperature-property NAME takes one of: t"),
            std::string::npos);
  EXPECT_EQ(said("property double t\n", "1700000000"),
            "'t' is not taken for a temperature, because of its values (1.7e+09 to 1.7e+09)");
  EXPECT_NE(said("property float t\nproperty float GPS_time\n", "20 7").find("because of 'GPS_time' beside it"),
            std::string::npos);
  EXPECT_EQ(said("property float time\n", "20"), "");
  EXPECT_EQ(
      said("property float stamp\nproperty float t\n", "0.5 20"),
      "'t' is not taken for a temperature, because of 'stamp' beside it; --temperature-property NAME takes one of: t");
  EXPECT_EQ(
      said("property float stamp\nproperty float quality\nproperty float t\n", "0.5 1 20"),
      "'t' is not taken for a temperature, because of 'stamp' beside it; --temperature-property NAME takes one of: t, "
      "quality");
  EXPECT_EQ(said("property uint t\nproperty float quality\n", "20 1"),
            "'t' is not taken for a temperature, because of its type, uint: whole numbers of that name count time; "
            "--temperature-property NAME takes one of: quality");
}

TEST(FieldKinds, ABareTOfTheFacesOrInMillikelvinIsNamed) {
  const auto said = [](const std::string& of_vertices, const std::string& value, const std::string& of_faces) {
    const LoadedScene scene = loaded(text_file(of_vertices, {"0 0 0" + value, "1 0 0" + value, "0 1 0" + value},
                                               "element face 1\n" + std::string(kFaces) + of_faces,
                                               "3 0 1 2" + std::string(of_faces.empty() ? "\n" : " 20\n")));
    EXPECT_FALSE(scene.mesh.has_temperature);
    return note_text(scene, "no_temperature");
  };
  for (const char* name : {"t", "T", "T_C", "scalar_T"}) {
    for (const char* type : {"float ", "double "}) {
      EXPECT_EQ(said("", "", std::string("property ") + type + name + "\n"),
                "'" + std::string(name) +
                    "' is not taken for a temperature, because of its name, which is not enough for one of the faces; "
                    "--temperature-property NAME takes one of: " +
                    name);
    }
  }
  EXPECT_NE(said("", "", "property int t\n").find("because of its type, int"), std::string::npos);
  for (const char* name : {"T_mK", "t_mK", "tMK"}) {
    EXPECT_EQ(said(std::string("property float ") + name + "\n", " 293150", ""),
              "'" + std::string(name) +
                  "' is not taken for a temperature, because of its values (293150 to 293150); --temperature-property "
                  "NAME takes one of: " +
                  name);
  }
}

TEST(FieldKinds, ABareTMayHaveANumberForNoData) {
  ReadOptions named;
  named.no_data = {-9999};
  ReadOptions positive;
  positive.no_data = {9999};
  for (const auto& [none, options] : {std::pair("-9999", ReadOptions{}), std::pair("-9999", named),
                                      std::pair("9999", positive), std::pair("-300", ReadOptions{})}) {
    std::vector<std::string> lines;
    for (int i = 0; i < 40; ++i)
      lines.push_back(std::to_string(i) + " 0 0 " + (i % 5 == 0 ? none : std::to_string(15 + i % 7)));
    const LoadedScene scene = loaded(text_file("property float t\n", lines), options);
    EXPECT_TRUE(scene.mesh.has_temperature) << none;
    EXPECT_EQ(note_count(scene, "missing_temperatures"), 8U) << none;
  }
  // What is left must look like temperatures, and be most of them.
  for (const auto& [none, other] : {std::pair("-9999", 0.01), std::pair("-9999", 1e6)}) {
    std::vector<std::string> lines;
    for (int i = 0; i < 40; ++i)
      lines.push_back(std::to_string(i) + " 0 0 " + (i % 5 == 0 ? none : std::to_string(other * (1 + i % 7))));
    EXPECT_FALSE(loaded(text_file("property float t\n", lines)).mesh.has_temperature) << other;
  }
  std::vector<std::string> lines;
  for (int i = 0; i < 40; ++i)
    lines.push_back(std::to_string(i) + " 0 0 " + (i % 5 != 0 ? "-9999" : std::to_string(15 + i % 7)));
  EXPECT_FALSE(loaded(text_file("property float t\n", lines)).mesh.has_temperature);
}

TEST(FieldKinds, ANameThatTheValuesContradictIsNotCalledTheirLook) {
  const auto note = [](const std::string& name, double first) {
    return note_text(loaded(text_file("property float " + name + "\n", lines_of(first, 0.1, 40))),
                     "implausible_temperatures");
  };
  const std::string contradicted = note("temperature_K", 20);
  EXPECT_EQ(contradicted.find("look like"), std::string::npos) << contradicted;
  EXPECT_NE(contradicted.find("by the name 'temperature_K' (which would make them -253.15"), std::string::npos)
      << contradicted;
  EXPECT_NE(note("temperature_ck", 20).find("-272.95"), std::string::npos) << note("temperature_ck", 20);
  EXPECT_NE(note("temperature_K", 290).find("look like kelvin"), std::string::npos);
}

TEST(FieldKinds, ZeroThatStandsAloneIsAskedAbout) {
  const auto note = [](double first, double step, int zero_count) {
    std::vector<std::string> lines = lines_of(first, step, 40);
    for (int i = 0; i < zero_count; ++i) lines[static_cast<std::size_t>(i)] = std::to_string(i) + " 0 0 0";
    return note_text(loaded(text_file("property float temperature\n", lines)), "implausible_temperatures");
  };
  EXPECT_NE(note(18, 0.3, 13)
                .find("13 are exactly 0 and no other is nearer to it than 18: if 0 stands for no data, "
                      "--no-data 0"),
            std::string::npos)
      << note(18, 0.3, 13);
  EXPECT_EQ(note(18, 0.3, 11), "");
  EXPECT_EQ(note(-20, 4, 13), "");  // Others are near 0 as well.
  EXPECT_EQ(note(-3, 0.5, 13), "");
  EXPECT_EQ(note(5, 10, 13), "");  // They reach so far that 0 may be one of them.
}

TEST(FieldKinds, SharesOfARangeAreNoTemperatures) {
  const LoadedScene shares = loaded(text_file("property float temperature\n", lines_of(0, 0.025, 40)));
  EXPECT_NE(note_text(shares, "implausible_temperatures").find("shares of a range"), std::string::npos);
  EXPECT_EQ(
      note_count(loaded(text_file("property float temperature\n", lines_of(0.5, 0.1, 40))), "implausible_temperatures"),
      0U);
  EXPECT_EQ(
      note_count(loaded(text_file("property float temperature\n", lines_of(0, 0, 40))), "implausible_temperatures"),
      0U);
}

TEST(FieldKinds, ImplausibleTemperaturesSayWhatMendsThem) {
  struct Case {
    std::string property;
    double first;
    double step;
    std::string says;
  };
  const std::vector<Case> cases = {
      {"float temperature", 290, 1, "--temperature-unit kelvin"},
      {"float temperature_K", 20, 1, "--temperature-unit kelvin"},
      {"float temperature_F", 70, 1, "--temperature-unit fahrenheit"},
      {"ushort temperature", 29000, 20, "--temperature-unit centikelvin"},
      {"ushort temperature", 2900, 2, "--temperature-scale 0.1 --temperature-offset -273.15"},
      {"short temperature", 2000, 32,
       "hundredths of a degree (20 to 22.88 degC): --temperature-scale 0.01, or like "
       "tenths of kelvin (-73.15 to -44.35 degC): --temperature-scale 0.1"},
      {"uchar thermal", 20, 20, "--temperature-scale"},
      {"ushort thermal", 7000, 20, "--temperature-scale"}};
  for (const auto& [property, first, step, says] : cases) {
    const LoadedScene scene = loaded(text_file("property " + property + "\n", lines_of(first, step, 40)));
    EXPECT_TRUE(scene.mesh.has_temperature);
    EXPECT_NE(note_text(scene, "implausible_temperatures").find(says), std::string::npos)
        << property << ": " << note_text(scene, "implausible_temperatures");
    EXPECT_EQ(scene.mesh.temperature_celsius()[0], static_cast<float>(first));
  }
  std::vector<std::string> lines = lines_of(15, 1, 40);
  EXPECT_EQ(note_count(loaded(text_file("property float temperature\n", lines)), "implausible_temperatures"), 0U);
  lines[3] = "3 0 0 9999";
  EXPECT_NE(note_text(loaded(text_file("property float temperature\n", lines)), "implausible_temperatures")
                .find("--no-data 9999"),
            std::string::npos);
  lines[3] = "3 0 0 -200";
  EXPECT_NE(note_text(loaded(text_file("property float temperature\n", lines)), "implausible_temperatures")
                .find("--no-data -200"),
            std::string::npos);
}

/// What a note names is taken back to the letter.
TEST(FieldKinds, TheNoDataValueOfANoteWorks) {
  for (const char* type : {"float", "double"}) {
    for (const char* value : {"3.4028234663852886e+38", "-3.4028234663852886e+38", "3.4028235e38", "12345.678",
                              "99999.99", "3000.7654", "-273.1499", "1e20", "16777217"}) {
      std::vector<std::string> lines = lines_of(15, 1, 40);
      lines[3] = std::string("3 0 0 ") + value;
      lines[7] = std::string("7 0 0 ") + value;
      const std::string file = text_file("property " + std::string(type) + " temperature\n", lines);
      const std::string text = note_text(loaded(file), "implausible_temperatures");
      const std::string option = "--no-data ";
      const std::size_t at = text.find(option);
      // Text is read as double, and what is below every float is no temperature anyway.
      if (at == std::string::npos) {
        EXPECT_GE(
            note_count(loaded(file), "impossible_temperatures") + note_count(loaded(file), "over_range_temperatures"),
            2U)
            << type << " " << value;
        continue;
      }
      ReadOptions options;
      options.no_data = {std::stod(text.substr(at + option.size()))};
      EXPECT_EQ(note_count(loaded(file, options), "no_data_temperatures"), 2U) << type << " " << value << ": " << text;
    }
  }
}

TEST(FieldKinds, ASensorsLargestCountDoesNotHideTheUnit) {
  const auto said = [](double first, double step, std::size_t full_count) {
    std::vector<std::string> lines = lines_of(first, step, 40);
    for (std::size_t i = 0; i < full_count; ++i) lines[i] = std::to_string(i) + " 0 0 65535";
    return note_text(loaded(text_file("property ushort temperature\n", lines)), "implausible_temperatures");
  };
  for (const std::size_t full_count : {1U, 25U}) {
    EXPECT_NE(said(29000, 20, full_count).find("centikelvin; if 65535 stands for no data, --no-data 65535"),
              std::string::npos)
        << said(29000, 20, full_count);
    EXPECT_NE(said(290, 1, full_count).find("--temperature-unit kelvin; if 65535"), std::string::npos)
        << said(290, 1, full_count);
    EXPECT_NE(said(7000, 20, full_count).find("counts of a sensor"), std::string::npos);
    EXPECT_NE(said(15, 1, full_count).find(": if 65535 stands for no data, --no-data 65535"), std::string::npos)
        << said(15, 1, full_count);
  }
  EXPECT_NE(said(15, 1, 40).find("--no-data 65535"), std::string::npos) << said(15, 1, 40);
  EXPECT_EQ(said(29000, 20, 0).find("65535"), std::string::npos);
}

TEST(FieldKinds, ColoursUnderPlainNamesAreTakenAndOthersAreNamed) {
  const auto scene_of = [](const std::vector<std::string>& names, const std::string& type = "uchar") {
    std::string properties, values;
    for (const std::string& name : names) {
      properties += "property " + type + ' ' + name + "\n";
      values += ' ' + std::to_string(10 * (1 + values.size()));
    }
    return loaded(text_file(properties, {"0 0 0" + values, "1 0 0" + values}));
  };
  for (const std::vector<std::string>& names : {std::vector<std::string>{"colour_red", "colour_green", "colour_blue"},
                                                {"color_r", "color_g", "color_b"},
                                                {"vertex_red", "vertex_green", "vertex_blue"},
                                                {"red_", "green_", "blue_"},
                                                {"vertexRed", "vertexGreen", "vertexBlue"},
                                                {"scalar_R", "scalar_G", "scalar_B"},
                                                {"Point_Color_Red", "Point_Color_Green", "Point_Color_Blue"}}) {
    const LoadedScene scene = scene_of(names);
    ASSERT_TRUE(scene.mesh.has_visible) << names[0];
    EXPECT_EQ(scene.mesh.visible()[1], (base::Rgb8{10, 40, 70})) << names[0];
    EXPECT_EQ(note_text(scene, "no_colours"), "") << names[0];
    if (names[0] != "scalar_R") {
      EXPECT_NE(note_text(scene, "colour_properties").find(names[0] + ", " + names[1]), std::string::npos) << names[0];
    }
  }
  EXPECT_EQ(scene_of({"color_b", "color_g", "color_r"}).mesh.visible()[0], (base::Rgb8{70, 40, 10}));
  EXPECT_EQ(scene_of({"gray", "color_r", "color_g", "color_b"}).mesh.visible()[0], (base::Rgb8{40, 70, 100}));
  for (const std::vector<std::string>& names : {std::vector<std::string>{"Rf", "Gf", "Bf"},
                                                {"scalar_Rf", "scalar_Gf", "scalar_Bf"},
                                                {"ambient_red", "ambient_green", "ambient_blue"},
                                                {"s_red", "s_green", "s_blue"},
                                                {"scalar_rgb"},
                                                {"intensity"}}) {
    const LoadedScene scene = scene_of(names, "ushort");
    EXPECT_FALSE(scene.mesh.has_visible) << names[0];
    EXPECT_NE(note_text(scene, "no_colours").find("everything is grey; these could be them: " + names[0]),
              std::string::npos)
        << names[0];
    EXPECT_EQ(note_count(scene, "no_colours"), names.size()) << names[0];
  }
  for (const std::vector<std::string>& names :
       {std::vector<std::string>{"quality"}, {"n_r", "n_g"}, {"red", "green", "blue", "intensity"}}) {
    EXPECT_EQ(note_text(scene_of(names), "no_colours"), "") << names[0];
  }
}

TEST(FieldKinds, TexturesAreSeenWhereverTheyAreSaid) {
  const std::string plain = text_file("property float s\nproperty float t\n", {"0 0 0 0.5 0.25"});
  EXPECT_EQ(note_count(loaded(plain), "texture"), 1U);
  EXPECT_EQ(note_count(loaded(text_file("comment TextureFile a b.jpg\n", {"0 0 0"})), "texture"), 1U);
  EXPECT_NE(note_text(loaded(text_file("comment TextureFile a b.jpg\n", {"0 0 0"})), "texture").find("a b.jpg"),
            std::string::npos);
  EXPECT_EQ(
      note_count(loaded(text_file("comment TextureFile a.jpg\n" + std::string(kRgb), {"0 0 0 1 2 3"})), "texture"), 0U);
}

/// The same scene with other line ends and letters in its header.
TEST(FieldKinds, HeadersOfAllEditorsAreRead) {
  const std::string lines =
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
      "property float z\nproperty float temperature\nend_header\n1 2 3 20\n4 5 6 30\n";
  const auto with_ends = [&lines](const std::string& end) {
    std::string text;
    for (const char c : lines) text += c == '\n' ? end : std::string(1, c);
    return text;
  };
  std::vector<std::string> files = {with_ends("\r\n"), with_ends("\r"),         with_ends("\r\r\n"),
                                    with_ends(" \n"),  "\xef\xbb\xbf" + lines,  "\xef\xbb\xbf" + with_ends("\r\n"),
                                    "\n \n" + lines,   "PLY" + lines.substr(3), " ply " + lines.substr(3)};
  std::string shouting = lines;
  for (char& c : shouting) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  files.push_back(shouting);
  for (const std::string& file : files) {
    const LoadedScene scene = loaded(file);
    ASSERT_EQ(scene.mesh.vertex_count(), 2U) << file;
    EXPECT_EQ(scene.mesh.positions()[1], (base::Vec3f{4, 5, 6}));
    EXPECT_EQ(scene.mesh.temperature_celsius()[1], 30.0F);
  }
}

/// A binary body begins right after the end of the header's last line, whatever its first byte.
TEST(FieldKinds, BinaryBodiesFollowHeadersOfAllLineEnds) {
  for (const std::string end : {"\n", "\r\n", "\r"}) {
    PlyBytes file;
    for (const std::string line : {"ply", "format binary_little_endian 1.0", "element vertex 1", "property uint x",
                                   "property float y", "property float z", "end_header"}) {
      file.text(line + end);
    }
    file.le(std::uint32_t{0x0D0A0D0A}).le(1.0F).le(2.0F);
    const LoadedScene scene = loaded(file.bytes());
    ASSERT_EQ(scene.mesh.vertex_count(), 1U);
    EXPECT_EQ(scene.mesh.origin.x + static_cast<double>(scene.mesh.positions()[0].x), double{0x0D0A0D0A});
    EXPECT_EQ(note_count(scene, "trailing_bytes"), 0U);
  }
}

TEST(FieldKinds, ATransferAsTextIsRecognised) {
  PlyBytes good;
  good.text("ply\nformat binary_little_endian 1.0\nelement vertex 400\n" + std::string(kXyz) + std::string(kRgb) +
            "end_header\n");
  for (int i = 0; i < 400; ++i) {
    good.le(static_cast<float>(i)).le(static_cast<float>(i) / 7).le(0.5F);
    good.le(static_cast<std::uint8_t>(i % 32)).le(std::uint8_t{1}).le(std::uint8_t{2});
  }
  ASSERT_TRUE(test::read_bytes(good.bytes()));
  std::string damaged;
  for (const char c : good.bytes()) damaged += c == '\n' ? std::string("\r\n") : std::string(1, c);
  const auto scene = test::read_bytes(damaged);
  ASSERT_FALSE(scene);
  EXPECT_NE(scene.error().message.find("took it for text"), std::string::npos) << scene.error().message;
}

TEST(FieldKinds, ABinaryFileThatBecameUtf8IsRecognised) {
  PlyBytes good;
  good.text("ply\nformat binary_little_endian 1.0\nelement vertex 400\n" + std::string(kXyz) +
            "element face 40\nproperty list uchar int vertex_indices\nend_header\n");
  for (int i = 0; i < 400; ++i) good.le(static_cast<float>(i) / 3).le(static_cast<float>(i) / 7).le(0.5F);
  for (int i = 0; i < 40; ++i) good.le(std::uint8_t{3}).le(i).le(i + 1).le(i + 2);
  ASSERT_TRUE(test::read_bytes(good.bytes()));
  std::string recoded;
  std::string replaced;
  for (const char c : good.bytes()) {
    const auto byte = static_cast<unsigned char>(c);
    const bool is_ascii = byte < 0x80;
    recoded += is_ascii
                   ? std::string(1, c)
                   : std::string{static_cast<char>(0xC0U | (byte >> 6U)), static_cast<char>(0x80U | (byte & 0x3FU))};
    replaced += is_ascii ? std::string(1, c) : std::string("\xEF\xBF\xBD");
  }
  for (const std::string& damaged : {recoded, replaced}) {
    const auto scene = test::read_bytes(damaged);
    ASSERT_FALSE(scene);
    EXPECT_NE(scene.error().message.find("in UTF-8"), std::string::npos) << scene.error().message;
  }
}

TEST(FieldKinds, OtherFilesAreCalledByTheirNames) {
  const std::vector<std::pair<std::string, std::string>> files = {
      {std::string("PK\x03\x04", 4) + "rest", "ZIP"},
      {"BZh91AY", "bzip2"},
      {"\xfd"
       "7zXZ",
       "xz"},
      {"\x28\xb5\x2f\xfd"
       "rest",
       "Zstandard"},
      {"glTF\x02", "GLB"},
      {"DRACO\x02", "Draco"},
      {"LASF", "LAS"},
      {"# .PCD v0.7\n", "PCD"},
      {"solid a\n", "STL"},
      {"v 0 0 0\n", "OBJ"},
      {"<html>", "HTML"},
      {"OFF\n3 1 0\n", "OFF"},
      {std::string("\xff\xfep\0l\0y\0\n\0", 10), "UTF-16"},
      {"version https://git-lfs.github.com/spec/v1\n", "Git LFS"},
      {"\xff\xd8\xff\xe0", "JPEG"},
      {"\x89PNG\r\n", "PNG"},
      {std::string("II*\0\x08\0\0\0", 8), "TIFF"},
      {std::string("MM\0*\0\0\0\x08", 8), "TIFF"},
      {"scene.ply" + std::string(248, '\0') + "ustar" + std::string(250, '\0'), "tar"}};
  for (const auto& [bytes, name] : files) {
    const auto scene = test::read_bytes(bytes);
    ASSERT_FALSE(scene);
    EXPECT_EQ(scene.error().code, base::ErrorCode::BadHeader);
    EXPECT_NE(scene.error().message.find(name), std::string::npos) << scene.error().message;
  }
}

TEST(FieldKinds, ASecondPropertyOfANameIsLeftOut) {
  const LoadedScene scene = loaded(text_file("property float scalar_temperature\nproperty float scalar_temperature\n",
                                             {"0 0 0 20 -1", "1 0 0 21 -1"}));
  EXPECT_EQ(scene.mesh.temperature_celsius()[1], 21.0F);
  EXPECT_EQ(note_count(scene, "skipped_vertex_properties"), 1U);
}

TEST(FieldKinds, TheOnlyListOfFacesHoldsTheirCorners) {
  const auto read = [](const std::string& lists, const std::string& row) {
    return test::read_bytes("ply\nformat ascii 1.0\nelement vertex 3\n" + std::string(kXyz) + "element face 1\n" +
                            lists + "end_header\n0 0 0\n1 0 0\n0 1 0\n" + row + "\n");
  };
  for (const char* name : {"vertex_indicies", "vertexIndices", "indices", "vertices"}) {
    const auto scene = read("property list uchar int " + std::string(name) + "\n", "3 0 1 2");
    ASSERT_TRUE(scene) << scene.error().message;
    EXPECT_EQ(scene.value().mesh.triangle_count(), 1U);
    EXPECT_EQ(note_count(scene.value(), "corner_list"), 1U) << name;
    EXPECT_EQ(note_count(scene.value(), "skipped_face_properties"), 0U) << name;
  }
  const auto beside =
      read("property list uchar float texcoord\nproperty list uchar int tex_ids\nproperty list uchar int corners\n",
           "2 0.5 0.5 1 7 3 0 1 2");
  ASSERT_TRUE(beside) << beside.error().message;
  EXPECT_EQ(beside.value().mesh.triangle_count(), 1U);
  const auto usual = read("property list uchar int others\nproperty list uchar int vertex_index\n", "0 3 0 1 2");
  ASSERT_TRUE(usual) << usual.error().message;
  EXPECT_EQ(note_count(usual.value(), "corner_list"), 0U);
  EXPECT_FALSE(read("property list uchar int a\nproperty list uchar int b\n", "3 0 1 2 0"));
  EXPECT_FALSE(read("property list uchar float texcoord\n", "0"));
}

TEST(FieldKinds, ScalarFieldsOfColoursAreColours) {
  for (const char* names : {"R G B", "red green blue"}) {
    std::istringstream words(names);
    std::string properties, name;
    while (words >> name) properties += "property float scalar_" + name + "\n";
    const LoadedScene scene = loaded(text_file(properties, {"0 0 0 10 20 255", "1 0 0 1 2 3"}));
    EXPECT_TRUE(scene.mesh.has_visible) << names;
    EXPECT_EQ(scene.mesh.visible()[0], (base::Rgb8{10, 20, 255})) << names;
  }
}

TEST(FieldKinds, GreyIsAColour) {
  for (const char* name : {"gray", "grey", "Luminance"}) {
    const LoadedScene scene = loaded(text_file("property uchar " + std::string(name) + "\n", {"0 0 0 7", "1 0 0 200"}));
    EXPECT_TRUE(scene.mesh.has_visible) << name;
    EXPECT_EQ(scene.mesh.visible()[1], (base::Rgb8{200, 200, 200})) << name;
  }
  PlyBytes binary;
  binary.text("ply\nformat binary_little_endian 1.0\nelement vertex 2\n" + std::string(kXyz) +
              "property uchar gray\nend_header\n");
  for (const std::uint8_t level : {std::uint8_t{9}, std::uint8_t{90}}) {
    binary.le(1.0F).le(2.0F).le(3.0F * static_cast<float>(level)).le(level);
  }
  EXPECT_EQ(loaded(binary.bytes()).mesh.visible()[1], (base::Rgb8{90, 90, 90}));
}

TEST(FieldKinds, TheWrongByteOrderOfACloudIsSeen) {
  const auto cloud = [](const std::string& format, const std::string& type, double size) {
    PlyBytes bytes;
    bytes.text("ply\nformat " + format + " 1.0\nelement vertex 200\nproperty " + type + " x\nproperty " + type +
               " y\nproperty " + type + " z\nend_header\n");
    for (int i = 0; i < 200; ++i) {
      for (const double value : {size * std::sin(i), size * std::cos(i), 0.0}) {
        if (type == "float") {
          bytes.le(static_cast<float>(value));
        } else {
          bytes.le(value);
        }
      }
    }
    return test::read_bytes(bytes.bytes());
  };
  for (const char* type : {"float", "double"}) {
    for (const double size : {1e-5, 3.0, 4.5e6}) {
      EXPECT_TRUE(cloud("binary_little_endian", type, size)) << type << size;
      const auto wrong = cloud("binary_big_endian", type, size);
      ASSERT_FALSE(wrong) << type << size;
      EXPECT_NE(wrong.error().message.find("format line binary_little_endian"), std::string::npos)
          << wrong.error().message;
    }
    EXPECT_TRUE(cloud("binary_little_endian", type, 1e-30)) << "small, but no better the other way round: " << type;
  }
}

/// One byte off, the positions make sense only the other way round, by chance.
TEST(FieldKinds, BytesBetweenHeaderAndPositionsAreCounted) {
  for (const bool is_big : {false, true}) {
    for (const auto& [between, count] :
         {std::pair("\n", 1), std::pair("\r\n", 2), std::pair(" \n", 2), std::pair("\n\n\n", 3)}) {
      for (const bool has_faces : {false, true}) {
        PlyBytes bytes;
        bytes.text(std::string("ply\nformat ") + (is_big ? "binary_big_endian" : "binary_little_endian") +
                   " 1.0\nelement vertex 200\n" + std::string(kXyz) +
                   (has_faces ? "element face 1\n" + std::string(kFaces) : "") + "end_header\n" + between);
        for (int i = 0; i < 200; ++i) {
          for (const double value : {3 * std::sin(i), 3 * std::cos(i), 1 + 0.1 * std::sin(2 * i)}) {
            bytes.ordered(is_big, static_cast<float>(value));
          }
        }
        if (has_faces) bytes.ordered(is_big, std::uint8_t{3}).ordered(is_big, 0).ordered(is_big, 1).ordered(is_big, 2);
        const auto scene = test::read_bytes(bytes.bytes());
        ASSERT_FALSE(scene);
        EXPECT_NE(scene.error().message.find(std::to_string(count) + (count == 1 ? " byte" : " bytes") +
                                             " too many between end_header and the first position"),
                  std::string::npos)
            << scene.error().message;
      }
    }
  }
}

/// A text is not bound to its declaration: shares of white were black without a word.
TEST(FieldKinds, ColoursOfATextMayBeOtherThanItSays) {
  const auto colours = [](const std::string& white, const std::string& half) {
    return loaded(text_file(std::string(test::kRgb), {"0 0 0 " + white + " 0 0", "1 0 0 0 " + half + " 0"}));
  };
  for (const auto& [white, half] :
       {std::pair("1.0", "0.5"), std::pair("255.0", "127.5"), std::pair("65535", "32896")}) {
    const LoadedScene scene = colours(white, half);
    EXPECT_EQ(scene.mesh.visible()[0], (base::Rgb8{255, 0, 0})) << white;
    EXPECT_EQ(scene.mesh.visible()[1], (base::Rgb8{0, 128, 0})) << white;
    EXPECT_EQ(note_count(scene, "converted_colours"), 2U) << white;
  }
  const LoadedScene bytes = colours("255.0", "1");
  EXPECT_EQ(bytes.mesh.visible()[1], (base::Rgb8{0, 1, 0}));
  EXPECT_EQ(note_count(bytes, "converted_colours"), 0U);
  EXPECT_FALSE(test::read_bytes(text_file(std::string(test::kRgb), {"0 0 0 -1 0 0"})));
  EXPECT_FALSE(test::read_bytes(text_file(std::string(test::kRgb), {"0 0 0 70000 0 0"})));
}

/// What a person can do about it is in the message.
TEST(FieldKinds, AWrongHeaderIsToldFromADamagedBody) {
  const auto says = [](const std::string& bytes) {
    const auto scene = test::read_bytes(bytes);
    EXPECT_FALSE(scene);
    return scene ? std::string() : scene.error().message;
  };
  const std::string head =
      "element vertex 3\n" + std::string(kXyz) + "element face 1\n" + std::string(test::kFaces) + "end_header\n";
  PlyBytes little;
  for (const float value : {0.1F, 0.2F, 0.3F, 1.1F, 0.0F, 0.3F, 0.1F, 1.2F, 0.3F}) little.le(value);
  little.le(std::uint8_t{3}).le(0).le(1).le(2);
  const std::string text = "0.123 0.234 0.345\n1.123 0.234 0.345\n0.123 1.234 0.345\n3 0 1 2\n";
  EXPECT_NE(says("ply\nformat ascii 1.0\n" + head + little.bytes()).find("what follows is binary"), std::string::npos);
  EXPECT_NE(says("ply\nformat binary_little_endian 1.0\n" + head + text).find("what follows is text"),
            std::string::npos);
  EXPECT_NE(says("ply\nformat binary_little_endian 1.0\n" + head + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
                .find("what follows is text"),
            std::string::npos)
      << "shorter than promised";
  EXPECT_NE(says("ply\nformat binary_big_endian 1.0\n" + head + little.bytes()).find("wrong byte order"),
            std::string::npos);
  EXPECT_NE(says("ply\nformat ascii 1.0\nelement points 1\n" + std::string(kXyz) + "end_header\n0 0 0\n")
                .find("it has 'points'"),
            std::string::npos);
  std::string damaged = text;
  damaged[20] = '\0';
  EXPECT_EQ(says("ply\nformat ascii 1.0\n" + head + damaged).find("what follows is binary"), std::string::npos);
}

TEST(FieldKinds, WholeNumbersOfEveryWidthAreRead) {
  for (const char* type : {"char", "uchar", "short", "ushort", "int", "uint", "int64", "uint64", "long", "ulong"}) {
    for (const bool big_endian : {false, true}) {
      PlyBytes file;
      file.text(std::string("ply\nformat ") + (big_endian ? "binary_big_endian" : "binary_little_endian") +
                " 1.0\nelement vertex 3\nproperty " + type + " x\nproperty float y\nproperty float z\nproperty " +
                type + " temperature\nelement face 1\nproperty list " + type + " " + type +
                " vertex_indices\nend_header\n");
      const auto put = [&](int value) {
        const std::string name = type;
        if (name == "char" || name == "uchar") file.ordered(big_endian, static_cast<std::uint8_t>(value));
        if (name == "short" || name == "ushort") file.ordered(big_endian, static_cast<std::uint16_t>(value));
        if (name == "int" || name == "uint") file.ordered(big_endian, static_cast<std::uint32_t>(value));
        if (name.find("64") != std::string::npos || name.find("long") != std::string::npos) {
          file.ordered(big_endian, static_cast<std::uint64_t>(value));
        }
      };
      for (int i = 0; i < 3; ++i) {
        put(10 + i);
        file.ordered(big_endian, i == 1 ? 1.0F : 0.0F).ordered(big_endian, 0.0F);
        put(20 + i);
      }
      for (const int value : {3, 0, 1, 2}) put(value);
      const LoadedScene scene = loaded(file.bytes());
      ASSERT_EQ(scene.mesh.vertex_count(), 3U) << type;
      EXPECT_EQ(scene.mesh.origin.x + static_cast<double>(scene.mesh.positions()[2].x), 12) << type;
      EXPECT_EQ(scene.mesh.temperature_celsius()[1], 21.0F) << type;
      EXPECT_EQ(scene.mesh.triangle_count(), 1U) << type;
    }
  }
}

TEST(FieldKinds, StripsTurnAndEndAsTheyShould) {
  for (const char* type : {"int", "uint", "short"}) {
    const std::string end = std::string(type) == "uint" ? "4294967295" : "-1";
    const LoadedScene scene =
        loaded(text_file("", {"0 0 0", "0 1 0", "1 0 0", "1 1 0", "nan 0 0"},
                         "element tristrips 2\nproperty list int " + std::string(type) + " vertex_indices\n",
                         "9 0 1 2 3 " + end + " 3 2 1 0\n6 0 1 1 2 4 0\n"));
    EXPECT_EQ(scene.mesh.triangles(), (std::vector<base::Triangle>{{0, 1, 2}, {2, 1, 3}, {3, 2, 1}, {1, 2, 0}}))
        << type;
    EXPECT_EQ(note_count(scene, "triangulated_strips"), 3U) << type;
    EXPECT_EQ(note_count(scene, "left_out_faces"), 2U) << type;
  }
}

std::string gzipped(std::string_view bytes) {
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, 9, Z_DEFLATED, 15 + 16, 9, Z_DEFAULT_STRATEGY), Z_OK);
  std::string packed(deflateBound(&stream, bytes.size()) + 64, '\0');
  std::string input(bytes);
  stream.next_in = reinterpret_cast<Bytef*>(input.data());
  stream.avail_in = static_cast<uInt>(input.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  return packed;
}

TEST(FieldKinds, GzipIsUnpackedWithinBounds) {
  std::vector<std::string> lines;
  for (int i = 0; i < 50'000; ++i)
    lines.push_back(std::to_string(i * 7919 % 100'003) + " 0 0 " + std::to_string(i % 97));
  const std::string plain = text_file("property float temperature\n", lines);
  const std::string packed = gzipped(plain);
  ASSERT_GT(plain.size(), BlockFile::kBufferBytes);
  EXPECT_EQ(loaded(packed).mesh.vertex_count(), 50'000U);
  EXPECT_EQ(loaded(gzipped(plain.substr(0, 1000)) + gzipped(plain.substr(1000))).mesh.vertex_count(), 50'000U);

  // What follows the last member is said.
  EXPECT_EQ(note_count(loaded(packed), "trailing_packed_bytes"), 0U);
  for (const std::string& behind :
       {std::string("x"), std::string(200'000, '\0'), std::string("appended by somebody")}) {
    const LoadedScene scene = loaded(packed + behind);
    EXPECT_EQ(scene.mesh.vertex_count(), 50'000U);
    EXPECT_EQ(note_count(scene, "trailing_packed_bytes"), behind.size());
  }

  const auto cut = test::read_bytes(std::string_view(packed).substr(0, packed.size() / 2));
  ASSERT_FALSE(cut);
  EXPECT_EQ(cut.error().code, base::ErrorCode::Truncated);
  EXPECT_NE(cut.error().message.find("gzip data end early: the file was cut"), std::string::npos)
      << cut.error().message;
  for (const std::size_t size : {std::size_t{2}, std::size_t{9}, packed.size() - 8, packed.size() - 1}) {
    const auto shorter = test::read_bytes(std::string_view(packed).substr(0, size));
    ASSERT_FALSE(shorter) << size;
    EXPECT_EQ(shorter.error().code, base::ErrorCode::Truncated) << size;
  }
  const auto twice = test::read_bytes(gzipped(packed));
  ASSERT_FALSE(twice);
  EXPECT_NE(twice.error().message.find("gzip data: unpack it first"), std::string::npos) << twice.error().message;
  std::string damaged = packed;
  damaged[damaged.size() / 2] = static_cast<char>(damaged[damaged.size() / 2] ^ 0x55);
  const auto broken = test::read_bytes(damaged);
  ASSERT_FALSE(broken);
  EXPECT_NE(broken.error().message.find("gzip"), std::string::npos) << broken.error().message;
}

TEST(FieldKinds, AGzipBombIsRefusedInLittleMemory) {
  const std::uint64_t unpacked = GzipFile::kFreeBytes + 20'000'000;
  const std::uint64_t vertex_count = unpacked / 12;
  std::string plain = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(vertex_count) + "\n" +
                      std::string(kXyz) + "end_header\n";
  plain.resize(plain.size() + vertex_count * 12);
  const std::string packed = gzipped(plain);
  plain.clear();
  plain.shrink_to_fit();
  ASSERT_LT(packed.size() * GzipFile::kMaxRatio, unpacked);
  const test::AllocationMeter meter;
  const auto scene = test::read_bytes(packed);
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().code, base::ErrorCode::TooLarge);
  EXPECT_LT(meter.peak_bytes(), 4'000'000U);
}

}  // namespace
}  // namespace spectra::files
