// Walks through docs/adding-a-method.md: the method below is compiled from the code of that page.

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <random>
#include <sstream>

#include "fusion/colour/palette.hpp"
#include "fusion/registry.hpp"
#include "tests/unit/fusion/scene.hpp"

namespace spectra::fusion {
namespace methods {
Method thermal_multiply();
}

namespace {

std::string text_of(const std::string& path) {
  std::ifstream file(std::string(SPECTRA_SOURCE_DIR) + "/" + path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

TEST(AddingAMethod, TheSchemaOfThePageValidates) {
  const Method method = methods::thermal_multiply();
  EXPECT_EQ(method.id, "thermal_multiply");
  ASSERT_EQ(method.parameters.size(), 1U);
  const Parameter& strength = method.parameters[0];
  EXPECT_EQ(strength.default_value, ParameterValue{1.0});
  EXPECT_TRUE(validated(strength, 0.5).has_value());
  EXPECT_EQ(validated(strength, 1.5).error().field, "strength");
}

TEST(AddingAMethod, TheKernelOfThePageFollowsItsFormula) {
  std::mt19937 engine(4);
  std::uniform_real_distribution<float> celsius(10, 40);
  std::vector<float> temperature;
  std::vector<base::Rgb8> visible;
  for (int i = 0; i < 1000; ++i) {
    temperature.push_back(i % 10 ? celsius(engine) : std::numeric_limits<float>::quiet_NaN());
    const auto bits = static_cast<std::uint32_t>(engine());
    visible.push_back(
        {static_cast<std::uint8_t>(bits), static_cast<std::uint8_t>(bits >> 8), static_cast<std::uint8_t>(bits >> 16)});
  }
  const SceneTemperature scene = test::scene_of(temperature);
  const double lo = double{scene.summary.minimum};
  const double hi = double{scene.summary.maximum};
  const PaletteTable& palette = find_palette("viridis")->table;
  const Method method = methods::thermal_multiply();
  const PreparedMethod prepared =
      method.prepare({{"strength", 0.7}}, MethodContext{lo, hi, scene, palette, std::nullopt});
  std::vector<base::Rgb8> fused(visible.size());
  prepared.kernel->fuse({temperature, visible}, fused);
  for (std::size_t i = 0; i < fused.size(); ++i) {
    if (!std::isfinite(temperature[i])) {
      EXPECT_EQ(fused[i], visible[i]);
      continue;
    }
    const auto m = palette_colour(palette, (double{temperature[i]} - lo) / (hi - lo));
    const int v[3] = {visible[i].r, visible[i].g, visible[i].b};
    const int f[3] = {fused[i].r, fused[i].g, fused[i].b};
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(f[c], v[c] * (0.3 + 0.7 * m[c] / 255), 0.501) << i;
  }
}

TEST(AddingAMethod, TheRegistryHasOneLinePerMethodAsThePageSays) {
  const std::string registry = text_of("fusion/registry.cpp");
  const std::string build = text_of("fusion/CMakeLists.txt");
  EXPECT_NE(text_of("docs/adding-a-method.md").find("\n  METHOD(thermal_multiply)"), std::string::npos);
  for (const Method* method : all_methods()) {
    EXPECT_NE(registry.find("\n  METHOD(" + method->id + ")"), std::string::npos) << method->id;
    EXPECT_NE(build.find("methods/" + method->id + ".cpp"), std::string::npos) << method->id;
  }
}

}  // namespace
}  // namespace spectra::fusion
