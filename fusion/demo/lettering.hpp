#pragma once

#include <array>
#include <string_view>
#include <vector>

namespace spectra::demo {

/// Lines of text on a flat sign, in a stroke font of its own (capitals, digits and . : - ! / >).
class Lettering {
 public:
  /// Adds a line whose capitals are `height_m` high. (x, y) is the left end of the base line, or its middle.
  void add(std::string_view text, double x, double y, double height_m, double stroke_m);
  void add_centred(std::string_view text, double x, double y, double height_m, double stroke_m);

  /// 1 on a stroke, 0 off it, with an edge of `edge_m` between.
  double ink(double x, double y, double edge_m) const;

 private:
  struct Glyph {
    double left, bottom, right, top;              ///< With the stroke's width.
    std::vector<std::array<double, 4>> segments;  ///< x, y, x, y.
    double half_stroke;
  };
  std::vector<Glyph> glyphs_;
};

}  // namespace spectra::demo
