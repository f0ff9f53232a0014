// Which properties are colours by their names.
#include "fusion/files/colour_names.hpp"

#include <gtest/gtest.h>

#include <string>

namespace spectra::files {
namespace {

/// 100,000 names that differ; looking for one at a time among all would take a minute.
TEST(ColourNames, ManyPropertiesTakeTimeByTheirNumber) {
  constexpr int kCount = 100'000;
  PlyElement element;
  for (int i = 0; i < kCount; ++i) {
    std::string name = "red_q";
    for (int rest = i; rest > 0; rest /= 26) name += static_cast<char>('a' + rest % 26);
    element.properties.emplace_back().name = name;
  }
  EXPECT_FALSE(plain_colour_channels(element));
  EXPECT_TRUE(possible_colours(element).empty());
  for (const char* name : {"blue_qzz", "green_qzz", "color_b", "color_g", "color_r"}) {
    element.properties.emplace_back().name = name;
  }
  EXPECT_EQ(plain_colour_channels(element), (std::array<std::size_t, 3>{kCount + 4, kCount + 3, kCount + 2}));
  EXPECT_EQ(possible_colours(element),
            (std::vector<std::size_t>{25 + 25 * 26, kCount + 1, kCount, kCount + 4, kCount + 3, kCount + 2}));
}

TEST(ColourNames, TheFirstOfANameIsTaken) {
  PlyElement element;
  for (const char* name : {"red", "green", "green (2)", "blue", "blue (2)"}) {
    element.properties.emplace_back().name = name;
  }
  EXPECT_EQ(plain_colour_channels(element), (std::array<std::size_t, 3>{0, 1, 3}));
  element.properties[1].is_list = true;
  EXPECT_EQ(plain_colour_channels(element), (std::array<std::size_t, 3>{0, 2, 3}));
}

}  // namespace
}  // namespace spectra::files
