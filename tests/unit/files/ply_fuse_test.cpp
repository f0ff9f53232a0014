#include "fusion/files/ply_fuse.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <vector>

#include "allocation_meter.hpp"
#include "fused_in_memory.hpp"
#include "fusion/files/scene_survey.hpp"
#include "fusion/registry.hpp"
#include "loaded.hpp"

namespace spectra::files {
namespace {

fusion::FusionSettings settings_of(const std::string& method) {
  fusion::FusionChange change;
  change.method = method;
  return fusion::with_change(fusion::default_settings(), change).value();
}

std::string fused_in_memory(const std::filesystem::path& in, const fusion::FusionSettings& settings,
                            const ReadOptions& options = {}) {
  const auto scene = read_ply(in, options);
  EXPECT_TRUE(scene);
  return test::fused_in_memory(scene.value(), settings);
}

void expect_same_bytes(const test::TemporaryFolder& folder, const std::filesystem::path& in,
                       const std::string& method) {
  const auto out = folder.path() / "fused.ply";
  const auto result = fuse_ply(in, out, settings_of(method));
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_TRUE(test::file_bytes(out) == fused_in_memory(in, settings_of(method))) << method;
}

/// Enough vertices for several blocks, some without temperature, far from the origin when asked for.
std::string wavy_scene(const std::string& coordinate, double offset, bool faces_first = false) {
  constexpr std::uint32_t kSide = 60;
  const std::string face = "element face " + std::to_string(kSide * (kSide - 1)) + "\n" + std::string(test::kFaces);
  const std::string vertex = "element vertex " + std::to_string(kSide * kSide) + "\nproperty " + coordinate +
                             " x\nproperty " + coordinate + " y\nproperty " + coordinate + " z\n" +
                             std::string(test::kRgb) + "property float temperature\n";
  test::PlyBytes vertices;
  for (std::uint32_t v = 0; v < kSide * kSide; ++v) {
    for (const double value : {offset + v % kSide * 0.1, offset + v / kSide * 0.1, std::sin(v)}) {
      if (coordinate == "double") {
        vertices.le(value);
      } else {
        vertices.le(static_cast<float>(value));
      }
    }
    vertices.le(static_cast<std::uint8_t>(v % 256)).le(static_cast<std::uint8_t>(v % 7)).le(std::uint8_t{90});
    vertices.le(v % 11 == 0 ? std::nanf("") : static_cast<float>(20 + 10 * std::sin(v * 0.01)));
  }
  test::PlyBytes faces;
  for (std::uint32_t i = 0; i < kSide * (kSide - 1); ++i) {
    faces.le(std::uint8_t{4}).le(i).le((i + 1) % (kSide * kSide)).le(i + kSide).le(i);
  }
  return "ply\nformat binary_little_endian 1.0\n" + (faces_first ? face + vertex : vertex + face) + "end_header\n" +
         (faces_first ? faces.bytes() + vertices.bytes() : vertices.bytes() + faces.bytes());
}

TEST(PlyFuse, HasTheBytesOfTheWholeMeshInMemory) {
  const test::TemporaryFolder folder;
  const auto in = folder.write("in.ply", wavy_scene("float", 0));
  for (const fusion::Method* method : fusion::all_methods()) expect_same_bytes(folder, in, method->id);
  expect_same_bytes(folder, folder.write("far.ply", wavy_scene("float", 5000)), "thermal_visible_blend");
  expect_same_bytes(folder, folder.write("utm.ply", wavy_scene("double", 447'000.1)), "histogram_bin");
  expect_same_bytes(folder, folder.write("faces.ply", wavy_scene("float", 0, true)), "thermal_only");
}

TEST(PlyFuse, HasThemWithoutTemperaturesColoursOrFaces) {
  const test::TemporaryFolder folder;
  const std::string head = "ply\nformat ascii 1.0\nelement vertex 2\n" + std::string(test::kXyz);
  expect_same_bytes(folder, folder.write("a.ply", head + "end_header\n0 0 0\n1 1 1\n"), "thermal_visible_blend");
  expect_same_bytes(folder,
                    folder.write("b.ply", head + std::string(test::kRgb) + "end_header\n0 0 0 1 2 3\n1 1 1 4 5 6\n"),
                    "histogram_distribution");
  expect_same_bytes(folder, folder.write("c.ply", head + "property float t\nend_header\n0 0 0 20\n1 1 1 30\n"),
                    "histogram_bin");
}

/// Holes that are written as a number stay where they were, and colour nothing.
TEST(PlyFuse, WritesHolesInTheirPlace) {
  const test::TemporaryFolder folder;
  std::string text = "ply\nformat ascii 1.0\nelement vertex 120\n" + std::string(test::kXyz) + std::string(test::kRgb) +
                     "property float temperature\nend_header\n";
  for (int i = 0; i < 120; ++i) {
    text += i % 4 == 3
                ? "0 0 0 9 8 7 0\n"
                : std::to_string(i) + " " + std::to_string(i % 7) + " 5000 200 90 30 2" + std::to_string(i % 10) + "\n";
  }
  const auto in = folder.write("holes.ply", text);
  expect_same_bytes(folder, in, "thermal_only");
  const auto result = fuse_ply(in, folder.path() / "out.ply", settings_of("thermal_only"));
  ASSERT_TRUE(result);
  EXPECT_EQ(result.value().temperature.minimum, 20);
  const auto out = read_ply(folder.path() / "out.ply");
  ASSERT_TRUE(out);
  ASSERT_EQ(out.value().mesh.left_out.size(), 30U);
  EXPECT_EQ(out.value().mesh.left_out[1].input_index, 7U);
  EXPECT_EQ(out.value().mesh.left_out[1].position, (base::Vec3d{0, 0, 0}));
  EXPECT_EQ(out.value().mesh.left_out[1].visible, (base::Rgb8{9, 8, 7}));
}

TEST(PlyFuse, HasThemOfTextWithMoreDigitsThanItDeclares) {
  const test::TemporaryFolder folder;
  const std::string head = "ply\nformat ascii 1.0\nelement vertex 2\n" + std::string(test::kXyz) + "end_header\n";
  expect_same_bytes(folder, folder.write("fine.ply", head + "4512345.678 1.1 2\n4512345.111 1.2 3\n"), "visible_only");
  expect_same_bytes(folder, folder.write("coarse.ply", head + "4512345.5 1.1 2\n4512346 1.2 3\n"), "visible_only");
}

TEST(PlyFuse, HasThemOfConcavePolygons) {
  const test::TemporaryFolder folder;
  const std::string head = "ply\nformat ascii 1.0\n";
  const std::string vertices = "element vertex 7\n" + std::string(test::kXyz) + "property float temperature\n";
  const std::string faces = "element face 2\n" + std::string(test::kFaces);
  const std::string vertex_lines = "9 9 nan 1\n0 0 0 1\n3 0 0 2\n3 1 0 3\n1 1 0 4\n1 3 0 5\n0 3 0 6\n";
  const std::string face_lines = "6 2 3 4 5 6 1\n4 3 4 5 2\n";
  expect_same_bytes(folder, folder.write("a.ply", head + vertices + faces + "end_header\n" + vertex_lines + face_lines),
                    "histogram_bin");
  expect_same_bytes(folder, folder.write("b.ply", head + faces + vertices + "end_header\n" + face_lines + vertex_lines),
                    "thermal_only");
}

/// Up and unit of a file as told, or as the options say, are those of what is written from it.
TEST(PlyFuse, SaysAgainWhatWasToldOfTheCoordinates) {
  struct Case {
    const char* comments;
    std::optional<base::UpAxis> wanted_up;
    std::optional<double> metres_per_unit;
    const char* written;
  };
  const test::TemporaryFolder folder;
  const auto out = folder.path() / "out.ply";
  for (const Case& one : std::initializer_list<Case>{
           {"", {}, {}, ""},
           {"obj_info num_cols 2\ncomment made by hand\n", {}, {}, ""},
           {"comment Y-up\n", {}, {}, "comment up y\n"},
           {"comment xyz metres, y = elevation\n", {}, {}, "comment up y; positions in metres\n"},
           {"comment gravity 0 0 9.81\nobj_info units: mm\n", {}, {}, "comment up -z; positions in millimetres\n"},
           {"comment coordinates in inches\n", {}, {}, "comment positions in inches\n"},
           {"comment units = um\n", {}, {}, "comment positions in micrometres\n"},
           {"comment unit: ft\n", {}, {}, "comment positions in feet\n"},
           {"comment values in cm\n", {}, {}, "comment positions in centimetres\n"},
           {"comment in inches\n", {}, {}, "comment positions in inches\n"},
           {"comment x up\ncomment y up\n", {}, {}, ""},
           {"comment x up\n", base::UpAxis::MinusX, {}, "comment up -x\n"},
           {"comment x up\ncomment units: mm\n", {}, 0.001, "comment up x; positions in metres\n"},
           {"", base::UpAxis::Z, 1.0, "comment up z; positions in metres\n"}}) {
    const auto in =
        folder.write("in.ply", "ply\nformat ascii 1.0\n" + std::string(one.comments) + "element vertex 2\n" +
                                   std::string(test::kXyz) + "end_header\n0 0 0\n1 1 1\n");
    ReadOptions options;
    options.up = one.wanted_up;
    options.metres_per_unit = one.metres_per_unit;
    ASSERT_TRUE(fuse_ply(in, out, settings_of("visible_only"), options));
    const std::string bytes = test::file_bytes(out);
    EXPECT_EQ(bytes, fused_in_memory(in, settings_of("visible_only"), options));
    const std::string head = "ply\nformat binary_little_endian 1.0\ncomment written by Spectra\n";
    EXPECT_EQ(bytes.substr(0, bytes.find("element")), head + one.written) << one.comments;
    auto scene = read_ply(in, options);
    auto again = read_ply(out);
    ASSERT_TRUE(scene && again);
    survey(scene.value(), options);
    survey(again.value());
    EXPECT_EQ(again.value().mesh.up, scene.value().mesh.up) << one.comments;
    EXPECT_EQ(again.value().mesh.is_metric, scene.value().mesh.is_metric) << one.comments;
    EXPECT_EQ(test::note_count(again.value(), "unit_told"), test::note_count(scene.value(), "unit_told"));
    EXPECT_EQ(again.value().mesh.told.unit, scene.value().mesh.told.unit);
  }
}

TEST(PlyFuse, ReportsWhatItDid) {
  const test::TemporaryFolder folder;
  const auto result =
      fuse_ply(folder.write("in.ply", wavy_scene("float", 0)), folder.path() / "out.ply", settings_of("thermal_only"));
  ASSERT_TRUE(result);
  EXPECT_EQ(result.value().vertex_count, 3600U);
  EXPECT_EQ(result.value().triangle_count, 3540U);
  EXPECT_EQ(result.value().temperature.missing_count, 328U);
  EXPECT_EQ(result.value().plan.range_maximum(), static_cast<double>(result.value().temperature.maximum));
  EXPECT_FALSE(result.value().notes.empty());
}

TEST(PlyFuse, MayReplaceItsInput) {
  const test::TemporaryFolder folder;
  const auto path = folder.write("in.ply", wavy_scene("float", 0));
  const std::string expected = fused_in_memory(path, settings_of("thermal_only"));
  ASSERT_TRUE(fuse_ply(path, path, settings_of("thermal_only")));
  EXPECT_TRUE(test::file_bytes(path) == expected);
}

TEST(PlyFuse, LeavesNothingBehindWhenTheInputIsBad) {
  const test::TemporaryFolder folder;
  const auto bad = folder.write("in.ply", wavy_scene("float", 0).substr(0, 60'000));
  const auto result = fuse_ply(bad, folder.path() / "out.ply", settings_of("thermal_only"));
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::Truncated);
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "out.ply"));
}

TEST(PlyFuse, NamesTheOutputWhenThatFails) {
  const test::TemporaryFolder folder;
  const auto in = folder.write("in.ply", wavy_scene("float", 0));
  const auto result = fuse_ply(in, "/dev/full", settings_of("thermal_only"));
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::FileUnwritable);
  EXPECT_EQ(result.error().message.rfind("/dev/full", 0), 0U) << result.error().message;
}

TEST(PlyFuse, NeedsMemoryOfFixedSize) {
  const char* const data = std::getenv("SPECTRA_TEST_DATA");
  if (data == nullptr) GTEST_SKIP() << "SPECTRA_TEST_DATA does not name a folder with the real scenes";
  const auto in = std::filesystem::path(data) / "arco_castle_1m.ply";
  if (!std::filesystem::exists(in)) GTEST_SKIP() << in << " is not there";
  const test::TemporaryFolder folder;
  const test::AllocationMeter meter;
  ASSERT_TRUE(fuse_ply(in, folder.path() / "out.ply", settings_of("histogram_bin")));
  EXPECT_LT(meter.peak_bytes(), 3'000'000U);
  EXPECT_TRUE(test::file_bytes(folder.path() / "out.ply") == fused_in_memory(in, settings_of("histogram_bin")));
}

}  // namespace
}  // namespace spectra::files
