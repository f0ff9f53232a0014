#include "fusion/base/up_axis.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>

namespace spectra::base {

namespace {

constexpr std::array<std::string_view, 6> kNames = {"x", "y", "z", "-x", "-y", "-z"};

}  // namespace

std::optional<UpAxis> up_axis(std::string_view name) {
  const auto found = std::find(kNames.begin(), kNames.end(), name);
  if (found == kNames.end()) return std::nullopt;
  return static_cast<UpAxis>(found - kNames.begin());
}

std::optional<UpAxis> up_axis_written(std::string_view name) {
  if (name.starts_with('+')) {
    name.remove_prefix(1);
    if (name.starts_with('-')) return std::nullopt;
  }
  std::string lower(name);
  for (char& c : lower) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return up_axis(lower);
}

std::string_view to_string(UpAxis up) {
  return kNames[static_cast<std::size_t>(up)];
}

Vec3f direction_of(UpAxis up) {
  const auto index = static_cast<std::size_t>(up);
  const float length = index < 3 ? 1 : -1;
  return {index % 3 == 0 ? length : 0, index % 3 == 1 ? length : 0, index % 3 == 2 ? length : 0};
}

}  // namespace spectra::base
