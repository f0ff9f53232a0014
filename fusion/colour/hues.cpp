#include "fusion/colour/hues.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace spectra::fusion {
namespace {

constexpr int kSectorsPerSextant = static_cast<int>(Hues::kSectors) / 6;

/// The sector of a colour whose chroma is above 0, in whole numbers.
std::size_t sector_of(int r, int g, int b, int largest, int chroma) {
  // The place on the circle times the chroma: sextants from red, yellow, green, cyan, blue, magenta on.
  int place = 0;
  if (largest == r) {
    place = g - b + (g < b ? 6 * chroma : 0);
  } else if (largest == g) {
    place = b - r + 2 * chroma;
  } else {
    place = r - g + 4 * chroma;
  }
  return static_cast<std::size_t>(place * kSectorsPerSextant / chroma) % Hues::kSectors;
}

}  // namespace

void add_to_hues(std::span<const base::Rgb8> colours, Hues& hues) {
  for (const base::Rgb8 colour : colours) {
    const int r = colour.r;
    const int g = colour.g;
    const int b = colour.b;
    const int largest = std::max({r, g, b});
    const int chroma = largest - std::min({r, g, b});
    if (chroma > 0) hues.chroma[sector_of(r, g, b, largest, chroma)] += static_cast<std::uint64_t>(chroma);
  }
}

double rarest_hue_degrees(const Hues& hues) {
  constexpr double kSectorDegrees = 360.0 / Hues::kSectors;
  double best_degrees = 0;
  double least = -1;
  for (std::size_t candidate = 0; candidate < Hues::kSectors; ++candidate) {
    const double degrees = kSectorDegrees * static_cast<double>(candidate);
    double near = 0;
    for (std::size_t sector = 0; sector < Hues::kSectors; ++sector) {
      const double middle = kSectorDegrees * (static_cast<double>(sector) + 0.5);
      const double cosine = std::cos((middle - degrees) * std::numbers::pi / 180);
      if (cosine > 0) near += cosine * cosine * static_cast<double>(hues.chroma[sector]);
    }
    if (least < 0 || near < least) {
      least = near;
      best_degrees = degrees;
    }
  }
  return best_degrees;
}

}  // namespace spectra::fusion
