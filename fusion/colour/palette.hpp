#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>

namespace spectra::fusion {

/// 256 sRGB-encoded colours in 0..255, real-valued; row 0 is the coldest.
using PaletteTable = std::array<std::array<double, 3>, 256>;

/// A palette. fusion_safe: it carries temperature by hue alone (smallest chroma >= 0.25 and no hue used twice), so
/// that intensity_hue may give lightness to the visible picture.
struct Palette {
  std::string id;
  std::string label;
  bool fusion_safe = false;
  PaletteTable table{};
};

/// All palettes, in the order a person should see them; at least 15.
std::span<const Palette> all_palettes();

/// The palette of that id, or nullptr.
const Palette* find_palette(std::string_view id);

/// The colour at position 255 t, t clamped to [0,1], linear between rows in double precision.
std::array<double, 3> palette_colour(const PaletteTable& table, double t);

}  // namespace spectra::fusion
