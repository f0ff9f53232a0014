#pragma once

#include <cstdint>

#include "fusion/demo/vector.hpp"

namespace spectra::demo {

/// Scrambles 64 bits (the finaliser of SplitMix64): the root of all randomness of the demo scene.
inline std::uint64_t scramble(std::uint64_t x) {
  x += 0x9E3779B97F4A7C15ULL;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBULL;
  return x ^ (x >> 31);
}

/// A sequence of random numbers that is the same on every machine.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(scramble(seed)) {}

  /// Uniform in [0, 1).
  double uniform() {
    state_ += 0x9E3779B97F4A7C15ULL;
    return static_cast<double>(scramble(state_) >> 11) * 0x1p-53;
  }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// Mean 0, deviation 1, at most 3.5 from 0: a sum of twelve uniform numbers.
  double normal() {
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += uniform();
    return sum < -3.5 ? -3.5 : sum > 3.5 ? 3.5 : sum;
  }
  std::uint64_t next_seed() { return scramble(state_ += 0x9E3779B97F4A7C15ULL); }

 private:
  std::uint64_t state_;
};

/// Smooth noise in -1..1 with features of about one unit.
double smooth_noise(Vec p, std::uint64_t seed);

/// Noise with detail: `octaves` of smooth_noise, each of half the size and half the strength; about -1..1.
double fractal_noise(Vec p, int octaves, std::uint64_t seed);

}  // namespace spectra::demo
