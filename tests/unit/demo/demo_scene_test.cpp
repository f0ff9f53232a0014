#include "fusion/demo/demo_scene.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <vector>

namespace spectra::demo {
namespace {

const mesh::MultispectralMesh& default_scene() {
  static const mesh::MultispectralMesh scene = demo_scene({});
  return scene;
}

/// FNV-1a over the bytes of everything in the scene.
std::uint64_t fingerprint(const mesh::MultispectralMesh& scene) {
  std::uint64_t hash = 0xCBF29CE484222325ULL;
  const auto take = [&hash](const void* data, std::size_t size) {
    const auto* bytes = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < size; ++i) hash = (hash ^ bytes[i]) * 0x100000001B3ULL;
  };
  take(scene.positions().data(), scene.positions().size_bytes());
  take(scene.visible().data(), scene.visible().size_bytes());
  for (const float celsius : scene.temperature_celsius()) {
    const float value = std::isnan(celsius) ? -1000.0F : celsius;
    take(&value, sizeof value);
  }
  take(scene.triangles().data(), scene.triangles().size() * sizeof(base::Triangle));
  return hash;
}

float square_distance(const base::Vec3f& a, const base::Vec3f& b) {
  const float dx = a.x - b.x, dy = a.y - b.y, dz = a.z - b.z;
  return dx * dx + dy * dy + dz * dz;
}

std::size_t nearest_vertex(const mesh::MultispectralMesh& scene, const base::Vec3f& to) {
  const auto positions = scene.positions();
  const auto nearest = std::min_element(
      positions.begin(), positions.end(),
      [&](const base::Vec3f& a, const base::Vec3f& b) { return square_distance(a, to) < square_distance(b, to); });
  return static_cast<std::size_t>(nearest - positions.begin());
}

base::Vec3f landmark_position(std::string_view name) {
  for (const DemoLandmark& landmark : demo_landmarks()) {
    if (landmark.name == name) return landmark.position;
  }
  ADD_FAILURE() << "no landmark " << name;
  return {};
}

/// Middle nine tenths of a set of values.
double spread(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() * 95 / 100] - values[values.size() * 5 / 100];
}

TEST(DemoScene, IsTheSameForTheSameSeed) {
  const mesh::MultispectralMesh first = demo_scene({20'000, 7}), second = demo_scene({20'000, 7});
  EXPECT_EQ(fingerprint(first), fingerprint(second));
  EXPECT_NE(fingerprint(first), fingerprint(demo_scene({20'000, 8})));
}

// The number changes with every change to the scene, and then on purpose; it must not differ between machines.
TEST(DemoScene, IsTheSameOnEveryMachine) {
  EXPECT_EQ(fingerprint(demo_scene({20'000, 1})), 0x7F305A20AD74F72ULL);
}

TEST(DemoScene, MeetsTheWantedVertexCount) {
  for (const std::uint64_t wanted : {5'000U, 40'000U, 120'000U, 700'000U}) {
    const auto made = static_cast<double>(demo_scene({wanted, 1}).vertex_count());
    EXPECT_NEAR(made / static_cast<double>(wanted), 1, 0.05) << wanted;
  }
  EXPECT_NEAR(static_cast<double>(default_scene().vertex_count()), 300'000, 15'000);
}

TEST(DemoScene, BringsAbsurdCountsIntoItsRange) {
  EXPECT_NEAR(static_cast<double>(demo_scene({0, 1}).vertex_count()), 5'000, 250);
}

TEST(DemoScene, HasFinitePositionsInTheRoom) {
  for (const base::Vec3f& p : default_scene().positions()) {
    ASSERT_TRUE(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z));
    ASSERT_LT(std::abs(p.x), 4.5F);
    ASSERT_LT(std::abs(p.z), 3.5F);
    ASSERT_GT(p.y, -0.5F);
    ASSERT_LT(p.y, 3.6F);
  }
}

TEST(DemoScene, HasUsableTrianglesAndNoLooseVertices) {
  const mesh::MultispectralMesh& scene = default_scene();
  std::vector<bool> is_used(scene.vertex_count());
  for (const base::Triangle& t : scene.triangles()) {
    for (const std::uint32_t v : t) {
      ASSERT_LT(v, scene.vertex_count());
      is_used[v] = true;
    }
    const auto p = scene.positions();
    ASSERT_GT(square_distance(p[t[0]], p[t[1]]), 0.0F);
    ASSERT_GT(square_distance(p[t[1]], p[t[2]]), 0.0F);
    ASSERT_GT(square_distance(p[t[2]], p[t[0]]), 0.0F);
  }
  EXPECT_EQ(std::count(is_used.begin(), is_used.end(), false), 0);
}

TEST(DemoScene, LacksTemperatureWhereNoViewReached) {
  const auto celsius = default_scene().temperature_celsius();
  const auto missing = std::count_if(celsius.begin(), celsius.end(), [](float t) { return std::isnan(t); });
  const double share = static_cast<double>(missing) / static_cast<double>(celsius.size());
  EXPECT_GT(share, 0.03);
  EXPECT_LT(share, 0.20);
}

TEST(DemoScene, HasTheTemperaturesOfAnOfficeWithPeopleAndMachines) {
  float lowest = 1000, highest = -1000;
  for (const float t : default_scene().temperature_celsius()) {
    if (std::isnan(t)) continue;
    lowest = std::min(lowest, t);
    highest = std::max(highest, t);
  }
  EXPECT_GT(lowest, 6);
  EXPECT_LT(lowest, 10);
  EXPECT_GT(highest, 54);
  EXPECT_LT(highest, 64);
}

TEST(DemoScene, HasItsLandmarksForEverySeed) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const mesh::MultispectralMesh scene = demo_scene({300'000, seed});
    for (const DemoLandmark& landmark : demo_landmarks()) {
      const std::size_t vertex = nearest_vertex(scene, landmark.position);
      EXPECT_LT(square_distance(scene.positions()[vertex], landmark.position), 0.02F * 0.02F) << landmark.name;
      EXPECT_GE(scene.temperature_celsius()[vertex], landmark.lowest_celsius) << landmark.name << ", seed " << seed;
      EXPECT_LE(scene.temperature_celsius()[vertex], landmark.highest_celsius) << landmark.name << ", seed " << seed;
    }
  }
}

TEST(DemoScene, HasLetteringForTheEyeOnly) {
  const mesh::MultispectralMesh& scene = default_scene();
  for (const std::string_view name : {"exit_sign", "danger_sign"}) {
    const base::Vec3f middle = landmark_position(name);
    std::vector<double> grey, celsius;
    for (std::size_t i = 0; i < scene.vertex_count(); ++i) {
      const base::Vec3f& p = scene.positions()[i];
      if (std::abs(p.x - middle.x) > 0.15F || std::abs(p.y - middle.y) > 0.06F || std::abs(p.z - middle.z) > 0.01F) {
        continue;
      }
      const base::Rgb8& c = scene.visible()[i];
      grey.push_back(0.299 * c.r + 0.587 * c.g + 0.114 * c.b);
      celsius.push_back(static_cast<double>(scene.temperature_celsius()[i]));
    }
    ASSERT_GT(grey.size(), 500U) << name;
    EXPECT_GT(spread(grey), 60) << name;
    EXPECT_LT(spread(celsius), 2.5) << name;
  }
}

TEST(DemoScene, HidesThePersonFromTheEye) {
  const mesh::MultispectralMesh& scene = default_scene();
  for (const std::string_view name : {"face", "hand"}) {
    const std::size_t vertex = nearest_vertex(scene, landmark_position(name));
    const base::Rgb8& c = scene.visible()[vertex];
    EXPECT_LT(std::max({c.r, c.g, c.b}) - std::min({c.r, c.g, c.b}), 60) << name << " is not dust-grey";
    EXPECT_GT(scene.temperature_celsius()[vertex], 30) << name;
  }
}

}  // namespace
}  // namespace spectra::demo
