#include "fusion/colour/colour_difference.hpp"

#include <gtest/gtest.h>

namespace spectra::fusion {
namespace {

struct Pair {
  fusion::Lab first, second;
  double difference;
};

// Figures published with Sharma, Wu and Dalal, "The CIEDE2000 color-difference formula", 2005, table 1.
const Pair kPublished[] = {
    {{50, 2.6772, -79.7751}, {50, 0, -82.7485}, 2.0425},
    {{50, 3.1571, -77.2803}, {50, 0, -82.7485}, 2.8615},
    {{50, 2.8361, -74.0200}, {50, 0, -82.7485}, 3.4412},
    {{50, -1.3802, -84.2814}, {50, 0, -82.7485}, 1.0000},
    {{50, 2.5, 0}, {50, 0, -2.5}, 4.3065},
    {{50, 2.5, 0}, {73, 25, -18}, 27.1492},
    {{60.2574, -34.0099, 36.2677}, {60.4626, -34.1751, 39.4387}, 1.2644},
    {{2.0776, 0.0795, -1.1350}, {0.9033, -0.0636, -0.5514}, 0.9082},
};

TEST(Ciede2000, GivesThePublishedDifferences) {
  for (const Pair& pair : kPublished) {
    EXPECT_NEAR(fusion::ciede2000(pair.first, pair.second), pair.difference, 5e-5);
    EXPECT_NEAR(fusion::ciede2000(pair.second, pair.first), pair.difference, 5e-5);
  }
}

TEST(Ciede2000, IsZeroForEqualColours) {
  EXPECT_EQ(fusion::ciede2000({40, 0, 0}, {40, 0, 0}), 0);
  EXPECT_EQ(fusion::ciede2000({40, 12, -7}, {40, 12, -7}), 0);
}

TEST(LabOf, MapsWhiteBlackAndRed) {
  const fusion::Lab white = fusion::lab_of(base::Rgb8{255, 255, 255}), black = fusion::lab_of(base::Rgb8{0, 0, 0}),
                    red = fusion::lab_of(base::Rgb8{255, 0, 0});
  EXPECT_NEAR(white[0], 100, 1e-3);
  EXPECT_NEAR(white[1], 0, 0.02);
  EXPECT_NEAR(white[2], 0, 0.02);
  EXPECT_NEAR(black[0], 0, 1e-9);
  EXPECT_NEAR(red[0], 53.24, 0.01);
  EXPECT_NEAR(red[1], 80.09, 0.02);
  EXPECT_NEAR(red[2], 67.20, 0.02);
}

}  // namespace
}  // namespace spectra::fusion
