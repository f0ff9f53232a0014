#include "fusion/age.hpp"

#include <cmath>

namespace spectra::fusion {

AgeSteps::AgeSteps(double half_life_s) {
  // Freshness k reaches as far as 8 w is at least k - 1/2.
  for (std::size_t k = 1; k <= kFresh; ++k) {
    last_age_s_[k - 1] = half_life_s * std::log2(8 / (static_cast<double>(k) - 0.5));
  }
}

std::uint8_t AgeSteps::freshness(double age_s) const {
  std::uint8_t steps = kFresh;
  // Written so that not-a-number is fresh.
  while (steps > 0 && age_s > last_age_s_[steps - 1U]) --steps;
  return steps;
}

}  // namespace spectra::fusion
