#include <algorithm>
#include <cmath>

#include "fusion/demo/noise.hpp"
#include "fusion/demo/office.hpp"

namespace spectra::demo {
namespace {

constexpr double kPipeHeight = 0.22, kPipeRadius = 0.028, kRiserX = -1.16;
constexpr double kPipeEnd = 0.45;

/// How much the hot pipe warms the wall behind it.
double pipe_warmth(double x, double y) {
  const double beside = std::max({0.0, x - kPipeEnd, -3.6 - x});
  const double to_run = std::sqrt((y - kPipeHeight) * (y - kPipeHeight) + beside * beside);
  const double below = std::max(0.0, kPipeHeight - y);
  const double to_riser = std::sqrt((x - kRiserX) * (x - kRiserX) + below * below);
  const double d = std::min(to_run, to_riser);
  // Warm air rises along the wall above the horizontal run.
  const double plume = x > -3.6 && x < kPipeEnd && y > kPipeHeight ? 0.8 / (1 + 3 * (y - kPipeHeight)) : 0;
  return 7 / (1 + 250 * d * d) + plume;
}

/// Plaster that has come off in places and shows the bricks; `x` along the wall, `y` up.
SurfacePoint wall_point(Vec p, Vec inwards, double x, double y, Colour paint, std::uint64_t seed) {
  const double stain = fractal_noise(p * 0.9, 4, seed);
  const double fine = fractal_noise(p * 9, 3, seed + 1);
  const double bare = smooth_step(0.30, 0.36, fractal_noise(p * 0.8, 4, seed + 2) + 0.05 * fine);
  const double row = std::floor(y / 0.085);
  const double along = x / 0.24 + 0.5 * (row - 2 * std::floor(row / 2));
  const double across = std::min(std::abs(y / 0.085 - row), std::abs(row + 1 - y / 0.085)) * 0.085;
  const double head = std::min(along - std::floor(along), std::floor(along) + 1 - along) * 0.24;
  const double mortar = 1 - smooth_step(0.006, 0.016, std::min(across, head));
  const double brick_tone = smooth_noise({std::floor(along) * 1.7, row * 1.3, 0.5}, seed + 4);
  const Colour brick =
      mix(mix(Colour{150, 84, 62}, Colour{112, 66, 54}, 0.5 + 0.5 * brick_tone), Colour{158, 150, 138}, mortar);
  SurfacePoint s;
  s.colour = mix(paint, paint * 0.80, clamp01(0.35 + 0.8 * stain));
  s.colour = mix(s.colour, Colour{96, 84, 70}, 0.45 * (1 - smooth_step(0.0, 0.55, y + 0.2 * stain)));
  s.colour = mix(s.colour, brick, bare) * (1 + 0.05 * fine);
  s.position = p + inwards * (0.006 * fine + 0.012 * stain - 0.022 * bare);
  s.celsius = ambient_celsius(p) + 0.3 * stain - 0.5 * bare;
  s.dust = 0.35;
  return s;
}

/// Height at which a wall is broken off: whole for `ruin` 0, ragged and low for 1.
double broken_height(double along, double ruin, std::uint64_t seed) {
  const double ragged =
      fractal_noise({along * 1.4, 0, 0}, 3, seed) + 0.5 * fractal_noise({along * 6, 3, 0}, 2, seed + 1);
  return kRoomHeight * (1 - 0.62 * ruin) + ragged * 0.45 * smooth_step(0, 0.4, ruin);
}

void add_walls(Tessellator& out, std::uint64_t seed) {
  const Colour paint{206, 200, 186};
  out.sheet(2 * kHalfWidth, kRoomHeight, 1.35, [&](double u, double v) {
    const double x = mix(-kHalfWidth, kHalfWidth, u);
    const double y = v * broken_height(x, 0.5 * smooth_step(1.2, 3.6, x), seed);
    SurfacePoint s = wall_point({x, y, -kHalfDepth}, {0, 0, 1}, x, y, paint, seed + 10);
    s.celsius += pipe_warmth(x, y);
    // The electrical box warms the wall a little.
    const double dx = x - 0.94, dy = y - 1.6;
    s.celsius += 1.6 * bell(std::sqrt(dx * dx + dy * dy) / 0.6);
    return s;
  });
  out.sheet(2 * kHalfDepth, kRoomHeight, 2.1, [&](double u, double v) {
    const double z = mix(kHalfDepth, -kHalfDepth, u);
    const double y = v * broken_height(z, smooth_step(-0.2, 2.8, z), seed + 1);
    SurfacePoint s = wall_point({-kHalfWidth, y, z}, {1, 0, 0}, z, y, Colour{190, 193, 186}, seed + 11);
    // Radiator panel behind: a warm patch low on the wall, as an old building has it.
    s.celsius += 2.2 * bell((z + 1.5) / 1.0) * bell((y - 0.5) / 0.8);
    return s;
  });
  out.sheet(2 * kHalfDepth, kRoomHeight, 2.1, [&](double u, double v) {
    const double z = mix(-kHalfDepth, kHalfDepth, u);
    const double y = v * broken_height(z, 0.25 + 0.75 * smooth_step(-0.8, 2.4, z), seed + 2);
    return wall_point({kHalfWidth, y, z}, {-1, 0, 0}, z, y, Colour{200, 192, 178}, seed + 12);
  });
}

void add_floor(Tessellator& out, std::uint64_t seed) {
  out.sheet(2 * kHalfWidth, 2 * kHalfDepth, 1.0, [&](double u, double v) {
    const double x = mix(-kHalfWidth, kHalfWidth, u), z = mix(kHalfDepth, -kHalfDepth, v);
    const double heap = heap_height(x, z);
    const Vec p{x, heap, z};
    const double fine = fractal_noise(p * 11, 4, seed + 20), broad = fractal_noise(p * 1.2, 4, seed + 21);
    const double tile_x = x / 0.5 - std::floor(x / 0.5), tile_z = z / 0.5 - std::floor(z / 0.5);
    const double joint = std::min(std::min(tile_x, 1 - tile_x), std::min(tile_z, 1 - tile_z)) * 0.5;
    const double tone = smooth_noise({std::floor(x / 0.5) * 1.9, 0.5, std::floor(z / 0.5) * 1.7}, seed + 22);
    const Colour tile = mix(Colour{98, 106, 112}, Colour{82, 88, 96}, 0.5 + 0.5 * tone) *
                        (1 - 0.3 * (1 - smooth_step(0.004, 0.02, joint)));
    const Colour gravel = mix(Colour{140, 132, 120}, Colour{98, 91, 82}, clamp01(0.5 + 1.1 * fine));
    const double covered = clamp01(smooth_step(0.01, 0.07, heap) + smooth_step(0.05, 0.5, broad) * 0.7);
    SurfacePoint s;
    s.position = p + Vec{0, 1, 0} * (fine * (0.004 + 0.022 * smooth_step(0.01, 0.1, heap)));
    s.colour = mix(tile, gravel, covered) * (1 + 0.06 * fine);
    s.celsius = ambient_celsius({x, 0, z}) - 0.5 + 0.3 * broad + 0.4 * smooth_step(0.05, 0.4, heap);
    s.dust = 0.55 + 0.4 * broad;
    // Under a body and around it the floor has taken up some warmth.
    const double dx = (x - 0.55) / 0.75, dz = (z - 1.15) / 0.6;
    s.celsius += 1.5 * bell(std::sqrt(dx * dx + dz * dz));
    return s;
  });
}

/// What is left of the ceiling at the back, and the slab that came down from it.
void add_ceiling(Tessellator& out, std::uint64_t seed) {
  out.sheet(4.6, 1.5, 2.0, [&](double u, double v) {
    const double x = mix(-kHalfWidth, 0.9, u);
    const double reach = 1.15 + 0.35 * fractal_noise({x * 1.7, 0, 3}, 3, seed + 30) - 0.8 * smooth_step(-0.6, 0.9, x);
    const Vec p{x, kRoomHeight, -kHalfDepth + v * reach};
    const double fine = fractal_noise(p * 8, 3, seed + 31);
    SurfacePoint s;
    // Along the break it hangs a little.
    s.position = p - Vec{0, 1, 0} * (0.10 * v * v * v + 0.008 * fine);
    s.colour =
        mix(Colour{206, 203, 194}, Colour{158, 150, 138}, clamp01(0.3 + 0.7 * fine + 0.9 * smooth_step(0.85, 1, v)));
    s.celsius = ambient_celsius(p) + 0.4 + 0.2 * fine;
    s.dust = 0;
    return s;
  });
  const Frame slab = facing({2.42, 1.28, -1.05}, {0.12, 0.05, 1}).turned(0, 0, 35);
  out.box({1.78, 0.10, 1.25}, 0.012, 0.80, true, [&](Vec local, Vec normal) {
    const double edge = 1 - std::min(std::min(1.78 - std::abs(local.x), 1.25 - std::abs(local.z)) / 0.25, 1.0);
    Vec torn{fractal_noise({local.z * 3, local.y * 4, 1}, 4, seed + 40), 0,
             fractal_noise({local.x * 3, local.y * 4, 2}, 4, seed + 41)};
    torn = torn * (0.20 * std::max(0.0, edge));
    const Vec p = slab.point(local + torn);
    const Vec n = slab.point(normal) - slab.origin;
    const double fine = fractal_noise(p * 14, 4, seed + 42), broad = fractal_noise(p * 1.8, 4, seed + 43);
    const double crack = 1 - smooth_step(0.004, 0.03, std::abs(fractal_noise(p * 1.1, 4, seed + 44)));
    SurfacePoint s;
    s.position = p + n * (0.007 * fine + 0.010 * broad - 0.012 * crack);
    s.colour = mix(Colour{164, 159, 150}, Colour{118, 113, 106}, clamp01(0.5 + 0.5 * broad + 0.45 * fine));
    s.colour = mix(s.colour, Colour{62, 58, 54}, 0.7 * crack);
    s.celsius = ambient_celsius(p) - 0.7 + 0.4 * broad;
    s.dust = 0.6;
    return s;
  });
  // Reinforcing bars that stick out of the torn lower edge.
  const Material rust{{134, 82, 54}, {84, 54, 42}, 0.03, 0.001, 0.25, -0.3};
  Random random(seed + 45);
  for (int i = 0; i < 9; ++i) {
    const double z = -1.1 + 0.275 * i;
    const double reach = random.uniform(0.18, 0.5), drop = random.uniform(-0.18, 0.14),
                 aside = random.uniform(-0.14, 0.14);
    add_solid_tube(out, slab.point(-1.6, 0, z), slab.point(-1.75 - 0.6 * reach, 0.02, z),
                   slab.point(-1.78 - reach, drop, z + aside), 0.009, 0.5, rust, seed + 46);
  }
}

void add_door(Tessellator& out, std::uint64_t seed) {
  const Material frame_paint{{118, 108, 92}, {96, 86, 72}, 0.1, 0.001, 0.4, 0};
  const Material leaf_paint{{120, 84, 56}, {92, 62, 42}, 0.16, 0.002, 0.35, 0.2};
  const Vec foot{-0.42, 0, -kHalfDepth};
  const Frame upright = facing(foot, {0, 0, 1});
  add_solid_box(out, upright.moved(-0.49, 1.02, 0.03), {0.045, 1.04, 0.05}, 0.01, 1.3, frame_paint, seed + 50);
  add_solid_box(out, upright.moved(0.49, 1.02, 0.03), {0.045, 1.04, 0.05}, 0.01, 1.3, frame_paint, seed + 51);
  add_solid_box(out, upright.moved(0, 2.09, 0.03), {0.53, 0.045, 0.05}, 0.01, 1.3, frame_paint, seed + 52);
  add_solid_box(out, upright.moved(0, 1.01, 0.04).turned(0, 0, 0.8), {0.44, 1.0, 0.025}, 0.008, 1.3, leaf_paint,
                seed + 53);
  const Material brass{{168, 152, 110}, {130, 116, 84}, 0.02, 0, 0.1, 0};
  add_solid_tube(out, upright.point(0.36, 1.02, 0.06), upright.point(0.36, 1.02, 0.13), upright.point(0.24, 1.01, 0.12),
                 0.012, 0.4, brass, seed + 54);
}

/// The hot pipe along the foot of the back wall and its riser.
void add_pipe(Tessellator& out, std::uint64_t seed) {
  const double z = -kHalfDepth + 0.075;
  const auto pipe = [&](Vec a, Vec c, double hot_a, double hot_c) {
    const double reach = length(c - a);
    out.tube(6.2832 * kPipeRadius, reach, 0.5, true, true, [&](double u, double v) {
      const Frame f = curve_frame(a, mix(a, c, 0.5), c, v);
      const Vec n = f.right * cosine(6.283185307 * u) + f.up * sine(6.283185307 * u);
      const double joint = bell((v * reach - 0.9 - 1.2 * std::floor(v * reach / 1.2 - 0.2)) / 0.03);
      SurfacePoint s = solid_point({{186, 182, 172}, {150, 142, 130}, 0.06, 0.0008, 0.5, 0}, f.origin, n, seed + 60);
      s.position = f.origin + n * (v == 0 || v == 1 ? 0 : kPipeRadius + 0.006 * joint);
      s.celsius = mix(hot_a, hot_c, v);
      return s;
    });
  };
  pipe({-3.6, kPipeHeight, z}, {kPipeEnd, kPipeHeight, z}, 49, 43);
  pipe({kRiserX, kPipeHeight, z + 0.004}, {kRiserX, kRoomHeight - 0.05, z + 0.004}, 47, 44);
}

void add_electrical_box(Tessellator& out, std::uint64_t seed) {
  const Frame box = electrical_box_frame();
  const Vec half{0.20, 0.27, 0.07};
  out.box(half, 0.012, 0.5, true, [&](Vec local, Vec normal) {
    const Vec n = box.point(normal) - box.origin;
    SurfacePoint s =
        solid_point({{156, 162, 164}, {134, 140, 144}, 0.12, 0.001, 0.2, 0}, box.point(local), n, seed + 70);
    // A window with a row of breakers, one of which is hot behind it.
    const double wx = local.x, wy = local.y - 0.09;
    if (local.z > 0.06 && std::abs(wx) < 0.145 && std::abs(wy) < 0.05) {
      const double cell = (wx + 0.145) / 0.0483;
      const double in_cell = cell - std::floor(cell);
      s.colour = in_cell < 0.1 || in_cell > 0.9 || std::abs(wy) > 0.044 ? Colour{40, 42, 44} : Colour{206, 206, 198};
      if (std::abs(wy) < 0.018 && in_cell > 0.35 && in_cell < 0.65) s.colour = Colour{30, 44, 92};
    }
    const double rim = std::min(0.185 - std::abs(local.x), 0.255 - std::abs(local.y));
    if (local.z > 0.06 && rim > 0 && rim < 0.008) s.colour = s.colour * 0.62;
    const double hx = local.x - 0.06, hy = local.y - 0.09;
    const double from_hot = std::sqrt(hx * hx + hy * hy);
    s.celsius = ambient_celsius(box.origin) + 3.5 + 40 * bell(from_hot / 0.085) + 7 * bell(from_hot / 0.22);
    s.dust = 0.15;
    return s;
  });
  const Material conduit{{126, 128, 126}, {102, 104, 104}, 0.05, 0.0005, 0.3, 1.2};
  const Vec top = box.point(-0.1, 0.25, 0);
  add_solid_tube(out, top, {top.x, 2.2, top.z}, {top.x - 0.02, 2.7, top.z}, 0.016, 0.8, conduit, seed + 71);
  const Material black{{44, 44, 46}, {28, 28, 30}, 0.04, 0.0005, 0.3, 0.6};
  const Vec bottom = box.point(0.18, -0.26, 0);
  add_solid_tube(out, bottom, bottom + Vec{0.20, -0.5, 0.14}, bottom + Vec{0.62, -1.02, 0.55}, 0.012, 0.6, black,
                 seed + 72);
}

/// A lamp and a cable that hang from the broken ceiling.
void add_hanging(Tessellator& out, std::uint64_t seed) {
  const Material black{{50, 50, 52}, {32, 32, 34}, 0.04, 0.0005, 0.3, 0.3};
  add_solid_tube(out, {-1.5, 2.84, -1.75}, {-1.45, 2.2, -1.65}, {-1.28, 1.9, -1.60}, 0.010, 0.6, black, seed + 80);
  add_solid_tube(out, {0.1, 2.85, -2.2}, {0.3, 2.3, -2.0}, {0.9, 2.35, -1.6}, 0.009, 0.6, black, seed + 81);
  const Material white{{214, 212, 204}, {188, 184, 174}, 0.1, 0.001, 0.4, 0.5};
  add_solid_tube(out, {-2.75, 2.86, -1.85}, {-2.75, 2.7, -1.82}, {-2.72, 2.52, -1.8}, 0.006, 0.6, black, seed + 82);
  add_solid_box(out, facing({-2.35, 2.40, -1.75}, {0.1, 0.3, 1}).turned(0, 0, -16), {0.58, 0.04, 0.09}, 0.02, 0.9,
                white, seed + 83);
}

}  // namespace

void add_room(Tessellator& out, std::uint64_t seed) {
  add_floor(out, seed);
  add_walls(out, seed);
  add_ceiling(out, seed);
  add_door(out, seed);
  add_pipe(out, seed);
  add_electrical_box(out, seed);
  add_hanging(out, seed);
}

}  // namespace spectra::demo
