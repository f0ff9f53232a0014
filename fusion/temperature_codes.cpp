#include "fusion/temperature_codes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace spectra::fusion {

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
  if (double{codes.scale} < step && step < 1e34) {
    codes.scale = std::nextafter(codes.scale, std::numeric_limits<float>::infinity());
  }
  codes.offset = static_cast<float>(std::floor(minimum / double{codes.scale}) * double{codes.scale});
  if (!std::isfinite(codes.offset)) codes.offset = minimum_celsius;
  return codes;
}

void TemperatureCodes::encode(std::span<const float> temperature_celsius, std::span<std::uint16_t> code) const {
  const double step = double{scale};
  for (std::size_t i = 0; i < temperature_celsius.size(); ++i) {
    const float value = temperature_celsius[i];
    if (std::isnan(value)) {
      code[i] = kMissing;
    } else if (std::isinf(value)) {
      code[i] = value > 0 ? kOverRange : kUnderRange;
    } else {
      const double position = std::floor((double{value} - double{offset}) / step + 0.5);
      code[i] = static_cast<std::uint16_t>(std::clamp(position, 0.0, double{kLargest}));
    }
  }
}

void TemperatureCodes::decode(std::span<const std::uint16_t> code, std::span<float> temperature_celsius) const {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  for (std::size_t i = 0; i < code.size(); ++i) {
    const float value = static_cast<float>(code[i]) * scale + offset;
    const float beyond = code[i] == kMissing     ? std::numeric_limits<float>::quiet_NaN()
                         : code[i] == kOverRange ? kInfinity
                                                 : -kInfinity;
    temperature_celsius[i] = code[i] > kLargest ? beyond : value;
  }
}

}  // namespace spectra::fusion
