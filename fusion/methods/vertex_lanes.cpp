#include "fusion/methods/vertex_lanes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace spectra::fusion {

Ramp Ramp::between(double from, double to, double top, double degenerate) {
  if (from == to) return flat(degenerate, top, 1);
  // Halves keep the span finite.
  const double half_span = to / 2 - from / 2;
  const double slope = half_span != 0 ? top / 2 / half_span : std::numeric_limits<double>::infinity();
  if (std::isfinite(slope)) return {from, slope, 0, top};
  // So small a span holds at most one float32, the one next to it: a step, with that value on its flank.
  const double inside = double{as_stored(from)};
  constexpr double kScale = 0x1p600;
  const double part = ((inside - from) * kScale) / ((to - from) * kScale);
  return {inside, to > from ? 1e300 : -1e300, top * std::clamp(part, 0.0, 1.0), top};
}

ThermalTable::ThermalTable(const PaletteTable& palette, double range_minimum, double range_maximum)
    : position(Ramp::between(range_minimum, range_maximum, 255, 127.5)) {
  // A table of the caller's may hold anything; what is not a number counts as 0.
  const auto channel = [&](std::size_t row, std::size_t index) {
    const double value = palette[row][index];
    return value > 0 ? std::min(value, 255.0) : 0.0;
  };
  double steepest = 0;
  for (std::size_t row = 0; row < 256; ++row) {
    const std::size_t next = std::min<std::size_t>(row + 1, 255);
    for (std::size_t index = 0; index < 3; ++index) {
      rows[row][index] = static_cast<float>(channel(row, index));
      const double step = channel(next, index) - channel(row, index);
      rows[row][4 + index] = static_cast<float>(step);
      steepest = std::max(steepest, std::abs(step));
    }
  }
  const double low = range_minimum;
  const double span = range_maximum - low;
  single_precision = steepest <= 12 && span > 1e-30 && span < 1e30 && std::abs(low) < 1e6 * span;
  if (!single_precision) return;
  origin = as_stored(low);
  origin_rest = static_cast<float>(low - double{origin});
  slope = static_cast<float>(255 / span);
}

Ramp normalisation(const MethodContext& context) {
  return Ramp::between(context.range_minimum, context.range_maximum, 1, 0.5);
}

float as_stored(double temperature_celsius) {
  constexpr double kLimit = std::numeric_limits<float>::max();
  if (temperature_celsius > kLimit) return std::numeric_limits<float>::infinity();
  if (temperature_celsius < -kLimit) return -std::numeric_limits<float>::infinity();
  return static_cast<float>(temperature_celsius);
}

float largest_at_most(double value) {
  const float nearest = as_stored(value);
  return double{nearest} > value ? std::nextafter(nearest, -std::numeric_limits<float>::infinity()) : nearest;
}

float smallest_at_least(double value) {
  const float nearest = as_stored(value);
  return double{nearest} < value ? std::nextafter(nearest, std::numeric_limits<float>::infinity()) : nearest;
}

}  // namespace spectra::fusion
