#include <algorithm>
#include <cmath>
#include <functional>

#include "fusion/demo/noise.hpp"
#include "fusion/demo/office.hpp"

namespace spectra::demo {
namespace {

/// What a screen shows at (u, v) in 0..1, v up.
using Picture = std::function<Colour(double u, double v)>;

/// A measuring program: curves over a dark grid, a side bar.
Colour chart_picture(double u, double v) {
  if (v > 0.93) return u < 0.25 && v > 0.95 && v < 0.975 ? Colour{230, 230, 235} : Colour{50, 62, 92};
  if (u < 0.2) {
    const double row = v * 12 - std::floor(v * 12);
    const bool is_text =
        row > 0.35 && row < 0.65 && u > 0.03 && u < 0.09 + 0.08 * std::abs(sine(std::floor(v * 12) * 2.3));
    return is_text ? Colour{190, 200, 215} : Colour{36, 42, 54};
  }
  const double x = (u - 0.2) / 0.8, y = v / 0.93;
  Colour c{16, 22, 30};
  if (std::abs(x * 8 - std::floor(x * 8 + 0.5)) < 0.04 || std::abs(y * 6 - std::floor(y * 6 + 0.5)) < 0.04)
    c = {44, 56, 68};
  const double green = 0.55 + 0.18 * sine(x * 13) + 0.10 * sine(x * 31 + 1),
               orange = 0.32 + 0.12 * sine(x * 9 + 2) + 0.2 * bell((x - 0.7) / 0.15);
  if (y < orange) c = mix(c, Colour{200, 110, 30}, 0.28);
  c = mix(c, Colour{90, 230, 120}, 1 - smooth_step(0.008, 0.026, std::abs(y - green)));
  return mix(c, Colour{255, 170, 60}, 1 - smooth_step(0.008, 0.026, std::abs(y - orange)));
}

/// A photograph: evening sky, two ridges, a lake.
Colour landscape_picture(double u, double v) {
  const double far_ridge = 0.52 + 0.14 * fractal_noise({u * 3.1, 0, 0}, 4, 77),
               near_ridge = 0.36 + 0.10 * fractal_noise({u * 4.3, 9, 0}, 4, 78);
  Colour c = mix(Colour{250, 196, 130}, Colour{70, 120, 190}, smooth_step(0.45, 1, v));
  const double sx = (u - 0.68) * 1.7, sy = v - 0.68;
  c = mix(c, Colour{255, 246, 214}, 1 - smooth_step(0.05, 0.075, std::sqrt(sx * sx + sy * sy)));
  if (v < far_ridge) c = mix(Colour{96, 104, 140}, Colour{128, 122, 148}, clamp01(v / far_ridge));
  if (v < near_ridge)
    c = mix(Colour{26, 58, 44}, Colour{48, 84, 52}, clamp01(0.5 + fractal_noise({u * 30, v * 30, 0}, 2, 79)));
  if (v < 0.2)
    c = mix(Colour{60, 92, 130}, Colour{206, 166, 128}, clamp01(0.4 + 0.7 * smooth_noise({u * 5, v * 60, 0}, 80)));
  return c;
}

/// An editor: lines of text of several colours.
Colour editor_picture(double u, double v) {
  const double line = std::floor(v * 17), row = v * 17 - line;
  const double indent = 0.06 + 0.05 * std::floor(2.9 * std::abs(sine(line * 1.7))),
               end = indent + 0.22 + 0.42 * std::abs(sine(line * 3.1 + 1));
  if (row < 0.3 || row > 0.72 || u < indent || u > end || v > 0.94)
    return v > 0.94 ? Colour{70, 80, 96} : Colour{24, 28, 36};
  const double word = std::floor(u * 14 + line * 0.37);
  if (sine(word * 12.9 + line * 4.1) > 0.75) return {24, 28, 36};
  const double kind = sine(word * 5.3 + line * 2.2);
  return kind > 0.4 ? Colour{120, 200, 250} : kind > -0.2 ? Colour{226, 226, 220} : Colour{250, 170, 110};
}

void add_monitor(Tessellator& out, const Frame& screen, const Picture& picture, double celsius, std::uint64_t seed) {
  const Material shell{{46, 47, 50}, {34, 35, 38}, 0.05, 0.0005, 0.35, 7};
  const Vec half{kScreenHalfWidth, kScreenHalfHeight, 0.022};
  add_solid_box(out, screen.moved(0, 0, -0.024), half, 0.008, 0.7, shell, seed);
  out.sheet(2 * half.x, 2 * half.y, 0.24, [&](double u, double v) {
    const double x = (u - 0.5) * 2 * half.x, y = (v - 0.5) * 2 * half.y;
    const double inside = std::min(half.x - std::abs(x), half.y - std::abs(y));
    SurfacePoint s;
    const bool is_rim = u == 0 || u == 1 || v == 0 || v == 1;
    s.position = screen.point(x * 0.985, y * 0.985, is_rim ? -0.004 : 0.003 + 0.002 * smooth_step(0.02, 0.0, inside));
    const double pu = clamp01((x + half.x - 0.016) / (2 * half.x - 0.032)),
                 pv = clamp01((y + half.y - 0.02) / (2 * half.y - 0.036));
    if (inside < 0.015) {
      s.colour = {34, 35, 38};
      s.dust = 0.25;
    } else {
      s.colour = picture(pu, pv);
      s.dust = 0.05;
      s.glow = 0.9;
    }
    // The electronics sit low in the middle.
    s.celsius = celsius - 3 * (std::abs(x) / half.x) * (std::abs(x) / half.x) - 2.2 * (y / half.y) +
                0.4 * smooth_noise({x * 8, y * 8, 0}, seed);
    if (inside < 0.015) s.celsius -= 3;
    return s;
  });
  const Material stand{{60, 61, 64}, {46, 47, 50}, 0.05, 0.0005, 0.5, 2};
  const Vec behind = screen.point(0, -0.06, -0.06);
  add_solid_tube(out, behind, {behind.x, 0.9, behind.z - 0.02}, {behind.x, 0.77, behind.z}, 0.022, 0.6, stand,
                 seed + 1);
  add_solid_box(out, facing({behind.x, 0.768, behind.z + 0.04}, {screen.out.x, 0, screen.out.z}), {0.12, 0.008, 0.09},
                0.006, 0.6, stand, seed + 2, false);
}

void add_keyboard(Tessellator& out, const Frame& frame, Vec half, double warmer, std::uint64_t seed) {
  out.box(half, 0.004, 0.3, false, [&](Vec local, Vec normal) {
    SurfacePoint s = solid_point({{58, 59, 62}, {50, 51, 54}, 0.1, 0, 0.5, warmer}, frame.point(local),
                                 frame.point(normal) - frame.origin, seed);
    const double kx = (local.x + half.x) / 0.019, kz = (local.z + half.z) / 0.021;
    const bool is_gap = kx - std::floor(kx) < 0.2 || kz - std::floor(kz) < 0.2;
    if (normal.y > 0.9 && !is_gap && std::abs(local.x) < half.x - 0.012 && std::abs(local.z) < half.z - 0.010) {
      s.colour = Colour{30, 31, 33};
      s.position = s.position + frame.up * 0.003;
    }
    return s;
  });
}

void add_laptop(Tessellator& out, std::uint64_t seed) {
  const Frame base = laptop_frame();
  const Material silver{{150, 153, 158}, {134, 137, 142}, 0.08, 0, 0.5, 0};
  out.box({0.17, 0.010, 0.12}, 0.006, 0.28, false, [&](Vec local, Vec normal) {
    SurfacePoint s = solid_point(silver, base.moved(0, 0.010, 0).point(local), base.point(normal) - base.origin, seed);
    const double kx = (local.x + 0.17) / 0.0185, kz = (local.z + 0.12) / 0.019;
    const bool on_keys = std::abs(local.x) < 0.148 && local.z > -0.10 && local.z < 0.015 && normal.y > 0.9;
    if (on_keys && kx - std::floor(kx) > 0.18 && kz - std::floor(kz) > 0.18) s.colour = Colour{36, 37, 40};
    if (normal.y > 0.9 && std::abs(local.x) < 0.05 && local.z > 0.035 && local.z < 0.10)
      s.colour = Colour{124, 127, 132};
    // The processor is at the back left, under the keys.
    const double dx = (local.x + 0.06) / 0.13, dz = (local.z + 0.06) / 0.10;
    s.celsius = 27 + 12 * bell(std::sqrt(dx * dx + dz * dz)) + 1.0 * smooth_noise(local * 20, seed);
    return s;
  });
  const Frame lid = base.moved(0, 0.125, -0.155).turned(0, 17, 0);
  const Material back{{150, 153, 158}, {140, 143, 148}, 0.08, 0, 0.3, 6};
  add_solid_box(out, lid.moved(0, 0, -0.006), {0.17, 0.115, 0.005}, 0.004, 0.6, back, seed + 1);
  out.sheet(0.34, 0.23, 0.21, [&](double u, double v) {
    const double inside = std::min(std::min(u, 1 - u) * 0.34, std::min(v, 1 - v) * 0.23);
    SurfacePoint s;
    s.position = lid.point((u - 0.5) * 0.335, (v - 0.5) * 0.226, u == 0 || u == 1 || v == 0 || v == 1 ? -0.003 : 0.003);
    s.colour = inside < 0.009 ? Colour{26, 26, 28} : editor_picture(u, v);
    s.glow = inside < 0.009 ? 0 : 0.85;
    s.celsius = 27.5 - 2 * v + 0.3 * smooth_noise({u * 5, v * 5, 0}, seed);
    s.dust = 0.06;
    return s;
  });
}

void add_phone(Tessellator& out, std::uint64_t seed) {
  const Frame phone = phone_frame().turned(24, 0, 0);
  out.box({0.038, 0.006, 0.078}, 0.004, 0.20, false, [&](Vec local, Vec normal) {
    SurfacePoint s = solid_point({{30, 31, 34}, {22, 23, 26}, 0.05, 0, 0.2, 0}, phone.point(local),
                                 phone.point(normal) - phone.origin, seed);
    const double u = (local.x + 0.034) / 0.068, v = (0.072 - local.z) / 0.144;
    if (normal.y > 0.9 && u > 0 && u < 1 && v > 0 && v < 1) {
      // A locked screen: a gradient, the time in four blocks, a message.
      s.colour = mix(Colour{46, 40, 110}, Colour{170, 70, 130}, v);
      const double d = (u - 0.2) / 0.16;
      if (v > 0.72 && v < 0.80 && d > 0 && d < 4 && d - std::floor(d) < 0.65) s.colour = {240, 240, 246};
      if (v > 0.44 && v < 0.58 && u > 0.08 && u < 0.92) s.colour = {214, 214, 226};
      s.glow = 0.8;
      s.dust = 0.08;
    }
    s.celsius = 31.5 + 2.5 * bell((v - 0.75) / 0.5) + 0.3 * smooth_noise(local * 40, seed);
    return s;
  });
}

void add_mug(Tessellator& out, std::uint64_t seed) {
  const Frame mug = mug_frame();
  // Outside up, over the lip, inside down to the coffee: one profile, turned.
  out.tube(0.26, 0.28, 0.28, true, true, [&](double u, double v) {
    const double a = -6.283185307 * u;
    double radius = 0, height = 0;
    const bool is_coffee = v > 0.62;
    if (v < 0.10) {
      radius = kMugRadius * 0.92 * (v / 0.10);
    } else if (v < 0.50) {
      const double t = (v - 0.10) / 0.40;
      radius = kMugRadius * mix(0.92, 1.0, smooth_step(0, 0.15, t));
      height = kMugHeight * t;
    } else if (v <= 0.62) {
      const double t = (v - 0.50) / 0.12;
      radius = kMugRadius - 0.0045 * t;
      height = kMugHeight - 0.016 * t;
    } else {
      radius = (kMugRadius - 0.0045) * (1 - (v - 0.62) / 0.38);
      height = kMugHeight - 0.016;
    }
    SurfacePoint s;
    s.position = mug.point(radius * cosine(a), height, radius * sine(a));
    const double glaze = fractal_noise(s.position * 30, 2, seed);
    const bool is_band = height > 0.045 && height < 0.066 && v < 0.5;
    s.colour = is_coffee ? Colour{44, 26, 16}
               : is_band ? Colour{178, 60, 44}
                         : Colour{224, 220, 210} * (1 + 0.04 * glaze);
    s.celsius = is_coffee ? 61.0 - 1.5 * radius / kMugRadius
                          : mix(46.0, 54.0, clamp01(height / 0.07)) - 3.0 * smooth_step(0.085, 0.10, height);
    s.dust = is_coffee ? 0 : 0.12;
    return s;
  });
  const Vec from = mug.point(kMugRadius, 0.078, 0), to = mug.point(kMugRadius, 0.026, 0);
  const Material ear{{224, 220, 210}, {206, 202, 192}, 0.05, 0, 0.12, 18};
  add_solid_tube(out, from, mug.point(kMugRadius + 0.05, 0.052, 0), to, 0.0055, 0.25, ear, seed + 1);
}

void add_bottle(Tessellator& out, std::uint64_t seed) {
  const Frame bottle = bottle_frame();
  Lettering label;
  label.add_centred("AQUA", 0, 0.101, 0.021, 0.0046);
  const double edge = out.spacing(0.15);
  out.tube(0.24, 0.34, 0.15, true, true, [&](double u, double v) {
    // The profile from the foot to the cap.
    const double a = 1.570796 - 6.283185307 * (u - 0.5);
    const double t = clamp01((v - 0.08) / 0.92), height = kBottleHeight * t;
    double radius = kBottleRadius * std::min(1.0, v / 0.08);
    radius = mix(radius, 0.014, smooth_step(0.62, 0.84, t));
    if (t > 0.89) radius = 0.0155;
    if (v >= 0.985) radius = 0.0155 * (1 - (v - 0.985) / 0.015);
    const double ribs = t > 0.08 && t < 0.30 ? 0.0012 * sine(height * 420) : 0;
    SurfacePoint s;
    s.position = bottle.point((radius + ribs) * cosine(a), height, (radius + ribs) * sine(a));
    const bool is_label = t > 0.32 && t<0.52, is_cap = t> 0.89;
    s.colour = is_cap     ? Colour{36, 84, 176}
               : is_label ? Colour{230, 236, 240}
                          : mix(Colour{138, 176, 196}, Colour{104, 142, 166},
                                0.5 + 0.5 * fractal_noise(s.position * 24, 3, seed));
    // x of the label's lettering is measured around the bottle from its front.
    if (is_label)
      s.colour = mix(s.colour, Colour{24, 60, 140}, label.ink((u - 0.5) * 6.283185307 * kBottleRadius, height, edge));
    s.celsius = is_cap ? 13.5 : 7.6 + 2.2 * smooth_step(0.5, 0.7, t) + 0.3 * smooth_noise(s.position * 20, seed + 1);
    s.dust = 0.1;
    return s;
  });
}

}  // namespace

void add_desk_things(Tessellator& out, std::uint64_t seed) {
  add_monitor(out, left_monitor_frame(), chart_picture, 37.5, seed + 300);
  add_monitor(out, right_monitor_frame(), landscape_picture, 36.0, seed + 310);
  add_keyboard(out, facing({-2.62, 0.772, -1.94}, {0.08, 0, 1}), {0.21, 0.011, 0.07}, 0.6, seed + 320);
  add_laptop(out, seed + 330);
  add_phone(out, seed + 340);
  add_mug(out, seed + 350);
  add_bottle(out, seed + 360);
  const Material black{{42, 42, 44}, {28, 28, 30}, 0.04, 0.0005, 0.4, 0.4};
  add_solid_tube(out, {-2.3, 0.78, -2.5}, {-1.3, 0.70, -1.9}, {-1.33, 0.03, -1.5}, 0.008, 0.5, black, seed + 370);
  add_solid_tube(out, {-1.33, 0.03, -1.5}, {-1.3, 0.02, -0.9}, {-0.2, 0.03, -0.7}, 0.008, 0.5, black, seed + 371);
}

}  // namespace spectra::demo
