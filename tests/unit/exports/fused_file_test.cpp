#include "server/exports/fused_file.hpp"

#include <gtest/gtest.h>
#include <tiny_gltf.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>

#include "fusion/files/glb_file.hpp"
#include "fusion/settings.hpp"
#include "server/map/scene_store.hpp"

namespace spectra::exports {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

mesh::MultispectralMesh two_triangles() {
  mesh::MultispectralMesh mesh;
  mesh.name = "two";
  mesh.has_visible = true;
  mesh.has_temperature = true;
  mesh.origin = {500'000.25, 4'000'000.5, 12};
  mesh.resize_vertices(4);
  const std::array<base::Vec3f, 4> positions{{{0, 0, 0}, {1, 0, -2}, {0, 3, 0}, {1, 1, 0}}};
  const std::array<float, 4> temperatures{10, 20, kNaN, 30};
  std::copy(positions.begin(), positions.end(), mesh.positions().begin());
  std::copy(temperatures.begin(), temperatures.end(), mesh.temperature_celsius().begin());
  mesh.triangles() = {{0, 1, 2}, {1, 3, 2}};
  return mesh;
}

const std::vector<base::Rgb8> kColours{{1, 2, 3}, {4, 5, 6}, {250, 0, 255}, {7, 8, 9}};

tinygltf::Model read_glb(const std::string& bytes) {
  tinygltf::Model model;
  tinygltf::TinyGLTF reader;
  std::string error;
  std::string warning;
  const void* raw = bytes.data();
  EXPECT_TRUE(reader.LoadBinaryFromMemory(&model, &error, &warning, static_cast<const unsigned char*>(raw),
                                          static_cast<unsigned>(bytes.size())))
      << error;
  EXPECT_EQ(error + warning, "");
  return model;
}

template <class T>
std::vector<T> values_of(const tinygltf::Model& model, int accessor_index, std::size_t per_element) {
  const auto& accessor = model.accessors.at(static_cast<std::size_t>(accessor_index));
  const auto& view = model.bufferViews.at(static_cast<std::size_t>(accessor.bufferView));
  std::vector<T> values(accessor.count * per_element);
  std::memcpy(values.data(), model.buffers.at(0).data.data() + view.byteOffset, values.size() * sizeof(T));
  return values;
}

TEST(SceneFileFormat, IsChosenByTheEnding) {
  EXPECT_EQ(scene_file_format("a.ply"), SceneFileFormat::Ply);
  EXPECT_EQ(scene_file_format("a.b.GLB"), SceneFileFormat::Glb);
  EXPECT_EQ(scene_file_format("/x/y.drc"), SceneFileFormat::Draco);
  for (const auto* name : {"", "ply", "a.obj", "a.ply.gz", "aply"}) EXPECT_FALSE(scene_file_format(name)) << name;
}

TEST(GlbFile, HoldsPositionsColoursTemperaturesAndTriangles) {
  const auto mesh = two_triangles();
  const auto model = read_glb(scene_file(mesh, kColours, {SceneFileFormat::Glb}).value().bytes);
  ASSERT_EQ(model.meshes.size(), 1U);
  const auto& primitive = model.meshes[0].primitives.at(0);
  EXPECT_EQ(primitive.mode, TINYGLTF_MODE_TRIANGLES);
  EXPECT_EQ(values_of<float>(model, primitive.attributes.at("POSITION"), 3),
            (std::vector<float>{0, 0, 0, 1, -2, 0, 0, 0, -3, 1, 0, -1}));
  const auto& position = model.accessors[static_cast<std::size_t>(primitive.attributes.at("POSITION"))];
  EXPECT_EQ(position.minValues, (std::vector<double>{0, -2, -3}));
  EXPECT_EQ(position.maxValues, (std::vector<double>{1, 0, 0}));
  // IEC 61966-2-1: 1 / 255 / 12.92 of 65535 is 19.9, ((250 / 255 + 0.055) / 1.055)^2.4 of it 62649.6, and so on.
  EXPECT_EQ(values_of<std::uint16_t>(model, primitive.attributes.at("COLOR_0"), 4),
            (std::vector<std::uint16_t>{20, 40, 60, 65535, 80, 99, 119, 65535, 62650, 0, 65535, 65535, 139, 159, 179,
                                        65535}));
  EXPECT_TRUE(model.accessors[static_cast<std::size_t>(primitive.attributes.at("COLOR_0"))].normalized);
  EXPECT_EQ(values_of<float>(model, primitive.attributes.at("_TEMPERATURE"), 1),
            (std::vector<float>{10, 20, files::kGlbMissingCelsius, 30}));
  EXPECT_EQ(values_of<std::uint32_t>(model, primitive.indices, 1), (std::vector<std::uint32_t>{0, 1, 2, 1, 3, 2}));
  EXPECT_EQ(model.nodes.at(0).translation, (std::vector<double>{500'000.25, 12, -4'000'000.5}));
}

TEST(GlbFile, GivesEveryColourBackToAViewerThatEncodesItForTheScreen) {
  mesh::MultispectralMesh mesh;
  mesh.resize_vertices(256);
  std::vector<base::Rgb8> colours;
  for (unsigned i = 0; i < 256; ++i) {
    const auto value = static_cast<std::uint8_t>(i);
    colours.push_back({value, value, value});
  }
  const auto model = read_glb(scene_file(mesh, colours, {SceneFileFormat::Glb}).value().bytes);
  const auto& accessor_index = model.meshes.at(0).primitives.at(0).attributes.at("COLOR_0");
  const auto linear = values_of<std::uint16_t>(model, accessor_index, 4);
  for (unsigned i = 0; i < 256; ++i) {
    const double value = linear[4 * i] / 65535.0;
    const double encoded = value <= 0.0031308 ? 12.92 * value : 1.055 * std::pow(value, 1 / 2.4) - 0.055;
    EXPECT_NEAR(255 * encoded, i, 0.04);
  }
}

TEST(GlbFile, IsTurnedToHaveYUp) {
  mesh::MultispectralMesh mesh;
  mesh.resize_vertices(1);
  mesh.positions()[0] = {1, 2, 3};
  const std::vector<base::Rgb8> colours(1);
  const auto turned = [&](base::UpAxis up) {
    mesh.up = up;
    const auto model = read_glb(scene_file(mesh, colours, {SceneFileFormat::Glb}).value().bytes);
    return values_of<float>(model, model.meshes.at(0).primitives.at(0).attributes.at("POSITION"), 3);
  };
  // Each is a turn, not a mirror image: what was right-handed stays so.
  EXPECT_EQ(turned(base::UpAxis::X), (std::vector<float>{-2, 1, 3}));
  EXPECT_EQ(turned(base::UpAxis::MinusX), (std::vector<float>{2, -1, 3}));
  EXPECT_EQ(turned(base::UpAxis::Y), (std::vector<float>{1, 2, 3}));
  EXPECT_EQ(turned(base::UpAxis::MinusY), (std::vector<float>{1, -2, -3}));
  EXPECT_EQ(turned(base::UpAxis::Z), (std::vector<float>{1, 3, -2}));
  EXPECT_EQ(turned(base::UpAxis::MinusZ), (std::vector<float>{1, -3, 2}));
}

TEST(GlbFile, HasNoInfinity) {
  auto mesh = two_triangles();
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  constexpr float kLargest = std::numeric_limits<float>::max();
  mesh.temperature_celsius()[0] = kInfinity;
  mesh.temperature_celsius()[1] = -kInfinity;
  const auto model = read_glb(scene_file(mesh, kColours, {SceneFileFormat::Glb}).value().bytes);
  const auto& primitive = model.meshes.at(0).primitives.at(0);
  EXPECT_EQ(values_of<float>(model, primitive.attributes.at("_TEMPERATURE"), 1),
            (std::vector<float>{kLargest, -kLargest, files::kGlbMissingCelsius, 30}));
}

TEST(GlbFile, OfAPointCloudWithoutTemperatureHasPointsOnly) {
  auto mesh = two_triangles();
  mesh.triangles().clear();
  mesh.has_temperature = false;
  const auto model = read_glb(scene_file(mesh, kColours, {SceneFileFormat::Glb}).value().bytes);
  const auto& primitive = model.meshes.at(0).primitives.at(0);
  EXPECT_EQ(primitive.mode, TINYGLTF_MODE_POINTS);
  EXPECT_EQ(primitive.indices, -1);
  EXPECT_FALSE(primitive.attributes.contains("_TEMPERATURE"));
}

TEST(GlbFile, OfAnEmptySceneIsAFileAllTheSame) {
  const mesh::MultispectralMesh empty;
  const auto model = read_glb(scene_file(empty, {}, {SceneFileFormat::Glb}).value().bytes);
  EXPECT_TRUE(model.meshes.empty());
}

TEST(SceneFile, IsTheSameOnDiskAndInMemory) {
  const auto mesh = two_triangles();
  for (const auto* name : {"a.ply", "a.glb", "a.drc"}) {
    SceneFileOptions options;
    options.format = *scene_file_format(name);
    options.position_step_m = 0.25F;
    const auto path = std::filesystem::temp_directory_path() / ("spectra_fused_" + std::to_string(getpid()) + name);
    ASSERT_TRUE(write_scene_file(path, mesh, kColours, options)) << name;
    std::ifstream in(path, std::ios::binary);
    const std::string on_disk(std::istreambuf_iterator<char>(in), {});
    EXPECT_EQ(on_disk, scene_file(mesh, kColours, options).value().bytes) << name;
    std::filesystem::remove(path);
  }
}

TEST(SceneFile, SaysWhereItCannotBeWritten) {
  const auto written = write_scene_file("/no/such/folder/a.glb", two_triangles(), kColours, {SceneFileFormat::Glb});
  ASSERT_FALSE(written);
  EXPECT_NE(written.error().message.find("/no/such/folder"), std::string::npos);
}

TEST(RoundForFile, MovesEveryVertexByItsStepAtMostInAMapOfSeveralBlocks) {
  jobs::WorkerPool pool(2);
  map::SceneStore scenes;
  map::MapChange change;
  for (const char* id : {"b", "a"}) {
    files::LoadedScene block;
    block.mesh = two_triangles();
    for (base::Vec3f& p : block.mesh.positions()) p.x += id[0] == 'b' ? 10.3F : 0.1F;
    change.put.push_back({.id = id, .scene = std::move(block), .observed_at = {}});
  }
  const auto scene = scenes.change(std::move(change), pool);
  const auto exact = scene->whole_mesh();
  auto rounded = scene->whole_mesh();
  SceneFileOptions options{.format = SceneFileFormat::Draco};
  ASSERT_TRUE(round_for_file(*scene, rounded, options));
  for (std::size_t v = 0; v < exact.vertex_count(); ++v) {
    const auto &p = exact.positions()[v], &q = rounded.positions()[v];
    const float most = options.largest_position_step_m;
    EXPECT_LE(std::abs(p.x - q.x), most);
    EXPECT_LE(std::abs(p.y - q.y), most);
    EXPECT_LE(std::abs(p.z - q.z), most);
  }
  EXPECT_LT(options.largest_position_step_m, 1);
}

/// A patch of a few centimetres, and a vertex hundreds of kilometres from it, of no triangle.
mesh::MultispectralMesh patch_with_a_stray(bool is_cloud) {
  constexpr std::uint32_t kSide = 12;
  mesh::MultispectralMesh mesh;
  mesh.has_visible = true;
  mesh.resize_vertices(kSide * kSide + 1);
  for (std::uint32_t v = 0; v < kSide * kSide; ++v)
    mesh.positions()[v] = {0.01F * static_cast<float>(v % kSide), 0.01F * static_cast<float>(v / kSide), 0};
  mesh.positions()[kSide * kSide] = {-500'000, -4'000'000, 0};
  for (std::uint32_t v = 0; !is_cloud && v + kSide < kSide * kSide; ++v) {
    if (v % kSide + 1 < kSide) mesh.triangles().push_back({v, v + 1, v + kSide});
  }
  return mesh;
}

TEST(RoundForFile, KeepsTheFormBesideAVertexFarAway) {
  jobs::WorkerPool pool(1);
  for (const bool is_cloud : {false, true}) {
    for (const auto keeping : {protocol::codec::DracoKeeping::Shape, protocol::codec::DracoKeeping::Order}) {
      const auto scene = map::SceneSnapshot::build(patch_with_a_stray(is_cloud), 1, pool);
      auto rounded = patch_with_a_stray(is_cloud);
      SceneFileOptions options{.format = SceneFileFormat::Draco, .keeping = keeping};
      ASSERT_TRUE(round_for_file(*scene, rounded, options));
      EXPECT_EQ(options.position_step_m > 0, keeping == protocol::codec::DracoKeeping::Shape && !is_cloud);
      EXPECT_LT(options.position_step_m, 0.003F);
      // A cloud's stray is drawn, and its tile reaches as far.
      if (!is_cloud) {
        EXPECT_LT(options.largest_position_step_m, 0.005F);
      }
      const auto file = scene_file(rounded, std::vector<base::Rgb8>(rounded.vertex_count()), options);
      ASSERT_TRUE(file) << file.error().message;
    }
  }
}

TEST(RoundForFile, KeepsTheFormBesideATriangleFarAway) {
  jobs::WorkerPool pool(1);
  const auto patch_with_a_triangle = [] {
    auto mesh = patch_with_a_stray(false);
    const auto last = static_cast<std::uint32_t>(mesh.vertex_count() - 1);
    mesh.triangles().push_back({0, 1, last});
    return mesh;
  };
  const auto exact = patch_with_a_triangle();
  const auto scene = map::SceneSnapshot::build(patch_with_a_triangle(), 1, pool);
  auto rounded = patch_with_a_triangle();
  SceneFileOptions options{.format = SceneFileFormat::Draco};
  ASSERT_TRUE(round_for_file(*scene, rounded, options));
  EXPECT_EQ(options.position_step_m, 0) << "it has no lattice";
  for (std::size_t v = 0; v < exact.vertex_count(); ++v) {
    EXPECT_LT(std::abs(exact.positions()[v].x - rounded.positions()[v].x), 0.003F);
    EXPECT_LT(std::abs(exact.positions()[v].y - rounded.positions()[v].y), 0.003F);
  }
}

/// What is said of the losses of a Draco file.
std::string said_of(const mesh::MultispectralMesh& mesh, SceneFileOptions options) {
  options.format = SceneFileFormat::Draco;
  const auto file = scene_file(mesh, std::vector<base::Rgb8>(mesh.vertex_count()), options);
  EXPECT_TRUE(file) << file.error().message;
  std::string said;
  for (const files::Note& loss : file.value().losses) said += loss.message + '\n';
  return said;
}

TEST(LossesOfADracoFile, SayOfPositionsWhatBecameOfThem) {
  auto mesh = two_triangles();
  mesh.triangles().push_back({0, 1, 3});
  const auto said = [&](float step_m, float largest_step_m) {
    return said_of(mesh, {.keeping = protocol::codec::DracoKeeping::Order,
                          .position_step_m = step_m,
                          .largest_position_step_m = largest_step_m});
  };
  const std::string more = "; --lossless keeps every value as it is\n";
  const std::string no_lattice =
      "No lattice as fine as the scene needs reaches all of it: positions are written as floats, which makes the file "
      "larger\n";
  EXPECT_EQ(said(0.25F, 0.25F), "In the file positions are rounded to 250 mm, temperatures to 0.015625 degC" + more);
  EXPECT_EQ(said(0.25F, 0.5F),
            "In the file positions are rounded to 500 mm, finer where the form is finer, "
            "temperatures to 0.015625 degC" +
                more);
  EXPECT_EQ(said(0, 0), "In the file temperatures are rounded to 0.015625 degC" + more + no_lattice);
  EXPECT_EQ(said(0, 0.5F),
            "In the file positions are rounded to 500 mm or finer, temperatures to 0.015625 degC" + more + no_lattice);
  mesh.has_temperature = false;
  EXPECT_EQ(said(0, 0), no_lattice) << "nothing is rounded";
}

TEST(LossesOfADracoFile, AddUpToTheVerticesOfTheFile) {
  // Two triangles that touch in a vertex, two that share none, and a vertex of no triangle.
  auto mesh = two_triangles();
  mesh.has_temperature = false;
  mesh.resize_vertices(12);
  const std::array<base::Vec3f, 12> positions{{{0, 0, 0},
                                               {1, 0, 0},
                                               {0, 1, 0},
                                               {-1, 0, 0},
                                               {0, -1, 0},
                                               {9, 9, 9},
                                               {5, 0, 0},
                                               {6, 0, 0},
                                               {5, 1, 0},
                                               {6, 0, 0},
                                               {6, 1, 0},
                                               {5, 1, 0}}};
  std::copy(positions.begin(), positions.end(), mesh.positions().begin());
  mesh.triangles() = {{0, 1, 2}, {0, 3, 4}, {6, 7, 8}, {9, 10, 11}};
  const std::string said = said_of(mesh, {.position_step_m = 0.25F, .largest_position_step_m = 0.25F});
  EXPECT_NE(said.find("\nIn the file 1 vertex of no triangle is left out; --keep-order"), std::string::npos) << said;
  EXPECT_NE(said.find("\n2 vertices merged with others"), std::string::npos) << said;
  EXPECT_NE(said.find("\n1 vertex added: where surfaces touch"), std::string::npos) << said;
}

TEST(TemperatureOfMesh, LeavesMissingValuesOut) {
  const auto mesh = two_triangles();
  const auto temperature = temperature_of(mesh);
  EXPECT_EQ(temperature.summary.finite_count, 3U);
  EXPECT_EQ(temperature.summary.missing_count, 1U);
  EXPECT_EQ(temperature.histogram(2).counts, (std::vector<std::uint64_t>{1, 2}));
}

TEST(FusedColours, AreThePlansForEveryVertex) {
  const auto mesh = two_triangles();
  fusion::FusionChange change;
  change.method = "visible_only";
  const auto settings = fusion::with_change(fusion::default_settings(), change).value();
  const auto plan = fusion::FusionPlan::prepare(settings, temperature_of(mesh)).value();
  const auto colours = fused_colours(mesh, plan);
  EXPECT_TRUE(std::equal(colours.begin(), colours.end(), mesh.visible().begin(), mesh.visible().end()));
}

}  // namespace
}  // namespace spectra::exports
