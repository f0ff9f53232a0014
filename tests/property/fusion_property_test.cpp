#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <thread>

#include "fusion/registry.hpp"
#include "tests/property/generators.hpp"
#include "tests/property/instruction_sets.hpp"
#include "tests/property/reference.hpp"

namespace spectra::fusion {
namespace {

using test::Case;
using test::FusionReference;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

/// Every property holds for every registered method.
class EveryMethod : public testing::TestWithParam<const fusion::Method*> {};

/// The registered methods that make a promise.
std::vector<const fusion::Method*> methods_that(bool fusion::Method::*promise) {
  std::vector<const fusion::Method*> methods;
  for (const fusion::Method* method : fusion::all_methods()) {
    if (method->*promise) methods.push_back(method);
  }
  return methods;
}

std::string id_of(const testing::TestParamInfo<const fusion::Method*>& one) {
  return one.param->id;
}

INSTANTIATE_TEST_SUITE_P(Fusion, EveryMethod,
                         testing::ValuesIn(std::vector<const fusion::Method*>(fusion::all_methods().begin(),
                                                                              fusion::all_methods().end())),
                         id_of);

/// The plan of a case, or nothing when low and high contradict each other.
std::optional<fusion::FusionPlan> plan_of(const Case& one) {
  auto plan = fusion::FusionPlan::prepare(one.settings, one.facts(), one.palette);
  if (plan.has_value()) return plan.value();
  RC_ASSERT(plan.error().code == base::ErrorCode::Inconsistent);
  return std::nullopt;
}

/// The exact answer for a case; a hue that follows the scene and percentiles are those of the plan.
FusionReference reference_of(const Case& one, const fusion::FusionPlan& plan) {
  fusion::FusionSettings settings = one.settings;
  if (settings.params.contains("hue")) settings.params["hue"] = plan.params_in_force().at("hue");
  if (settings.range.mode == fusion::RangeMode::Percentile) {
    settings.range = fusion::RangeSetting::manual(plan.range_minimum(), plan.range_maximum());
  }
  return {settings, one.palette, one.facts().summary, one.temperature};
}

std::vector<base::Rgb8> fused(const fusion::FusionPlan& plan, const base::VertexValues& vertices) {
  std::vector<base::Rgb8> result(vertices.visible.size());
  plan.fuse(vertices, result);
  return result;
}

FusionReference::Colour exact_of(const FusionReference& reference, const Case& one, std::size_t i) {
  return reference.fused(one.temperature[i], one.visible[i],
                         one.baseline.empty() ? std::numeric_limits<float>::quiet_NaN() : one.baseline[i],
                         one.freshness.empty() ? std::uint8_t{8} : one.freshness[i]);
}

std::array<std::uint8_t, 3> channels(base::Rgb8 colour) {
  return {colour.r, colour.g, colour.b};
}

TEST_P(EveryMethod, EqualsTheExactAnswer) {
  EXPECT_TRUE(rc::check([this] {
    const Case one = *test::cases(*GetParam());
    const auto plan = plan_of(one);
    if (!plan) return;
    const auto answer = fused(*plan, one.values());
    const FusionReference reference = reference_of(one, *plan);
    for (std::size_t i = 0; i < answer.size(); ++i) {
      const auto exact = exact_of(reference, one, i);
      for (std::size_t c = 0; c < 3; ++c) {
        if (test::within_accuracy(channels(answer[i])[c], exact[c])) continue;
        RC_LOG() << "vertex " << i << " channel " << c << " at " << std::hexfloat << one.temperature[i] << ": "
                 << std::defaultfloat << int{channels(answer[i])[c]} << " for " << static_cast<double>(exact[c]);
        RC_FAIL("outside the promised accuracy");
      }
    }
  }));
}

TEST_P(EveryMethod, EveryInstructionSetGivesTheSameBytes) {
  EXPECT_TRUE(rc::check([this] {
    const Case one = *test::cases(*GetParam());
    std::optional<std::vector<base::Rgb8>> first;
    for (const std::int64_t target : test::instruction_sets()) {
      const test::UsingInstructionSet use(target);
      const auto plan = plan_of(one);
      if (!plan) return;
      const auto answer = fused(*plan, one.values());
      if (!first) first = answer;
      RC_ASSERT(answer == *first);
    }
  }));
}

TEST_P(EveryMethod, EveryLengthGivesTheSameBytes) {
  const Case one = [this] {
    Case room;
    std::mt19937 engine(5);
    std::uniform_real_distribution<float> celsius(15, 40);
    for (int i = 0; i < 600; ++i) {
      room.temperature.push_back(i % 11 ? celsius(engine) : std::numeric_limits<float>::quiet_NaN());
      const auto bits = static_cast<std::uint32_t>(engine());
      room.visible.push_back({static_cast<std::uint8_t>(bits), static_cast<std::uint8_t>(bits >> 8),
                              static_cast<std::uint8_t>(bits >> 16)});
      room.baseline.push_back(i % 7 ? celsius(engine) : std::numeric_limits<float>::quiet_NaN());
      room.freshness.push_back(static_cast<std::uint8_t>(i < 300 ? 8 : engine() % 9));
    }
    fusion::FusionChange change;
    change.method = GetParam()->id;
    room.settings = fusion::with_change(fusion::default_settings(), change).value();
    room.palette = fusion::find_palette("iron")->table;
    return room;
  }();
  for (const std::int64_t target : test::instruction_sets()) {
    const test::UsingInstructionSet use(target);
    const fusion::FusionPlan plan = fusion::FusionPlan::prepare(one.settings, one.facts(), one.palette).value();
    const auto whole = fused(plan, one.values());
    for (std::size_t length = 0; length <= one.temperature.size(); ++length) {
      const base::VertexValues last = one.values().subspan(one.temperature.size() - length, length);
      // One colour more than is asked for, to see that nothing is written behind the end.
      std::vector<base::Rgb8> answer(length + 1, base::Rgb8{1, 2, 3});
      plan.fuse(last, std::span(answer).first(length));
      ASSERT_EQ(answer.back(), (base::Rgb8{1, 2, 3})) << test::name_of(target) << " " << length;
      ASSERT_TRUE(std::equal(answer.begin(), answer.end() - 1, whole.end() - static_cast<std::ptrdiff_t>(length)))
          << test::name_of(target) << " " << length;
    }
  }
}

TEST_P(EveryMethod, FusingInPlaceIsAllowed) {
  EXPECT_TRUE(rc::check([this] {
    Case one = *test::cases(*GetParam());
    const auto plan = plan_of(one);
    if (!plan) return;
    const auto answer = fused(*plan, one.values());
    plan->fuse(one.values(), one.visible);
    RC_ASSERT(one.visible == answer);
  }));
}

TEST_P(EveryMethod, ThreadsAndSplitsGiveTheSameBytes) {
  EXPECT_TRUE(rc::check([this] {
    const Case one = *test::cases(*GetParam());
    const auto plan = plan_of(one);
    if (!plan) return;
    const auto whole = fused(*plan, one.values());
    std::vector<base::Rgb8> pieces(whole.size());
    std::vector<std::thread> threads;
    const std::size_t count = *rc::gen::inRange<std::size_t>(1, 5);
    const std::size_t piece = whole.size() / count + 1;
    for (std::size_t begin = 0; begin < whole.size(); begin += piece) {
      const std::size_t size = std::min(piece, whole.size() - begin);
      threads.emplace_back(
          [&, begin, size] { plan->fuse(one.values().subspan(begin, size), std::span(pieces).subspan(begin, size)); });
    }
    for (std::thread& thread : threads) thread.join();
    RC_ASSERT(pieces == whole);
  }));
}

TEST_P(EveryMethod, PermutingVerticesPermutesColours) {
  EXPECT_TRUE(rc::check([this] {
    const Case one = *test::cases(*GetParam());
    const auto plan = plan_of(one);
    if (!plan) return;
    const auto answer = fused(*plan, one.values());
    std::vector<std::size_t> order(answer.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::shuffle(order.begin(), order.end(), std::mt19937(*rc::gen::arbitrary<std::uint32_t>()));
    Case moved = one;
    for (std::size_t i = 0; i < order.size(); ++i) {
      moved.temperature[i] = one.temperature[order[i]];
      moved.visible[i] = one.visible[order[i]];
      if (!one.baseline.empty()) moved.baseline[i] = one.baseline[order[i]];
      if (!one.freshness.empty()) moved.freshness[i] = one.freshness[order[i]];
    }
    // The facts of the scene are gathered anew: they must not depend on the order either.
    const auto again = fused(plan_of(moved).value(), moved.values());
    for (std::size_t i = 0; i < order.size(); ++i) RC_ASSERT(again[i] == answer[order[i]]);
  }));
}

TEST_P(EveryMethod, AnyBitsAsTemperatureAreAllowedBesideTheScene) {
  // The plan is made for one scene and given the vertices of another.
  EXPECT_TRUE(rc::check([this] {
    const Case one = *test::cases(*GetParam());
    const auto plan = plan_of(one);
    if (!plan) return;
    const auto foreign = *rc::gen::container<std::vector<std::uint32_t>>(rc::gen::arbitrary<std::uint32_t>());
    std::vector<float> temperature;
    for (const std::uint32_t bits : foreign) temperature.push_back(std::bit_cast<float>(bits));
    const auto visible = *test::colours(temperature.size());
    const auto answer = fused(*plan, {temperature, visible, temperature});
    for (std::size_t i = 0; i < answer.size(); ++i) {
      if (!std::isnan(temperature[i]) || !GetParam()->needs_temperature) continue;
      RC_ASSERT(answer[i] == one.settings.missing.value_or(visible[i]));
    }
  }));
}

TEST_P(EveryMethod, AlphaZeroIsVisibleAndAlphaOneIsThermal) {
  const auto& parameters = GetParam()->parameters;
  const bool has_alpha =
      std::any_of(parameters.begin(), parameters.end(), [](const fusion::Parameter& p) { return p.name == "alpha"; });
  if (!has_alpha) GTEST_SKIP() << GetParam()->id << " has no alpha";
  EXPECT_TRUE(rc::check([this] {
    Case one = *test::cases(*GetParam());
    one.freshness.clear();
    one.settings.missing.reset();
    one.settings.params["alpha"] = 0.0;
    RC_ASSERT(fused(plan_of(one).value(), one.values()) == one.visible);
    if (!GetParam()->uses_palette) return;
    one.settings.params["alpha"] = 1.0;
    const auto answer = fused(plan_of(one).value(), one.values());
    fusion::FusionChange change;
    change.method = "thermal_only";
    Case thermal = one;
    thermal.settings = fusion::with_change(one.settings, change).value();
    if (GetParam()->compares_with_baseline) {
      // The palette is that of the changes.
      const double span = std::get<double>(one.settings.params.at("span"));
      thermal.settings.range = fusion::RangeSetting::manual(-span, span);
      thermal.baseline.resize(one.temperature.size(), kNan);
      for (std::size_t i = 0; i < one.temperature.size(); ++i) thermal.temperature[i] -= thermal.baseline[i];
    }
    const auto colours = fused(plan_of(thermal).value(), thermal.values());
    for (std::size_t i = 0; i < answer.size(); ++i) {
      RC_ASSERT(answer[i] == colours[i] || answer[i] == one.visible[i]);
    }
  }));
}

/// A scene of whole multiples of 1/64 degC, which can be shifted by 256 and doubled without any rounding.
Case exact_case(const fusion::Method& method) {
  Case one;
  one.temperature = *rc::gen::nonEmpty(rc::gen::container<std::vector<float>>(rc::gen::map(
      rc::gen::inRange(0, 64 * 100), [](int sixty_fourths) { return static_cast<float>(sixty_fourths) / 64; })));
  one.visible = *test::colours(one.temperature.size());
  one.settings = *test::settings_of(method, one.temperature);
  one.settings.range = {};
  for (const fusion::Parameter& parameter : method.parameters) {
    if (parameter.kind == fusion::ParameterKind::Temperature) one.settings.params[parameter.name] = fusion::Automatic{};
  }
  one.palette = *test::palettes();
  return one;
}

TEST_P(EveryMethod, UnitsLeavePixelsAlone) {
  EXPECT_TRUE(rc::check([this] {
    const Case celsius = exact_case(*GetParam());
    const auto answer = fused(plan_of(celsius).value(), celsius.values());
    // A change is a number of kelvin, and there is no baseline here: what it shows is tried elsewhere.
    if (GetParam()->compares_with_baseline) return;
    Case doubled = celsius;
    for (float& value : doubled.temperature) value *= 2;
    RC_ASSERT(fused(plan_of(doubled).value(), doubled.values()) == answer);
    // A shift rounds mean and sigma anew, which may move a vertex that lies exactly on the border.
    if (GetParam()->id == "histogram_distribution") return;
    Case shifted = celsius;
    for (float& value : shifted.temperature) value += 256;
    const fusion::FusionPlan shifted_plan = plan_of(shifted).value();
    const FusionReference reference = reference_of(shifted, shifted_plan);
    const auto moved = fused(shifted_plan, shifted.values());
    for (std::size_t i = 0; i < answer.size(); ++i) {
      const auto exact = exact_of(reference, shifted, i);
      for (std::size_t c = 0; c < 3; ++c) RC_ASSERT(test::within_accuracy(channels(answer[i])[c], exact[c]));
      for (std::size_t c = 0; c < 3; ++c) RC_ASSERT(test::within_accuracy(channels(moved[i])[c], exact[c]));
    }
  }));
}

/// A palette and visible colours that cannot be mistaken for each other, so that a highlight can be seen.
Case telling_case(const fusion::Method& method) {
  Case one = *test::cases(method);
  one.settings.missing.reset();
  one.freshness.clear();
  for (auto& row : one.palette) row = {250, 10, 10};
  one.visible.assign(one.temperature.size(), base::Rgb8{0, 200, 100});
  if (one.settings.params.contains("alpha")) one.settings.params["alpha"] = 1.0;
  return one;
}

std::vector<bool> highlighted(const Case& one) {
  const auto answer = fused(plan_of(one).value(), one.values());
  std::vector<bool> flags;
  for (const base::Rgb8 colour : answer) flags.push_back(colour != base::Rgb8{0, 200, 100});
  return flags;
}

class InvertibleMethod : public testing::TestWithParam<const fusion::Method*> {};
INSTANTIATE_TEST_SUITE_P(Fusion, InvertibleMethod, testing::ValuesIn(methods_that(&fusion::Method::invert_complements)),
                         id_of);

TEST_P(InvertibleMethod, InvertComplementsExceptOnTheThreshold) {
  EXPECT_TRUE(rc::check([this] {
    Case one = telling_case(*GetParam());
    // Automatic thresholds are others when inverted.
    std::vector<float> thresholds;
    for (const fusion::Parameter& parameter : GetParam()->parameters) {
      if (parameter.kind != fusion::ParameterKind::Temperature) continue;
      const int threshold = *rc::gen::inRange(-50, 500);
      one.settings.params[parameter.name] = double(threshold);
      thresholds.push_back(static_cast<float>(threshold));
    }
    one.settings.params["invert"] = false;
    const auto plain = highlighted(one);
    one.settings.params["invert"] = true;
    const auto inverted = highlighted(one);
    // Where nothing is unusual a method that knows no threshold highlights neither.
    const bool nothing_is_unusual = thresholds.empty() && !(one.facts().summary.sigma > 0);
    for (std::size_t i = 0; i < plain.size(); ++i) {
      const float t = one.temperature[i];
      bool on_threshold = std::ranges::find(thresholds, t) != thresholds.end();
      bool is_known = !std::isnan(t);
      if (GetParam()->compares_with_baseline) {
        const float change = one.baseline.empty() ? kNan : t - one.baseline[i];
        is_known = !std::isnan(change);
        on_threshold = std::fabs(change) == static_cast<float>(std::get<double>(one.settings.params.at("threshold")));
      }
      const bool either = is_known && !on_threshold && (GetParam()->compares_with_baseline || !nothing_is_unusual);
      RC_ASSERT(plain[i] + inverted[i] == (either ? 1 : 0));
    }
  }));
}

TEST(Promises, AMethodWithoutHighlightsOfTemperaturesHasNoIntervals) {
  for (const fusion::Method* method : fusion::all_methods()) {
    if (method->highlights && !method->compares_with_baseline) continue;
    EXPECT_TRUE(rc::check([method] {
      const auto plan = plan_of(*test::cases(*method));
      RC_ASSERT(!plan || plan->highlighted().empty());
    })) << method->id;
  }
}

TEST(Promises, EveryMethodThatMakesAPromiseIsTried) {
  EXPECT_GE(methods_that(&fusion::Method::highlights).size(), 5U);
  EXPECT_GE(methods_that(&fusion::Method::invert_complements).size(), 3U);
  EXPECT_GE(methods_that(&fusion::Method::hotter_is_lighter).size(), 5U);
}

TEST(HighlightedIntervals, HoldEveryHighlightedTemperature) {
  for (const fusion::Method* method : methods_that(&fusion::Method::highlights)) {
    if (method->compares_with_baseline) continue;
    EXPECT_TRUE(rc::check([method] {
      const Case one = telling_case(*method);
      const auto plan = plan_of(one);
      if (!plan) return;
      const auto answer = fused(*plan, one.values());
      const auto& intervals = plan->highlighted();
      for (std::size_t i = 0; i + 1 < intervals.size(); ++i) {
        RC_ASSERT(intervals[i].high < intervals[i + 1].low || intervals[i].high == intervals[i + 1].low);
      }
      const fusion::TemperatureSummary data = one.facts().summary;
      const double tolerance = 1e-6 * (std::abs(double{data.minimum}) + std::abs(double{data.maximum}));
      for (const fusion::TemperatureInterval& interval : intervals) {
        RC_ASSERT(interval.low <= interval.high);
        RC_ASSERT(interval.low >= double{data.minimum} && interval.high <= double{data.maximum});
      }
      for (std::size_t i = 0; i < answer.size(); ++i) {
        // The axis has no place for what is infinite.
        if (answer[i] == one.visible[i] || std::isinf(one.temperature[i])) continue;
        const double t = double{one.temperature[i]};
        RC_ASSERT(std::any_of(intervals.begin(), intervals.end(), [&](const fusion::TemperatureInterval& interval) {
          return t >= interval.low - tolerance && t <= interval.high + tolerance;
        }));
      }
    })) << method->id;
  }
}

/// Indices of the vertices with a temperature, coldest first.
std::vector<std::size_t> by_temperature(const Case& one) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < one.temperature.size(); ++i) {
    if (!std::isnan(one.temperature[i])) order.push_back(i);
  }
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return one.temperature[a] < one.temperature[b]; });
  return order;
}

TEST(Monotone, HotterIsNeverDarkerWhereTheEquationsSaySo) {
  for (const fusion::Method* method : methods_that(&fusion::Method::hotter_is_lighter)) {
    EXPECT_TRUE(rc::check([method] {
      Case one = *test::cases(*method);
      one.freshness.clear();
      one.palette = fusion::find_palette("white_hot")->table;
      one.visible.assign(one.temperature.size(), (*test::colours(1))[0]);
      if (one.settings.params.contains("sides")) {
        // Beyond the hot threshold the palette lightens what is black.
        one.settings.params["sides"] = std::string("hot");
        one.visible.assign(one.temperature.size(), base::Rgb8{0, 0, 0});
      }
      const auto answer = fused(plan_of(one).value(), one.values());
      const auto order = by_temperature(one);
      for (std::size_t i = 1; i < order.size(); ++i) {
        const auto colder = channels(answer[order[i - 1]]);
        const auto hotter = channels(answer[order[i]]);
        for (std::size_t c = 0; c < 3; ++c) RC_ASSERT(hotter[c] >= colder[c]);
      }
    })) << method->id;
  }
}

TEST(IntensityHue, KeepsTheHueOfThePalette) {
  EXPECT_TRUE(rc::check([] {
    Case one = *test::cases(*fusion::find_method("intensity_hue"));
    one.freshness.clear();
    fusion::FusionChange change;
    change.method = "thermal_only";
    const fusion::FusionPlan plan = plan_of(one).value();
    Case thermal = one;
    thermal.settings = fusion::with_change(one.settings, change).value();
    const FusionReference reference = reference_of(thermal, plan);
    const auto answer = fused(plan, one.values());
    for (std::size_t i = 0; i < answer.size(); ++i) {
      if (std::isnan(one.temperature[i])) continue;
      // HSV hue is where the middle channel lies between the others; F = M + L (255 - M) and M + L M keep that.
      const auto m = exact_of(reference, one, i);
      const auto f = channels(answer[i]);
      const auto [m_low, m_high] = std::minmax_element(m.begin(), m.end());
      const auto [f_low, f_high] = std::minmax_element(f.begin(), f.end());
      const double m_span = static_cast<double>(*m_high - *m_low);
      const double f_span = static_cast<double>(*f_high - *f_low);
      if (m_span < 1) continue;
      for (std::size_t c = 0; c < 3; ++c) {
        const double m_place = static_cast<double>(m[c] - *m_low) / m_span;
        // Three rounded channels: each within 0.5 level, and a little for the arithmetic.
        RC_ASSERT(std::abs(m_place * f_span - (double(f[c]) - double(*f_low))) <= 2.01);
      }
    }
  }));
}

TEST(Statistics, MatchExtendedPrecisionForAnyOrderAndSplit) {
  EXPECT_TRUE(rc::check([] {
    const auto values = *test::temperatures();
    fusion::TemperatureAccumulator whole;
    whole.add(values);
    fusion::TemperatureAccumulator merged;
    const std::size_t piece = *rc::gen::inRange<std::size_t>(1, 300);
    for (std::size_t end = values.size(); end > 0;) {
      const std::size_t begin = end > piece ? end - piece : 0;
      fusion::TemperatureAccumulator part;
      part.add(std::span(values).subspan(begin, end - begin));
      merged.merge(part);
      end = begin;
    }
    const fusion::TemperatureSummary a = whole.summary();
    const fusion::TemperatureSummary b = merged.summary();
    RC_ASSERT(a.mean == b.mean && a.sigma == b.sigma && a.minimum == b.minimum && a.maximum == b.maximum);
    RC_ASSERT(a.finite_count == b.finite_count && a.missing_count == b.missing_count);
    RC_ASSERT(a.over_range_count == b.over_range_count && a.under_range_count == b.under_range_count);
    const auto count_of = [&](auto is) { return static_cast<std::uint64_t>(std::ranges::count_if(values, is)); };
    RC_ASSERT(a.missing_count == count_of([](float v) { return std::isnan(v); }));
    RC_ASSERT(a.over_range_count == count_of([](float v) { return std::isinf(v) && v > 0; }));
    RC_ASSERT(a.under_range_count == count_of([](float v) { return std::isinf(v) && v < 0; }));
    RC_ASSERT(a.finite_count + a.missing_count + a.over_range_count + a.under_range_count == values.size());
    if (!a.has_temperature()) return;
    long double largest = 0;
    long double sum = 0;
    for (const float v : values) {
      if (std::isfinite(v)) sum += v;
      if (std::isfinite(v)) largest = std::max(largest, std::fabs(static_cast<long double>(v)));
    }
    const long double mean = sum / static_cast<long double>(a.finite_count);
    long double squares = 0;
    for (const float v : values) {
      if (std::isfinite(v)) squares += (v - mean) * (v - mean);
    }
    const long double sigma = std::sqrt(squares / static_cast<long double>(a.finite_count));
    RC_ASSERT(std::fabs(static_cast<long double>(a.mean) - mean) <= 1e-14L * largest);
    RC_ASSERT(std::fabs(static_cast<long double>(a.sigma) - sigma) <= 1e-12L * sigma + 1e-16L * largest);
    RC_ASSERT(a.mean >= double{a.minimum} && a.mean <= double{a.maximum});
  }));
}

TEST(Statistics, HistogramFollowsTheFormulaOnEveryInstructionSet) {
  EXPECT_TRUE(rc::check([] {
    const auto values = *test::temperatures();
    fusion::TemperatureAccumulator accumulator;
    accumulator.add(values);
    const fusion::TemperatureSummary summary = accumulator.summary();
    const auto bins = *rc::gen::oneOf(rc::gen::inRange<std::size_t>(1, 100), rc::gen::inRange<std::size_t>(1, 4097));
    std::vector<std::uint64_t> expected(bins);
    const double low = double{summary.minimum};
    const double high = double{summary.maximum};
    for (const float value : values) {
      if (!std::isfinite(value)) continue;
      const double position = low == high ? 0 : std::floor((double{value} - low) / (high - low) * double(bins));
      ++expected[static_cast<std::size_t>(std::min(position, double(bins) - 1))];
    }
    for (const std::int64_t target : test::instruction_sets()) {
      const test::UsingInstructionSet use(target);
      fusion::Histogram histogram{summary.minimum, summary.maximum, std::vector<std::uint64_t>(bins)};
      fusion::add_to_histogram(values, histogram);
      RC_ASSERT(histogram.counts == expected);
    }
  }));
}

TEST(Range, APercentileIsWithinA4096thOfTheSpan) {
  EXPECT_TRUE(rc::check([] {
    Case one = *test::cases(*fusion::find_method("thermal_only"));
    const double low = *rc::gen::map(rc::gen::inRange(0, 500), [](int tenths) { return tenths / 10.0; });
    const double high = *rc::gen::map(rc::gen::inRange(501, 1001), [](int tenths) { return tenths / 10.0; });
    one.settings.range = fusion::RangeSetting::percentile(low, high);
    const fusion::FusionPlan plan = plan_of(one).value();
    std::vector<double> sorted;
    for (const float t : one.temperature) {
      if (std::isfinite(t)) sorted.push_back(double{t});
    }
    if (sorted.empty()) {
      RC_ASSERT(plan.range_minimum() == 0 && plan.range_maximum() == 0);
      return;
    }
    std::ranges::sort(sorted);
    const double tolerance = (sorted.back() - sorted.front()) / 4096 * 1.000001;
    // Any temperature with so many below it, and so many at or below it, will do.
    const auto holds = [&](double told, double percent) {
      const double wanted = percent / 100 * static_cast<double>(sorted.size());
      const auto below = static_cast<double>(std::ranges::lower_bound(sorted, told - tolerance) - sorted.begin());
      const auto up_to = static_cast<double>(std::ranges::upper_bound(sorted, told + tolerance) - sorted.begin());
      return below <= wanted && wanted <= up_to && told >= sorted.front() && told <= sorted.back();
    };
    RC_ASSERT(holds(plan.range_minimum(), low));
    RC_ASSERT(holds(plan.range_maximum(), high));
    RC_ASSERT(plan.range_minimum() <= plan.range_maximum());
    one.settings.range = fusion::RangeSetting::percentile(0, 100);
    const fusion::FusionPlan whole = plan_of(one).value();
    RC_ASSERT(whole.range_minimum() == sorted.front() && whole.range_maximum() == sorted.back());
  }));
}

TEST(Marks, AreWhereThePictureIsAnother) {
  for (const fusion::Method* method : fusion::all_methods()) {
    EXPECT_TRUE(rc::check([method] {
      const Case one = telling_case(*method);
      const auto plan = plan_of(one);
      if (!plan) return;
      const auto answer = fused(*plan, one.values());
      std::vector<std::uint8_t> marked(answer.size(), 7);
      plan->mark(one.temperature, one.baseline, marked);
      for (std::size_t i = 0; i < answer.size(); ++i) {
        RC_ASSERT(marked[i] == (method->highlights && answer[i] != one.visible[i] ? 1 : 0));
      }
    })) << method->id;
  }
}

TEST(ThermalChange, WithoutABaselineItShowsTheVisiblePicture) {
  EXPECT_TRUE(rc::check([] {
    Case one = *test::cases(*fusion::find_method("thermal_change"));
    one.baseline.clear();
    one.freshness.clear();
    one.settings.missing.reset();
    const fusion::FusionPlan plan = plan_of(one).value();
    RC_ASSERT(fused(plan, one.values()) == one.visible);
    const double span = std::get<double>(one.settings.params.at("span"));
    RC_ASSERT(plan.change_scale() && plan.change_scale()->minimum == -span && plan.change_scale()->maximum == span);
  }));
}

TEST(Age, WhatIsFreshIsTheSameByteForByteAndWhatIsOldestIsGrey) {
  for (const fusion::Method* method : fusion::all_methods()) {
    EXPECT_TRUE(rc::check([method] {
      Case one = *test::cases(*method);
      one.freshness.clear();
      const auto plan = plan_of(one);
      if (!plan) return;
      const auto without = fused(*plan, one.values());
      one.freshness.assign(one.temperature.size(), 8);
      RC_ASSERT(fused(*plan, one.values()) == without);
      one.freshness.assign(one.temperature.size(), 0);
      for (const base::Rgb8 colour : fused(*plan, one.values()))
        RC_ASSERT(colour.r == colour.g && colour.g == colour.b);
    })) << method->id;
  }
}

TEST(Age, FreshnessIsTheRoundedPower) {
  EXPECT_TRUE(rc::check([] {
    const double half_life_s = std::exp2(*rc::gen::inRange(0, 24));
    const fusion::AgeSteps steps(half_life_s);
    const double age_s = half_life_s * (*rc::gen::inRange(-1000, 8000) / 1000.0);
    const double exact = age_s > 0 ? 8 * std::exp2(-age_s / half_life_s) : 8;
    const int told = steps.freshness(age_s);
    const double to_tie = std::abs(exact - std::floor(exact) - 0.5);
    RC_ASSERT(std::abs(told - exact) <= 0.5 + 1e-9);
    RC_ASSERT(to_tie < 1e-9 || told == static_cast<int>(std::floor(exact + 0.5)));
    if (told > 0) {
      RC_ASSERT(steps.freshness(steps.last_age_s(static_cast<std::uint8_t>(told))) == told);
      RC_ASSERT(steps.freshness(std::nextafter(steps.last_age_s(static_cast<std::uint8_t>(told)), 1e300)) == told - 1);
    }
  }));
  const fusion::AgeSteps minute(60);
  EXPECT_EQ(minute.freshness(std::numeric_limits<double>::quiet_NaN()), 8);
  EXPECT_EQ(minute.freshness(std::numeric_limits<double>::infinity()), 0);
  EXPECT_EQ(minute.freshness(60), 4);
}

TEST(FusionProperty, AMillionEqualValuesWithOneOutlier) {
  Case one;
  one.temperature.assign(1'000'000, 21.5F);
  one.temperature[123'456] = 90.0F;
  one.visible.assign(one.temperature.size(), base::Rgb8{60, 70, 80});
  one.palette = fusion::find_palette("iron")->table;
  for (const fusion::Method* method : fusion::all_methods()) {
    fusion::FusionChange change;
    change.method = method->id;
    one.settings = fusion::with_change(fusion::default_settings(), change).value();
    const fusion::SceneTemperature facts = one.facts();
    const auto plan = fusion::FusionPlan::prepare(one.settings, facts, one.palette).value();
    const auto answer = fused(plan, one.values());
    const FusionReference reference = reference_of(one, plan);
    const auto ordinary = reference.fused(21.5F, one.visible[0], kNan, 8);
    const auto outlier = reference.fused(90.0F, one.visible[0], kNan, 8);
    for (std::size_t i = 0; i < answer.size(); ++i) {
      const auto& exact = i == 123'456 ? outlier : ordinary;
      for (std::size_t c = 0; c < 3; ++c) {
        ASSERT_TRUE(test::within_accuracy(channels(answer[i])[c], exact[c])) << method->id << " " << i;
      }
    }
  }
}

}  // namespace
}  // namespace spectra::fusion
