#include "protocol/codec/draco_file.hpp"

#include <draco/compression/decode.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace spectra::protocol::codec {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

struct Scene {
  std::vector<std::array<float, 3>> positions;
  std::vector<ColourBytes> colours;
  std::vector<float> temperatures;
  std::vector<TileTriangle> triangles;

  DracoFileInput input(float step_m) const {
    DracoFileInput input;
    input.positions_m = positions;
    input.colours = colours;
    input.temperature_celsius = temperatures;
    input.triangles = triangles;
    input.origin_m = {500'000.25, 1.0 / 3, -7};
    input.position_step_m = step_m;
    return input;
  }
};

/// Every vertex has a colour of its own, so that it can be found again.
Scene numbered(std::vector<std::array<float, 3>> positions, std::vector<TileTriangle> triangles) {
  Scene scene;
  for (std::uint32_t i = 0; i < positions.size(); ++i) {
    scene.colours.push_back({static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(i >> 8U), 77});
    scene.temperatures.push_back(i % 5 == 0 ? kNaN : 15 + 0.013F * static_cast<float>(i % 1000));
  }
  scene.positions = std::move(positions);
  scene.triangles = std::move(triangles);
  return scene;
}

std::uint32_t number_of(const ColourBytes& colour) {
  return colour[0] + 256U * colour[1];
}

/// A sheet, far from the origin, with a fin that three triangles share an edge with, two cones that touch in a vertex,
/// and vertices of no triangle.
Scene crooked_scene() {
  constexpr std::uint32_t kSide = 40;
  std::mt19937 random(3);
  std::uniform_real_distribution<float> noise(-0.004F, 0.004F);
  std::vector<std::array<float, 3>> positions;
  std::vector<TileTriangle> triangles;
  for (std::uint32_t y = 0; y < kSide; ++y)
    for (std::uint32_t x = 0; x < kSide; ++x)
      positions.push_back({-3 + 0.05F * static_cast<float>(x) + noise(random),
                           100 + 0.05F * static_cast<float>(y) + noise(random), noise(random)});
  for (std::uint32_t y = 0; y + 1 < kSide; ++y)
    for (std::uint32_t x = 0; x + 1 < kSide; ++x) {
      const std::uint32_t at = y * kSide + x;
      triangles.push_back({at, at + 1, at + kSide + 1});
      triangles.push_back({at, at + kSide + 1, at + kSide});
    }
  const auto add = [&positions](float x, float y, float z) {
    positions.push_back({x, y, z});
    return static_cast<std::uint32_t>(positions.size() - 1);
  };
  triangles.push_back({5, 6, add(-2.7F, 100, 0.3F)});
  const std::uint32_t tip = add(0, 0, 0);
  triangles.push_back({tip, add(1, 0, 1), add(0, 1, 1)});
  triangles.push_back({tip, add(1, 0, -1), add(0, 1, -1)});
  add(9, 9, 9);
  add(9, 9, 8);
  return numbered(std::move(positions), std::move(triangles));
}

struct Decoded {
  std::vector<std::array<float, 3>> positions;
  std::vector<ColourBytes> colours;
  std::vector<float> temperatures;
  std::vector<TileTriangle> triangles;
  std::vector<double> origin_m;
  double position_step_m = 0;
  double missing_celsius = 0;
};

Decoded decoded(const std::vector<std::byte>& bytes) {
  Decoded result;
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  draco::Decoder decoder;
  std::unique_ptr<draco::PointCloud> cloud;
  if (draco::Decoder::GetEncodedGeometryType(&buffer).value() == draco::TRIANGULAR_MESH) {
    auto mesh = decoder.DecodeMeshFromBuffer(&buffer).value();
    for (std::uint32_t i = 0; i < mesh->num_faces(); ++i) {
      const auto& face = mesh->face(draco::FaceIndex(i));
      result.triangles.push_back({face[0].value(), face[1].value(), face[2].value()});
    }
    cloud = std::move(mesh);
  } else {
    cloud = decoder.DecodePointCloudFromBuffer(&buffer).value();
  }
  const auto* position = cloud->GetNamedAttribute(draco::GeometryAttribute::POSITION);
  const auto* colour = cloud->GetNamedAttribute(draco::GeometryAttribute::COLOR);
  const int temperature_id = cloud->GetAttributeIdByMetadataEntry("name", "temperature");
  const auto* temperature = temperature_id < 0 ? nullptr : cloud->attribute(temperature_id);
  for (std::uint32_t i = 0; i < cloud->num_points(); ++i) {
    const draco::PointIndex point(i);
    position->GetMappedValue(point, result.positions.emplace_back().data());
    colour->GetMappedValue(point, result.colours.emplace_back().data());
    if (temperature != nullptr) temperature->GetMappedValue(point, &result.temperatures.emplace_back());
  }
  cloud->GetMetadata()->GetEntryDoubleArray("origin_m", &result.origin_m);
  cloud->GetMetadata()->GetEntryDouble("position_step_m", &result.position_step_m);
  if (temperature_id >= 0)
    cloud->GetAttributeMetadataByAttributeId(temperature_id)->GetEntryDouble("missing", &result.missing_celsius);
  return result;
}

/// Triangles by the numbers of their vertices, whatever their rotation and order.
std::multiset<TileTriangle> triangles_by_number(const std::vector<ColourBytes>& colours,
                                                const std::vector<TileTriangle>& triangles) {
  std::multiset<TileTriangle> result;
  for (const TileTriangle& triangle : triangles) {
    TileTriangle named{number_of(colours[triangle[0]]), number_of(colours[triangle[1]]),
                       number_of(colours[triangle[2]])};
    std::rotate(named.begin(), std::min_element(named.begin(), named.end()), named.end());
    result.insert(named);
  }
  return result;
}

void expect_within_half_a_step(const Scene& scene, const Decoded& seen, float step_m, float step_celsius) {
  ASSERT_EQ(seen.temperatures.size(), seen.positions.size());
  for (std::size_t i = 0; i < seen.positions.size(); ++i) {
    const std::uint32_t source = number_of(seen.colours[i]);
    ASSERT_EQ(seen.colours[i], scene.colours.at(source));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double error =
          static_cast<double>(seen.positions[i][axis]) - static_cast<double>(scene.positions[source][axis]);
      ASSERT_LE(std::abs(error), static_cast<double>(step_m) / 2 * (1 + 1e-6));
    }
    const float celsius = scene.temperatures[source];
    if (std::isnan(celsius)) {
      ASSERT_EQ(seen.temperatures[i], kDracoMissingCelsius);
    } else {
      ASSERT_LE(std::abs(static_cast<double>(seen.temperatures[i]) - static_cast<double>(celsius)),
                static_cast<double>(step_celsius) / 2);
    }
  }
}

TEST(DracoFile, OfTheShapeIsWithinHalfAStepAndHasEveryTriangleOnce) {
  const Scene scene = crooked_scene();
  for (const float step_m : {0.0015625F, 0.00244140625F, 0.25F}) {
    for (const int speed : {0, 3, 5, 7, 10}) {
      const auto file = draco_file(scene.input(step_m), DracoKeeping::Shape, speed);
      ASSERT_TRUE(file.has_value()) << file.error().message;
      const Decoded seen = decoded(file.value().bytes);
      expect_within_half_a_step(scene, seen, step_m, file.value().temperature_step_celsius);
      EXPECT_EQ(triangles_by_number(seen.colours, seen.triangles), triangles_by_number(scene.colours, scene.triangles));
      EXPECT_EQ(file.value().left_out_vertex_count, 2U);
      EXPECT_EQ(file.value().left_out_triangle_count, 0U);
      EXPECT_EQ(file.value().split_vertex_count, seen.positions.size() + 2 - scene.positions.size());
      EXPECT_GT(file.value().split_vertex_count, 0U);
      EXPECT_EQ(seen.origin_m, (std::vector<double>{500'000.25, 1.0 / 3, -7}));
      EXPECT_EQ(seen.position_step_m, static_cast<double>(step_m));
      EXPECT_EQ(seen.missing_celsius, -1000);
    }
  }
}

TEST(DracoFile, OfTheShapeIsAsSmallForTrianglesThatShareNoVertices) {
  const Scene scene = crooked_scene();
  Scene soup;
  for (const TileTriangle& triangle : scene.triangles) {
    const auto first = static_cast<std::uint32_t>(soup.positions.size());
    soup.triangles.push_back({first, first + 1, first + 2});
    for (const std::uint32_t v : triangle) {
      soup.positions.push_back(scene.positions[v]);
      soup.colours.push_back(scene.colours[v]);
      soup.temperatures.push_back(scene.temperatures[v]);
    }
  }
  const auto shared = draco_file(scene.input(0.0015625F), DracoKeeping::Shape, 7);
  const auto file = draco_file(soup.input(0.0015625F), DracoKeeping::Shape, 7);
  ASSERT_TRUE(shared.has_value() && file.has_value());
  EXPECT_LT(static_cast<double>(file.value().bytes.size()), 1.1 * static_cast<double>(shared.value().bytes.size()));
  const Decoded seen = decoded(file.value().bytes);
  expect_within_half_a_step(scene, seen, 0.0015625F, kDracoTemperatureStepCelsius);
  EXPECT_EQ(triangles_by_number(seen.colours, seen.triangles), triangles_by_number(scene.colours, scene.triangles));
  const std::uint64_t drawn = scene.positions.size() - shared.value().left_out_vertex_count;
  EXPECT_EQ(file.value().merged_vertex_count, soup.positions.size() - drawn);
  EXPECT_EQ(seen.positions.size(), drawn + file.value().split_vertex_count);
  EXPECT_EQ(shared.value().merged_vertex_count, 0U);
  EXPECT_EQ(file.value().left_out_vertex_count + file.value().left_out_triangle_count, 0U);
  EXPECT_EQ(decoded(draco_file(soup.input(0.01F), DracoKeeping::Order, 7).value().bytes).positions.size(),
            soup.positions.size());
}

TEST(DracoFile, OfTheShapeKeepsATriangleWhoseCornersAreAlike) {
  // Of the second triangle two corners are the same but for their numbers.
  Scene scene;
  scene.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 0, 0}, {1, 0, 0}, {0, 1, 0}, {5, 5, 5}};
  scene.triangles = {{0, 1, 2}, {3, 4, 5}};
  scene.colours.assign(7, {1, 2, 3});
  scene.temperatures.assign(7, 20);
  const auto file = draco_file(scene.input(0.01F), DracoKeeping::Shape, 7);
  ASSERT_TRUE(file.has_value()) << file.error().message;
  EXPECT_EQ(decoded(file.value().bytes).triangles.size(), 2U);
  EXPECT_EQ(file.value().left_out_triangle_count, 0U);
  EXPECT_EQ(file.value().left_out_vertex_count, 1U);
  EXPECT_EQ(decoded(file.value().bytes).positions.size(), scene.positions.size() + file.value().split_vertex_count -
                                                              file.value().left_out_vertex_count -
                                                              file.value().merged_vertex_count);
}

TEST(DracoFile, OfAPointCloudIsWithinHalfAStep) {
  Scene scene = crooked_scene();
  scene.triangles.clear();
  const auto file = draco_file(scene.input(0.003F), DracoKeeping::Shape, 7);
  ASSERT_TRUE(file.has_value()) << file.error().message;
  const Decoded seen = decoded(file.value().bytes);
  expect_within_half_a_step(scene, seen, 0.003F, kDracoTemperatureStepCelsius);
  EXPECT_EQ(std::set(seen.colours.begin(), seen.colours.end()), std::set(scene.colours.begin(), scene.colours.end()));
  EXPECT_EQ(seen.positions.size(), scene.positions.size());
}

TEST(DracoFile, OfAPointCloudIsTheSmallerOfAnyOrderAndTheScans) {
  constexpr std::uint32_t kCount = 20'000;
  std::vector<std::array<float, 3>> positions;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    const float angle = 0.003F * static_cast<float>(i);
    positions.push_back({3 * std::cos(angle), 3 * std::sin(angle), 0.0001F * static_cast<float>(i)});
  }
  Scene scan = numbered(positions, {});
  for (std::uint32_t i = 0; i < kCount; ++i) scan.temperatures[i] = 20 + 0.0005F * static_cast<float>(i);
  Scene mixed = scan;
  std::mt19937 random(5);
  for (std::uint32_t i = kCount - 1; i > 0; --i) {
    const std::size_t other = random() % (i + 1);
    std::swap(mixed.positions[i], mixed.positions[other]);
    std::swap(mixed.colours[i], mixed.colours[other]);
    std::swap(mixed.temperatures[i], mixed.temperatures[other]);
  }
  for (const auto& [scene, kept] : {std::pair(scan, DracoKeeping::Order), std::pair(mixed, DracoKeeping::Shape)}) {
    const auto small = draco_file(scene.input(0.001F), DracoKeeping::Shape, 7);
    const auto ordered = draco_file(scene.input(0.001F), DracoKeeping::Order, 7);
    ASSERT_TRUE(small.has_value() && ordered.has_value());
    EXPECT_EQ(small.value().kept, kept);
    EXPECT_LE(small.value().bytes.size(), ordered.value().bytes.size());
  }
}

TEST(DracoFile, ThatKeepsOrderHasEveryVertexAndTriangleInItsPlace) {
  Scene scene = crooked_scene();
  scene.triangles.push_back({0, 1, 1});
  for (const bool is_cloud : {false, true}) {
    if (is_cloud) scene.triangles.clear();
    const auto file = draco_file(scene.input(0.0015625F), DracoKeeping::Order, 7);
    ASSERT_TRUE(file.has_value()) << file.error().message;
    const Decoded seen = decoded(file.value().bytes);
    expect_within_half_a_step(scene, seen, 0.0015625F, kDracoTemperatureStepCelsius);
    EXPECT_EQ(seen.colours, scene.colours);
    EXPECT_EQ(seen.triangles, scene.triangles);
    EXPECT_EQ(file.value().left_out_vertex_count + file.value().left_out_triangle_count, 0U);
  }
}

TEST(DracoFile, ThatKeepsEverythingHasEveryBit) {
  Scene scene = numbered({{0.1F, 2e9F, -3}, {1, 1.0F / 3, 0}, {0, 1, 7}, {5, 5, 5}}, {{2, 1, 0}, {0, 1, 1}});
  scene.temperatures = {20.5F, kInfinity, 1e6F, 0.1F};
  for (const int speed : {0, 7, 10}) {
    for (const bool is_cloud : {false, true}) {
      Scene tried = scene;
      if (is_cloud) tried.triangles.clear();
      const auto file = draco_file(tried.input(0), DracoKeeping::Everything, speed);
      ASSERT_TRUE(file.has_value()) << file.error().message;
      EXPECT_EQ(file.value().temperature_step_celsius, 0);
      const Decoded seen = decoded(file.value().bytes);
      EXPECT_EQ(seen.positions, tried.positions);
      EXPECT_EQ(seen.colours, tried.colours);
      EXPECT_EQ(seen.temperatures, tried.temperatures);
      EXPECT_EQ(seen.triangles, tried.triangles);
    }
  }
}

TEST(DracoFile, OfManyVerticesAndFewTrianglesIsOpenedWithTrianglesOfOneVertexAdded) {
  Scene scene = numbered({}, {{2, 1, 0}, {3, 4, 1}});
  for (int i = 0; i < 20; ++i) {
    scene.positions.push_back({static_cast<float>(i), static_cast<float>(i % 3), 1});
    scene.colours.push_back({static_cast<std::uint8_t>(i), 0, 77});
    scene.temperatures.push_back(20);
  }
  for (const DracoKeeping keeping : {DracoKeeping::Order, DracoKeeping::Everything}) {
    const auto file = draco_file(scene.input(0.01F), keeping, 7);
    ASSERT_TRUE(file.has_value()) << file.error().message;
    EXPECT_EQ(file.value().added_triangle_count, 5U);
    const Decoded seen = decoded(file.value().bytes);
    ASSERT_EQ(seen.positions.size(), 20U);
    ASSERT_EQ(seen.triangles.size(), 7U);
    EXPECT_EQ(seen.triangles[1], scene.triangles[1]);
    for (std::size_t t = 2; t < 7; ++t) EXPECT_EQ(seen.triangles[t], (TileTriangle{0, 0, 0}));
  }
  EXPECT_EQ(draco_file(scene.input(0.01F), DracoKeeping::Shape, 7).value().added_triangle_count, 0U);
}

TEST(DracoFile, TellsTrianglesThatNameAVertexTwice) {
  Scene scene = numbered({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 1, 1}});
  const auto file = draco_file(scene.input(0.01F), DracoKeeping::Shape, 7);
  ASSERT_TRUE(file.has_value()) << file.error().message;
  EXPECT_EQ(file.value().left_out_triangle_count, 1U);
  EXPECT_EQ(decoded(file.value().bytes).triangles.size(), 1U);
}

TEST(DracoFile, WritesTemperaturesBeyondRangeJustOutsideTheOthers) {
  Scene scene = numbered({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}, {{0, 1, 2}, {1, 3, 2}});
  scene.temperatures = {kInfinity, 20.25F, -kInfinity, -3};
  const auto file = draco_file(scene.input(0.01F), DracoKeeping::Order, 7);
  ASSERT_TRUE(file.has_value()) << file.error().message;
  EXPECT_EQ(file.value().over_range_count, 1U);
  EXPECT_EQ(file.value().under_range_count, 1U);
  EXPECT_EQ(decoded(file.value().bytes).temperatures, (std::vector<float>{20.265625F, 20.25F, -3.015625F, -3}));
}

TEST(DracoFile, WidensTheStepOfTemperaturesThatReachFar) {
  Scene scene = numbered({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}});
  for (const float far : {1e5F, 1e9F, 1e30F, std::numeric_limits<float>::max()}) {
    scene.temperatures = {far, -far, 20};
    const auto file = draco_file(scene.input(0.01F), DracoKeeping::Order, 7);
    ASSERT_TRUE(file.has_value()) << file.error().message;
    EXPECT_LE(file.value().temperature_step_celsius / std::min(far, 1e30F), 0x1p-21F);
    const auto seen = decoded(file.value().bytes).temperatures;
    for (std::size_t i = 0; i < 3; ++i) {
      if (file.value().over_range_count > 0 && i < 2) continue;
      EXPECT_NEAR(seen[i], scene.temperatures[i], file.value().temperature_step_celsius / 2);
    }
  }
}

TEST(DracoFile, OfASceneWithoutTemperatureHasNone) {
  Scene scene = crooked_scene();
  scene.temperatures.clear();
  const auto file = draco_file(scene.input(0.01F), DracoKeeping::Shape, 7);
  ASSERT_TRUE(file.has_value()) << file.error().message;
  EXPECT_EQ(file.value().temperature_step_celsius, 0);
  EXPECT_TRUE(decoded(file.value().bytes).temperatures.empty());
}

TEST(DracoFile, WhoseTemperaturesAreAllMissingSaysSo) {
  Scene scene = numbered({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}});
  scene.temperatures = {kNaN, kNaN, kNaN};
  const auto file = draco_file(scene.input(0.01F), DracoKeeping::Shape, 7);
  ASSERT_TRUE(file.has_value()) << file.error().message;
  EXPECT_EQ(decoded(file.value().bytes).temperatures, (std::vector<float>{-1000, -1000, -1000}));
}

TEST(DracoFile, RefusesArraysThatDoNotMatch) {
  Scene scene = numbered({{0, 0, 0}, {1, 0, 0}}, {});
  scene.colours.pop_back();
  EXPECT_TRUE(draco_file(scene.input(1), DracoKeeping::Shape, 7).has_error());
  scene = numbered({{0, 0, 0}, {1, 0, 0}}, {{0, 1, 2}});
  EXPECT_TRUE(draco_file(scene.input(1), DracoKeeping::Shape, 7).has_error());
  scene = numbered({{0, 0, 0}, {1, 0, 0}}, {});
  EXPECT_TRUE(draco_file(scene.input(-1), DracoKeeping::Shape, 7).has_error());
}

TEST(DracoFile, WithAnEdgeOfVeryManyTrianglesKeepsEveryOne) {
  const std::vector<TileTriangle> same(50'000, TileTriangle{0, 1, 2});
  const Scene scene = numbered({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, same);
  const auto file = draco_file(scene.input(0.01F), DracoKeeping::Shape, 5);
  ASSERT_TRUE(file) << file.error().message;
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(file.value().bytes.data()), file.value().bytes.size());
  draco::Decoder decoder;
  const auto mesh = decoder.DecodeMeshFromBuffer(&buffer);
  ASSERT_TRUE(mesh.ok());
  EXPECT_EQ(mesh.value()->num_faces(), same.size());
}

TEST(DracoFile, OfAVertexWithVeryManyTrianglesIsInOrder) {
  for (const std::uint32_t count : {2000U, 60'000U}) {
    std::vector<std::array<float, 3>> positions{{0, 0, 0}};
    std::vector<TileTriangle> triangles;
    for (std::uint32_t i = 0; i < count; ++i) {
      const float angle = 6.2831853F * static_cast<float>(i) / static_cast<float>(count);
      positions.push_back({std::cos(angle), std::sin(angle), 0});
      triangles.push_back({0, 1 + i, 1 + (i + 1) % count});
    }
    const auto file = draco_file(numbered(positions, triangles).input(1e-5F), DracoKeeping::Shape, 7);
    ASSERT_TRUE(file) << file.error().message;
    constexpr std::size_t kMethodAt = 8;  // After the name, the version and what it is of.
    EXPECT_EQ(static_cast<int>(file.value().bytes[kMethodAt]), count < 10'000 ? 1 : 0) << "1: edgebreaker";
    EXPECT_EQ(file.value().kept, count < 10'000 ? DracoKeeping::Shape : DracoKeeping::Order);
  }
}

TEST(DracoFile, RefusesASceneThatIsTooLargeForItsStep) {
  for (const float far : {3e38F, -3.4e38F, 1e30F}) {
    const Scene scene = numbered({{0, 0, far}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}});
    const auto file = draco_file(scene.input(0.01F), DracoKeeping::Shape, 5);
    ASSERT_FALSE(file) << far;
    EXPECT_NE(file.error().message.find("too large for its position step"), std::string::npos);
  }
}

TEST(DracoFile, OfAShapeIsRoundedByWhatIsInIt) {
  // The far one is of no triangle.
  const Scene scene = numbered({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {5e5F, 4e6F, 0}}, {{0, 1, 2}});
  const auto file = draco_file(scene.input(0.0009765625F), DracoKeeping::Shape, 5);
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ(file.value().left_out_vertex_count, 1U);
  EXPECT_EQ(decoded(file.value().bytes).positions.size(), 3U);
}

TEST(DracoFile, OfACrowdWithAVertexFarAwayHasPositionsAsTheyAre) {
  // Written in order for its crowd, so that the far vertex of no triangle is in it.
  const Scene scene =
      numbered({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-5e5F, -4e6F, 0}}, std::vector<TileTriangle>(400, {0, 1, 2}));
  const auto file = draco_file(scene.input(0.0009765625F), DracoKeeping::Shape, 5);
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ(file.value().kept, DracoKeeping::Order);
  EXPECT_EQ(file.value().position_step_m, 0);
  const Decoded seen = decoded(file.value().bytes);
  EXPECT_EQ(std::set(seen.positions.begin(), seen.positions.end()),
            std::set(scene.positions.begin(), scene.positions.end()));
}

TEST(DracoFile, WithoutAStepHasPositionsAsTheyAre) {
  const Scene mesh = numbered({{0, 0, 0}, {1e-5F, 0, 0}, {0, 1e-5F, 4e6F}}, {{0, 1, 2}});
  Scene cloud = mesh;
  cloud.triangles.clear();
  for (const Scene& scene : {mesh, cloud}) {
    for (const DracoKeeping keeping : {DracoKeeping::Shape, DracoKeeping::Order}) {
      const auto file = draco_file(scene.input(0), keeping, 5);
      ASSERT_TRUE(file) << file.error().message;
      const Decoded seen = decoded(file.value().bytes);
      EXPECT_EQ(std::set(seen.positions.begin(), seen.positions.end()),
                std::set(scene.positions.begin(), scene.positions.end()));
      EXPECT_EQ(file.value().kept, scene.triangles.empty() ? DracoKeeping::Order : keeping);
    }
  }
}

}  // namespace
}  // namespace spectra::protocol::codec
