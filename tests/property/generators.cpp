#include "tests/property/generators.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <random>

namespace spectra::fusion::test {
namespace {

constexpr float kLargest = std::numeric_limits<float>::max();
constexpr float kStep = std::numeric_limits<float>::denorm_min();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

using Engine = std::mt19937_64;

float between(Engine& engine, float low, float high) {
  return std::uniform_real_distribution<float>(low, high)(engine);
}

template <class Make>
std::vector<float> filled(std::size_t count, Make make) {
  std::vector<float> values(count);
  for (float& value : values) value = make();
  return values;
}

std::vector<float> temperatures_of_kind(int kind, Engine& engine) {
  const std::size_t count = 1 + engine() % 700;
  const auto pick = [&](std::initializer_list<float> from) {
    return *(from.begin() + static_cast<std::ptrdiff_t>(engine() % from.size()));
  };
  switch (kind) {
    case 0:
      return {};
    case 1:
      return {between(engine, -50, 500)};
    case 2:
      return std::vector<float>(count, between(engine, -50, 500));
    case 3:
      return filled(count, [&] { return pick({kNan, kInfinity, -kInfinity}); });
    case 4:
      return filled(count, [&] { return std::bit_cast<float>(static_cast<std::uint32_t>(engine())); });
    case 5:
      return filled(count, [&] { return pick({kLargest, -kLargest, 3.4e38F, -3.4e38F, 0, 1, -1, 1e30F}); });
    case 6:
      return filled(count, [&] { return static_cast<float>(engine() % 9) * kStep; });
    case 7: {
      const float value = between(engine, -400, 400);
      return filled(count, [&] { return engine() % 2 ? value : std::nextafter(value, kInfinity); });
    }
    case 8:
      return filled(count, [&] { return between(engine, 299.9F, 300.1F); });
    case 9: {
      std::vector<float> values(count, 21.5F);
      values[engine() % count] = pick({90, -40, kLargest, 21.500002F});
      return values;
    }
    case 10: {
      // On the edges of 64 bins, and the neighbours of the edges.
      return filled(count, [&] {
        const float edge = 17.3F + static_cast<float>(engine() % 65) * (41.9F - 17.3F) / 64;
        return pick({edge, std::nextafter(edge, 0.0F), std::nextafter(edge, 100.0F), 17.3F, 41.9F});
      });
    }
    case 11:
      return filled(count, [&] {
        return engine() % 3 ? between(engine, 15, 40) : pick({kNan, kInfinity, -kInfinity});
      });
    case 12:
      return filled(count, [&] { return pick({kStep, -kStep, 1e-38F, 1.2e-38F, 0, -0.0F}); });
    case 13:
      return filled(count, [&] { return static_cast<float>(engine() % 40); });
    default:
      return filled(count, [&] { return between(engine, 15, 40); });
  }
}

/// Mostly near the temperatures, and everything else.
std::vector<float> baselines_of(const std::vector<float>& temperature, Engine& engine) {
  std::vector<float> baseline = temperature;
  for (float& value : baseline) {
    switch (engine() % 12) {
      case 0:
        value = kNan;
        break;
      case 1:
        value = engine() % 2 ? kInfinity : -kInfinity;
        break;
      case 2:
        value = std::bit_cast<float>(static_cast<std::uint32_t>(engine()));
        break;
      case 3:
        value += 0.5F;  // Just the usual threshold.
        break;
      case 4:
        break;
      default:
        value += between(engine, -8, 8);
        break;
    }
  }
  return baseline;
}

const char* const kKinds[] = {"none",     "one vertex", "uniform",     "all missing", "random bits",
                              "extremes", "subnormal",  "one step",    "kelvin",      "outlier",
                              "edges",    "mixed",      "tiny values", "whole",       "room"};

rc::Gen<double> number_within(double low, double high) {
  return rc::gen::map(rc::gen::inRange<std::int64_t>(0, 1'000'001),
                      [=](std::int64_t part) { return low + (high - low) * (static_cast<double>(part) / 1e6); });
}

}  // namespace

fusion::SceneTemperature Case::facts() const {
  fusion::TemperatureAccumulator accumulator;
  accumulator.add(temperature);
  fusion::SceneTemperature facts;
  facts.summary = accumulator.summary();
  facts.histogram = [values = temperature, summary = facts.summary](std::uint32_t bins) {
    fusion::Histogram histogram{summary.minimum, summary.maximum, std::vector<std::uint64_t>(bins)};
    fusion::add_to_histogram(values, histogram);
    return histogram;
  };
  facts.hues = [colours = visible] {
    fusion::Hues hues;
    fusion::add_to_hues(colours, hues);
    return hues;
  };
  return facts;
}

void showValue(const Case& one, std::ostream& out) {
  out << one.scene << ", " << one.temperature.size() << " vertices, " << fusion::cache_key(one.settings);
}

rc::Gen<std::vector<float>> temperatures() {
  return rc::gen::map(rc::gen::pair(rc::gen::inRange(0, 15), rc::gen::arbitrary<std::uint64_t>()),
                      [](const std::pair<int, std::uint64_t>& chosen) {
                        Engine engine(chosen.second);
                        return temperatures_of_kind(chosen.first, engine);
                      });
}

rc::Gen<std::vector<base::Rgb8>> colours(std::size_t count) {
  return rc::gen::map(rc::gen::arbitrary<std::uint64_t>(), [count](std::uint64_t seed) {
    Engine engine(seed);
    std::vector<base::Rgb8> result(count);
    for (base::Rgb8& colour : result) {
      const auto byte = [&] { return static_cast<std::uint8_t>(engine()); };
      switch (engine() % 8) {
        case 0:
          colour = {0, 0, 0};
          break;
        case 1:
          colour = {255, 255, 255};
          break;
        case 2: {
          const std::uint8_t grey = byte();
          colour = {grey, grey, grey};
          break;
        }
        default:
          colour = {byte(), byte(), byte()};
          break;
      }
    }
    return result;
  });
}

namespace {

rc::Gen<fusion::ParameterValue> value_that_is_set(const fusion::Parameter& parameter,
                                                  const std::vector<float>& temperature) {
  const auto boxed = [](auto value) { return fusion::ParameterValue{value}; };
  switch (parameter.kind) {
    case fusion::ParameterKind::Toggle:
      return rc::gen::map(rc::gen::arbitrary<bool>(), boxed);
    case fusion::ParameterKind::Choice:
      return rc::gen::map(rc::gen::elementOf(parameter.options),
                          [](const std::string& option) { return fusion::ParameterValue{option}; });
    case fusion::ParameterKind::Integer: {
      const auto low = static_cast<std::int64_t>(parameter.min);
      const auto high = static_cast<std::int64_t>(parameter.max);
      return rc::gen::map(rc::gen::oneOf(rc::gen::element(low, high), rc::gen::inRange(low, high + 1),
                                         rc::gen::inRange(low, std::min(high, low + 64) + 1)),
                          boxed);
    }
    case fusion::ParameterKind::Temperature: {
      std::vector<double> of_data = {0, 25, -1e30, 1e30, 1e300, -1e300};
      for (std::size_t i = 0; i < temperature.size() && i < 20; ++i) {
        if (std::isfinite(temperature[i])) of_data.push_back(double{temperature[i]});
      }
      return rc::gen::oneOf(rc::gen::map(number_within(-50, 500), boxed),
                            rc::gen::map(rc::gen::elementOf(of_data), boxed));
    }
    case fusion::ParameterKind::Number:
      break;
  }
  const bool bounded_below = std::isfinite(parameter.min);
  const bool bounded_above = std::isfinite(parameter.max);
  const double low = bounded_below ? parameter.min : -1000;
  const double high = bounded_above ? parameter.max : 1000;
  std::vector<double> ends = {std::nextafter(low, high), high, (low + high) / 2};
  if (!(parameter.exclusive_min >= low)) ends.push_back(low);
  if (!bounded_above) ends.insert(ends.end(), {1e6, 1e30, 1e308, 1e-308});
  const double inner = parameter.exclusive_min >= low ? std::nextafter(low, high) : low;
  return rc::gen::map(rc::gen::oneOf(rc::gen::elementOf(ends), number_within(inner, high),
                                     number_within(inner, std::min(high, inner + 3))),
                      boxed);
}

}  // namespace

rc::Gen<fusion::ParameterValue> parameter_value(const fusion::Parameter& parameter,
                                                const std::vector<float>& temperature) {
  if (!parameter.automatic) return value_that_is_set(parameter, temperature);
  return rc::gen::oneOf(rc::gen::just(fusion::ParameterValue{fusion::Automatic{}}),
                        value_that_is_set(parameter, temperature));
}

rc::Gen<fusion::FusionSettings> settings_of(const fusion::Method& method, const std::vector<float>& temperature) {
  return rc::gen::exec([&method, temperature] {
    fusion::FusionChange change;
    change.method = method.id;
    for (const fusion::Parameter& parameter : method.parameters) {
      change.params[parameter.name] = *parameter_value(parameter, temperature);
    }
    const auto* low = change.params.contains("low") ? std::get_if<double>(&change.params["low"]) : nullptr;
    const auto* high = change.params.contains("high") ? std::get_if<double>(&change.params["high"]) : nullptr;
    if (low && high && *low > *high) std::swap(change.params["low"], change.params["high"]);
    const int range = *rc::gen::inRange(0, 10);
    const double a = *number_within(-50, 500);
    const double b = *number_within(-50, 500);
    if (range == 0) change.range = fusion::RangeSetting::manual(std::min(a, b), std::max(a, b));
    if (range == 1) change.range = fusion::RangeSetting::manual(a, a);
    if (range == 2) change.range = fusion::RangeSetting::manual(-1e308, 1e308);
    if (range == 3) change.range = fusion::RangeSetting::manual(-1e-310, 2e-310);
    if (range == 4) change.range = fusion::RangeSetting::manual(a, std::nextafter(a, 1e9));
    if (range == 5) change.range = fusion::RangeSetting::percentile();
    if (range == 6) change.range = fusion::RangeSetting::percentile(*number_within(0, 50), *number_within(50.001, 100));
    if (*rc::gen::inRange(0, 4) == 0) change.missing = fusion::MissingDisplay{base::Rgb8{255, 0, 200}};
    const auto settings = fusion::with_change(fusion::default_settings(), change);
    RC_ASSERT(settings.has_value());
    return settings.value();
  });
}

rc::Gen<fusion::PaletteTable> palettes() {
  return rc::gen::map(
      rc::gen::pair(rc::gen::inRange<std::size_t>(0, fusion::all_palettes().size() + 4),
                    rc::gen::arbitrary<std::uint64_t>()),
      [](const std::pair<std::size_t, std::uint64_t>& chosen) {
        const auto known = fusion::all_palettes();
        if (chosen.first < known.size()) return known[chosen.first].table;
        Engine engine(chosen.second);
        std::uniform_real_distribution<double> channel(0, 255);
        fusion::PaletteTable table{};
        const std::size_t kind = chosen.first - known.size();
        const std::array<double, 3> one = {channel(engine), channel(engine), channel(engine)};
        for (std::size_t row = 0; row < 256; ++row) {
          if (kind < 2) table[row] = one;
          if (kind == 2) table[row] = {channel(engine), channel(engine), channel(engine)};
          if (kind == 3) table[row] = row % 2 ? std::array<double, 3>{255, 0, 255} : std::array<double, 3>{0, 255, 0};
        }
        return table;
      });
}

rc::Gen<Case> cases(const fusion::Method& method) {
  return rc::gen::exec([&method] {
    Case one;
    const int kind = *rc::gen::inRange(0, 15);
    one.scene = kKinds[kind];
    Engine engine(*rc::gen::arbitrary<std::uint64_t>());
    one.temperature = temperatures_of_kind(kind, engine);
    one.visible = *colours(one.temperature.size());
    if (*rc::gen::inRange(0, 8) != 0) one.baseline = baselines_of(one.temperature, engine);
    if (*rc::gen::inRange(0, 2) != 0) {
      const std::uint64_t steps = *rc::gen::inRange<std::uint64_t>(1, 10);
      one.freshness.resize(one.temperature.size());
      for (std::uint8_t& freshness : one.freshness) freshness = static_cast<std::uint8_t>(8 - engine() % steps);
    }
    one.settings = *settings_of(method, one.temperature);
    one.palette = *palettes();
    return one;
  });
}

}  // namespace spectra::fusion::test
