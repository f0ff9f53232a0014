#include "fusion/demo/office.hpp"

#include "fusion/demo/noise.hpp"

namespace spectra::demo {

double ambient_celsius(Vec p) {
  return 17.1 + 0.65 * p.y - 0.18 * p.z + 0.25 * smooth_noise(p * 0.7, 11);
}

double heap_height(double x, double z) {
  const auto mound = [&](double cx, double cz, double rx, double rz, double height) {
    const double u = (x - cx) / rx, v = (z - cz) / rz;
    return height * bell(std::sqrt(u * u + v * v));
  };
  const double mounds = mound(2.1, -0.5, 2.3, 2.1, 0.50) + mound(1.35, 0.75, 1.35, 0.95, 0.42) +
                        mound(3.1, -2.2, 1.7, 1.5, 0.55) + mound(-1.1, 0.5, 1.3, 1.1, 0.06) +
                        mound(3.2, 1.7, 1.5, 1.2, 0.30);
  return mounds * (1 + 0.35 * smooth_noise({x * 2.3, 0, z * 2.3}, 5)) +
         smooth_step(0.01, 0.2, mounds) * 0.03 * fractal_noise({x * 7, 1, z * 7}, 3, 6);
}

Frame head_frame() {
  const double x = 0.30, z = 1.20;
  return facing({x, heap_height(x, z) + 0.105, z}, {-0.20, 0.62, 0.76}, {-1, 0.12, 0.05});
}

Frame hand_frame() {
  const double x = -0.10, z = 1.78;
  // `out` is the back of the hand, `up` points to the fingers.
  return facing({x, heap_height(x, z) + 0.062, z}, {-0.05, 0.93, 0.36}, {-0.86, 0.05, 0.5});
}

Frame left_monitor_frame() {
  return facing({-2.72, 1.10, -2.28}, {0.22, 0.05, 1});
}
Frame right_monitor_frame() {
  return facing({-2.02, 1.09, -2.26}, {-0.02, 0.10, 1}).turned(0, 0, -4);
}
Frame laptop_frame() {
  return facing({-3.20, 0.765, 0.10}, {1, 0, 0.45});
}
Frame phone_frame() {
  return facing({-3.02, 0.770, -0.42}, {1, 0, 0.8});
}
Frame mug_frame() {
  return facing({-1.62, 0.765, -1.98}, {0.3, 0, 1});
}
Frame bottle_frame() {
  return facing({-3.12, 0.765, 0.62}, {1, 0, 0.3});
}
Frame electrical_box_frame() {
  return facing({0.94, 1.56, -kHalfDepth + 0.07}, {0, 0, 1});
}
Frame exit_sign_frame() {
  return facing({-0.42, 2.28, -kHalfDepth + 0.03}, {0, 0, 1}).turned(0, 0, -3);
}
Frame danger_sign_frame() {
  return electrical_box_frame().moved(0, -0.50, -0.045).turned(0, 0, 2);
}

SurfacePoint solid_point(const Material& material, Vec p, Vec normal, std::uint64_t seed) {
  const double grain = fractal_noise(p * (1 / material.grain_m), 3, seed);
  const double speck = smooth_noise(p * 160, seed + 1);
  SurfacePoint s;
  s.position = material.roughness_m > 0 ? p + normal * (material.roughness_m * grain) : p;
  s.colour = mix(material.light, material.dark, clamp01(0.5 + 0.9 * grain)) * (1 + 0.05 * speck);
  s.celsius = ambient_celsius(p) + material.warmer_kelvin + 0.15 * grain;
  s.dust = material.dust;
  return s;
}

void add_solid_box(Tessellator& out, const Frame& frame, Vec half, double bevel, double relative,
                   const Material& material, std::uint64_t seed, bool has_bottom) {
  out.box(half, bevel, relative, has_bottom, [&](Vec local, Vec normal) {
    const Vec n = frame.point(normal) - frame.origin;
    return solid_point(material, frame.point(local), n, seed);
  });
}

Frame curve_frame(Vec a, Vec b, Vec c, double t) {
  const Vec at = mix(mix(a, b, t), mix(b, c, t), t);
  const Vec along = mix(b - a, c - b, t);
  const bool is_upright = std::abs(along.y) > 0.9 * length(along);
  return facing(at, along, is_upright ? Vec{0, 0, 1} : Vec{0, 1, 0});
}

void add_solid_tube(Tessellator& out, Vec a, Vec b, Vec c, double radius, double relative, const Material& material,
                    std::uint64_t seed) {
  const double along = length(b - a) + length(c - b);
  out.tube(6.2832 * radius, along, relative, true, true, [&](double u, double v) {
    const Frame f = curve_frame(a, b, c, v);
    const double round = v == 0 || v == 1 ? 0 : radius;
    const Vec normal = f.right * cosine(6.283185307 * u) + f.up * sine(6.283185307 * u);
    return solid_point(material, f.origin + normal * round, normal, seed);
  });
}

}  // namespace spectra::demo
