#include "fusion/temperature_codes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace spectra::fusion {
namespace {

/// Beyond so many steps from 0 degC float32 does not tell neighbours from each other well enough.
constexpr double kFarthestStep = 0x1p22;

}  // namespace

TemperatureCodes TemperatureCodes::covering(float minimum_celsius, float maximum_celsius, double step_celsius) {
  const double minimum = double{minimum_celsius};
  const double maximum = double{maximum_celsius};
  // A step more at each end: one for the offset that is moved down to a multiple, one for the rounding of float32.
  constexpr double kRoom = kLargest - 2;
  double step = std::max(step_celsius, (maximum - minimum) / kRoom);
  // Below its own resolution float32 has no steps.
  step = std::max({step, std::abs(minimum) * 0x1p-23, std::abs(maximum) * 0x1p-23, 1e-30});
  TemperatureCodes codes;
  codes.scale = static_cast<float>(std::min(step, 1e34));
  const double per_degree = std::nearbyint(1 / step);
  if (per_degree >= 1 && static_cast<float>(1 / per_degree) == codes.scale) {
    codes.offset = static_cast<float>(std::floor(minimum * per_degree) / per_degree);
    if (minimum == maximum) codes.offset = minimum_celsius;
    if (minimum == maximum || codes.lattice()) return codes;
  }
  if (double{codes.scale} < step && step < 1e34) {
    codes.scale = std::nextafter(codes.scale, std::numeric_limits<float>::infinity());
  }
  codes.offset = static_cast<float>(std::floor(minimum / double{codes.scale}) * double{codes.scale});
  if (minimum == maximum || !std::isfinite(codes.offset)) codes.offset = minimum_celsius;
  return codes;
}

std::optional<TemperatureCodes::Lattice> TemperatureCodes::lattice() const {
  const double per_degree = std::nearbyint(1 / double{scale});
  const double first = std::nearbyint(double{offset} * per_degree);
  const bool is_there = per_degree >= 1 && std::abs(first) <= kFarthestStep &&
                        static_cast<float>(1 / per_degree) == scale && static_cast<float>(first / per_degree) == offset;
  return is_there ? std::optional(Lattice{per_degree, first}) : std::nullopt;
}

void TemperatureCodes::encode(std::span<const float> temperature_celsius, std::span<std::uint16_t> code) const {
  const std::optional<Lattice> steps = lattice();
  for (std::size_t i = 0; i < temperature_celsius.size(); ++i) {
    const float value = temperature_celsius[i];
    if (std::isnan(value)) {
      code[i] = kMissing;
    } else if (std::isinf(value)) {
      code[i] = value > 0 ? kOverRange : kUnderRange;
    } else {
      const double position =
          steps ? double{value} * steps->per_degree - steps->first : (double{value} - double{offset}) / double{scale};
      code[i] = static_cast<std::uint16_t>(std::clamp(std::floor(position + 0.5), 0.0, double{kLargest}));
    }
  }
}

void TemperatureCodes::decode(std::span<const std::uint16_t> code, std::span<float> temperature_celsius) const {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const std::optional<Lattice> steps = lattice();
  const double first = steps ? steps->first : 0;
  // The product is as good as the quotient: a number of so few digits is never as near to the middle between two floats as it is off.
  const double step = steps ? 1 / steps->per_degree : 0;
  for (std::size_t i = 0; i < code.size(); ++i) {
    const float value = steps ? static_cast<float>((first + static_cast<double>(code[i])) * step)
                              : static_cast<float>(code[i]) * scale + offset;
    const float beyond = code[i] == kMissing     ? std::numeric_limits<float>::quiet_NaN()
                         : code[i] == kOverRange ? kInfinity
                                                 : -kInfinity;
    temperature_celsius[i] = code[i] > kLargest ? beyond : value;
  }
}

}  // namespace spectra::fusion
