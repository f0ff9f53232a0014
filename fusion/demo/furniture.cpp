#include <algorithm>
#include <cmath>

#include "fusion/demo/noise.hpp"
#include "fusion/demo/office.hpp"

namespace spectra::demo {
namespace {

void add_desk(Tessellator& out, const Frame& top, Vec half, std::uint64_t seed, double hot_x, double hot_z) {
  const Material wood{{164, 128, 92}, {128, 96, 66}, 0.25, 0.001, 0.55, 0.1};
  out.box(half, 0.008, 0.75, true, [&](Vec local, Vec normal) {
    const Vec p = top.point(local);
    // Grain runs along the board.
    const double grain = fractal_noise({local.x * 2.5, local.y * 20, local.z * 38}, 3, seed);
    SurfacePoint s = solid_point(wood, p, top.point(normal) - top.origin, seed);
    s.colour = mix(s.colour, Colour{96, 68, 46}, clamp01(0.25 + 0.6 * grain));
    // Warm from what stands on it.
    const double dx = (local.x - hot_x) / 0.32, dz = (local.z - hot_z) / 0.28;
    s.celsius += 2.4 * bell(std::sqrt(dx * dx + dz * dz));
    return s;
  });
  const Material steel{{92, 96, 100}, {74, 78, 82}, 0.1, 0.0005, 0.4, 0};
  for (const double side : {-1.0, 1.0}) {
    add_solid_box(out, top.moved(side * (half.x - 0.06), -0.37, half.z - 0.08), {0.025, 0.36, 0.025}, 0.005, 1.0, steel,
                  seed + 1, false);
    add_solid_box(out, top.moved(side * (half.x - 0.06), -0.37, -half.z + 0.08), {0.025, 0.36, 0.025}, 0.005, 1.0,
                  steel, seed + 2, false);
  }
  add_solid_box(out, top.moved(0, -0.22, -half.z + 0.05), {half.x - 0.1, 0.17, 0.008}, 0.003, 1.5, wood, seed + 3);
}

void add_drawers(Tessellator& out, const Frame& frame, std::uint64_t seed) {
  const Material body{{138, 142, 144}, {118, 122, 126}, 0.15, 0.001, 0.4, 0};
  out.box({0.21, 0.29, 0.26}, 0.01, 0.8, false, [&](Vec local, Vec normal) {
    SurfacePoint s = solid_point(body, frame.point(local), frame.point(normal) - frame.origin, seed);
    const double drawer = (local.y + 0.29) / 0.195;
    const double gap = std::min(drawer - std::floor(drawer), std::floor(drawer) + 1 - drawer) * 0.195;
    if (local.z > 0.24 && gap < 0.008) s.colour = s.colour * 0.45;
    const double handle_y = (drawer - std::floor(drawer) - 0.78) * 0.195;
    if (local.z > 0.24 && std::abs(handle_y) < 0.012 && std::abs(local.x) < 0.07) s.colour = Colour{52, 54, 56};
    return s;
  });
}

/// An office chair that has been knocked over.
void add_chair(Tessellator& out, std::uint64_t seed) {
  const Material cloth{{62, 72, 92}, {40, 48, 64}, 0.04, 0.004, 0.75, 0.2};
  const Material plastic{{46, 46, 48}, {32, 32, 34}, 0.06, 0.001, 0.7, 0};
  const Frame seat = facing({-2.05, 0.30, 1.15}, {0.35, 0, 1}).turned(0, 0, 78);
  add_solid_box(out, seat, {0.24, 0.045, 0.23}, 0.04, 0.75, cloth, seed);
  add_solid_box(out, seat.moved(0, 0.42, -0.25).turned(0, -12, 0), {0.22, 0.28, 0.04}, 0.038, 0.75, cloth, seed + 1);
  add_solid_tube(out, seat.point(0, 0.03, -0.18), seat.point(0, 0.04, -0.34), seat.point(0, 0.30, -0.29), 0.02, 0.6,
                 plastic, seed + 2);
  add_solid_tube(out, seat.point(0, -0.04, 0), seat.point(0, -0.2, 0), seat.point(0, -0.36, 0), 0.026, 0.6, plastic,
                 seed + 3);
  for (int i = 0; i < 5; ++i) {
    const double a = 1.2566 * i;
    const double x = 0.27 * cosine(a), z = 0.27 * sine(a);
    add_solid_tube(out, seat.point(0, -0.34, 0), seat.point(0.6 * x, -0.34, 0.6 * z), seat.point(x, -0.39, z), 0.018,
                   0.6, plastic, seed + 4);
    add_solid_box(out, seat.moved(x, -0.41, z), {0.022, 0.026, 0.022}, 0.02, 0.5, plastic, seed + 5);
  }
}

/// A desk lamp's worth of office clutter: folders that stand and lie about.
void add_folders(Tessellator& out, std::uint64_t seed) {
  Random random(seed);
  const Colour spines[] = {{42, 70, 120}, {132, 40, 38}, {52, 96, 66}, {60, 60, 64}, {176, 140, 52}};
  for (int i = 0; i < 5; ++i) {
    const Colour c = spines[i];
    const Material folder{c, c * 0.75, 0.1, 0.001, 0.45, 0};
    const double lean = i == 4 ? -14 : random.uniform(-2, 2);
    add_solid_box(out,
                  facing({-3.46 + 0.085 * i + (i == 4 ? 0.05 : 0.0), 0.925, -2.52}, {0.05, 0, 1}).turned(0, 0, lean),
                  {0.037, 0.155, 0.12}, 0.004, 0.6, folder, seed + 10);
  }
  for (int i = 0; i < 11; ++i) {
    const double x = random.uniform(-3.2, 0.3), z = random.uniform(-0.9, 2.4), turn = random.uniform(0, 360);
    const double grey = random.uniform(205, 238), curl = random.uniform(0.01, 0.05);
    const Frame sheet = facing({x, heap_height(x, z) + 0.018, z}, {0.03, 1, 0.05}, {0, 0, -1}).turned(0, 0, turn);
    const std::uint64_t own = random.next_seed();
    out.sheet(0.21, 0.297, 0.45, [&](double u, double v) {
      SurfacePoint s;
      const double bend = curl * (u - 0.3) * (u - 0.3) * 2 + 0.012 * smooth_noise({u * 3, v * 3, 0}, own);
      s.position = sheet.point((u - 0.5) * 0.21, (v - 0.5) * 0.297, bend);
      s.position.y += heap_height(s.position.x, s.position.z) - heap_height(x, z);
      const bool is_line = u > 0.12 && u < 0.85 && v > 0.1 && v < 0.9 && std::floor(v * 18) / 2 != std::floor(v * 9);
      s.colour = Colour{grey, grey, grey * 0.96} * (is_line ? 0.86 : 1);
      s.celsius = ambient_celsius(s.position) - 0.3;
      s.dust = 0.55;
      return s;
    });
  }
}

}  // namespace

void add_furniture(Tessellator& out, std::uint64_t seed) {
  add_desk(out, facing({-2.45, 0.74, -2.22}, {0, 0, 1}), {1.10, 0.02, 0.46}, seed + 200, 0.1, -0.1);
  add_drawers(out, facing({-1.68, 0.30, -2.16}, {0, 0, 1}), seed + 210);
  add_desk(out, facing({-3.28, 0.74, 0.12}, {1, 0, 0}), {0.86, 0.02, 0.42}, seed + 220, 0.0, -0.05);
  add_chair(out, seed + 230);
  add_folders(out, seed + 240);
}

}  // namespace spectra::demo
