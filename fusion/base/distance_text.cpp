#include "fusion/base/distance_text.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace spectra::base {

std::string distance_text(double metres) {
  const bool is_far = metres >= 1000;
  const double value = is_far ? metres / 1000 : metres;
  std::array<char, 64> text{};
  constexpr double kBeyondWords = 1e9;
  if (metres >= kBeyondWords) {
    std::snprintf(text.data(), text.size(), "%.3g km", value);
    return text.data();
  }
  const int decimals = value > 0 ? std::clamp(2 - static_cast<int>(std::floor(std::log10(value))), 0, 6) : 0;
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return std::string(text.data()) + (is_far ? " km" : " m");
}

}  // namespace spectra::base
