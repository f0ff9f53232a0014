// What the native library answers, for whoever holds another build of it to that (module.test.mjs).
//
//   fusion_cases golden FILE.json      the golden vectors
//   fusion_cases property N            N random cases of every method, from the generators of the property tests
//   fusion_cases settings N            N vertices of every kind of scene, under every method, palette and kind of range
//   fusion_cases refusals              changes that are refused
//   fusion_cases codes                 temperatures as 16-bit codes
//   fusion_cases bench N ROUNDS        N vertices and the best nanoseconds a vertex of every method
//
// Standard output takes records: a length (u32, little-endian) and a JSON text, then the arrays that it names in `arrays`,
// their lengths in bytes.

#include <openssl/sha.h>
#include <time.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>

#include "fusion/colour/palette.hpp"
#include "fusion/registry.hpp"
#include "fusion/temperature_codes.hpp"
#include "tests/property/generators.hpp"

namespace spectra::fusion {
namespace {

using Json = nlohmann::json;

struct Scene {
  std::string name;
  std::vector<float> temperature;
  std::vector<base::Rgb8> visible;
  fusion::TemperatureSummary summary;
};

template <class T>
std::string bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

void write(Json record, const std::vector<std::string>& arrays) {
  record["arrays"] = Json::array();
  for (const std::string& array : arrays) record["arrays"].push_back(array.size());
  const std::string text = record.dump();
  const auto size = static_cast<std::uint32_t>(text.size());
  std::fwrite(&size, sizeof size, 1, stdout);
  std::fwrite(text.data(), 1, text.size(), stdout);
  for (const std::string& array : arrays) std::fwrite(array.data(), 1, array.size(), stdout);
}

Json json_of(const fusion::ParameterValues& values) {
  Json json = Json::object();
  for (const auto& [name, value] : values) {
    json[name] = std::visit(
        [](const auto& one) -> Json {
          if constexpr (std::is_same_v<std::decay_t<decltype(one)>, fusion::Automatic>) {
            return nullptr;
          } else {
            return one;
          }
        },
        value);
  }
  return json;
}

Json json_of(const fusion::FusionChange& change) {
  Json json = {{"params", json_of(change.params)}};
  if (change.method) json["method"] = *change.method;
  if (change.palette) json["palette"] = *change.palette;
  if (const auto& range = change.range) {
    switch (range->mode) {
      case fusion::RangeMode::Auto:
        json["range"] = {{"mode", "auto"}};
        break;
      case fusion::RangeMode::Manual:
        json["range"] = {{"mode", "manual"}, {"min", range->minimum_celsius}, {"max", range->maximum_celsius}};
        break;
      case fusion::RangeMode::Percentile:
        json["range"] = {{"mode", "percentile"}, {"low", range->low_percent}, {"high", range->high_percent}};
        break;
    }
  }
  if (change.missing) {
    char text[8] = "visible";
    if (const fusion::MissingDisplay& colour = *change.missing) {
      std::snprintf(text, sizeof text, "#%02x%02x%02x", unsigned{colour->r}, unsigned{colour->g}, unsigned{colour->b});
    }
    json["missing"] = text;
  }
  return json;
}

Json json_of(const fusion::FusionSettings& settings) {
  fusion::FusionChange change;
  change.method = settings.method;
  change.params = settings.params;
  change.palette = settings.palette;
  change.range = settings.range;
  change.missing = settings.missing;
  return json_of(change);
}

Json json_of(const fusion::TemperatureSummary& summary) {
  return {{"finite_count", summary.finite_count},
          {"missing_count", summary.missing_count},
          {"over_range_count", summary.over_range_count},
          {"under_range_count", summary.under_range_count},
          {"minimum", double{summary.minimum}},
          {"maximum", double{summary.maximum}},
          {"mean", summary.mean},
          {"sigma", summary.sigma}};
}

/// The facts of a scene, and in `used` those that a plan asked for.
fusion::SceneTemperature watched(const std::vector<float>& temperature, const std::vector<base::Rgb8>& visible,
                                 const fusion::TemperatureSummary& summary, Json& used) {
  used = {{"summary", json_of(summary)}, {"histograms", Json::object()}, {"hues", nullptr}};
  fusion::SceneTemperature facts;
  facts.summary = summary;
  facts.histogram = [&temperature, &used, summary](std::uint32_t bins) {
    fusion::Histogram histogram{summary.minimum, summary.maximum, std::vector<std::uint64_t>(bins)};
    fusion::add_to_histogram(temperature, histogram);
    used["histograms"][std::to_string(bins)] = histogram.counts;
    return histogram;
  };
  facts.hues = [&visible, &used] {
    fusion::Hues hues;
    fusion::add_to_hues(visible, hues);
    used["hues"] = hues.chroma;
    return hues;
  };
  return facts;
}

std::string bytes_of(const fusion::PaletteTable& palette) {
  return {reinterpret_cast<const char*>(palette.data()), sizeof palette};
}

Json in_force(const fusion::FusionPlan& plan) {
  Json intervals = Json::array();
  for (const fusion::TemperatureInterval& one : plan.highlighted()) intervals.push_back({one.low, one.high});
  return {{"range", {plan.range_minimum(), plan.range_maximum()}},
          {"params_in_force", json_of(plan.params_in_force())},
          {"highlighted", intervals}};
}

/// A record of settings under a palette, with arrays temperature, visible, palette and fused; or with `refused`.
void write_case(const fusion::FusionSettings& settings, const fusion::PaletteTable& palette,
                const std::vector<float>& temperature, const std::vector<base::Rgb8>& visible,
                const fusion::TemperatureSummary& summary, const std::string& name) {
  Json used;
  const fusion::SceneTemperature facts = watched(temperature, visible, summary, used);
  const auto plan = fusion::FusionPlan::prepare(settings, facts, palette);
  Json record = {{"name", name}, {"settings", json_of(settings)}};
  std::vector<base::Rgb8> fused(temperature.size());
  if (plan) {
    plan.value().fuse(temperature, visible, fused);
    record["plan"] = in_force(plan.value());
  } else {
    record["refused"] = {{"code", static_cast<int>(plan.error().code)},
                         {"message", plan.error().message},
                         {"field", plan.error().field}};
  }
  record["facts"] = used;
  write(record, {bytes_of(temperature), bytes_of(visible), bytes_of(palette), bytes_of(fused)});
}

fusion::TemperatureSummary summary_of(const std::vector<float>& temperature) {
  fusion::TemperatureAccumulator accumulator;
  accumulator.add(temperature);
  return accumulator.summary();
}

fusion::ParameterValue parameter_value(const Json& json) {
  if (json.is_null()) return fusion::Automatic{};
  if (json.is_boolean()) return json.get<bool>();
  if (json.is_number_integer()) return json.get<std::int64_t>();
  if (json.is_number()) return json.get<double>();
  return json.get<std::string>();
}

void golden(const char* path) {
  std::ifstream file(path);
  const Json json = Json::parse(file);
  std::vector<base::Rgb8> visible;
  for (const Json& row : json["visible"]) {
    visible.push_back({row[0].get<std::uint8_t>(), row[1].get<std::uint8_t>(), row[2].get<std::uint8_t>()});
  }
  std::vector<float> temperature;
  for (const Json& value : json["temperature"]) {
    temperature.push_back(value.is_null() ? std::numeric_limits<float>::quiet_NaN() : value.get<float>());
  }
  fusion::PaletteTable palette{};
  for (std::size_t i = 0; i < 768; ++i) palette[i / 3][i % 3] = json["palette"][i / 3][i % 3].get<double>();
  for (const Json& one : json["cases"]) {
    fusion::FusionChange change;
    change.method = one["method"].get<std::string>();
    for (const auto& [name, value] : one["params"].items()) change.params[name] = parameter_value(value);
    if (!one["range"].is_null()) {
      change.range = fusion::RangeSetting::manual(one["range"][0].get<double>(), one["range"][1].get<double>());
    }
    write_case(fusion::with_change(fusion::default_settings(), change).value(), palette, temperature, visible,
               summary_of(temperature), "golden " + *change.method + " " + one["params"].dump());
  }
}

void property(std::size_t count) {
  for (const fusion::Method* method : fusion::all_methods()) {
    const auto generator = test::cases(*method);
    for (std::size_t i = 0; i < count; ++i) {
      const rc::Random random(0x5bec7a + i);
      const test::Case one = generator(random, static_cast<int>(i % 100)).value();
      write_case(one.settings, one.palette, one.temperature, one.visible, one.facts().summary,
                 one.scene + " under " + fusion::cache_key(one.settings));
    }
  }
}

std::vector<base::Rgb8> random_colours(std::size_t count, std::mt19937& engine) {
  std::vector<base::Rgb8> colours(count);
  for (base::Rgb8& colour : colours) {
    const auto bits = static_cast<std::uint32_t>(engine());
    colour = {static_cast<std::uint8_t>(bits), static_cast<std::uint8_t>(bits >> 8),
              static_cast<std::uint8_t>(bits >> 16)};
  }
  return colours;
}

std::vector<Scene> scenes(std::size_t count) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  std::mt19937 engine(20);
  std::uniform_real_distribution<float> celsius(15, 40);
  const auto scene = [&](std::string name, auto&& make) {
    Scene one;
    one.name = std::move(name);
    one.temperature.resize(count);
    for (float& value : one.temperature) value = make();
    one.visible = random_colours(count, engine);
    one.summary = summary_of(one.temperature);
    return one;
  };
  return {
      scene("a room", [&] { return celsius(engine); }),
      scene("a room with holes",
            [&] {
              const auto roll = engine() % 16;
              return roll == 0 ? kNan : roll == 1 ? kInfinity : roll == 2 ? -kInfinity : celsius(engine);
            }),
      scene("one temperature", [&] { return 21.5F; }),
      scene("nothing measured", [&] { return kNan; }),
      scene("any bits", [&] { return std::bit_cast<float>(static_cast<std::uint32_t>(engine())); }),
      scene("both ends of float32", [&] { return (engine() % 2 ? 1.0F : -1.0F) * std::numeric_limits<float>::max(); }),
      scene("subnormal", [&] { return std::bit_cast<float>(static_cast<std::uint32_t>(engine() % 64)); }),
      scene("two neighbours", [&] { return engine() % 2 ? 300.0F : std::nextafter(300.0F, 301.0F); }),
  };
}

void settings(std::size_t count) {
  const std::vector<std::pair<std::string, fusion::RangeSetting>> ranges = {
      {"auto", {}},
      {"manual", fusion::RangeSetting::manual(20, 31.7)},
      {"one point", fusion::RangeSetting::manual(25, 25)},
      {"huge", fusion::RangeSetting::manual(-1e308, 1e308)},
      {"percentile", fusion::RangeSetting::percentile(2, 97)}};
  for (const Scene& scene : scenes(count)) {
    write({{"scene", scene.name}}, {bytes_of(scene.temperature), bytes_of(scene.visible)});
    for (const fusion::Method* method : fusion::all_methods()) {
      for (const fusion::Palette& palette : fusion::all_palettes()) {
        if (!method->uses_palette && &palette != fusion::all_palettes().data()) continue;
        for (const auto& [range_name, range] : ranges) {
          for (const bool is_fixed : {false, true}) {
            fusion::FusionChange change;
            change.method = method->id;
            change.palette = palette.id;
            change.range = range;
            if (is_fixed) change.missing = fusion::MissingDisplay{base::Rgb8{255, 0, 200}};
            const fusion::FusionSettings all = fusion::with_change(fusion::default_settings(), change).value();
            Json used;
            const auto plan =
                fusion::FusionPlan::prepare(all, watched(scene.temperature, scene.visible, scene.summary, used));
            if (!plan) continue;
            std::vector<base::Rgb8> fused(count);
            plan.value().fuse(scene.temperature, scene.visible, fused);
            std::string hash(SHA256_DIGEST_LENGTH, '\0');
            SHA256(reinterpret_cast<const unsigned char*>(fused.data()), 3 * fused.size(),
                   reinterpret_cast<unsigned char*>(hash.data()));
            write({{"name", scene.name + ", " + method->id + ", " + palette.id + ", " + range_name},
                   {"settings", json_of(all)},
                   {"facts", used},
                   {"plan", in_force(plan.value())}},
                  {hash});
          }
        }
      }
    }
  }
}

void refusals() {
  const std::vector<fusion::FusionChange> changes = {
      {.method = "no_such_method"},
      {.params = {{"no_such_parameter", 1.0}}},
      {.params = {{"alpha", 1.5}}},
      {.params = {{"alpha", std::string("much")}}},
      {.params = {{"alpha", fusion::Automatic{}}}},
      {.palette = "no_such_palette"},
      {.range = fusion::RangeSetting::manual(30, 20)},
      {.range = fusion::RangeSetting::percentile(80, 20)},
      {.method = "thermal_highlighting", .params = {{"low", 40.0}, {"high", 20.25}}},
      {.method = "histogram_bin", .params = {{"bins", 2.5}}},
      {.method = "histogram_bin", .params = {{"ties", std::string("neither")}}},
      {.method = "inverse_intensity_hue", .params = {{"k", 0.0}}},
      {.method = "colour_mapped_threshold", .params = {{"invert", 1.0}}},
  };
  for (const fusion::FusionChange& change : changes) {
    const auto settings = fusion::with_change(fusion::default_settings(), change);
    if (settings) std::abort();
    write({{"change", json_of(change)},
           {"refused",
            {{"code", static_cast<int>(settings.error().code)},
             {"message", settings.error().message},
             {"field", settings.error().field}}}},
          {});
  }
}

void codes() {
  std::mt19937 engine(4);
  for (const Scene& scene : scenes(20'000)) {
    for (const double step : {0.01, 0.5, 1e-9}) {
      const fusion::TemperatureCodes table =
          fusion::TemperatureCodes::covering(scene.summary.minimum, scene.summary.maximum, step);
      std::vector<std::uint16_t> code(scene.temperature.size());
      table.encode(scene.temperature, code);
      std::vector<float> decoded(code.size());
      table.decode(code, decoded);
      fusion::FusionChange change;
      change.method = "thermal_only";
      const fusion::FusionSettings all = fusion::with_change(fusion::default_settings(), change).value();
      Json used;
      const auto plan =
          fusion::FusionPlan::prepare(all, watched(scene.temperature, scene.visible, scene.summary, used));
      std::vector<base::Rgb8> fused(code.size());
      plan.value().fuse(decoded, scene.visible, fused);
      write({{"name", scene.name + ", step " + std::to_string(step)},
             {"scale", double{table.scale}},
             {"offset", double{table.offset}},
             {"settings", json_of(all)},
             {"facts", used},
             {"plan", in_force(plan.value())}},
            {bytes_of(code), bytes_of(scene.visible), bytes_of(fused)});
    }
  }
}

/// Settings under which a method has work to do: thresholds in the middle, half of the bins, a fractional power.
fusion::FusionSettings working_settings(const fusion::Method& method) {
  fusion::FusionChange change;
  change.method = method.id;
  change.palette = "inferno";
  for (const fusion::Parameter& parameter : method.parameters) {
    if (parameter.name == "threshold") change.params["threshold"] = 27.5;
    if (parameter.name == "low") change.params["low"] = 24.0;
    if (parameter.name == "high") change.params["high"] = 31.0;
    if (parameter.name == "n") change.params["n"] = std::int64_t{32};
    if (parameter.name == "alpha") change.params["alpha"] = 0.5;
    if (parameter.name == "hue") change.params["hue"] = 0.0;
    if (parameter.name == "k") change.params["k"] = method.id == "inverse_intensity_hue" ? 2.5 : 1.0;
  }
  return fusion::with_change(fusion::default_settings(), change).value();
}

double thread_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

void bench(std::size_t count, std::size_t rounds) {
  std::mt19937 engine(1);
  std::uniform_real_distribution<float> celsius(15, 40);
  std::vector<float> temperature(count);
  for (float& value : temperature) value = celsius(engine);
  const std::vector<base::Rgb8> visible = random_colours(count, engine);
  const fusion::TemperatureSummary summary = summary_of(temperature);
  write({{"scene", "bench"}}, {bytes_of(temperature), bytes_of(visible)});
  std::vector<base::Rgb8> fused(count);
  for (const fusion::Method* method : fusion::all_methods()) {
    const fusion::FusionSettings all = working_settings(*method);
    Json used;
    const fusion::FusionPlan plan =
        fusion::FusionPlan::prepare(all, watched(temperature, visible, summary, used)).value();
    double best = std::numeric_limits<double>::infinity();
    for (std::size_t round = 0; round < rounds; ++round) {
      const double begin = thread_seconds();
      plan.fuse(temperature, visible, fused);
      best = std::min(best, thread_seconds() - begin);
    }
    write({{"name", method->id},
           {"settings", json_of(all)},
           {"facts", used},
           {"plan", in_force(plan)},
           {"nanoseconds", best * 1e9 / static_cast<double>(count)}},
          {bytes_of(fused)});
  }
}

}  // namespace
}  // namespace spectra::fusion

int main(int argc, char** argv) {
  using namespace spectra::fusion;
  const std::string what = argc > 1 ? argv[1] : "";
  const auto number = [&](int index) { return argc > index ? std::strtoull(argv[index], nullptr, 10) : 0; };
  if (what == "golden" && argc > 2) {
    golden(argv[2]);
  } else if (what == "property") {
    property(number(2));
  } else if (what == "settings") {
    settings(number(2));
  } else if (what == "refusals") {
    refusals();
  } else if (what == "codes") {
    codes();
  } else if (what == "bench") {
    bench(number(2), number(3));
  } else {
    std::fprintf(stderr,
                 "usage: fusion_cases golden FILE | property N | settings N | refusals | codes | bench N ROUNDS\n");
    return 2;
  }
  return 0;
}
