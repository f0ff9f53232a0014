#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "fusion/base/vertex_types.hpp"

namespace spectra::fusion {

/// How much of every hue some colours have: the chroma (largest channel minus smallest) of those of a hue, summed by equal
/// sectors of the colour circle. Grey has no hue.
struct Hues {
  static constexpr std::size_t kSectors = 36;
  std::array<std::uint64_t, kSectors> chroma{};  ///< Sector i holds hues from i to i + 1 sectors, from red on.
};

/// Adds colours; the same for every order and every split.
void add_to_hues(std::span<const base::Rgb8> colours, Hues& hues);

/// The hue in degrees that is seen best among these: the one with the least colour near it, weighed by the square of the
/// cosine of the angle between. Red where nothing has colour; of equals the first from red on.
double rarest_hue_degrees(const Hues& hues);

}  // namespace spectra::fusion
