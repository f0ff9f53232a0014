#include <algorithm>
#include <cmath>

#include "fusion/demo/noise.hpp"
#include "fusion/demo/office.hpp"

namespace spectra::demo {
namespace {

constexpr Colour kDustySkin{168, 148, 132};
constexpr double kFull = 6.283185307;

double bump(double x, double y, double cx, double cy, double rx, double ry) {
  const double u = (x - cx) / rx, v = (y - cy) / ry;
  return bell(std::sqrt(u * u + v * v));
}

/// The head as a displaced ball: face towards `out`, crown towards `up`.
void add_head(Tessellator& out, const Frame& head, std::uint64_t seed) {
  out.tube(0.62, 0.34, 0.36, true, true, [&](double u, double v) {
    const double polar = 3.14159265 * v, a = 1.570796 - kFull * (u - 0.5);
    const double ring = v == 0 || v == 1 ? 0 : sine(polar);
    const Vec d{ring * cosine(a), -cosine(polar), ring * sine(a)};
    // Half a head is 7.5 cm wide, 11.5 high, 9.5 deep.
    Vec p{0.074 * d.x, 0.112 * d.y, 0.094 * d.z};
    const double jaw = smooth_step(0.1, -1.0, d.y);
    p.x *= 1 - 0.26 * jaw;
    if (d.z < 0) p.z *= 1 - 0.25 * jaw;
    double skin = 0, cavity = 0;
    if (d.z > 0) {
      const double x = d.x, y = d.y;
      const double eyes = bump(std::abs(x), y, 0.36, 0.10, 0.24, 0.15);
      const double nose = bump(x, y, 0, -0.10, 0.15, 0.33) * (0.35 + 0.65 * smooth_step(0.25, -0.28, y));
      const double brow = bump(std::abs(x), y, 0.32, 0.30, 0.40, 0.13);
      const double lips = bump(x, y, 0, -0.47, 0.33, 0.085), mouth = bump(x, y, 0, -0.47, 0.28, 0.025);
      const double chin = bump(x, y, 0, -0.80, 0.36, 0.22), cheeks = bump(std::abs(x), y, 0.52, -0.16, 0.26, 0.26);
      p.z += d.z * (0.036 * nose - 0.017 * eyes + 0.006 * brow + 0.006 * lips - 0.007 * mouth + 0.008 * chin +
                    0.004 * cheeks);
      cavity = 0.60 * eyes + 0.75 * mouth + 0.5 * bump(std::abs(x), y, 0.10, -0.34, 0.06, 0.05);
      cavity +=
          0.5 * bump(std::abs(x), y, 0.35, 0.30, 0.26, 0.05) + 0.4 * bump(std::abs(x), y, 0.35, 0.08, 0.17, 0.025);
    }
    const double ear = bump(d.z, d.y, -0.10, -0.02, 0.20, 0.24) * smooth_step(0.7, 0.9, std::abs(d.x));
    p.x += (d.x > 0 ? 1 : -1) * 0.016 * ear;
    const double strand = fractal_noise({d.x * 26, d.y * 9, d.z * 26}, 3, seed);
    const double hairline = d.y - 0.52 + 0.5 * smooth_step(0.25, -0.25, d.z) * (1 - ear) * 1.1 + 0.08 * strand;
    const double hair = smooth_step(-0.03, 0.05, hairline - (d.z < 0 ? -0.3 * smooth_step(0, -0.5, d.z) : 0.0));
    p = p + d * (0.010 * hair * (1 + 0.5 * strand));
    skin = 1 - hair;
    const double patch = fractal_noise(p * 22, 3, seed + 1), grit = fractal_noise(p * 120, 2, seed + 2);
    SurfacePoint s;
    s.position = head.point(p + d * (0.0012 * grit));
    const Colour flesh =
        mix(kDustySkin, Colour{142, 112, 96}, clamp01(0.30 + 0.8 * patch)) * (1 - 0.55 * clamp01(cavity));
    s.colour =
        mix(flesh, mix(Colour{92, 84, 76}, Colour{128, 120, 110}, clamp01(0.5 + strand)), hair) * (1 + 0.05 * grit);
    const double nose_tip = d.z > 0 ? bump(d.x, d.y, 0, -0.22, 0.20, 0.16) : 0;
    const double dusty = clamp01(0.5 + 1.2 * patch);
    s.celsius = mix(28.5, 35.9 - 0.9 * dusty - 1.4 * nose_tip + 0.4 * clamp01(cavity) - 1.2 * ear, skin);
    s.dust = 0.55 + 0.35 * patch;
    s.is_skin = skin > 0.5;
    return s;
  });
}

/// A clothed limb or body: a tapering, slightly flattened tube along a curve, with folds.
void add_clothed(Tessellator& out, Vec a, Vec b, Vec c, double start_radius, double end_radius, double flatness,
                 Colour cloth, double celsius, std::uint64_t seed) {
  const double along = length(b - a) + length(c - b), widest = std::max(start_radius, end_radius);
  out.tube(kFull * widest, along, 0.5, true, true, [&](double u, double v) {
    const Frame f = curve_frame(a, b, c, v);
    const double angle = kFull * u;
    const double ends = std::sqrt(clamp01(std::min(v, 1 - v) * along / (0.6 * widest)) *
                                  (2 - clamp01(std::min(v, 1 - v) * along / (0.6 * widest))));
    const double radius = mix(start_radius, end_radius, v) * ends;
    const Vec side = f.right * cosine(angle) + f.up * (flatness * sine(angle));
    Vec p = f.origin + side * radius;
    const double folds = fractal_noise({p.x * 9 + p.y * 5, p.y * 11, p.z * 13}, 3, seed);
    const double crease = 1 - std::abs(fractal_noise({p.x * 7, p.y * 7 + p.x * 5, p.z * 7}, 2, seed + 1)) * 2;
    p = p + side * (ends * (0.022 * folds + 0.014 * crease));
    const double weave = fractal_noise(p * 60, 2, seed + 2);
    SurfacePoint s;
    s.position = p;
    s.colour = mix(cloth, cloth * 0.72, clamp01(0.45 - 0.5 * crease + 0.4 * folds)) * (1 + 0.07 * weave);
    s.celsius = celsius + 0.7 * folds - 1.0 * smooth_step(0.2, -0.9, sine(angle));
    s.dust = 0.95;
    return s;
  });
}

/// Bare skin along a curve: wrist and fingers.
void add_finger(Tessellator& out, Vec a, Vec b, Vec c, double start_radius, double end_radius, double start_celsius,
                double end_celsius, std::uint64_t seed) {
  const double along = length(b - a) + length(c - b);
  out.tube(kFull * start_radius, along, 0.27, true, true, [&](double u, double v) {
    const Frame f = curve_frame(a, b, c, v);
    const Vec side = f.right * cosine(kFull * u) + f.up * sine(kFull * u);
    const double to_tip = (1 - v) * along, end = std::min(1.0, to_tip / end_radius);
    double radius = mix(start_radius, end_radius, v) * std::sqrt(end * (2 - end));
    if (v == 0) radius = 0;
    // The knuckles are a little thicker.
    radius *= 1 + 0.10 * (bell((v - 0.36) / 0.10) + bell((v - 0.70) / 0.09));
    const Vec p = f.origin + side * radius;
    const double patch = fractal_noise(p * 30, 3, seed);
    SurfacePoint s;
    s.position = p + side * (0.0008 * patch);
    const double nail = bell((v - 0.92) / 0.09) * smooth_step(0.5, 0.8, sine(kFull * u));
    s.colour =
        mix(mix(kDustySkin, Colour{138, 110, 96}, clamp01(0.35 + 0.9 * patch)), Colour{186, 164, 152}, 0.5 * nail);
    s.colour = s.colour * (1 - 0.18 * bell((v - 0.40) / 0.03));
    s.celsius = mix(start_celsius, end_celsius, v) - 0.7 * clamp01(0.5 + patch);
    s.dust = 0.6 + 0.3 * patch;
    s.is_skin = true;
    return s;
  });
}

void add_hand(Tessellator& out, const Frame& hand, std::uint64_t seed) {
  out.box({0.041, 0.048, 0.015}, 0.014, 0.24, true, [&](Vec local, Vec normal) {
    // Wider at the knuckles than at the wrist, arched across.
    const double reach = local.y / 0.048;
    Vec p{local.x * (0.92 + 0.14 * reach), local.y, local.z - 0.006 * (local.x / 0.041) * (local.x / 0.041)};
    const double column = (local.x + 0.041) / 0.0205, ridge = bell((column - std::floor(column) - 0.5) / 0.5);
    p.z += normal.z > 0.3 ? 0.0035 * ridge * smooth_step(-0.6, 1, reach) : 0;
    const Vec n = hand.point(normal) - hand.origin;
    const double patch = fractal_noise(p * 30, 3, seed), vein = std::abs(fractal_noise(p * 24, 2, seed + 1));
    SurfacePoint s;
    s.position = hand.point(p) + n * (0.0010 * patch + 0.0012 * (1 - smooth_step(0.0, 0.12, vein)));
    s.colour = mix(kDustySkin, Colour{138, 110, 96}, clamp01(0.35 + 0.9 * patch - 0.25 * ridge));
    s.celsius = 35.7 - 0.8 * clamp01(0.5 + patch);
    s.dust = 0.6 + 0.3 * patch;
    s.is_skin = true;
    return s;
  });
  for (int i = 0; i < 4; ++i) {
    const double x = -0.032 + 0.0213 * i, spread = 0.016 * (i - 1.5);
    const double reach = i == 0 ? 0.062 : i == 3 ? 0.070 : i == 1 ? 0.080 : 0.084;
    const double curl = i == 0 ? 0.040 : 0.028 + 0.004 * i;
    add_finger(out, hand.point(x, 0.036, -0.002), hand.point(x + 0.5 * spread, 0.046 + 0.62 * reach, 0.016),
               hand.point(x + spread, 0.040 + reach, -curl), 0.0100, 0.0076, 35.2, 33.8,
               seed + 10 + static_cast<std::uint64_t>(i));
  }
  add_finger(out, hand.point(0.030, -0.030, -0.004), hand.point(0.066, 0.0, -0.004), hand.point(0.070, 0.038, -0.022),
             0.0125, 0.0090, 35.2, 34.0, seed + 20);
}

}  // namespace

void add_person(Tessellator& out, std::uint64_t seed) {
  const Frame head = head_frame(), hand = hand_frame();
  add_head(out, head, seed + 500);
  const Colour jacket{112, 110, 106}, trousers{88, 86, 84};
  const Vec neck = head.point(0, -0.075, -0.020);
  const Vec chest{0.72, heap_height(0.72, 1.10) + 0.11, 1.10}, hip{1.25, heap_height(1.25, 1.02) + 0.08, 1.02};
  add_finger(out, head.point(0, -0.02, -0.02), mix(head.point(0, -0.02, -0.02), neck, 0.6),
             neck + Vec{0.10, -0.01, -0.02}, 0.056, 0.058, 35.0, 33.5, seed + 505);
  add_clothed(out, neck + Vec{0.035, -0.02, -0.02}, chest + Vec{-0.05, 0.05, 0}, hip, 0.158, 0.148, 0.68, jacket, 27.4,
              seed + 510);
  const Vec shoulder = neck + Vec{0.13, 0.0, 0.09};
  const Vec wrist = hand.point(0, -0.058, -0.004);
  const Vec elbow{0.36, heap_height(0.36, 1.66) + 0.075, 1.66};
  const Vec cuff = mix(elbow, wrist, 0.72);
  add_clothed(out, shoulder, elbow + Vec{0.10, 0.02, 0.07}, cuff, 0.078, 0.042, 0.92, jacket, 27.0, seed + 520);
  add_finger(out, mix(elbow, wrist, 0.6), mix(elbow, wrist, 0.85), hand.point(0, 0.0, -0.002), 0.030, 0.027, 34.0, 35.0,
             seed + 540);
  add_hand(out, hand, seed + 550);
  add_clothed(out, hip, hip + Vec{0.40, 0.0, -0.06}, hip + Vec{0.85, -0.12, -0.15}, 0.10, 0.07, 0.9, trousers, 26.4,
              seed + 560);
}

}  // namespace spectra::demo
