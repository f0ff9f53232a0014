#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "fusion/method.hpp"

namespace spectra::fusion {

/// clamp((T - origin) * slope + offset, 0, top): a linear part of the way between two temperatures, made so that it
/// neither overflows nor loses a span of one float32 step. Double precision on the stored float32 values.
struct Ramp {
  double origin = 0;
  double slope = 0;
  double offset = 0;
  double top = 1;

  /// From 0 at `from` to `top` at `to`, which may be the lower one; where both are equal, flat at `degenerate`.
  static Ramp between(double from, double to, double top, double degenerate);

  /// The same value for every finite T. What is infinite takes the end of the ramp: `top` at +infinity where `direction` is
  /// 1, at -infinity where it is -1, and 0 at the other.
  static Ramp flat(double value, double top, double direction) { return {0, direction * 1e-300, value, top}; }
};

/// The palette over the active range, laid out for the kernels.
struct ThermalTable {
  explicit ThermalTable(const MethodContext& context)
      : ThermalTable(context.palette, context.range_minimum, context.range_maximum) {}
  ThermalTable(const PaletteTable& palette, double range_minimum, double range_maximum);

  Ramp position;  ///< T to 0..255.
  /// Whether the position may be computed as (T - origin - origin_rest) * slope in float32: its error of at most 6.1e-5
  /// rows is then below 8e-4 of a level. Steep palettes and extreme ranges need double precision.
  bool single_precision = false;
  float origin = 0;
  float origin_rest = 0;
  float slope = 0;
  /// Per row r, g, b and a pad, then the same of the step to the next row; 32 bytes, so that both halves load as one.
  alignas(64) std::array<std::array<float, 8>, 256> rows{};
};

/// T to 0..1 over the active range, 0.5 for every finite T where the range is one point.
Ramp normalisation(const MethodContext& context);

/// The nearest float32: how thresholds are compared. Infinite beyond the float32 range.
float as_stored(double temperature_celsius);

/// The float32 values just at or below and at or above a double: comparing with them is comparing with it.
float largest_at_most(double value);
float smallest_at_least(double value);

/// The vertices that a kernel is given; colours are interleaved bytes r, g, b. No baseline and no freshness: nullptr.
struct VertexSpan {
  const float* temperature_celsius = nullptr;
  const float* baseline_celsius = nullptr;
  const std::uint8_t* freshness = nullptr;
  const std::uint8_t* visible = nullptr;
  std::uint8_t* fused = nullptr;
  std::size_t count = 0;
  MissingDisplay missing;
};

/// A kernel that hands each span to fuse(const VertexSpan&).
template <class Fuse>
class LaneKernel final : public Kernel {
 public:
  LaneKernel(const Fuse& fuse, const MissingDisplay& missing) : fuse_(fuse), missing_(missing) {}

  void fuse(const base::VertexValues& vertices, std::span<base::Rgb8> fused) const noexcept override {
    if (fused.empty()) return;
    const auto start = [](const auto& values) { return values.empty() ? nullptr : values.data(); };
    fuse_(VertexSpan{vertices.temperature_celsius.data(), start(vertices.baseline_celsius), start(vertices.freshness),
                     &vertices.visible.data()->r, &fused.data()->r, fused.size(), missing_});
  }

 private:
  Fuse fuse_;
  MissingDisplay missing_;
};

template <class Fuse>
std::shared_ptr<const Kernel> lane_kernel(const MethodContext& context, const Fuse& fuse) {
  return std::make_shared<LaneKernel<Fuse>>(fuse, context.missing);
}

}  // namespace spectra::fusion
