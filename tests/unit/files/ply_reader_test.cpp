#include "fusion/files/ply_reader.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "allocation_meter.hpp"
#include "fusion/files/ply_stream.hpp"
#include "fusion/files/ply_writer.hpp"
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

std::string ascii_head(std::uint64_t vertices, std::string_view properties, std::uint64_t faces = 0,
                       std::string_view face_properties = kFaces) {
  std::string head = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(vertices) + "\n";
  head += properties;
  if (faces > 0) head += "element face " + std::to_string(faces) + "\n" + std::string(face_properties);
  return head + "end_header\n";
}

void expect_sample(const LoadedScene& scene) {
  const mesh::MultispectralMesh& mesh = scene.mesh;
  ASSERT_EQ(mesh.vertex_count(), 4U);
  EXPECT_EQ(mesh.positions()[1], (base::Vec3f{1, 0.5F, -2}));
  EXPECT_EQ(mesh.positions()[3], (base::Vec3f{0.25F, 1, 0}));
  EXPECT_TRUE(mesh.has_visible);
  EXPECT_EQ(mesh.visible()[0], (base::Rgb8{1, 2, 3}));
  EXPECT_EQ(mesh.visible()[2], (base::Rgb8{255, 0, 128}));
  EXPECT_TRUE(mesh.has_temperature);
  EXPECT_EQ(mesh.temperature_celsius()[0], 36.5F);
  EXPECT_TRUE(std::isnan(mesh.temperature_celsius()[1]));
  EXPECT_EQ(mesh.temperature_celsius()[3], -40.0F);
  EXPECT_EQ(note_count(scene, "missing_temperatures"), 1U);
  EXPECT_EQ(mesh.triangles(), (std::vector<base::Triangle>{{0, 1, 2}, {0, 2, 3}}));
  EXPECT_FALSE(mesh.is_point_cloud());
}

std::string sample_head(const std::string& format) {
  return "ply\nformat " + format + " 1.0\nelement vertex 4\n" + std::string(kXyz) + std::string(kRgb) +
         "property float temperature\nelement face 2\n" + std::string(kFaces) + "end_header\n";
}

std::string binary_sample(bool big_endian) {
  PlyBytes file;
  file.text(sample_head(big_endian ? "binary_big_endian" : "binary_little_endian"));
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float positions[4][3] = {{0, 0, 0}, {1, 0.5F, -2}, {3, 1, 1}, {0.25F, 1, 0}};
  const int colours[4][3] = {{1, 2, 3}, {4, 5, 6}, {255, 0, 128}, {7, 8, 9}};
  const float temperatures[4] = {36.5F, nan, 20, -40};
  for (std::size_t i = 0; i < 4; ++i) {
    for (const float value : positions[i]) file.ordered(big_endian, value);
    for (const int value : colours[i]) file.ordered(big_endian, static_cast<std::uint8_t>(value));
    file.ordered(big_endian, temperatures[i]);
  }
  for (const base::Triangle& triangle : {base::Triangle{0, 1, 2}, base::Triangle{0, 2, 3}}) {
    file.ordered(big_endian, std::uint8_t{3});
    for (const std::uint32_t index : triangle) file.ordered(big_endian, static_cast<std::int32_t>(index));
  }
  return file.bytes();
}

TEST(PlyReader, ReadsAscii) {
  expect_sample(loaded(sample_head("ascii") +
                       "0 0 0 1 2 3 36.5\n1 .5 -2e0 4 5 6 nan\n3 1 1 255 0 128 20\n0.25 +1 0 7 8 9 -4e1\n"
                       "3 0 1 2\n3 0 2 3\n"));
}

TEST(PlyReader, ReadsAsciiWithCarriageReturnsEmptyLinesAndNoLastLineEnd) {
  expect_sample(
      loaded("ply\r\nformat ascii 1.0\r\nelement vertex 4\r\nproperty float x\r\nproperty float y\r\n"
             "property float z\r\nproperty uchar red\r\nproperty uchar green\r\nproperty uchar blue\r\n"
             "property float temperature\r\nelement face 2\r\nproperty list uchar int vertex_index\r\n"
             "end_header\r\n0 0 0 1 2 3 36.5\r\n\r\n1\t.5 -2 4 5 6 NaN  \r\n3 1 1 255 0 128 20\r\n"
             "0.25 1 0 7 8 9 -40\r\n3 0 1 2\r\n3 0 2 3"));
}

TEST(PlyReader, ReadsBinaryOfBothByteOrders) {
  expect_sample(loaded(binary_sample(false)));
  expect_sample(loaded(binary_sample(true)));
}

TEST(PlyReader, ReadsBinaryAfterAHeaderWithCarriageReturns) {
  std::string bytes = binary_sample(false);
  const std::size_t body = bytes.find("end_header\n") + 11;
  std::string head;
  for (const char c : bytes.substr(0, body)) head += c == '\n' ? std::string("\r\n") : std::string(1, c);
  expect_sample(loaded(head + bytes.substr(body)));
}

TEST(PlyReader, ReadsEveryScalarTypeAndSkipsWhatItDoesNotKnow) {
  for (const bool big_endian : {false, true}) {
    PlyBytes file;
    file.text(std::string("ply\nformat ") + (big_endian ? "binary_big_endian" : "binary_little_endian") +
              " 1.0\nelement camera 2\nproperty char a\nproperty list ushort double d\nproperty short b\n"
              "element vertex 3\nproperty double nx\nproperty float x\nproperty uint flags\nproperty double y\n"
              "property ushort u\nproperty float z\nproperty list uchar short tags\nproperty double temp\n"
              "element empty 5\nelement face 1\nproperty uchar group\nproperty list uint ushort vertex_indices\n"
              "property list char float texcoord\nelement edge 1\nproperty int v\nend_header\n");
    for (int camera = 0; camera < 2; ++camera) {
      file.ordered(big_endian, std::int8_t{-1}).ordered(big_endian, std::uint16_t{2});
      file.ordered(big_endian, 1.0).ordered(big_endian, 2.0).ordered(big_endian, std::int16_t{-5});
    }
    for (std::uint8_t i = 0; i < 3; ++i) {
      file.ordered(big_endian, 9.0).ordered(big_endian, static_cast<float>(i)).ordered(big_endian, 77U);
      file.ordered(big_endian, 0.5 * i).ordered(big_endian, std::uint16_t{1}).ordered(big_endian, i * 0.25F);
      file.ordered(big_endian, i);
      for (std::uint8_t k = 0; k < i; ++k) file.ordered(big_endian, std::int16_t{-7});
      file.ordered(big_endian, 20.0 + i);
    }
    file.ordered(big_endian, std::uint8_t{1}).ordered(big_endian, std::uint32_t{3});
    for (const std::uint16_t index : {std::uint16_t{2}, std::uint16_t{1}, std::uint16_t{0}}) {
      file.ordered(big_endian, index);
    }
    file.ordered(big_endian, std::int8_t{1}).ordered(big_endian, 0.5F).ordered(big_endian, std::int32_t{4});

    const LoadedScene scene = loaded(file.bytes());
    ASSERT_EQ(scene.mesh.vertex_count(), 3U);
    EXPECT_EQ(scene.mesh.positions()[2], (base::Vec3f{2, 1, 0.5F}));
    EXPECT_EQ(scene.mesh.temperature_celsius()[2], 22.0F);
    EXPECT_EQ(scene.mesh.triangles(), (std::vector<base::Triangle>{{2, 1, 0}}));
    EXPECT_FALSE(scene.mesh.has_visible);
    EXPECT_TRUE(scene.mesh.double_positions);
    EXPECT_EQ(note_count(scene, "skipped_vertex_properties"), 4U);
    EXPECT_EQ(note_count(scene, "skipped_face_properties"), 2U);
    EXPECT_EQ(note_count(scene, "skipped_elements"), 2U);
    EXPECT_EQ(note_count(scene, "trailing_bytes"), 0U);
  }
}

TEST(PlyReader, SkipsTheSameInAscii) {
  const LoadedScene scene = loaded(
      "ply\nformat ascii 1.0\nelement camera 1\nproperty list uchar float m\nproperty int id\nelement vertex 3\n"
      "property list uchar int tags\nproperty float x\nproperty float y\nproperty float z\nproperty float q\n"
      "element face 1\nproperty list uchar int vertex_indices\nproperty list uchar float uv\nend_header\n"
      "2 not_read 1.5 8\n0 0 0 0 9\n1 5 1 0 0 9\n3 5 5 5 0 1 0 9\n3 0 1 2 2 0.1 0.2\n");
  ASSERT_EQ(scene.mesh.vertex_count(), 3U);
  EXPECT_EQ(scene.mesh.positions()[2], (base::Vec3f{0, 1, 0}));
  EXPECT_EQ(scene.mesh.triangle_count(), 1U);
}

TEST(PlyReader, ReadsFacesThatStandBeforeTheVertices) {
  const LoadedScene scene =
      loaded("ply\nformat ascii 1.0\nelement face 1\n" + std::string(kFaces) + "element vertex 3\n" +
             std::string(kXyz) + "end_header\n3 0 1 2\n0 0 0\n1 0 0\n0 1 0\n");
  EXPECT_EQ(scene.mesh.triangle_count(), 1U);
}

TEST(PlyReader, FindsColoursUnderTheirNames) {
  for (const char* names : {"property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\n",
                            "property uchar diffuse_red\nproperty uchar diffuse_green\nproperty uchar diffuse_blue\n"
                            "property uchar diffuse_alpha\n",
                            "property uchar r\nproperty uchar g\nproperty uchar b\nproperty uchar a\n",
                            "property uchar Red\nproperty uchar Green\nproperty uchar Blue\nproperty uchar Alpha\n"}) {
    const LoadedScene scene = loaded(ascii_head(1, std::string(kXyz) + names) + "0 0 0 10 20 30 40\n");
    EXPECT_TRUE(scene.mesh.has_visible) << names;
    EXPECT_EQ(scene.mesh.visible()[0], (base::Rgb8{10, 20, 30})) << names;
    EXPECT_EQ(note_count(scene, "skipped_vertex_properties"), 1U) << names;
  }
}

TEST(PlyReader, IsGreyWithoutAllThreeChannels) {
  const LoadedScene scene = loaded(ascii_head(1, std::string(kXyz) + "property uchar red\n") + "0 0 0 10\n");
  EXPECT_FALSE(scene.mesh.has_visible);
  EXPECT_EQ(scene.mesh.visible()[0], (base::Rgb8{128, 128, 128}));
  EXPECT_EQ(note_count(scene, "skipped_vertex_properties"), 1U);
}

TEST(PlyReader, ConvertsColoursOfOtherTypes) {
  const std::string floats = "property float red\nproperty float green\nproperty float blue\n";
  const LoadedScene scaled = loaded(ascii_head(1, std::string(kXyz) + floats) + "0 0 0 0 0.5 1\n");
  EXPECT_EQ(scaled.mesh.visible()[0], (base::Rgb8{0, 128, 255}));
  EXPECT_EQ(note_count(scaled, "converted_colours"), 1U);

  const std::string ints = "property int red\nproperty int green\nproperty int blue\n";
  EXPECT_EQ(loaded(ascii_head(1, std::string(kXyz) + ints) + "0 0 0 1 2 255\n").mesh.visible()[0],
            (base::Rgb8{1, 2, 255}));

  PlyBytes binary;
  binary.text("ply\nformat binary_little_endian 1.0\nelement vertex 1\n" + std::string(kXyz) +
              "property ushort red\nproperty ushort green\nproperty ushort blue\nend_header\n");
  binary.le(0.0F).le(0.0F).le(0.0F).le(std::uint16_t{7}).le(std::uint16_t{8}).le(std::uint16_t{9});
  EXPECT_EQ(loaded(binary.bytes()).mesh.visible()[0], (base::Rgb8{7, 8, 9}));
}

TEST(PlyReader, AnOverExposedColourDoesNotDarkenTheOthers) {
  const std::string head = std::string(kXyz) + "property float red\nproperty float green\nproperty float blue\n";
  std::string shares, levels;
  for (int i = 0; i < 20; ++i) {
    shares += std::to_string(i) + " 0 0 0.5 0.2 0.75\n";
    levels += std::to_string(i) + " 0 0 " + std::to_string(i) + " 0.5 3\n";
  }
  for (const char* sun : {"7.06", "300", "100000"}) {
    const LoadedScene scene = loaded(ascii_head(21, head) + shares + "0 1 0 " + sun + " 0 1\n");
    EXPECT_EQ(scene.mesh.visible()[0], (base::Rgb8{128, 51, 191})) << sun;
    EXPECT_EQ(scene.mesh.visible()[20], (base::Rgb8{255, 0, 255})) << sun;
    EXPECT_EQ(note_count(scene, "clamped_colours"), 1U) << sun;
  }
  const LoadedScene dark = loaded(ascii_head(20, head) + levels);
  EXPECT_EQ(dark.mesh.visible()[19], (base::Rgb8{19, 1, 3}));
  // White is a share, too; but where all numbers are whole, 1 is nearly black.
  std::string white, ones;
  for (int i = 0; i < 20; ++i) {
    white += std::to_string(i) + " 0 0 1 1 " + (i % 2 == 0 ? "1" : "0.5") + '\n';
    ones += std::to_string(i) + " 0 0 1 0 1\n";
  }
  const LoadedScene bright = loaded(ascii_head(21, head) + white + "0 1 0 7.06 7 7\n");
  EXPECT_EQ(bright.mesh.visible()[0], (base::Rgb8{255, 255, 255}));
  EXPECT_EQ(bright.mesh.visible()[1], (base::Rgb8{255, 255, 128}));
  EXPECT_EQ(note_count(bright, "clamped_colours"), 1U);
  for (const char* rest : {"255 0 0", "255 nan inf", "255 -inf -3"}) {
    const LoadedScene whole = loaded(ascii_head(21, head) + ones + "0 1 0 " + rest + "\n");
    EXPECT_EQ(whole.mesh.visible()[0], (base::Rgb8{1, 0, 1})) << rest;
  }
}

/// The first vertex has the colour `level`, the second 0; what is said is left in `said`.
base::Rgb8 colour_of_type(const std::string& type, const std::string& level, const ReadOptions& options,
                          LoadedScene& scene) {
  const std::string head =
      std::string(kXyz) + "property " + type + " red\nproperty " + type + " green\nproperty " + type + " blue\n";
  scene = loaded(ascii_head(2, head) + "0 0 0 " + level + " 0 0\n1 0 0 0 0 0\n", options);
  return scene.mesh.visible()[0];
}

TEST(PlyReader, CountsOfTenAndTwelveBitsAreNotDark) {
  LoadedScene scene;
  for (const char* type : {"ushort", "short", "int", "float"}) {
    EXPECT_EQ(colour_of_type(type, "4095", {}, scene), (base::Rgb8{255, 0, 0})) << type;
    EXPECT_EQ(note_text(scene, "converted_colours"),
              "Colours of type " + std::string(type) + " with values up to 4095 taken as 12 bits, 0 to 4095");
    EXPECT_EQ(note_text(scene, "colour_white"),
              "As 16 bits no colour would be brighter than 16 of 255; where they are, --colour-white 65535");
    EXPECT_EQ(colour_of_type(type, "1023", {}, scene), (base::Rgb8{255, 0, 0})) << type;
    EXPECT_EQ(note_count(scene, "colour_white"), 2U);
    EXPECT_EQ(colour_of_type(type, "2048", {}, scene), (base::Rgb8{128, 0, 0})) << type;
    EXPECT_EQ(colour_of_type(type, "600", {}, scene), (base::Rgb8{150, 0, 0})) << type;
  }
  // From there on 16 bits are as likely, and said to be dark.
  EXPECT_EQ(colour_of_type("ushort", "16383", {}, scene), (base::Rgb8{64, 0, 0}));
  EXPECT_EQ(note_text(scene, "colour_white"),
            "No colour is brighter than 64 of 255; where 16383 is white in the file (14 bits), --colour-white 16383");
  EXPECT_EQ(colour_of_type("ushort", "25700", {}, scene), (base::Rgb8{100, 0, 0}));
  EXPECT_EQ(note_count(scene, "colour_white"), 0U);
  // Levels that are a little over-exposed are no ten bits where they are floats.
  EXPECT_EQ(colour_of_type("float", "300.5", {}, scene), (base::Rgb8{255, 0, 0}));
  EXPECT_EQ(note_count(scene, "clamped_colours"), 1U);
  EXPECT_EQ(note_count(scene, "colour_white"), 0U);
  // Those of faces.
  const LoadedScene faces =
      loaded(ascii_head(3, std::string(kXyz) + "element face 1\n" + std::string(kFaces) +
                               "property ushort red\nproperty ushort green\nproperty ushort blue\n") +
             "0 0 0\n1 0 0\n0 1 0\n3 0 1 2 4095 2048 0\n");
  EXPECT_EQ(faces.mesh.visible()[2], (base::Rgb8{255, 128, 0}));
  EXPECT_EQ(note_count(faces, "colour_white"), 3U);
}

TEST(PlyReader, WhatIsWhiteCanBeTold) {
  LoadedScene scene;
  ReadOptions options;
  options.colour_white = 65535;
  EXPECT_EQ(colour_of_type("ushort", "4095", options, scene), (base::Rgb8{16, 0, 0}));
  EXPECT_EQ(note_text(scene, "converted_colours"), "Colours of type ushort with values up to 4095 taken as 0 to 65535");
  EXPECT_EQ(note_count(scene, "colour_white"), 0U);
  options.colour_white = 1;
  EXPECT_EQ(colour_of_type("float", "0.5", options, scene), (base::Rgb8{128, 0, 0}));
  EXPECT_EQ(colour_of_type("float", "7", options, scene), (base::Rgb8{255, 0, 0}));
  EXPECT_EQ(note_count(scene, "clamped_colours"), 1U);
  options.colour_white = 100;
  EXPECT_EQ(colour_of_type("uchar", "60", options, scene), (base::Rgb8{153, 0, 0}));
  EXPECT_EQ(note_text(scene, "converted_colours"), "Colours of type uchar taken as 0 to 100");
  PlyBytes binary;
  binary.text("ply\nformat binary_little_endian 1.0\nelement vertex 1\n" + std::string(kXyz) + std::string(test::kRgb) +
              "end_header\n");
  binary.le(0.0F).le(0.0F).le(0.0F).le(std::uint8_t{60}).le(std::uint8_t{100}).le(std::uint8_t{200});
  EXPECT_EQ(loaded(binary.bytes(), options).mesh.visible()[0], (base::Rgb8{153, 255, 255}));
  options.colour_white = 255;
  EXPECT_EQ(loaded(binary.bytes(), options).mesh.visible()[0], (base::Rgb8{60, 100, 200}));
  const LoadedScene none = loaded(ascii_head(1, std::string(kXyz)) + "0 0 0\n", options);
  EXPECT_EQ(note_text(none, "unused_options"), "There are no colours of levels, so this has no effect: --colour-white");
  for (const double white : {0.0, -1.0, 1e17, std::numeric_limits<double>::quiet_NaN()}) {
    options.colour_white = white;
    EXPECT_FALSE(test::read_bytes(binary.bytes(), options)) << white;
  }
}

TEST(PlyReader, ColoursAreTakenFromThePropertiesThatAreNamed) {
  ReadOptions options;
  options.colour_properties = {"Ka", "kb", "KC"};
  const std::string head = std::string(kXyz) + std::string(test::kRgb) +
                           "property uchar ka\nproperty uchar kb\nproperty uchar kc\nproperty uint colours_rgb\n";
  const std::string text = ascii_head(1, head) + "0 0 0 1 2 3 40 50 60 3957840\n";
  const LoadedScene scene = loaded(text, options);
  EXPECT_EQ(scene.mesh.visible()[0], (base::Rgb8{40, 50, 60}));
  EXPECT_EQ(note_text(scene, "colour_properties"), "The colours are taken from the properties ka, kb, kc");
  EXPECT_NE(note_text(scene, "skipped_vertex_properties").find("red, green, blue"), std::string::npos);
  options.colour_properties = {"kb"};
  const LoadedScene grey = loaded(text, options);
  EXPECT_EQ(grey.mesh.visible()[0], (base::Rgb8{50, 50, 50}));
  EXPECT_EQ(note_text(grey, "colour_properties"), "The colours are taken from the property kb");
  options.colour_properties = {"colours_rgb"};
  EXPECT_EQ(loaded(text, options).mesh.visible()[0], (base::Rgb8{60, 100, 80}));
  // Of the faces, where the vertices have none of that name.
  const std::string of_faces = ascii_head(3, std::string(kXyz) + std::string(test::kRgb) + "element face 1\n" +
                                                 std::string(kFaces) + "property uchar kb\n") +
                               "0 0 0 1 2 3\n1 0 0 1 2 3\n0 1 0 1 2 3\n3 0 1 2 70\n";
  options.colour_properties = {"kb"};
  EXPECT_EQ(loaded(of_faces, options).mesh.visible()[1], (base::Rgb8{70, 70, 70}));
  options.colour_properties = {"ka", "missing", "kc"};
  const auto refused = test::read_bytes(text, options);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().field, "colour_properties");
  EXPECT_NE(refused.error().message.find("there is no scalar property 'missing'"), std::string::npos);
}

TEST(PlyReader, BytesDeclaredAsCharAreBytes) {
  PlyBytes file;
  file.text("ply\nformat binary_little_endian 1.0\nelement vertex 3\n" + std::string(kXyz) +
            "property char red\nproperty char green\nproperty char blue\nelement face 1\n" + std::string(kFaces) +
            "end_header\n");
  for (float x = 0; x < 3; ++x) {
    file.le(x).le(x * x).le(0.0F);
    for (const int value : {200, 255, 12}) file.le(static_cast<std::uint8_t>(value));
  }
  file.le(std::uint8_t{3}).le(0).le(1).le(2);
  const LoadedScene scene = loaded(file.bytes());
  EXPECT_EQ(scene.mesh.visible()[0], (base::Rgb8{200, 255, 12}));
  EXPECT_EQ(note_count(scene, "clamped_colours"), 0U);
  EXPECT_EQ(test::note_text(scene, "converted_colours"),
            "Colours of type char taken as bytes: negative ones are 128 to 255");
  // The same of faces.
  const LoadedScene faces = loaded(ascii_head(3, std::string(kXyz) + "element face 1\n" + std::string(kFaces) +
                                                     "property char red\nproperty char green\nproperty char blue\n") +
                                   "0 0 0\n1 0 0\n0 1 0\n3 0 1 2 -56 -1 12\n");
  EXPECT_EQ(faces.mesh.visible()[2], (base::Rgb8{200, 255, 12}));
}

TEST(PlyReader, TemperaturesOfFacesAreCountedAtTheirVertices) {
  const LoadedScene scene = loaded(
      ascii_head(6, std::string(kXyz) + "element face 2\n" + std::string(kFaces) + "property float temperature\n") +
      "0 0 0\n1 0 0\n0 1 0\n1 1 0\n2 1 0\n2 2 0\n3 0 1 2 inf\n3 1 2 3 20\n");
  EXPECT_EQ(note_count(scene, "over_range_temperatures"), 3U);
  EXPECT_EQ(note_count(scene, "missing_temperatures"), 2U);
  EXPECT_EQ(note_count(scene, "under_range_temperatures"), 0U);
}

TEST(PlyReader, FindsTheTemperatureUnderItsNames) {
  for (const char* name : {"temperature", "Temperature", "TEMP", "thermal", "t", "T", "scalar_Temperature"}) {
    for (const char* type : {"float", "double"}) {
      const LoadedScene scene =
          loaded(ascii_head(1, std::string(kXyz) + "property " + type + " " + name + "\n") + "0 0 0 21.5\n");
      EXPECT_TRUE(scene.mesh.has_temperature) << name;
      EXPECT_EQ(scene.mesh.temperature_celsius()[0], 21.5F) << name;
    }
  }
}

TEST(PlyReader, PrefersTheFullNameOfTheTemperature) {
  const LoadedScene scene =
      loaded(ascii_head(1, std::string(kXyz) + "property float t\nproperty float temperature\n") + "0 0 0 1 2\n");
  EXPECT_EQ(scene.mesh.temperature_celsius()[0], 2.0F);
}

TEST(PlyReader, DoesNotTakeATextureCoordinateForATemperature) {
  const LoadedScene scene =
      loaded(ascii_head(1, std::string(kXyz) + "property float s\nproperty float t\n") + "0 0 0 0.5 0.5\n");
  EXPECT_FALSE(scene.mesh.has_temperature);
  EXPECT_EQ(note_count(scene, "skipped_vertex_properties"), 2U);
}

TEST(PlyReader, CountsTemperaturesThatAreNone) {
  const LoadedScene scene = loaded(ascii_head(6, std::string(kXyz) + "property double temperature\n") +
                                   "0 0 0 nan\n1 0 0 -273.15\n2 0 0 -9999\n3 0 0 -1e39\n4 0 0 -273.1\n5 0 0 3e38\n");
  EXPECT_EQ(note_count(scene, "missing_temperatures"), 4U);
  EXPECT_EQ(note_count(scene, "impossible_temperatures"), 3U);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_TRUE(std::isnan(scene.mesh.temperature_celsius()[i])) << i;
  EXPECT_EQ(scene.mesh.temperature_celsius()[4], -273.1F);
  EXPECT_EQ(scene.mesh.temperature_celsius()[5], 3e38F);
}

TEST(PlyReader, HasOneZeroOfTemperature) {
  for (const std::string other : {"5", "nan"}) {
    const LoadedScene scene = loaded(ascii_head(3, std::string(kXyz) + "property double temperature\n") +
                                     "0 0 0 -1e-60\n1 0 0 -0.0\n2 0 0 " + other + "\n");
    EXPECT_FALSE(std::signbit(scene.mesh.temperature_celsius()[0]));
    EXPECT_FALSE(std::signbit(scene.mesh.temperature_celsius()[1]));
  }
}

TEST(PlyReader, KeepsWhatIsBeyondTheRangeOfTheSensor) {
  const LoadedScene scene = loaded(ascii_head(4, std::string(kXyz) + "property double temperature\n") +
                                   "0 0 0 inf\n1 0 0 -inf\n2 0 0 1e39\n3 0 0 1e999\n");
  const float infinity = std::numeric_limits<float>::infinity();
  EXPECT_EQ(note_count(scene, "missing_temperatures"), 0U);
  EXPECT_EQ(note_count(scene, "over_range_temperatures"), 3U);
  EXPECT_EQ(note_count(scene, "under_range_temperatures"), 1U);
  EXPECT_EQ(scene.mesh.temperature_celsius()[0], infinity);
  EXPECT_EQ(scene.mesh.temperature_celsius()[1], -infinity);
  EXPECT_EQ(scene.mesh.temperature_celsius()[2], infinity);
  EXPECT_EQ(scene.mesh.temperature_celsius()[3], infinity);
}

TEST(PlyReader, CutsPolygonsIntoFans) {
  const LoadedScene scene =
      loaded(ascii_head(5, kXyz, 2) + "0 0 0\n1 0 0\n2 1 0\n1 2 0\n0 1 0\n5 0 1 2 3 4\n4 0 1 3 4\n");
  EXPECT_EQ(scene.mesh.triangles(),
            (std::vector<base::Triangle>{{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 1, 3}, {0, 3, 4}}));
  EXPECT_EQ(note_count(scene, "triangulated_polygons"), 2U);
}

/// An L from its outer end, an arrow from its wing, a bow tie: in text and binary, faces before and after the vertices, at
/// map coordinates, and with a vertex that is left out before them.
TEST(PlyReader, CutsConcavePolygonsAlongTheirInside) {
  const std::vector<std::array<double, 2>> points = {{0, 0}, {3, 0}, {3, 1}, {1, 1}, {1, 3}, {0, 3}, {2, 2}, {4, 2}};
  const std::vector<std::vector<int>> faces = {{1, 2, 3, 4, 5, 0}, {1, 2, 3}, {1, 3, 5, 0}, {6, 0, 7, 1}};
  const auto area = [](const LoadedScene& scene, const base::Triangle& t) {
    const auto p = [&](std::size_t corner) { return scene.mesh.positions()[t[corner]]; };
    return (p(1).x - p(0).x) * (p(2).y - p(0).y) - (p(1).y - p(0).y) * (p(2).x - p(0).x);
  };
  for (const bool is_text : {true, false}) {
    for (const bool has_faces_first : {false, true}) {
      for (const double away : {0.0, 4'500'000.0}) {
        std::string vertices, text_faces;
        PlyBytes vertex_bytes, face_bytes;
        for (std::size_t v = 0; v <= points.size(); ++v) {
          const double x = v == 0 ? std::nan("") : points[v - 1][0] + away, y = v == 0 ? 0 : points[v - 1][1] - away;
          vertices += (v == 0 ? "nan" : std::to_string(x)) + " " + std::to_string(y) + " 0\n";
          vertex_bytes.le(x).le(y).le(0.0);
        }
        for (const auto& face : faces) {
          text_faces += std::to_string(face.size());
          face_bytes.le(static_cast<std::uint8_t>(face.size()));
          for (const int corner : face) {
            text_faces += " " + std::to_string(corner + 1);
            face_bytes.le(corner + 1);
          }
          text_faces += "\n";
        }
        const std::string vertex_head = "element vertex 9\nproperty double x\nproperty double y\nproperty double z\n";
        const std::string face_head = "element face 4\n" + std::string(kFaces);
        std::string bytes = std::string("ply\nformat ") + (is_text ? "ascii" : "binary_little_endian") + " 1.0\n" +
                            (has_faces_first ? face_head + vertex_head : vertex_head + face_head) + "end_header\n";
        const std::string body_faces = is_text ? text_faces : face_bytes.bytes();
        const std::string body_vertices = is_text ? vertices : vertex_bytes.bytes();
        bytes += has_faces_first ? body_faces + body_vertices : body_vertices + body_faces;
        const LoadedScene scene = loaded(bytes);
        ASSERT_EQ(scene.mesh.triangle_count(), 9U);
        double l_area = 0;
        for (std::size_t t = 0; t < 4; ++t) {
          const double one = static_cast<double>(area(scene, scene.mesh.triangles()[t]));
          EXPECT_GE(one, 0);
          l_area += one / 2;
        }
        EXPECT_NEAR(l_area, 5, 1e-3) << "a fan from that corner would cover more";
        EXPECT_EQ(scene.mesh.triangles()[4], (base::Triangle{1, 2, 3}));
        EXPECT_EQ(note_count(scene, "triangulated_polygons"), 3U);
        EXPECT_EQ(note_count(scene, "crossing_polygons"), 1U);
        EXPECT_EQ(note_count(scene, "large_polygons"), 0U);
      }
    }
  }
}

TEST(PlyReader, LeavesOutFacesWithoutAreaAndSaysSo) {
  const LoadedScene scene = loaded(ascii_head(5, kXyz, 6) +
                                   "0 0 0\n1 0 0\n0 1 0\n5 5 5\n6 6 6\n0\n1 0\n2 0 1\n3 0 1 1\n3 0 1 2\n4 0 1 1 2\n");
  EXPECT_EQ(scene.mesh.triangles(), (std::vector<base::Triangle>{{0, 1, 2}, {0, 1, 2}}));
  EXPECT_EQ(note_count(scene, "incomplete_faces"), 3U);
  EXPECT_EQ(note_count(scene, "degenerate_faces"), 2U);
  EXPECT_EQ(note_count(scene, "unreferenced_vertices"), 2U);
}

TEST(PlyReader, ReadsAPointCloud) {
  const LoadedScene scene = loaded(ascii_head(2, kXyz) + "0 0 0\n1 1 1\n");
  EXPECT_TRUE(scene.mesh.is_point_cloud());
  EXPECT_TRUE(scene.notes.empty());
  EXPECT_TRUE(loaded("ply\nformat ascii 1.0\nelement vertex 1\n" + std::string(kXyz) +
                     "element face 0\nproperty int nothing\nend_header\n1 2 3\n")
                  .mesh.is_point_cloud());
}

TEST(PlyReader, NotesTrailingBytes) {
  EXPECT_EQ(note_count(loaded(binary_sample(false) + "junk"), "trailing_bytes"), 4U);
  EXPECT_EQ(note_count(loaded(ascii_head(1, kXyz) + "0 0 0\n \r\n\n"), "trailing_bytes"), 0U);
  EXPECT_EQ(note_count(loaded(ascii_head(1, kXyz) + "0 0 0\n\nmore"), "trailing_bytes"), 4U);
}

TEST(PlyReader, NamesTheSceneAfterTheFile) {
  const test::TemporaryFolder folder;
  const auto scene = read_ply(folder.write("hall 3.ply", ascii_head(1, kXyz) + "0 0 0\n"));
  ASSERT_TRUE(scene);
  EXPECT_EQ(scene.value().mesh.name, "hall 3.ply");
}

TEST(PlyReader, SaysWhatIsNoFile) {
  const test::TemporaryFolder folder;
  EXPECT_EQ(read_ply(folder.path() / "none.ply").error().code, base::ErrorCode::FileNotFound);
  EXPECT_EQ(read_ply(folder.path()).error().code, base::ErrorCode::FileUnreadable);
  EXPECT_EQ(read_ply("/dev/null").error().code, base::ErrorCode::FileUnreadable);
  EXPECT_NE(read_ply(folder.path() / "none.ply").error().message.find("none.ply"), std::string::npos);
}

TEST(SceneOrigin, StaysZeroForASceneAroundZero) {
  const LoadedScene scene = loaded(ascii_head(2, kXyz) + "-3 -1 0\n5 1 10\n");
  EXPECT_EQ(scene.mesh.origin, base::Vec3d{});
}

TEST(SceneOrigin, IsTheOneThatIsGiven) {
  // Two parts of one map: what they share is the same, though each by itself would have an origin of its own.
  const auto part = [](const std::string& other, const base::Vec3d& origin) {
    const std::string text =
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty double y\nproperty double z\nend_header\n"
        "500010.1230000001 4000000.7 1.1\n" +
        other + "\n";
    files::ReadOptions options;
    options.origin = origin;
    return loaded(text, options);
  };
  const base::Vec3d origin{500000, 4000000, 0};
  const auto one = part("500000 4000000 0", origin), two = part("500030 4000900 2", origin);
  EXPECT_EQ(one.mesh.origin, origin);
  EXPECT_EQ(two.mesh.origin, origin);
  EXPECT_EQ(one.mesh.positions()[0], two.mesh.positions()[0]);
  EXPECT_EQ(one.mesh.positions()[0].x, static_cast<float>(500010.1230000001 - 500000));
}

TEST(SceneOrigin, LosesNothingOfFloatCoordinatesFarAway) {
  const float xs[] = {448'000.03125F, 448'123.0F, 448'127.96875F};
  const float ys[] = {-0.1F, 1e-20F, 3.0F};
  const float zs[] = {16'777'215.0F, 16'777'215.0F, 16'777'215.0F};
  PlyBytes file;
  file.text("ply\nformat binary_little_endian 1.0\nelement vertex 3\n" + std::string(kXyz) + "end_header\n");
  for (std::size_t i = 0; i < 3; ++i) file.le(xs[i]).le(ys[i]).le(zs[i]);
  const LoadedScene scene = loaded(file.bytes());
  const base::Vec3d& origin = scene.mesh.origin;
  EXPECT_NE(origin.x, 0);
  EXPECT_EQ(origin.y, 0);
  EXPECT_EQ(std::fmod(origin.x, 128), 0);
  for (std::size_t i = 0; i < 3; ++i) {
    const base::Vec3f& p = scene.mesh.positions()[i];
    EXPECT_EQ(origin.x + static_cast<double>(p.x), static_cast<double>(xs[i]));
    EXPECT_EQ(origin.y + static_cast<double>(p.y), static_cast<double>(ys[i]));
    EXPECT_EQ(origin.z + static_cast<double>(p.z), static_cast<double>(zs[i]));
    EXPECT_LT(std::abs(p.x), 128);
  }
}

TEST(SceneOrigin, KeepsMillimetresOfDoubleCoordinatesOnTheEarth) {
  // UTM and earth-centred coordinates of a scene of 200 m.
  const base::Vec3d corners[] = {{447'000.0005, 5'411'000.1234, 312.0}, {4'157'222.543, 664'789.307, 4'774'952.099}};
  for (const base::Vec3d& corner : corners) {
    PlyBytes file;
    file.text(
        "ply\nformat binary_little_endian 1.0\nelement vertex 21\nproperty double x\nproperty double y\n"
        "property double z\nend_header\n");
    for (int i = 0; i <= 20; ++i) {
      file.le(corner.x + 10.0001 * i).le(corner.y + 3.0003 * i).le(corner.z + 0.0007 * i);
    }
    const LoadedScene scene = loaded(file.bytes());
    EXPECT_TRUE(scene.mesh.double_positions);
    for (int i = 0; i <= 20; ++i) {
      const base::Vec3f& p = scene.mesh.positions()[static_cast<std::size_t>(i)];
      const double tolerance = 256 * 0x1p-24;
      EXPECT_NEAR(scene.mesh.origin.x + static_cast<double>(p.x), corner.x + 10.0001 * i, tolerance);
      EXPECT_NEAR(scene.mesh.origin.y + static_cast<double>(p.y), corner.y + 3.0003 * i, tolerance);
      EXPECT_NEAR(scene.mesh.origin.z + static_cast<double>(p.z), corner.z + 0.0007 * i, tolerance);
    }
  }
}

TEST(SceneOrigin, KeepsASinglePointExactly) {
  const LoadedScene scene =
      loaded(ascii_head(1, "property double x\nproperty double y\nproperty double z\n") + "447000.123456789 1 0.1\n");
  EXPECT_EQ(scene.mesh.origin.x + static_cast<double>(scene.mesh.positions()[0].x), 447000.123456789);
  EXPECT_EQ(scene.mesh.origin.z + static_cast<double>(scene.mesh.positions()[0].z), 0.1);
}

TEST(SceneOrigin, BearsTheLargestExtent) {
  const LoadedScene scene = loaded(ascii_head(3, kXyz) + "-1e30 0 1e-40\n1e30 0 9e29\n3.4e38 0 0\n");
  EXPECT_EQ(scene.mesh.positions()[0].x, -1e30F);
  EXPECT_EQ(scene.mesh.positions()[1].z, 9e29F);
  EXPECT_EQ(scene.mesh.vertex_count(), 2U) << "beyond that stand numbers for none";
  EXPECT_EQ(note_count(scene, "left_out_vertices"), 1U);
}

std::string grid_scene(std::uint32_t side) {
  PlyBytes file;
  file.text("ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(side * side) + "\n" +
            std::string(kXyz) + std::string(kRgb) + "property float temperature\nelement face " +
            std::to_string(2 * (side - 1) * (side - 1)) + "\n" + std::string(kFaces) + "end_header\n");
  for (std::uint32_t v = 0; v < side * side; ++v) {
    file.le(static_cast<float>(v % side)).le(static_cast<float>(v / side)).le(static_cast<float>(v) * 0.001F);
    file.le(static_cast<std::uint8_t>(v)).le(static_cast<std::uint8_t>(v / 256)).le(std::uint8_t{3});
    file.le(static_cast<float>(v) * 0.01F);
  }
  for (std::uint32_t y = 0; y + 1 < side; ++y) {
    for (std::uint32_t x = 0; x + 1 < side; ++x) {
      const std::uint32_t v = y * side + x;
      file.le(std::uint8_t{3}).le(v).le(v + 1).le(v + side);
      file.le(std::uint8_t{3}).le(v + 1).le(v + side + 1).le(v + side);
    }
  }
  return file.bytes();
}

TEST(PlyReader, NeedsFewBytesPerVertex) {
  const test::TemporaryFolder folder;
  const auto path = folder.write("grid.ply", grid_scene(400));
  const test::AllocationMeter meter;
  const auto scene = read_ply(path);
  ASSERT_TRUE(scene);
  EXPECT_EQ(scene.value().mesh.triangles().back(), (base::Triangle{159'599, 159'999, 159'998}));
  EXPECT_EQ(scene.value().mesh.positions()[159'999], (base::Vec3f{399, 399, 159'999.0F * 0.001F}));
  EXPECT_EQ(scene.value().mesh.visible()[16'000], (base::Rgb8{128, 62, 3}));
  // 24 of the mesh, 24 of two triangles, and the reader's buffers.
  EXPECT_LT(meter.peak_bytes(), 160'000U * 49 + 1'500'000U);
}

TEST(PlyStream, HandsOnBlocksInOrderAndAgain) {
  const test::TemporaryFolder folder;
  const auto path = folder.write("grid.ply", grid_scene(100));
  auto stream = PlyStream::open(path);
  ASSERT_TRUE(stream);
  EXPECT_EQ(stream.value().vertex_count(), 10'000U);
  EXPECT_GE(stream.value().triangle_count_limit(), 19'602U);
  const auto scene = read_ply(path);
  ASSERT_TRUE(scene);
  for (int pass = 0; pass < 2; ++pass) {
    std::uint64_t next_vertex = 0;
    std::vector<base::Triangle> triangles;
    PlyHandlers handlers;
    handlers.vertices = [&](const PlyVertexBlock& block) -> base::Result<void> {
      EXPECT_EQ(block.first_vertex, next_vertex);
      for (std::size_t i = 0; i < block.positions.size(); ++i, ++next_vertex) {
        EXPECT_EQ(block.visible[i], scene.value().mesh.visible()[next_vertex]);
        EXPECT_EQ(block.temperature_celsius[i], scene.value().mesh.temperature_celsius()[next_vertex]);
        EXPECT_EQ(block.positions[i].z, static_cast<double>(scene.value().mesh.positions()[next_vertex].z));
      }
      return base::success();
    };
    handlers.triangles = [&](std::span<const base::Triangle> block) -> base::Result<void> {
      triangles.insert(triangles.end(), block.begin(), block.end());
      return base::success();
    };
    const auto facts = stream.value().read(handlers);
    ASSERT_TRUE(facts);
    EXPECT_EQ(next_vertex, 10'000U);
    EXPECT_EQ(triangles, scene.value().mesh.triangles());
    EXPECT_EQ(facts.value().faces.triangle_count, 19'602U);
    EXPECT_EQ(facts.value().max.x, 99);
  }
}

TEST(PlyStream, NeedsMemoryOfFixedSize) {
  const test::TemporaryFolder folder;
  const auto path = folder.write("grid.ply", grid_scene(500));
  const test::AllocationMeter meter;
  auto stream = PlyStream::open(path);
  ASSERT_TRUE(stream);
  ASSERT_TRUE(stream.value().read({}));
  EXPECT_LT(meter.peak_bytes(), 1'500'000U);
}

TEST(PlyStream, EndsWithTheErrorOfAHandler) {
  const test::TemporaryFolder folder;
  auto stream = PlyStream::open(folder.write("grid.ply", grid_scene(10)));
  ASSERT_TRUE(stream);
  PlyHandlers handlers;
  handlers.triangles = [](std::span<const base::Triangle>) -> base::Result<void> {
    return base::failure(base::ErrorCode::FileUnwritable, "the disk is full", "out.ply");
  };
  const auto facts = stream.value().read(handlers);
  ASSERT_FALSE(facts);
  EXPECT_EQ(facts.error().code, base::ErrorCode::FileUnwritable);
  EXPECT_EQ(facts.error().field, "out.ply");
}

/// "property float" of a text tells what wrote it, not what it wrote.
TEST(PlyReader, KeepsEveryDigitOfATextFarFromZero) {
  const auto scene = [](const std::string& type, const std::string& rows, const ReadOptions& options = {}) {
    return test::loaded("ply\nformat ascii 1.0\nelement vertex 3\nproperty " + type + " x\nproperty " + type +
                            " y\nproperty " + type + " z\nend_header\n" + rows,
                        options);
  };
  const std::string utm = "691234.123 4512345.678 12.345\n691234.133 4512345.668 12.355\n691234.143 4512345.688 12\n";
  const LoadedScene fine = scene("float", utm);
  EXPECT_TRUE(fine.mesh.double_positions) << "an output keeps them, too";
  const auto y = [](const LoadedScene& one, std::size_t v) {
    return one.mesh.origin.y + static_cast<double>(one.mesh.positions()[v].y);
  };
  EXPECT_NEAR(y(fine, 0), 4512345.678, 1e-8);
  EXPECT_NEAR(y(fine, 1), 4512345.668, 1e-8);
  EXPECT_EQ(note_count(fine, "rounded_positions"), 3U);
  EXPECT_EQ(test::loaded([&] {
              std::ostringstream out;
              EXPECT_TRUE(write_ply(out, fine.mesh, fine.mesh.visible()));
              return out.str();
            }())
                .mesh.positions()[1],
            fine.mesh.positions()[1]);
  ReadOptions feet;
  feet.metres_per_unit = 0.3048;
  EXPECT_NEAR(y(scene("float", utm, feet), 1), 4512345.668 * 0.3048, 1e-6);

  // Written by a program that had floats.
  const LoadedScene rounded = scene("float", "691234.125 4512345.5 12\n691234.25 4512346 12\n691235 4512346 12\n");
  EXPECT_FALSE(rounded.mesh.double_positions);
  EXPECT_EQ(note_count(rounded, "rounded_positions"), 3U);
  EXPECT_FALSE(scene("float", "0.1 0.2 0.3\n0.4 0.5 0.6\n0.7 0.8 0.9\n").mesh.double_positions) << "no origin";
  EXPECT_FALSE(scene("float", "512 0.2 0.3\n512.5 0.5 0.6\n512.25 0.8 0.9\n").mesh.double_positions)
      << "an origin on the axis of floats only";
}

}  // namespace
}  // namespace spectra::files
