#include "fusion/demo/noise.hpp"

namespace spectra::demo {
namespace {

double lattice_value(std::int64_t x, std::int64_t y, std::int64_t z, std::uint64_t seed) {
  std::uint64_t h = seed + static_cast<std::uint64_t>(x) * 0x8DA6B343ULL +
                    static_cast<std::uint64_t>(y) * 0xD8163841ULL + static_cast<std::uint64_t>(z) * 0xCB1AB31FULL;
  h = (h ^ (h >> 29)) * 0xBF58476D1CE4E5B9ULL;
  h = (h ^ (h >> 32)) * 0x94D049BB133111EBULL;
  return static_cast<double>(h >> 40) * 0x1p-23 - 1;
}

double ease(double t) {
  return t * t * t * (t * (t * 6 - 15) + 10);
}

}  // namespace

double smooth_noise(Vec p, std::uint64_t seed) {
  const double fx = std::floor(p.x), fy = std::floor(p.y), fz = std::floor(p.z);
  const auto x = static_cast<std::int64_t>(fx), y = static_cast<std::int64_t>(fy), z = static_cast<std::int64_t>(fz);
  const double u = ease(p.x - fx), v = ease(p.y - fy), w = ease(p.z - fz);
  const auto row = [&](std::int64_t j, std::int64_t k) {
    return mix(lattice_value(x, j, k, seed), lattice_value(x + 1, j, k, seed), u);
  };
  return mix(mix(row(y, z), row(y + 1, z), v), mix(row(y, z + 1), row(y + 1, z + 1), v), w);
}

double fractal_noise(Vec p, int octaves, std::uint64_t seed) {
  double sum = 0, strength = 0.6;
  p = Vec{0.36 * p.x + 0.48 * p.y - 0.80 * p.z, -0.80 * p.x + 0.60 * p.y, 0.48 * p.x + 0.64 * p.y + 0.60 * p.z};
  for (int i = 0; i < octaves; ++i) {
    sum += strength * smooth_noise(p, seed + static_cast<std::uint64_t>(i) * 7919);
    // Turned and not exactly doubled, so that the lattices of the octaves never line up.
    p = Vec{0.80 * p.y + 0.60 * p.z, -0.80 * p.x + 0.36 * p.y - 0.48 * p.z, -0.60 * p.x - 0.48 * p.y + 0.64 * p.z} *
        2.03;
    strength *= 0.5;
  }
  return sum;
}

}  // namespace spectra::demo
