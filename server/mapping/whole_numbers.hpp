#pragma once

#include <cstdint>

namespace spectra::mapping {

/// As std::floor and std::ceil, of values that fit; without a call where the processor at hand need have no instruction for them.
inline std::int32_t floor_of(float value) {
  const auto towards_0 = static_cast<std::int32_t>(value);
  return towards_0 - (value < static_cast<float>(towards_0) ? 1 : 0);
}
inline std::int32_t ceil_of(float value) {
  const auto towards_0 = static_cast<std::int32_t>(value);
  return towards_0 + (value > static_cast<float>(towards_0) ? 1 : 0);
}

}  // namespace spectra::mapping
