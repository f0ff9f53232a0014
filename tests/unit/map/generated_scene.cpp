#include "tests/unit/map/generated_scene.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <vector>

namespace spectra::testing {
namespace {

/// std::shuffle differs between libraries; this does not.
template <class T>
void shuffle(std::vector<T>& values, std::mt19937& random) {
  for (std::size_t i = values.size(); i > 1; --i) std::swap(values[i - 1], values[random() % i]);
}

float unit(std::mt19937& random) {
  return static_cast<float>(random() >> 8) * 0x1p-24f;
}

base::Rgb8 colour(std::mt19937& random) {
  const auto bits = static_cast<std::uint32_t>(random());
  return {static_cast<std::uint8_t>(bits), static_cast<std::uint8_t>(bits >> 8), static_cast<std::uint8_t>(bits >> 16)};
}

}  // namespace

mesh::MultispectralMesh terrain(const TerrainOptions& options) {
  std::mt19937 random(options.seed);
  const std::uint32_t lone_count = options.has_lone_vertices ? 1 + options.columns * options.rows / 50 : 0;
  const std::uint32_t count = options.columns * options.rows + lone_count;
  std::vector<std::uint32_t> place(count);
  std::iota(place.begin(), place.end(), 0u);
  if (options.is_shuffled) shuffle(place, random);

  mesh::MultispectralMesh mesh;
  mesh.resize_vertices(count);
  mesh.name = "terrain";
  mesh.origin = {500000.25, 4000000.5, 12};
  mesh.has_visible = mesh.has_temperature = true;
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t row = i / options.columns, column = i % options.columns;
    const auto x = static_cast<float>(column), y = static_cast<float>(row);
    const float height = 4 * std::sin(x * 0.05f) * std::cos(y * 0.07f) + 0.2f * unit(random);
    const float temperature = 15 + 5 * std::sin(x * 0.02f + y * 0.03f) + unit(random);
    const bool is_missing = options.has_missing_temperature && i % 7 == 3;
    mesh.positions()[place[i]] = {x, y, height};
    mesh.visible()[place[i]] = colour(random);
    mesh.temperature_celsius()[place[i]] = is_missing ? std::numeric_limits<float>::quiet_NaN() : temperature;
  }
  std::vector<base::Triangle>& triangles = mesh.triangles();
  for (std::uint32_t row = 0; row + 1 < options.rows; ++row) {
    for (std::uint32_t column = 0; column + 1 < options.columns; ++column) {
      const std::uint32_t a = row * options.columns + column, b = a + options.columns;
      triangles.push_back({place[a], place[a + 1], place[b]});
      triangles.push_back({place[a + 1], place[b + 1], place[b]});
    }
  }
  if (options.is_shuffled) shuffle(triangles, random);
  return mesh;
}

mesh::MultispectralMesh torus(std::uint32_t columns, std::uint32_t rows, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<std::uint32_t> place(std::size_t{columns} * rows);
  std::iota(place.begin(), place.end(), 0u);
  shuffle(place, random);
  mesh::MultispectralMesh mesh;
  mesh.resize_vertices(place.size());
  mesh.name = "torus";
  mesh.has_visible = mesh.has_temperature = true;
  constexpr float kTurn = 6.2831853f;
  for (std::uint32_t i = 0; i < place.size(); ++i) {
    const float u = kTurn * static_cast<float>(i % columns) / static_cast<float>(columns);
    const float v = kTurn * static_cast<float>(i / columns) / static_cast<float>(rows);
    const float tube = 3 + 0.02f * unit(random);
    const float ring = 10 + tube * std::cos(v);
    mesh.positions()[place[i]] = {ring * std::cos(u), ring * std::sin(u), tube * std::sin(v)};
    mesh.visible()[place[i]] = colour(random);
    mesh.temperature_celsius()[place[i]] = 20 + 3 * std::sin(2 * u) + unit(random);
  }
  for (std::uint32_t row = 0; row < rows; ++row) {
    for (std::uint32_t column = 0; column < columns; ++column) {
      const std::uint32_t right = (column + 1) % columns, up = (row + 1) % rows;
      const std::uint32_t a = place[row * columns + column], b = place[row * columns + right];
      const std::uint32_t c = place[up * columns + column], d = place[up * columns + right];
      mesh.triangles().push_back({a, b, c});
      mesh.triangles().push_back({b, d, c});
    }
  }
  shuffle(mesh.triangles(), random);
  return mesh;
}

mesh::MultispectralMesh soup_of(const mesh::MultispectralMesh& mesh) {
  mesh::MultispectralMesh soup;
  soup.resize_vertices(3 * mesh.triangle_count());
  soup.has_visible = mesh.has_visible;
  soup.has_temperature = mesh.has_temperature;
  for (std::size_t t = 0; t < mesh.triangle_count(); ++t) {
    base::Triangle triangle{};
    for (unsigned corner = 0; corner < 3; ++corner) {
      const std::size_t v = 3 * t + corner;
      const std::uint32_t source = mesh.triangles()[t][corner];
      triangle[corner] = static_cast<std::uint32_t>(v);
      soup.positions()[v] = mesh.positions()[source];
      soup.visible()[v] = mesh.visible()[source];
      soup.temperature_celsius()[v] = mesh.temperature_celsius()[source];
    }
    soup.triangles().push_back(triangle);
  }
  return soup;
}

mesh::MultispectralMesh point_cloud(std::uint32_t count, std::uint32_t seed) {
  std::mt19937 random(seed);
  mesh::MultispectralMesh mesh;
  mesh.resize_vertices(count);
  mesh.name = "points";
  mesh.has_visible = mesh.has_temperature = true;
  for (std::uint32_t i = 0; i < count; ++i) {
    const float x = unit(random), y = unit(random), z = unit(random);
    mesh.positions()[i] = {x, y, z};
    mesh.visible()[i] = colour(random);
    mesh.temperature_celsius()[i] = 20 + 10 * x + unit(random);
  }
  return mesh;
}

mesh::MultispectralMesh copy_of(const mesh::MultispectralMesh& mesh) {
  mesh::MultispectralMesh copy;
  copy.resize_vertices(mesh.vertex_count());
  std::ranges::copy(mesh.positions(), copy.positions().begin());
  std::ranges::copy(mesh.visible(), copy.visible().begin());
  std::ranges::copy(mesh.temperature_celsius(), copy.temperature_celsius().begin());
  copy.triangles() = mesh.triangles();
  copy.origin = mesh.origin;
  copy.has_visible = mesh.has_visible;
  copy.has_temperature = mesh.has_temperature;
  copy.double_positions = mesh.double_positions;
  copy.name = mesh.name;
  return copy;
}

}  // namespace spectra::testing
