#include "fusion/demo/lettering.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace spectra::demo {
namespace {

constexpr double kAdvance = 5.9;  // of a cell 4 wide and 6 high

/// Strokes on a grid 0..4 x 0..6: pairs of digits x y, strokes parted by a blank.
std::string_view strokes_of(char c) {
  switch (c) {
    case 'A':
      return "002640 1232";
    case 'B':
      return "00063645443303 3342413000";
    case 'C':
      return "4536160501103041";
    case 'D':
      return "00062644422000";
    case 'E':
      return "46060040 0333";
    case 'F':
      return "460600 0333";
    case 'G':
      return "45361605011030414323";
    case 'H':
      return "0006 4046 0343";
    case 'I':
      return "2026 1636 1030";
    case 'J':
      return "4641301001";
    case 'K':
      return "0006 460340";
    case 'L':
      return "060040";
    case 'M':
      return "0006234640";
    case 'N':
      return "00064046";
    case 'O':
      return "100105163645413010";
    case 'P':
      return "00063645443303";
    case 'Q':
      return "100105163645413010 2240";
    case 'R':
      return "00063645443303 2340";
    case 'S':
      return "453616050413334241301001";
    case 'T':
      return "0646 2026";
    case 'U':
      return "060110304146";
    case 'V':
      return "062046";
    case 'W':
      return "0610233046";
    case 'X':
      return "0046 0640";
    case 'Y':
      return "0623 4623 2320";
    case 'Z':
      return "06460040";
    case '0':
      return "100105163645413010";
    case '1':
      return "152620 1030";
    case '2':
      return "05163645440040";
    case '3':
      return "05163645443323 334241301001";
    case '4':
      return "30360242";
    case '5':
      return "460603334241301001";
    case '6':
      return "4536160501103041423303";
    case '7':
      return "064610";
    case '8':
      return "13040516364544331302011030414233";
    case '9':
      return "0110304145361605041343";
    case '.':
      return "2020";
    case ':':
      return "2121 2424";
    case '-':
      return "0343";
    case '!':
      return "2622 2020";
    case '/':
      return "0046";
    case '>':
      return "0343 254321";
    default:
      return "";
  }
}

}  // namespace

void Lettering::add(std::string_view text, double x, double y, double height_m, double stroke_m) {
  const double unit = height_m / 6;
  for (const char c : text) {
    Glyph glyph{x - stroke_m, y - stroke_m, x + 4 * unit + stroke_m, y + height_m + stroke_m, {}, stroke_m / 2};
    const std::string_view strokes = strokes_of(c);
    for (std::size_t i = 0; i + 3 < strokes.size();) {
      if (strokes[i + 2] == ' ') {
        i += 3;
        continue;
      }
      const auto at = [&](std::size_t k) { return static_cast<double>(strokes[k] - '0') * unit; };
      glyph.segments.push_back({x + at(i), y + at(i + 1), x + at(i + 2), y + at(i + 3)});
      i += 2;
    }
    if (!glyph.segments.empty()) glyphs_.push_back(std::move(glyph));
    x += kAdvance * unit;
  }
}

void Lettering::add_centred(std::string_view text, double x, double y, double height_m, double stroke_m) {
  const double width = (static_cast<double>(text.size()) * kAdvance - (kAdvance - 4)) * height_m / 6;
  add(text, x - width / 2, y, height_m, stroke_m);
}

double Lettering::ink(double x, double y, double edge_m) const {
  double most = 0;
  for (const Glyph& glyph : glyphs_) {
    if (x < glyph.left || x > glyph.right || y < glyph.bottom || y > glyph.top) continue;
    double nearest = 1e30;
    for (const auto& [ax, ay, bx, by] : glyph.segments) {
      const double dx = bx - ax, dy = by - ay, square = dx * dx + dy * dy;
      const double t = square > 0 ? std::clamp(((x - ax) * dx + (y - ay) * dy) / square, 0.0, 1.0) : 0;
      const double ex = x - ax - t * dx, ey = y - ay - t * dy;
      nearest = std::min(nearest, ex * ex + ey * ey);
    }
    most = std::max(most, std::clamp((glyph.half_stroke - std::sqrt(nearest)) / edge_m + 0.5, 0.0, 1.0));
  }
  return most;
}

}  // namespace spectra::demo
