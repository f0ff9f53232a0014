#include "fusion/demo/baked_light.hpp"

#include <algorithm>
#include <cmath>

#include "fusion/demo/office.hpp"

namespace spectra::demo {
namespace {

constexpr std::size_t kShadowPixels = 512;
constexpr double kSceneRadius = 5.6;  // m about kSceneCentre
constexpr Vec kSceneCentre{0, 1.2, 0};
constexpr double kPixelsPerMetre = static_cast<double>(kShadowPixels) / (2 * kSceneRadius);
constexpr double kNearnessOffset = 10;  // keeps every nearness positive
constexpr double kShadowSlack = 0.022;  // m, hides the stair-steps of the shadow pixels
constexpr int kSkySources = 22;
constexpr int kKeySources = 7;

}  // namespace

std::vector<base::Vec3f> vertex_normals(const SurfaceMesh& mesh) {
  std::vector<base::Vec3f> normals(mesh.positions.size());
  for (const base::Triangle& t : mesh.triangles) {
    const base::Vec3f &a = mesh.positions[t[0]], &b = mesh.positions[t[1]], &c = mesh.positions[t[2]];
    const base::Vec3f e{b.x - a.x, b.y - a.y, b.z - a.z}, f{c.x - a.x, c.y - a.y, c.z - a.z};
    const base::Vec3f n{e.y * f.z - e.z * f.y, e.z * f.x - e.x * f.z, e.x * f.y - e.y * f.x};
    for (const std::uint32_t v : t) {
      normals[v].x += n.x;
      normals[v].y += n.y;
      normals[v].z += n.z;
    }
  }
  for (base::Vec3f& n : normals) {
    const float l = std::sqrt(n.x * n.x + n.y * n.y + n.z * n.z);
    n = l > 0 ? base::Vec3f{n.x / l, n.y / l, n.z / l} : base::Vec3f{0, 1, 0};
  }
  return normals;
}

BakedLight::BakedLight(const SurfaceMesh& stand_in) {
  const auto add = [this](Vec towards, Colour strength) {
    const Frame f = facing({}, towards, std::abs(towards.y) > 0.95 ? Vec{0, 0, 1} : Vec{0, 1, 0});
    sources_.push_back({f.out, f.right, f.up, strength, {}});
  };
  for (int i = 0; i < kSkySources; ++i) {
    const double height = (i + 0.7) / kSkySources, flat = std::sqrt(1 - height * height), angle = 2.399963 * i;
    const Vec towards{flat * cosine(angle), height, flat * sine(angle)};
    // The room is open towards the viewer; from the other sides less light comes in.
    const double weight = (0.75 + 0.45 * towards.z) * 1.05 / kSkySources;
    add(towards, Colour{0.92, 0.98, 1.08} * weight);
  }
  const Frame key = facing({}, {-0.50, 0.80, 0.62});
  for (int i = 0; i < kKeySources; ++i) {
    const double angle = 2.399963 * i, spread = 0.10 * std::sqrt(i / static_cast<double>(kKeySources));
    add(key.out + key.right * (spread * cosine(angle)) + key.up * (spread * sine(angle)),
        Colour{1.10, 1.0, 0.84} * (1.15 / kKeySources));
  }
  std::vector<ImagePoint> points(stand_in.positions.size());
  for (Source& source : sources_) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const base::Vec3f& p = stand_in.positions[i];
      const Vec q = Vec{p.x, p.y, p.z} - kSceneCentre;
      points[i] = {static_cast<float>((dot(q, source.right) + kSceneRadius) * kPixelsPerMetre),
                   static_cast<float>((dot(q, source.up) + kSceneRadius) * kPixelsPerMetre),
                   static_cast<float>(dot(q, source.towards) + kNearnessOffset)};
    }
    source.shadow = draw(points, stand_in.triangles, {}, kShadowPixels, kShadowPixels);
  }
}

double BakedLight::share_visible(const Source& source, Vec position) const {
  const Vec q = position - kSceneCentre;
  const double x = (dot(q, source.right) + kSceneRadius) * kPixelsPerMetre - 0.5;
  const double y = (dot(q, source.up) + kSceneRadius) * kPixelsPerMetre - 0.5;
  if (x < 0 || y < 0 || x >= kShadowPixels - 1 || y >= kShadowPixels - 1) return 1;
  const auto lit_from = static_cast<float>(dot(q, source.towards) + kNearnessOffset + kShadowSlack);
  const auto i = static_cast<std::size_t>(x), j = static_cast<std::size_t>(y);
  const double u = x - static_cast<double>(i), v = y - static_cast<double>(j);
  const float* row = &source.shadow.nearness[j * kShadowPixels + i];
  const auto lit = [&](std::size_t at) { return row[at] <= lit_from ? 1.0 : 0.0; };
  return mix(mix(lit(0), lit(1), u), mix(lit(kShadowPixels), lit(kShadowPixels + 1), u), v);
}

Colour BakedLight::at(Vec position, Vec normal) const {
  // Off the surface a little, or it would shade itself.
  Vec from = position + normal * 0.015;
  // And off the walls and the floor, whose seams would let light through.
  from = {std::clamp(from.x, -kHalfWidth + 0.05, kHalfWidth - 0.05), std::max(from.y, 0.03),
          std::max(from.z, -kHalfDepth + 0.05)};
  Colour light{0.105, 0.11, 0.12};
  for (const Source& source : sources_) {
    const double slope = dot(normal, source.towards);
    if (slope <= 0) continue;
    const double lit = slope * share_visible(source, from);
    light.r += source.strength.r * lit;
    light.g += source.strength.g * lit;
    light.b += source.strength.b * lit;
  }
  return light;
}

}  // namespace spectra::demo
