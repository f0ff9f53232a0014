#include "server/tradeoff/measure.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "fusion/mesh/multispectral_mesh.hpp"
#include "server/tradeoff/report.hpp"

namespace spectra::tradeoff {
namespace {

/// A wavy square of side 1 m with a temperature ramp.
mesh::MultispectralMesh wavy_square(std::uint32_t side) {
  mesh::MultispectralMesh mesh;
  mesh.name = "wavy <square>";
  mesh.has_visible = mesh.has_temperature = true;
  mesh.resize_vertices(static_cast<std::size_t>(side) * side);
  for (std::uint32_t y = 0; y < side; ++y) {
    for (std::uint32_t x = 0; x < side; ++x) {
      const std::size_t i = static_cast<std::size_t>(y) * side + x;
      const float u = static_cast<float>(x) / static_cast<float>(side - 1);
      const float v = static_cast<float>(y) / static_cast<float>(side - 1);
      mesh.positions()[i] = {u, v, 0.05F * std::sin(12 * u) * std::cos(9 * v)};
      mesh.visible()[i] = {static_cast<std::uint8_t>(255 * u), static_cast<std::uint8_t>(255 * v), 90};
      mesh.temperature_celsius()[i] = 15 + 20 * u;
      if (x + 1 < side && y + 1 < side) {
        const auto at = static_cast<std::uint32_t>(i);
        mesh.triangles().push_back({at, at + 1, at + side});
        mesh.triangles().push_back({at + 1, at + side + 1, at + side});
      }
    }
  }
  return mesh;
}

class Tradeoff : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    jobs::WorkerPool pool(2);
    const auto scene = map::SceneSnapshot::build(wavy_square(80), 1, pool, 2000);
    TradeoffOptions options;
    options.sample_count = 500;
    options.encoder_speeds = {0, 10};
    options.step_factors = {0.5, 4};
    const auto progress = [](std::string_view phase, double share) {
      EXPECT_EQ(phase, kMeasuringPhase);
      shares_.push_back(share);
    };
    measurement_ = new TradeoffMeasurement(measured_tradeoff(*scene, options, progress).value());
  }
  static void TearDownTestSuite() { delete measurement_; }
  static TradeoffMeasurement* measurement_;
  static std::vector<double> shares_;

  static int full_level() {
    int level = 0;
    for (const auto& p : measurement_->geometry) level = std::max(level, p.level);
    return level;
  }
};
TradeoffMeasurement* Tradeoff::measurement_ = nullptr;
std::vector<double> Tradeoff::shares_;

TEST_F(Tradeoff, TellsHowFarItIs) {
  EXPECT_TRUE(std::is_sorted(shares_.begin(), shares_.end()));
  ASSERT_GE(shares_.size(), 3U);
  EXPECT_EQ(shares_.front(), 0);
  EXPECT_EQ(shares_.back(), 1);
  // That is said when all is done, not before.
  const double last_measured = *(shares_.end() - 2);
  EXPECT_LT(last_measured, 1);
  EXPECT_GT(last_measured, 0.4);
}

TEST_F(Tradeoff, FullDetailIsWithinHalfAStepPerAxis) {
  int seen = 0;
  for (const GeometryPoint& p : measurement_->geometry) {
    if (p.level != full_level()) continue;
    ++seen;
    EXPECT_LE(p.error_worst_mm, 0.5001 * std::sqrt(3.0) * p.position_step_mm);
    EXPECT_LE(p.error_rms_mm, p.error_worst_mm);
    EXPECT_GT(p.size_bytes, 0U);
  }
  EXPECT_EQ(seen, 2 * (3 + 2));
}

TEST_F(Tradeoff, FewerBitsCostFewerBytesAndMoreError) {
  std::vector<ColourPoint> draco;
  for (const ColourPoint& p : measurement_->colours) {
    if (p.codec == "draco" && p.level == full_level()) draco.push_back(p);
  }
  ASSERT_EQ(draco.size(), 5U);
  EXPECT_LT(draco.front().ciede2000_mean, 0.05) << "8 bits at full detail show the fused colours";
  for (std::size_t i = 1; i < draco.size(); ++i) {
    EXPECT_LT(draco[i].size_bytes, draco[i - 1].size_bytes);
    EXPECT_GT(draco[i].ciede2000_mean, draco[i - 1].ciede2000_mean);
  }
  for (const ColourPoint& p : measurement_->colours) {
    if (p.codec != kSubtractGreen || p.level != full_level()) continue;
    const auto plain =
        std::find_if(draco.begin(), draco.end(), [&](const auto& d) { return d.colour_bits == p.colour_bits; });
    EXPECT_EQ(p.ciede2000_mean, plain->ciede2000_mean) << "the same colours, written otherwise";
    EXPECT_NE(p.size_bytes, plain->size_bytes);
  }
  EXPECT_LT(draco.front().temperature_p95_celsius, 20 * 0.01) << "read back within one percent of the range";
}

TEST_F(Tradeoff, RecommendsMoreForFasterLinks) {
  const auto recommended = recommended_points(*measurement_, {0.05, 100});
  ASSERT_EQ(recommended.size(), 2U);
  const auto size = [](const Recommendation& r) { return r.geometry.size_bytes + r.colours.size_bytes; };
  EXPECT_LE(size(recommended[0]), size(recommended[1]));
  EXPECT_LE(recommended[1].parameter_change_s, 0.5);
  for (const auto& r : recommended) EXPECT_EQ(r.colours.codec, kSubtractGreen);
}

TEST_F(Tradeoff, CoarserRawTemperaturesCostLessAndAreOffByHalfAStepAtMost) {
  const auto& raw = measurement_->raw;
  ASSERT_EQ(raw.size(), TradeoffOptions().temperature_steps_celsius.size());
  for (std::size_t i = 0; i < raw.size(); ++i) {
    EXPECT_GT(raw[i].visible_bytes, 0U);
    // 20 degC in 32-bit floats are exact to some millionths.
    EXPECT_LE(raw[i].temperature_worst_celsius, raw[i].temperature_step_celsius / 2 + 1e-5);
    EXPECT_GT(raw[i].temperature_worst_celsius, raw[i].temperature_step_celsius / 8);
    if (i == 0) continue;
    EXPECT_LT(raw[i].temperature_bytes, raw[i - 1].temperature_bytes);
    EXPECT_EQ(raw[i].visible_bytes, raw[i - 1].visible_bytes);
    EXPECT_GE(raw[i].levels_mean, raw[i - 1].levels_mean);
  }
  EXPECT_LT(raw.front().levels_p95, 2);
  EXPECT_GT(raw.back().levels_p95, 1);
}

TEST_F(Tradeoff, TellsFromWhichChangeOnRawLayersAreCheaper) {
  RawPoint raw;
  ColourPoint change;
  raw.temperature_bytes = 100;
  raw.visible_bytes = 99;
  change.size_bytes = 100;
  EXPECT_EQ(break_even(raw, change), 2U) << "two changes cost 200 bytes, one 100";
  raw.visible_bytes = 100;
  EXPECT_EQ(break_even(raw, change), 3U) << "two changes cost as much";
  EXPECT_EQ(full_change(*measurement_).level, full_level());
  EXPECT_EQ(full_change(*measurement_).colour_bits, 8);
}

TEST_F(Tradeoff, ReportsRawLayersForEveryLink) {
  const std::string csv = raw_csv(*measurement_);
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n') - 1, 4 * 4);
  EXPECT_NE(raw_text(*measurement_).find("cheaper from change"), std::string::npos);
  TradeoffMeasurement without = *measurement_;
  without.raw.clear();
  EXPECT_EQ(raw_text(without), "");
  EXPECT_EQ(report_html(without, {}).find("Raw layers"), std::string::npos);
}

TEST_F(Tradeoff, ReportsEveryPointAndEscapesNames) {
  const std::string csv = grid_csv(*measurement_);
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n') - 1,
            std::count_if(measurement_->geometry.begin(), measurement_->geometry.end(), [](const auto& p) {
              return p.codec == "draco";
            }) * 10);
  const std::string html = report_html(*measurement_, recommended_points(*measurement_, {5}));
  EXPECT_NE(html.find("wavy &lt;square&gt;"), std::string::npos);
  EXPECT_EQ(html.find("nan"), std::string::npos);
  EXPECT_EQ(html.find("http"), std::string::npos) << "self-contained";
}

}  // namespace
}  // namespace spectra::tradeoff
