#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <optional>
#include <utility>

#include "fusion/method.hpp"

namespace spectra::fusion {

/// A colour in arithmetic: sRGB-encoded, 0..255, real-valued.
struct Colour {
  double r = 0, g = 0, b = 0;
};

/// a * over + (1 - a) * under.
inline Colour mixed(double a, const Colour& over, const Colour& under) {
  const double rest = 1 - a;
  return {a * over.r + rest * under.r, a * over.g + rest * under.g, a * over.b + rest * under.b};
}

/// The one rounding: clamped to [0, 255], half up.
inline std::uint8_t rounded(double value) {
  return static_cast<std::uint8_t>(std::clamp(value, 0.0, 255.0) + 0.5);
}

/// Temperature to [0, 1] over the active range; 0.5 where the range is one point.
class Normalisation {
 public:
  Normalisation(double minimum, double maximum)
      : minimum_(minimum), half_span_(maximum / 2 - minimum / 2), uniform_(!(minimum < maximum)) {}

  double operator()(double temperature_celsius) const {
    if (uniform_) return 0.5;
    // Halves keep the differences finite; a half span of zero is a range of one subnormal step.
    const double half = temperature_celsius / 2 - minimum_ / 2;
    if (half <= 0) return 0;
    return half >= half_span_ ? 1 : half / half_span_;
  }

 private:
  double minimum_;
  double half_span_;
  bool uniform_;
};

/// What a method's function sees of one vertex that has a temperature.
struct Vertex {
  float temperature_celsius;
  Colour visible;
};

/// The nearest float32: how thresholds are compared. Infinite beyond the float32 range.
inline float as_stored(double temperature_celsius) {
  constexpr double kLimit = std::numeric_limits<float>::max();
  if (temperature_celsius > kLimit) return std::numeric_limits<float>::infinity();
  if (temperature_celsius < -kLimit) return -std::numeric_limits<float>::infinity();
  return static_cast<float>(temperature_celsius);
}

/// The float32 values just below and above (or at) a double, so that comparing with them is comparing with it.
inline float largest_at_most(double value) {
  const float nearest = as_stored(value);
  return double{nearest} > value ? std::nextafter(nearest, -std::numeric_limits<float>::infinity()) : nearest;
}
inline float smallest_at_least(double value) {
  const float nearest = as_stored(value);
  return double{nearest} < value ? std::nextafter(nearest, std::numeric_limits<float>::infinity()) : nearest;
}

/// Fuses vertex by vertex with shade(Vertex) -> Colour; vertices without temperature never reach it.
template <class Shade>
class VertexKernel final : public Kernel {
 public:
  VertexKernel(Shade shade, const MissingDisplay& missing) : shade_(std::move(shade)), missing_(missing) {}

  void fuse(std::span<const float> temperature_celsius, std::span<const Rgb8> visible,
            std::span<Rgb8> fused) const noexcept override {
    for (std::size_t i = 0; i < fused.size(); ++i) {
      const Rgb8 v = visible[i];
      if (!std::isfinite(temperature_celsius[i])) {
        fused[i] = missing_.value_or(v);
        continue;
      }
      const Colour colour = shade_(Vertex{temperature_celsius[i], {double(v.r), double(v.g), double(v.b)}});
      fused[i] = {rounded(colour.r), rounded(colour.g), rounded(colour.b)};
    }
  }

 private:
  Shade shade_;
  MissingDisplay missing_;
};

template <class Shade>
std::shared_ptr<const Kernel> vertex_kernel(Shade shade, const MissingDisplay& missing) {
  return std::make_shared<VertexKernel<Shade>>(std::move(shade), missing);
}

/// Temperature to palette colour over the active range.
class ThermalColour {
 public:
  explicit ThermalColour(const MethodContext& context)
      : normalised_(context.range_minimum, context.range_maximum), table_(context.palette) {}
  Colour operator()(double temperature_celsius) const {
    const auto colour = palette_colour(table_, normalised_(temperature_celsius));
    return {colour[0], colour[1], colour[2]};
  }

 private:
  Normalisation normalised_;
  PaletteTable table_;
};

}  // namespace spectra::fusion
