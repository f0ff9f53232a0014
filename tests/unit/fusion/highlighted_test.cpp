#include <gtest/gtest.h>

#include <cstdint>
#include <limits>

#include "fusion/registry.hpp"
#include "tests/unit/fusion/scene.hpp"

namespace spectra::fusion {

bool operator==(const TemperatureInterval& a, const TemperatureInterval& b) {
  return a.low == b.low && a.high == b.high;
}
void PrintTo(const TemperatureInterval& interval, std::ostream* out) {
  *out << "[" << interval.low << ", " << interval.high << "]";
}

namespace {

using Intervals = std::vector<TemperatureInterval>;
using test::scene_of;
using test::settings_with;

Intervals highlighted(const std::string& method, ParameterValues params, std::vector<float> temperature) {
  return FusionPlan::prepare(settings_with(method, std::move(params)), scene_of(std::move(temperature)))
      .value()
      .highlighted();
}

TEST(Highlighted, MethodsThatTreatAllTemperaturesAlikeHaveNone) {
  std::vector<float> temperature(40, 20.0F);
  temperature.insert(temperature.end(), {10, 40});
  for (const Method* method : all_methods()) {
    EXPECT_EQ(highlighted(method->id, {}, temperature).empty(), !method->highlights || method->compares_with_baseline)
        << method->id;
  }
}

TEST(Highlighted, ThresholdsReachToTheExtremes) {
  EXPECT_EQ(highlighted("colour_mapped_threshold", {{"threshold", 25.0}}, {10, 30}), (Intervals{{25, 30}}));
  EXPECT_EQ(highlighted("monochrome_threshold", {{"threshold", 25.0}, {"invert", true}}, {10, 30}),
            (Intervals{{10, 25}}));
  EXPECT_EQ(highlighted("colour_mapped_threshold", {{"threshold", 5.0}}, {10, 30}), (Intervals{{10, 30}}));
  EXPECT_TRUE(highlighted("colour_mapped_threshold", {{"threshold", 30.0}}, {10, 30}).empty());
}

TEST(Highlighted, AnExtremeStandsForWhatIsBeyondTheSensorsRangeWhereThatAloneIs) {
  constexpr float kBeyond = std::numeric_limits<float>::infinity();
  // Mean 20, sigma 2: 1.5 sigma reach beyond both extremes.
  EXPECT_TRUE(highlighted("histogram_distribution", {}, {18, 22}).empty());
  EXPECT_EQ(highlighted("histogram_distribution", {}, {18, 22, -kBeyond}), (Intervals{{18, 18}}));
  EXPECT_EQ(highlighted("histogram_distribution", {}, {18, 22, kBeyond, -kBeyond}), (Intervals{{18, 18}, {22, 22}}));
  EXPECT_TRUE(highlighted("histogram_distribution", {{"invert", true}}, {18, 22, kBeyond}).size() == 1);
  EXPECT_EQ(highlighted("colour_mapped_threshold", {{"threshold", 25.0}}, {18, 22, kBeyond, -kBeyond}),
            (Intervals{{22, 22}}));
  EXPECT_EQ(highlighted("colour_mapped_threshold", {{"threshold", 20.0}}, {18, 22, kBeyond}), (Intervals{{20, 22}}));
}

TEST(Highlighted, HighlightingHasOneIntervalPerSide) {
  const std::vector<float> temperature = {10, 30};
  EXPECT_EQ(highlighted("thermal_highlighting", {{"low", 15.0}, {"high", 25.0}}, temperature),
            (Intervals{{10, 15}, {25, 30}}));
  EXPECT_EQ(highlighted("thermal_highlighting", {{"high", 25.0}, {"sides", std::string("hot")}}, temperature),
            (Intervals{{25, 30}}));
  EXPECT_EQ(highlighted("thermal_highlighting", {{"low", 15.0}, {"sides", std::string("cold")}}, temperature),
            (Intervals{{10, 15}}));
}

TEST(Highlighted, NeighbouringBinsBecomeOneInterval) {
  // Four bins of [0, 8]: counts 1, 1, 3, 1.
  const std::vector<float> temperature = {0, 2, 4, 4.5, 5, 8};
  const ParameterValues three = {{"bins", std::int64_t{4}}, {"n", std::int64_t{3}}};
  EXPECT_EQ(highlighted("histogram_bin", three, temperature), (Intervals{{0, 4}, {6, 8}}));
  const ParameterValues commonest = {{"bins", std::int64_t{4}}, {"n", std::int64_t{1}}, {"invert", true}};
  EXPECT_EQ(highlighted("histogram_bin", commonest, temperature), (Intervals{{4, 6}}));
  const ParameterValues tied = {{"bins", std::int64_t{4}}, {"n", std::int64_t{1}}, {"ties", std::string("all")}};
  EXPECT_EQ(highlighted("histogram_bin", tied, temperature), (Intervals{{0, 4}, {6, 8}}));
  const ParameterValues none = {{"bins", std::int64_t{4}}, {"n", std::int64_t{0}}, {"ties", std::string("all")}};
  EXPECT_TRUE(highlighted("histogram_bin", none, temperature).empty());
}

TEST(Highlighted, DistributionIsOutsideOrInside) {
  const std::vector<float> temperature = {2, 4, 4, 4, 5, 5, 7, 9};  // mean 5, sigma 2
  EXPECT_EQ(highlighted("histogram_distribution", {{"k", 1.0}}, temperature), (Intervals{{2, 3}, {7, 9}}));
  EXPECT_EQ(highlighted("histogram_distribution", {{"k", 1.75}}, temperature), (Intervals{{8.5, 9}}));
  EXPECT_EQ(highlighted("histogram_distribution", {{"k", 1.0}, {"invert", true}}, temperature), (Intervals{{3, 7}}));
}

TEST(Mark, TellsVerticesThatAreHighlightedFromOthersAndFromMissingOnes) {
  constexpr float kInfinite = std::numeric_limits<float>::infinity();
  const std::vector<float> temperature = {10,        24,        26, 30, std::numeric_limits<float>::quiet_NaN(),
                                          kInfinite, -kInfinite};
  const auto marks = [&](const std::string& method, ParameterValues params, std::optional<RangeSetting> range = {}) {
    // What is missing has a colour of its own, and is not highlighted by that.
    const auto plan =
        FusionPlan::prepare(settings_with(method, std::move(params), range, MissingDisplay(base::Rgb8{255, 0, 0})),
                            scene_of(temperature))
            .value();
    std::vector<std::uint8_t> marked(temperature.size(), 7);
    plan.mark(temperature, {}, marked);
    EXPECT_EQ(plan.highlights(), find_method(method)->highlights);
    return marked;
  };
  using Marks = std::vector<std::uint8_t>;
  EXPECT_EQ(marks("colour_mapped_threshold", {{"threshold", 25.0}}), (Marks{0, 0, 1, 1, 0, 1, 0}));
  EXPECT_EQ(marks("colour_mapped_threshold", {{"threshold", 25.0}, {"invert", true}}), (Marks{1, 1, 0, 0, 0, 0, 1}));
  EXPECT_EQ(marks("colour_mapped_threshold", {{"threshold", 25.0}}, RangeSetting::manual(26.5, 27)),
            (Marks{0, 0, 1, 1, 0, 1, 0}))
      << "the range of the palette is another matter";
  EXPECT_EQ(marks("thermal_highlighting", {{"low", 15.0}, {"high", 25.0}}), (Marks{1, 0, 1, 1, 0, 1, 1}));
  EXPECT_EQ(marks("thermal_visible_blend", {}), (Marks{0, 0, 0, 0, 0, 0, 0}));
}

TEST(Mark, OfChangesAsksTheBaseline) {
  const std::vector<float> temperature = {20, 20, 20, 20};
  const std::vector<float> baseline = {20, 19, 21, std::numeric_limits<float>::quiet_NaN()};
  const auto plan = FusionPlan::prepare(settings_with("thermal_change"), scene_of(temperature)).value();
  std::vector<std::uint8_t> marked(4);
  plan.mark(temperature, baseline, marked);
  EXPECT_EQ(marked, (std::vector<std::uint8_t>{0, 1, 1, 0}));
  plan.mark(temperature, {}, marked);
  EXPECT_EQ(marked, (std::vector<std::uint8_t>{0, 0, 0, 0})) << "without a baseline nothing has changed";
}

}  // namespace
}  // namespace spectra::fusion
