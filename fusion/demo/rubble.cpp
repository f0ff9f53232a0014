#include <algorithm>
#include <array>
#include <cmath>

#include "fusion/demo/noise.hpp"
#include "fusion/demo/office.hpp"

namespace spectra::demo {
namespace {

constexpr int kBlockTries = 3200;

/// Distance from p to the way between a and b.
double distance_to_way(Vec p, Vec a, Vec b) {
  const Vec d = b - a;
  const double t = clamp01(dot(p - a, d) / dot(d, d));
  return length(p - (a + d * t));
}

/// Nothing falls between the face or the hand and those who look for them, nor into the furniture.
bool is_kept_clear(Vec p, double radius) {
  const std::array<Vec, 2> shown{head_frame().origin, hand_frame().origin};
  const std::array<Vec, 3> viewers{Vec{-0.8, 2.0, 4.6}, Vec{0.2, 1.2, 2.7}, Vec{2.6, 1.7, 3.6}};
  for (const Vec& at : shown) {
    for (const Vec& eye : viewers) {
      if (distance_to_way(p, at, eye) < radius + 0.13) return true;
    }
  }
  // The shoulder and the arm.
  if (distance_to_way(p, head_frame().origin, hand_frame().origin + Vec{0.4, 0.05, -0.2}) < radius + 0.10) return true;
  return p.x < -1.0 && p.z < -1.4;
}

void add_block(Tessellator& out, Vec at, Vec half, double kind, Random& random) {
  const double yaw = random.uniform(0, 360), pitch = random.uniform(-34, 34), roll = random.uniform(-34, 34);
  const Frame frame = facing(at, {0, 0, 1}).turned(yaw, pitch, roll);
  const double tone = random.uniform(0.84, 1.08), cooler = random.uniform(-0.9, 0.3);
  const std::uint64_t seed = random.next_seed();
  const double size = std::sqrt(std::sqrt(half.x * half.z) * half.y);
  Colour light{166, 160, 150}, dark{122, 116, 108};
  if (kind > 0.80) {
    light = {156, 100, 80};
    dark = {116, 74, 62};
  } else if (kind > 0.62) {
    light = {212, 207, 196};
    dark = {168, 162, 150};
  }
  const double relative = std::clamp(size * 12, 0.75, 1.15);
  // A fragment is what some random planes leave of a box.
  struct Plane {
    Vec normal;
    double distance;
  };
  std::array<Plane, 9> breaks;
  for (Plane& plane : breaks) {
    const double x = random.normal(), y = random.normal(), z = random.normal();
    plane.normal = normalised({x, y, z});
    const double reach =
        std::abs(plane.normal.x) * half.x + std::abs(plane.normal.y) * half.y + std::abs(plane.normal.z) * half.z;
    plane.distance = reach * random.uniform(0.50, 0.82);
  }
  out.box(half, 0.10 * std::min({half.x, half.y, half.z}), relative, false, [&](Vec local, Vec normal) {
    const double lump = smooth_noise(local * (1.6 / size), seed);
    double keep = 1 + 0.05 * lump;
    for (const Plane& plane : breaks) {
      const double outside = dot(local, plane.normal) / plane.distance;
      if (outside * keep > 1) keep = 1 / outside + 0.012 * lump;
    }
    const Vec shaped = local * keep;
    const Vec p = frame.point(shaped);
    const Vec n = frame.point(normal) - frame.origin;
    const double fine = fractal_noise(p * 18, 3, seed + 1);
    SurfacePoint s;
    s.position = p + n * (std::min(0.010, 0.12 * size) * fine);
    s.colour = mix(light, dark, clamp01(0.45 + 0.8 * fine + 0.3 * lump)) * tone;
    s.celsius = ambient_celsius(p) + cooler + 0.2 * lump;
    s.dust = 0.55 + 0.3 * lump;
    return s;
  });
}

}  // namespace

void add_rubble(Tessellator& out, std::uint64_t seed) {
  Random random(seed + 400);
  for (int i = 0; i < kBlockTries; ++i) {
    // Many small pieces, few large ones.
    const double draw = random.uniform(), reach = draw * draw * draw * draw * draw * draw;
    const double size = 0.020 + 0.26 * reach;
    const double x = random.uniform(-2.4, 3.6), z = random.uniform(-2.6, 2.6);
    const double chance = random.uniform(), kind = random.uniform();
    Vec half{size * random.uniform(0.7, 1.3), 0, 0};
    half.y = size * random.uniform(0.35, 0.8);
    half.z = size * random.uniform(0.6, 1.1);
    const double lift = random.uniform(-0.1, 0.75);
    const std::uint64_t own = random.next_seed();
    const double heap = heap_height(x, z);
    // On the heap they lie close, on the open floor only small ones do, and few.
    if (chance > 0.05 + 2.4 * heap || (heap < 0.04 && size > 0.07)) continue;
    const Vec at{x, heap + half.y * lift, z};
    if (is_kept_clear(at, std::max({half.x, half.y, half.z}))) continue;
    // Below the distance between vertices a scan would not have found them.
    if (size < 1.1 * out.spacing(1)) continue;
    Random block(own);
    add_block(out, at, half, kind, block);
  }

  // The pieces that hold the person down, the same for every seed.
  Random fixed(4711);
  const auto place = [&](double x, double z, double above, Vec half, double kind) {
    add_block(out, {x, heap_height(x, z) + above, z}, half, kind, fixed);
  };
  place(1.42, 1.16, 0.20, {0.30, 0.13, 0.24}, 0.2);
  place(1.12, 0.84, 0.24, {0.22, 0.12, 0.20}, 0.1);
  place(0.98, 1.10, 0.25, {0.19, 0.10, 0.15}, 0.3);
  place(0.80, 0.93, 0.20, {0.10, 0.07, 0.10}, 0.7);
  place(1.24, 1.42, 0.10, {0.19, 0.11, 0.17}, 0.7);
  place(1.72, 1.55, 0.08, {0.26, 0.12, 0.20}, 0.3);
  place(0.78, 0.68, 0.12, {0.18, 0.09, 0.16}, 0.9);
  place(1.00, 1.52, 0.05, {0.10, 0.06, 0.09}, 0.9);
  place(0.02, 0.86, 0.07, {0.15, 0.09, 0.12}, 0.2);
  place(-0.16, 1.32, 0.03, {0.08, 0.05, 0.07}, 0.85);
  place(0.55, 1.86, 0.04, {0.12, 0.06, 0.09}, 0.1);

  const Material panel{{198, 192, 180}, {166, 160, 148}, 0.12, 0.004, 0.6, -0.4};
  add_solid_box(out, facing({1.55, 0.66, 0.90}, {0.1, 0, 1}).turned(12, 8, -24), {0.62, 0.022, 0.42}, 0.006, 0.75,
                panel, seed + 410);
  add_solid_box(out, facing({2.9, 0.50, 1.7}, {0.5, 0, 1}).turned(30, 22, 10), {0.34, 0.014, 0.34}, 0.005, 0.9, panel,
                seed + 411);
  add_solid_box(out, facing({-0.25, 0.10, -0.75}, {0.9, 0, 1}).turned(0, 6, 12), {0.31, 0.010, 0.30}, 0.004, 0.9, panel,
                seed + 412);
  const Material timber{{150, 114, 78}, {112, 82, 56}, 0.05, 0.003, 0.5, 0};
  add_solid_box(out, facing({0.95, 0.42, 0.2}, {0.6, 0.2, 1}).turned(0, 0, 24), {0.75, 0.035, 0.05}, 0.006, 0.8, timber,
                seed + 413);
  add_solid_box(out, facing({2.2, 0.75, 0.75}, {-0.8, 0.3, 1}).turned(0, 0, 33), {0.85, 0.03, 0.045}, 0.006, 0.8,
                timber, seed + 414);
}

}  // namespace spectra::demo
