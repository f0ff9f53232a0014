#include "fusion/demo/demo_scene.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <span>

#include "fusion/demo/baked_light.hpp"
#include "fusion/demo/noise.hpp"
#include "fusion/demo/office.hpp"
#include "fusion/demo/scan_view.hpp"
#include "fusion/demo/thermal_sensor.hpp"

namespace spectra::demo {
namespace {

/// Light and temperature are found on a scene of this size, whatever the size asked for, so that they cost and look the
/// same for all.
constexpr std::uint64_t kStandInVertices = 160'000;

void add_everything(Tessellator& out, std::uint64_t seed) {
  add_room(out, seed);
  add_signs(out, seed);
  add_furniture(out, seed);
  add_desk_things(out, seed);
  add_rubble(out, seed);
  add_person(out, seed);
}

/// The distance between vertices that gives this many.
double spacing_for(std::uint64_t vertex_count, std::uint64_t seed) {
  double fine = 1e-4, coarse = 1;
  for (int i = 0; i < 40; ++i) {
    const double middle = std::sqrt(fine * coarse);
    Tessellator count(middle, nullptr);
    add_everything(count, seed);
    (count.vertex_count() > vertex_count ? fine : coarse) = middle;
  }
  return coarse;
}

SurfaceMesh surfaces(std::uint64_t vertex_count, std::uint64_t seed) {
  SurfaceMesh mesh;
  const auto room = static_cast<std::size_t>(vertex_count + vertex_count / 20);
  mesh.positions.reserve(room);
  mesh.colours.reserve(room);
  mesh.celsius.reserve(room);
  mesh.dust.reserve(room);
  mesh.glow.reserve(room);
  mesh.is_skin.reserve(room);
  mesh.triangles.reserve(2 * room);
  Tessellator cut(spacing_for(vertex_count, seed), &mesh);
  add_everything(cut, seed);
  return mesh;
}

/// Leaves out what the depth camera never saw, as a scan does; a triangle stays when one of its corners was seen.
void keep_seen(SurfaceMesh& mesh, const ScanCoverage& coverage) {
  const std::vector<base::Vec3f> normals = vertex_normals(mesh);
  constexpr std::uint32_t kUnused = 0xFFFFFFFF;
  std::vector<std::uint8_t> is_seen(mesh.positions.size());
  for (std::size_t i = 0; i < is_seen.size(); ++i) {
    const base::Vec3f &p = mesh.positions[i], &n = normals[i];
    is_seen[i] = coverage.has_seen({p.x, p.y, p.z}, {n.x, n.y, n.z}) ? 1 : 0;
  }
  std::vector<std::uint32_t> new_index(mesh.positions.size(), kUnused);
  std::erase_if(mesh.triangles, [&](const base::Triangle& t) {
    if (is_seen[t[0]] + is_seen[t[1]] + is_seen[t[2]] == 0) return true;
    for (const std::uint32_t v : t) new_index[v] = 0;
    return false;
  });
  std::uint32_t next = 0;
  for (std::size_t i = 0; i < new_index.size(); ++i) {
    if (new_index[i] == kUnused) continue;
    mesh.positions[next] = mesh.positions[i];
    mesh.colours[next] = mesh.colours[i];
    mesh.celsius[next] = mesh.celsius[i];
    mesh.dust[next] = mesh.dust[i];
    mesh.glow[next] = mesh.glow[i];
    mesh.is_skin[next] = mesh.is_skin[i];
    new_index[i] = next++;
  }
  mesh.positions.resize(next);
  mesh.colours.resize(next);
  mesh.celsius.resize(next);
  mesh.dust.resize(next);
  mesh.glow.resize(next);
  mesh.is_skin.resize(next);
  for (base::Triangle& t : mesh.triangles) {
    for (std::uint32_t& v : t) v = new_index[v];
  }
}

/// The part of the scene that the depth camera saw, with about this many vertices.
SurfaceMesh seen_surfaces(std::uint64_t vertex_count, std::uint64_t seed, const ScanCoverage& coverage,
                          const SurfaceMesh& stand_in) {
  // How much is seen hardly depends on the size, so a small scene tells it; then one try, seldom two.
  SurfaceMesh sample = vertex_count < kStandInVertices ? surfaces(vertex_count, seed) : stand_in;
  double cut_per_seen = static_cast<double>(sample.positions.size());
  keep_seen(sample, coverage);
  cut_per_seen /= static_cast<double>(sample.positions.size());
  const auto wanted = static_cast<double>(vertex_count);
  SurfaceMesh mesh;
  for (int i = 0; i < 6; ++i) {
    mesh = surfaces(static_cast<std::uint64_t>(wanted * cut_per_seen), seed);
    keep_seen(mesh, coverage);
    const double ratio = wanted / static_cast<double>(mesh.positions.size());
    if (std::abs(ratio - 1) < 0.03) break;
    cut_per_seen *= ratio;
  }
  return mesh;
}

/// An sRGB level from light: the square root stands in for the transfer curve, and the brightest rolls off softly.
std::uint8_t level(double albedo, double light, double glow, double grain) {
  const double reflected = (albedo / 255) * (albedo / 255);
  double seen = mix(reflected * light, reflected * 1.05, glow);
  if (seen > 0.7) seen = 0.7 + 0.3 * (1 - 1 / (1 + (seen - 0.7) / 0.3));
  return static_cast<std::uint8_t>(std::clamp(255 * std::sqrt(seen) + grain + 0.5, 0.0, 255.0));
}

/// The colours of the scene in its light, under its dust; `done` is told of shares.
void paint(const SurfaceMesh& scene, const std::vector<base::Vec3f>& normals, const BakedLight& light,
           std::uint64_t seed, std::span<base::Rgb8> visible, const std::function<void(double)>& done) {
  for (std::size_t i = 0; i < scene.positions.size(); ++i) {
    if (i % 16'384 == 0) done(static_cast<double>(i) / static_cast<double>(scene.positions.size()));
    const Vec p{scene.positions[i].x, scene.positions[i].y, scene.positions[i].z};
    const Vec n{normals[i].x, normals[i].y, normals[i].z};
    const base::Rgb8& bare = scene.colours[i];
    const double settled = scene.dust[i] / 255.0 * smooth_step(-0.35, 0.9, n.y);
    const double cloud = fractal_noise(p * 3.1, 3, seed + 901);
    const Colour c = mix(Colour{static_cast<double>(bare.r), static_cast<double>(bare.g), static_cast<double>(bare.b)},
                         Colour{162, 155, 144} * (1 + 0.10 * cloud), clamp01(settled * (0.85 + 0.5 * cloud)));
    const Colour lit = light.at(p, n);
    const double glow = scene.glow[i] / 255.0;
    const double grain = 5 * (static_cast<double>(scramble(seed + i) >> 40) * 0x1p-23 - 1);
    visible[i] = {level(c.r, lit.r, glow, grain), level(c.g, lit.g, glow, grain), level(c.b, lit.b, glow, grain)};
  }
}

/// A mesh with the form of the scene.
mesh::MultispectralMesh formed(const SurfaceMesh& scene) {
  mesh::MultispectralMesh mesh;
  mesh.name = "demo";
  mesh.up = base::UpAxis::Y;
  mesh.is_metric = true;
  mesh.told = {mesh.up, "metres"};
  mesh.has_visible = true;
  mesh.has_temperature = true;
  mesh.resize_vertices(scene.positions.size());
  std::copy(scene.positions.begin(), scene.positions.end(), mesh.positions().begin());
  return mesh;
}

}  // namespace

LabelledDemoScene labelled_demo_scene(const DemoSceneOptions& options, const base::Progress& progress) {
  base::report(progress, base::kModellingPhase, 0);
  const std::uint64_t wanted = std::clamp(options.vertex_count, kDemoSceneLeastVertices, kDemoSceneMostVertices);
  const std::uint64_t seed = scramble(options.seed);
  // The stand-in takes as long as so many vertices of the scene, and three quarters of those go into the surfaces.
  constexpr double kStandInWork = 600'000;
  const double stand_in_share = kStandInWork / (kStandInWork + static_cast<double>(wanted));
  const SurfaceMesh stand_in = surfaces(kStandInVertices, seed);
  base::report(progress, base::kModellingPhase, 0.18 * stand_in_share);
  const BakedLight light(stand_in);
  base::report(progress, base::kModellingPhase, 0.85 * stand_in_share);
  const ThermalSensor sensor(stand_in, seed + 900);
  const double surfaces_share = stand_in_share + 0.75 * (1 - stand_in_share);
  base::report(progress, base::kModellingPhase, stand_in_share);

  SurfaceMesh scene = seen_surfaces(wanted, seed, ScanCoverage(stand_in), stand_in);
  const std::vector<base::Vec3f> normals = vertex_normals(scene);
  mesh::MultispectralMesh mesh = formed(scene);
  paint(scene, normals, light, seed, mesh.visible(), [&](double share) {
    base::report(progress, base::kModellingPhase, surfaces_share + (1 - surfaces_share) * share);
  });
  const std::span<float> celsius = mesh.temperature_celsius();
  for (std::size_t i = 0; i < scene.positions.size(); ++i) {
    const base::Vec3f &p = scene.positions[i], &n = normals[i];
    celsius[i] = sensor.celsius_at({p.x, p.y, p.z}, {n.x, n.y, n.z});
  }
  mesh.triangles() = std::move(scene.triangles);
  return {std::move(mesh), std::move(scene.is_skin)};
}

mesh::MultispectralMesh true_demo_scene(const DemoSceneOptions& options, const base::Progress& progress) {
  base::report(progress, base::kModellingPhase, 0);
  const std::uint64_t wanted = std::clamp(options.vertex_count, kDemoSceneLeastVertices, kDemoSceneMostVertices);
  const std::uint64_t seed = scramble(options.seed);
  const BakedLight light(surfaces(std::min(wanted, kStandInVertices), seed));
  base::report(progress, base::kModellingPhase, 0.4);
  SurfaceMesh scene = surfaces(wanted, seed);
  base::report(progress, base::kModellingPhase, 0.6);
  const std::vector<base::Vec3f> normals = vertex_normals(scene);
  mesh::MultispectralMesh mesh = formed(scene);
  paint(scene, normals, light, seed, mesh.visible(),
        [&](double share) { base::report(progress, base::kModellingPhase, 0.6 + 0.4 * share); });
  std::copy(scene.celsius.begin(), scene.celsius.end(), mesh.temperature_celsius().begin());
  mesh.triangles() = std::move(scene.triangles);
  return mesh;
}

mesh::MultispectralMesh demo_scene(const DemoSceneOptions& options, const base::Progress& progress) {
  return labelled_demo_scene(options, progress).mesh;
}

std::vector<DemoLandmark> demo_landmarks() {
  const auto at = [](Vec p) {
    return base::Vec3f{static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)};
  };
  return {
      {"monitor_left", at(left_monitor_frame().point(0, -0.02, 0.003)), 34, 41},
      {"monitor_right", at(right_monitor_frame().point(0, -0.02, 0.003)), 33, 39},
      {"laptop", at(laptop_frame().point(-0.06, 0.02, -0.05)), 28, 41},
      {"phone", at(phone_frame().point(0, 0.006, 0)), 24, 35},
      {"mug", at(mug_frame().point(0, 0.055, kMugRadius)), 40, 56},
      {"coffee", at(mug_frame().point(0, kMugHeight - 0.016, 0)), 33, 62},
      {"bottle", at(bottle_frame().point(0, 0.09, kBottleRadius)), 6.5F, 13},
      {"electrical_box", at(electrical_box_frame().point(0.06, 0.09, 0.07)), 48, 62.5F},
      {"pipe", base::Vec3f{-0.9F, 0.22F, -2.697F}, 38, 50},
      {"face", at(head_frame().point(0.03, 0.045, 0.088)), 31, 36.5F},
      {"hand", at(hand_frame().point(0, 0.01, 0.015)), 30, 36},
      {"exit_sign", at(exit_sign_frame().point(0, 0, 0.004)), 17, 22},
      {"danger_sign", at(danger_sign_frame().point(0, 0, 0.004)), 17, 24},
  };
}

}  // namespace spectra::demo
