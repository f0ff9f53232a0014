#include "fusion/demo/lettering.hpp"

#include <gtest/gtest.h>

#include <string>

namespace spectra::demo {
namespace {

TEST(Lettering, HasInkOnStrokesOnly) {
  Lettering line;
  line.add("L", 0, 0, 0.06, 0.01);
  EXPECT_EQ(line.ink(0, 0.03, 0.001), 1);
  EXPECT_EQ(line.ink(0.02, 0, 0.001), 1);
  EXPECT_EQ(line.ink(0.02, 0.03, 0.001), 0);
  EXPECT_EQ(line.ink(1, 1, 0.001), 0);
  EXPECT_NEAR(line.ink(0.005, 0.03, 0.002), 0.5, 1e-9);
}

TEST(Lettering, DrawsEveryGlyphDifferently) {
  const std::string glyphs = "ABCDEFGHIJKLMNPQRSTUVWXYZ0123456789.:-!/>";
  const auto picture = [](char glyph) {
    Lettering line;
    line.add(std::string(1, glyph), 0, 0, 6, 0.8);
    std::string dots;
    for (int y = 0; y <= 12; ++y) {
      for (int x = 0; x <= 8; ++x) dots += line.ink(0.5 * x, 0.5 * y, 0.1) > 0.5 ? '#' : '.';
    }
    return dots;
  };
  for (std::size_t i = 0; i < glyphs.size(); ++i) {
    EXPECT_NE(picture(glyphs[i]).find('#'), std::string::npos) << glyphs[i];
    for (std::size_t j = 0; j < i; ++j) EXPECT_NE(picture(glyphs[i]), picture(glyphs[j])) << glyphs[i] << glyphs[j];
  }
}

TEST(Lettering, CentresALine) {
  Lettering line;
  line.add_centred("H", 0, 0, 0.06, 0.01);
  EXPECT_EQ(line.ink(-0.02, 0.01, 0.001), 1);
  EXPECT_EQ(line.ink(0.02, 0.01, 0.001), 1);
  EXPECT_EQ(line.ink(0, 0.01, 0.001), 0);
}

}  // namespace
}  // namespace spectra::demo
