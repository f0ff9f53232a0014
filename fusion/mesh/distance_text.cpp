#include "fusion/mesh/distance_text.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace spectra::fusion {

std::string distance_text(double metres) {
  const bool is_far = metres >= 1000;
  const double value = is_far ? metres / 1000 : metres;
  const int decimals = value > 0 ? std::clamp(2 - static_cast<int>(std::floor(std::log10(value))), 0, 6) : 0;
  std::array<char, 400> text{};
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return std::string(text.data()) + (is_far ? " km" : " m");
}

}  // namespace spectra::fusion
