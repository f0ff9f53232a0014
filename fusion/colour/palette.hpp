#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>

namespace spectra::fusion {

/// 256 sRGB-encoded colours in 0..255, real-valued; row 0 is the coldest.
using PaletteTable = std::array<std::array<double, 3>, 256>;

/// A palette. fusion_safe: it carries temperature by hue alone, so that intensity_hue may give lightness to the visible
/// picture; see carries_hue_alone.
/// diverging: it tells two directions from a neutral middle; see is_diverging.
struct Palette {
  std::string id;
  std::string label;
  bool fusion_safe = false;
  bool diverging = false;
  PaletteTable table{};
};

/// The rule behind fusion_safe. Chroma is that of HSV, the largest channel minus the smallest, as a part of 255: at least
/// 0.25 in every row. Hue is that of HSV, the one intensity_hue keeps: it turns one way from row to row without a halt,
/// and by less than the full circle, so that no hue is used twice.
bool carries_hue_alone(const PaletteTable& table);

/// The rule behind diverging. Chroma and hue are those above: at most 0.1 in the two rows of the middle, at least 0.25 in every
/// row of the outer thirds, in each of the two of hues within 60 degrees of its end, and the two ends at least 90 degrees
/// apart, so that warmer is never taken for colder.
bool is_diverging(const PaletteTable& table);

/// All palettes, in the order a person should see them; at least 15.
std::span<const Palette> all_palettes();

/// The palette of that id, or nullptr.
const Palette* find_palette(std::string_view id);

/// The colour at position 255 t, t clamped to [0,1], linear between rows in double precision.
std::array<double, 3> palette_colour(const PaletteTable& table, double t);

}  // namespace spectra::fusion
