#include "fusion/colour/palette.hpp"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <utility>
#include <vector>

#include "fusion/colour/palette_tables.hpp"

namespace spectra::fusion {
namespace {

/// A colour that a palette passes through; position 0 is the coldest row, 1 the hottest.
struct ControlPoint {
  double position;
  std::array<double, 3> colour;
};

/// A table that joins the control points by straight lines; they ascend from position 0 to 1.
PaletteTable drawn(std::initializer_list<ControlPoint> points) {
  PaletteTable table{};
  const ControlPoint* from = points.begin();
  for (std::size_t row = 0; row < table.size(); ++row) {
    const double position = static_cast<double>(row) / 255;
    while (from + 2 < points.end() && position > (from + 1)->position) ++from;
    const ControlPoint* to = from + 1;
    const double part = (position - from->position) / (to->position - from->position);
    for (std::size_t channel = 0; channel < 3; ++channel) {
      table[row][channel] = from->colour[channel] + part * (to->colour[channel] - from->colour[channel]);
    }
  }
  return table;
}

Palette palette(std::string id, std::string label, const PaletteTable& table) {
  return {std::move(id), std::move(label), carries_hue_alone(table), is_diverging(table), table};
}

std::vector<Palette> make_palettes() {
  std::vector<Palette> list;
  list.push_back(palette("iron", "Iron",
                         drawn({{0.00, {0, 0, 10}},
                                {0.12, {32, 0, 100}},
                                {0.30, {120, 0, 158}},
                                {0.50, {204, 48, 92}},
                                {0.68, {240, 112, 10}},
                                {0.85, {254, 198, 30}},
                                {1.00, {255, 255, 235}}})));
  list.push_back(palette("iron_safe", "Iron, hue only",
                         drawn({{0.00, {80, 70, 230}},
                                {0.20, {140, 50, 220}},
                                {0.40, {210, 40, 170}},
                                {0.60, {235, 50, 70}},
                                {0.80, {245, 130, 30}},
                                {1.00, {250, 220, 50}}})));
  list.push_back(palette("white_hot", "White hot", drawn({{0, {0, 0, 0}}, {1, {255, 255, 255}}})));
  list.push_back(palette("black_hot", "Black hot", drawn({{0, {255, 255, 255}}, {1, {0, 0, 0}}})));
  list.push_back(palette("rainbow", "Rainbow",
                         drawn({{0.00, {0, 0, 110}},
                                {0.15, {0, 40, 255}},
                                {0.35, {0, 215, 235}},
                                {0.50, {20, 200, 40}},
                                {0.65, {245, 240, 20}},
                                {0.85, {255, 60, 0}},
                                {1.00, {255, 225, 225}}})));
  list.push_back(palette("rainbow_safe", "Rainbow, hue only",
                         drawn({{0.00, {70, 60, 240}},
                                {0.20, {40, 150, 240}},
                                {0.35, {30, 215, 205}},
                                {0.50, {50, 205, 80}},
                                {0.65, {170, 220, 40}},
                                {0.80, {250, 190, 40}},
                                {1.00, {235, 40, 45}}})));
  list.push_back(palette("arctic", "Arctic",
                         drawn({{0.00, {8, 12, 60}},
                                {0.25, {20, 60, 190}},
                                {0.45, {60, 170, 230}},
                                {0.60, {150, 190, 190}},
                                {0.80, {225, 165, 50}},
                                {1.00, {255, 240, 190}}})));
  list.push_back(palette("lava", "Lava",
                         drawn({{0.00, {4, 20, 40}},
                                {0.25, {30, 70, 100}},
                                {0.45, {110, 30, 80}},
                                {0.65, {205, 30, 30}},
                                {0.85, {250, 150, 30}},
                                {1.00, {255, 250, 215}}})));
  list.push_back(palette("high_contrast", "High contrast",
                         drawn({{0.00, {0, 0, 0}},
                                {0.10, {90, 20, 160}},
                                {0.22, {20, 60, 255}},
                                {0.34, {0, 220, 255}},
                                {0.46, {0, 120, 50}},
                                {0.58, {110, 255, 60}},
                                {0.70, {255, 245, 0}},
                                {0.82, {255, 90, 0}},
                                {0.92, {200, 0, 60}},
                                {1.00, {255, 255, 255}}})));
  list.push_back(palette("blue_red", "Blue to red",
                         drawn({{0.00, {12, 40, 140}},
                                {0.25, {66, 134, 224}},
                                {0.42, {184, 206, 232}},
                                {0.50, {232, 230, 228}},
                                {0.58, {238, 200, 182}},
                                {0.75, {224, 92, 66}},
                                {1.00, {128, 8, 30}}})));
  list.push_back(palette("cyan_amber", "Cyan to amber, dark middle",
                         drawn({{0.00, {120, 250, 255}},
                                {0.25, {20, 160, 200}},
                                {0.42, {40, 80, 96}},
                                {0.50, {46, 46, 48}},
                                {0.58, {104, 68, 34}},
                                {0.75, {214, 128, 16}},
                                {1.00, {255, 226, 96}}})));
  list.push_back(palette("inferno", "Inferno", kInfernoTable));
  list.push_back(palette("magma", "Magma", kMagmaTable));
  list.push_back(palette("plasma", "Plasma", kPlasmaTable));
  list.push_back(palette("viridis", "Viridis", kViridisTable));
  list.push_back(palette("cividis", "Cividis", kCividisTable));
  list.push_back(palette("turbo", "Turbo", kTurboTable));
  return list;
}

/// HSV hue in degrees, 0..360, of a colour that is not grey; chroma is its largest minus its smallest channel.
double hue_degrees(const std::array<double, 3>& colour, double chroma) {
  const auto [r, g, b] = colour;
  const double largest = std::max({r, g, b});
  double sextant = 0;
  if (largest == r) {
    sextant = (g - b) / chroma + (g < b ? 6 : 0);
  } else if (largest == g) {
    sextant = (b - r) / chroma + 2;
  } else {
    sextant = (r - g) / chroma + 4;
  }
  return 60 * sextant;
}

double chroma_of(const std::array<double, 3>& colour) {
  const auto [smallest, largest] = std::minmax_element(colour.begin(), colour.end());
  return (*largest - *smallest) / 255;
}

double hue_apart(double a, double b) {
  return std::abs(std::remainder(a - b, 360.0));
}

}  // namespace

bool is_diverging(const PaletteTable& table) {
  if (chroma_of(table[127]) > 0.1 || chroma_of(table[128]) > 0.1) return false;
  const auto hue_of = [&](std::size_t row) { return hue_degrees(table[row], 255 * chroma_of(table[row])); };
  for (std::size_t row = 0; row < table.size() / 3; ++row) {
    for (const std::size_t here : {row, 255 - row}) {
      if (chroma_of(table[here]) < 0.25 || hue_apart(hue_of(here), hue_of(here == row ? 0 : 255)) > 60) return false;
    }
  }
  return hue_apart(hue_of(0), hue_of(255)) >= 90;
}

bool carries_hue_alone(const PaletteTable& table) {
  double previous_hue = 0;
  double turned = 0;
  double direction = 0;
  for (std::size_t row = 0; row < table.size(); ++row) {
    const auto [smallest, largest] = std::minmax_element(table[row].begin(), table[row].end());
    const double chroma = *largest - *smallest;
    if (chroma < 0.25 * 255) return false;
    const double hue = hue_degrees(table[row], chroma);
    if (row > 0) {
      const double step = std::remainder(hue - previous_hue, 360.0);
      if (row == 1) direction = step;
      if (!(step * direction > 0)) return false;
      turned += std::abs(step);
    }
    previous_hue = hue;
  }
  return turned < 360;
}

std::span<const Palette> all_palettes() {
  static const std::vector<Palette> list = make_palettes();
  return list;
}

const Palette* find_palette(std::string_view id) {
  for (const Palette& palette : all_palettes()) {
    if (palette.id == id) return &palette;
  }
  return nullptr;
}

std::array<double, 3> palette_colour(const PaletteTable& table, double t) {
  // Written so that not-a-number becomes the coldest row.
  const double position = t > 0 ? 255 * std::min(t, 1.0) : 0;
  const auto row = std::min<std::size_t>(static_cast<std::size_t>(position), 254);
  const double part = position - static_cast<double>(row);
  std::array<double, 3> colour{};
  for (std::size_t channel = 0; channel < 3; ++channel) {
    colour[channel] = table[row][channel] + part * (table[row + 1][channel] - table[row][channel]);
  }
  return colour;
}

}  // namespace spectra::fusion
