// Files as people of the field have them, each with one kind of trouble; what each holds is said in its name. Unless said
// otherwise it is a bumpy square of 3 m with 12 x 12 vertices, 18 to 32.5 degC, and (60, 100, 80) for its first colour.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "fused_in_memory.hpp"
#include "fusion/files/ply_fuse.hpp"
#include "fusion/files/ply_reader.hpp"
#include "fusion/fusion_plan.hpp"
#include "fusion/registry.hpp"
#include "fusion/statistics/temperature_statistics.hpp"
#include "loaded.hpp"

namespace spectra::files {
namespace {

using test::note_count;
using test::note_text;

std::filesystem::path field_path(const std::string& name) {
  return std::filesystem::path(SPECTRA_FIELD_DATA) / name;
}

LoadedScene field_scene(const std::string& name, const ReadOptions& options = {}) {
  auto scene = read_ply(field_path(name), options);
  if (!scene) {
    ADD_FAILURE() << scene.error().message;
    return {};
  }
  return std::move(scene).value();
}

std::string field_error(const std::string& name) {
  const auto scene = read_ply(field_path(name));
  if (scene) ADD_FAILURE() << name << " was read";
  return scene ? std::string() : scene.error().message;
}

void expect_in(const std::string& part, const std::string& text) {
  EXPECT_NE(text.find(part), std::string::npos) << "'" << part << "' is not in: " << text;
}

fusion::TemperatureSummary summary_of(const LoadedScene& scene) {
  fusion::TemperatureAccumulator accumulator;
  accumulator.add(scene.mesh.temperature_celsius());
  return accumulator.summary();
}

void expect_usual_temperatures(const LoadedScene& scene) {
  const fusion::TemperatureSummary summary = summary_of(scene);
  EXPECT_TRUE(scene.mesh.has_temperature);
  EXPECT_NEAR(static_cast<double>(summary.minimum), 18, 0.2);
  EXPECT_NEAR(static_cast<double>(summary.maximum), 32.517, 0.01);
}

void expect_usual_colours(const LoadedScene& scene) {
  ASSERT_TRUE(scene.mesh.has_visible);
  EXPECT_EQ(scene.mesh.visible()[0], (base::Rgb8{60, 100, 80}));
  EXPECT_EQ(scene.mesh.visible()[scene.mesh.vertex_count() - 1], (base::Rgb8{170, 199, 80}));
}

void expect_usual_scene(const std::string& name, std::size_t triangle_count = 242) {
  SCOPED_TRACE(name);
  const LoadedScene scene = field_scene(name);
  EXPECT_EQ(scene.mesh.vertex_count(), 144U);
  EXPECT_EQ(scene.mesh.triangle_count(), triangle_count);
  expect_usual_colours(scene);
  expect_usual_temperatures(scene);
}

TEST(FieldFiles, VerticesWithoutAPositionAreLeftOut) {
  for (const auto& [name, triangle_count] :
       {std::pair("01-nan-positions.ply", 0U), {"01b-nan-positions-mesh.ply", 233U}}) {
    const LoadedScene scene = field_scene(name);
    EXPECT_EQ(scene.mesh.vertex_count(), 142U);
    EXPECT_EQ(scene.mesh.triangle_count(), triangle_count);
    EXPECT_EQ(note_count(scene, "left_out_vertices"), 2U);
    ASSERT_EQ(scene.mesh.left_out.size(), 2U);
    EXPECT_EQ(scene.mesh.left_out[0].input_index, 5U);
    for (const base::Vec3f& p : scene.mesh.positions()) EXPECT_TRUE(std::isfinite(p.x + p.y + p.z));
    expect_usual_colours(scene);
    expect_usual_temperatures(scene);
  }
}

TEST(FieldFiles, NanIsKnownInEverySpelling) {
  for (const char* name :
       {"02a-nan-spelling.ply", "02b-nan-spelling.ply", "02d-nan-spelling.ply", "02e-nan-spelling.ply"}) {
    expect_usual_scene(name);
    EXPECT_EQ(note_count(field_scene(name), "missing_temperatures"), 1U) << name;
  }
  expect_usual_scene("02f-nan-normals.ply");
}

TEST(FieldFiles, ColoursAreScaledByWhatTheyHold) {
  for (const char* name : {"03-colours-16-bit.ply", "03b-colours-16-bit-holding-8.ply", "03c-colours-float-0-255.ply",
                           "03d-colours-float-rgba.ply"}) {
    expect_usual_scene(name);
    EXPECT_EQ(note_count(field_scene(name), "converted_colours"), 144U) << name;
  }
}

TEST(FieldFiles, WhatCannotBeATemperatureIsMissing) {
  const LoadedScene dead = field_scene("04-dead-pixel-absolute-zero.ply");
  EXPECT_EQ(note_count(dead, "impossible_temperatures"), 1U);
  expect_usual_temperatures(dead);
  const LoadedScene empty = field_scene("05-no-data-minus-9999.ply");
  EXPECT_EQ(note_count(empty, "impossible_temperatures"), 48U);
  expect_usual_temperatures(empty);
  ReadOptions options;
  options.no_data = {-9999};
  const LoadedScene named = field_scene("05-no-data-minus-9999.ply", options);
  EXPECT_EQ(note_count(named, "no_data_temperatures"), 48U);
  EXPECT_EQ(note_count(named, "impossible_temperatures"), 0U);
}

TEST(FieldFiles, UnitsAreGuessedAloudAndTakenFromTheOption) {
  expect_in("--temperature-unit kelvin", note_text(field_scene("06-kelvin.ply"), "implausible_temperatures"));
  expect_in("--temperature-unit centikelvin",
            note_text(field_scene("07-centikelvin-ushort.ply"), "implausible_temperatures"));
  ReadOptions options;
  options.temperature_unit = TemperatureUnit::Kelvin;
  const LoadedScene kelvin = field_scene("06-kelvin.ply", options);
  expect_usual_temperatures(kelvin);
  EXPECT_EQ(note_count(kelvin, "implausible_temperatures"), 0U);
  options.temperature_unit = TemperatureUnit::Centikelvin;
  const LoadedScene centikelvin = field_scene("07-centikelvin-ushort.ply", options);
  expect_usual_temperatures(centikelvin);
  EXPECT_EQ(note_count(centikelvin, "impossible_temperatures"), 15U);
  options = {};
  options.temperature_scale = 0.01;
  options.temperature_offset = -273.15;
  expect_usual_temperatures(field_scene("07-centikelvin-ushort.ply", options));
}

TEST(FieldFiles, TheTemperatureIsFoundUnderItsNamesOrNamed) {
  for (const char* name : {"08a-field-name.ply", "08f-field-name.ply", "08h-field-name.ply"}) {
    expect_usual_scene(name);
    EXPECT_EQ(note_count(field_scene(name), "temperature_property"), 144U) << name;
  }
  const std::vector<std::pair<std::string, std::string>> named = {{"08b-field-name.ply", "scalar_Scalar_field"},
                                                                  {"08d-field-name.ply", "quality"},
                                                                  {"08j-field-name.ply", "thermal_intensity"},
                                                                  {"08l-field-name.ply", "value"},
                                                                  {"08m-field-name.ply", "scalar"}};
  for (const auto& [name, property] : named) {
    const LoadedScene without = field_scene(name);
    EXPECT_FALSE(without.mesh.has_temperature) << name;
    expect_in("--temperature-property", note_text(without, "no_temperature"));
    expect_in(property, note_text(without, "no_temperature"));
    ReadOptions options;
    options.temperature_property = property;
    const LoadedScene with = field_scene(name, options);
    expect_usual_temperatures(with);
    EXPECT_EQ(note_count(with, "no_temperature"), 0U);
  }
}

TEST(FieldFiles, ATimeIsNoTemperature) {
  const LoadedScene scene = field_scene("09-t-is-time.ply");
  EXPECT_FALSE(scene.mesh.has_temperature);
  expect_in("'t'", note_text(scene, "no_temperature"));
}

TEST(FieldFiles, WhatTheFacesCarryGoesToTheirCorners) {
  const LoadedScene scene = field_scene("12-face-colours.ply");
  ASSERT_TRUE(scene.mesh.has_visible);
  EXPECT_EQ(note_count(scene, "face_colours"), 242U);
  EXPECT_EQ(scene.mesh.visible()[0].r, 200);
  EXPECT_EQ(scene.mesh.visible()[0].b, 30);
}

TEST(FieldFiles, ATextureIsCalledByItsName) {
  const LoadedScene scene = field_scene("13-textured.ply");
  EXPECT_FALSE(scene.mesh.has_visible);
  expect_in("model_tex0.png", note_text(scene, "texture"));
  expect_usual_temperatures(scene);
}

TEST(FieldFiles, HeadersMayLookAsEditorsLeaveThem) {
  for (const char* name : {"14-crlf-binary.ply", "15-header-blanks.ply", "15b-byte-order-mark.ply",
                           "15d-comment-before-format.ply", "15e-latin1-comment.ply"}) {
    expect_usual_scene(name);
  }
  expect_usual_scene("44-crlf-text-no-last-end.ply", 0);
}

TEST(FieldFiles, WhatIsNotReadNamesTheTrueReasonAndThePlace) {
  expect_in("line 13, vertex 1 has '0,272727', a number with a decimal comma", field_error("16-comma-decimals.ply"));
  expect_in("face 242 refers to vertex -1", field_error("24b-one-bad-index.ply"));
  expect_in("ends at face 142, of 242", field_error("31-cut-short.ply"));
  expect_in("line 12, vertex 0 has fewer values", field_error("32-two-lines-a-vertex.ply"));
}

TEST(FieldFiles, DegenerateScenesAreScenes) {
  const std::vector<std::pair<std::string, std::size_t>> files = {
      {"17a-one-vertex.ply", 1},       {"17b-two-vertices.ply", 2}, {"17c-line.ply", 144},
      {"17d-plane.ply", 144},          {"17e-one-place.ply", 144},  {"17f-one-place-mesh.ply", 144},
      {"17g-one-temperature.ply", 144}};
  for (const auto& [name, vertex_count] : files) {
    const LoadedScene scene = field_scene(name);
    EXPECT_EQ(scene.mesh.vertex_count(), vertex_count) << name;
    EXPECT_TRUE(scene.mesh.has_temperature) << name;
    EXPECT_TRUE(scene.notes.empty()) << name << ": " << scene.notes[0].message;
  }
}

TEST(FieldFiles, FlatPlacesFarFromEachOtherAreForm) {
  for (const auto& [name, triangle_count] : {std::pair("39-low-poly-room.ply", 36U), {"40-long-pipe.ply", 24U}}) {
    const LoadedScene scene = field_scene(name);
    EXPECT_EQ(scene.mesh.vertex_count(), 24U) << name;
    EXPECT_EQ(scene.mesh.triangle_count(), triangle_count) << name;
    EXPECT_TRUE(scene.notes.empty()) << name << ": " << scene.notes[0].message;
  }
}

TEST(FieldFiles, CoordinatesOfMapsAreExactOrTheirRoundingIsSaid) {
  const LoadedScene exact = field_scene("18a-utm-double.ply");
  EXPECT_EQ(note_count(exact, "rounded_positions"), 0U);
  EXPECT_NEAR(exact.mesh.origin.x + static_cast<double>(exact.mesh.positions()[1].x), 412345.8727, 1e-6);
  const LoadedScene text = field_scene("18b-utm-float.ply");
  expect_in("0.5 m", note_text(text, "rounded_positions"));
  EXPECT_EQ(text.mesh.origin, exact.mesh.origin);
  for (std::size_t i = 0; i < text.mesh.vertex_count(); ++i) {
    ASSERT_EQ(text.mesh.positions()[i], exact.mesh.positions()[i]) << "what the text says is kept";
  }
  ReadOptions options;
  options.metres_per_unit = 0.3048;
  expect_in("0.1524 m", note_text(field_scene("18b-utm-float.ply", options), "rounded_positions"));
}

TEST(FieldFiles, OtherUnitsOfLengthAreScaled) {
  for (const char* name : {"19-millimetres.ply", "20a-short-positions.ply"}) {
    ReadOptions options;
    options.metres_per_unit = 0.001;
    const LoadedScene scene = field_scene(name, options);
    double furthest = 0;
    for (const base::Vec3f& p : scene.mesh.positions()) furthest = std::max(furthest, static_cast<double>(p.x));
    EXPECT_NEAR(scene.mesh.origin.x + furthest, 3, 1e-3) << name;
    expect_usual_scene(name);
  }
}

TEST(FieldFiles, OtherOrdersTypesAndListsAreRead) {
  expect_usual_scene("21a-faces-first.ply");
  expect_usual_scene("21b-big-endian-camera-edge.ply");
  expect_usual_scene("21c-list-in-vertex.ply", 0);
  expect_usual_scene("24a-broken-faces.ply");
  expect_usual_scene("26-packed-rgb.ply", 0);
  expect_usual_scene("29-gzip.ply.gz");
  expect_usual_scene("30-fortran-exponents.ply", 0);
  expect_usual_scene("37-two-temperatures-case.ply");
  expect_usual_scene("38-bgr-order.ply");
  expect_usual_scene("43-non-manifold.ply", 264);
  EXPECT_EQ(field_scene("11-triangle-soup.ply").mesh.triangle_count(), 242U);
  EXPECT_EQ(field_scene("23-range-grid.ply").mesh.vertex_count(), 144U);
  EXPECT_EQ(field_scene("28-huge-triangle.ply").mesh.triangle_count(), 243U);
  expect_usual_temperatures(field_scene("35-temperature-only.ply"));
}

TEST(FieldFiles, StripsAreCutIntoTheTrianglesOfTheSameMesh) {
  expect_usual_scene("22-triangle-strips.ply");
  const LoadedScene scene = field_scene("22-triangle-strips.ply");
  EXPECT_EQ(note_count(scene, "triangulated_strips"), 11U);
  // Every triangle of the square faces the same side.
  for (const auto& [a, b, c] : scene.mesh.triangles()) {
    const auto p = scene.mesh.positions();
    EXPECT_LT((p[b].x - p[a].x) * (p[c].y - p[a].y) - (p[b].y - p[a].y) * (p[c].x - p[a].x), 0);
  }
}

TEST(FieldFiles, SplatsHaveTheirColour) {
  const LoadedScene scene = field_scene("25-gaussian-splat.ply");
  expect_usual_colours(scene);
  EXPECT_EQ(note_count(scene, "converted_colours"), 144U);
}

TEST(FieldFiles, SaturatedPixelsAreNotMissing) {
  const LoadedScene scene = field_scene("36-saturated-inf.ply");
  EXPECT_EQ(note_count(scene, "over_range_temperatures"), 2U);
  EXPECT_EQ(note_count(scene, "under_range_temperatures"), 1U);
  EXPECT_EQ(note_count(scene, "missing_temperatures"), 0U);
  const float infinity = std::numeric_limits<float>::infinity();
  EXPECT_EQ(scene.mesh.temperature_celsius()[9], infinity);
  EXPECT_EQ(scene.mesh.temperature_celsius()[10], -infinity);
  EXPECT_EQ(scene.mesh.temperature_celsius()[11], infinity);
}

TEST(FieldFiles, AreFusedInBlocksAsInMemory) {
  const test::TemporaryFolder folder;
  const auto out = folder.path() / "fused.ply";
  std::size_t fused_count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(SPECTRA_FIELD_DATA)) {
    SCOPED_TRACE(entry.path().filename().string());
    for (const double scale : {1.0, 0.001}) {
      ReadOptions options;
      options.metres_per_unit = scale;
      const auto scene = read_ply(entry.path(), options);
      for (const char* method : {"histogram_bin", "thermal_visible_blend"}) {
        fusion::FusionChange change;
        change.method = method;
        const fusion::FusionSettings settings = fusion::with_change(fusion::default_settings(), change).value();
        const auto fused = fuse_ply(entry.path(), out, settings, options);
        ASSERT_EQ(fused.has_value(), scene.has_value());
        if (!scene) {
          EXPECT_EQ(fused.error().message, scene.error().message);
          continue;
        }
        EXPECT_TRUE(test::file_bytes(out) == test::fused_in_memory(scene.value(), settings)) << method;
        ASSERT_EQ(fused.value().notes.size(), scene.value().notes.size());
        for (std::size_t i = 0; i < scene.value().notes.size(); ++i) {
          EXPECT_EQ(fused.value().notes[i].message, scene.value().notes[i].message);
        }
        ++fused_count;
      }
    }
  }
  EXPECT_GT(fused_count, 200U);
}

TEST(FieldFiles, FuseWritesWhatIsLeftOutInItsPlace) {
  const test::TemporaryFolder folder;
  const auto out = folder.path() / "fused.ply";
  fusion::FusionChange change;
  change.method = "thermal_only";
  ASSERT_TRUE(fuse_ply(field_path("01b-nan-positions-mesh.ply"), out,
                       fusion::with_change(fusion::default_settings(), change).value()));
  const auto again = read_ply(out);
  ASSERT_TRUE(again);
  const mesh::MultispectralMesh& mesh = again.value().mesh;
  const LoadedScene before = field_scene("01b-nan-positions-mesh.ply");
  EXPECT_EQ(mesh.vertex_count(), 142U);
  EXPECT_EQ(mesh.triangles(), before.mesh.triangles());
  ASSERT_EQ(mesh.left_out.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(mesh.left_out[i].input_index, before.mesh.left_out[i].input_index);
    EXPECT_EQ(mesh.left_out[i].visible, before.mesh.left_out[i].visible);
    EXPECT_EQ(mesh.left_out[i].temperature_celsius, before.mesh.left_out[i].temperature_celsius);
    EXPECT_TRUE(std::isnan(mesh.left_out[i].position.x));
  }
  EXPECT_NE(mesh.visible()[0], before.mesh.visible()[0]);
}

}  // namespace
}  // namespace spectra::files
