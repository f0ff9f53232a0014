// How far every fusion method is from the exact answer, against the extended-precision reference of the property tests.
//
//   fusion_accuracy [--vertices N] [--method ID|statistics]
//
// Random vertices for every method and set of parameters, and all 2^24 visible colours for the methods that read them.
// The status is 1 when a channel is off by more than 1 level, or wrongly rounded more than 1e-3 from a tie.

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "fusion/colour/colour_difference.hpp"
#include "fusion/colour/palette.hpp"
#include "tests/property/reference.hpp"

namespace spectra::fusion {
namespace {

struct Run {
  const char* what;
  const char* method;
  fusion::ParameterValues params;
  const char* palette = "iron";
  float low = 15;
  float high = 40;
};

/// What was seen of one run.
struct Seen {
  double worst_levels = 0;      ///< From the exact, unrounded answer; up to 0.5 is the rounding itself.
  std::size_t other_level = 0;  ///< Channels that differ from the exact answer rounded, near a tie.
  std::size_t broken = 0;       ///< Channels outside the promise.
  double worst_ciede2000 = 0;   ///< From the exact answer rounded.
};

Seen compare(const Run& run, const std::vector<float>& temperature, const std::vector<base::Rgb8>& visible) {
  fusion::FusionChange change;
  change.method = run.method;
  change.params = run.params;
  const fusion::FusionSettings settings = fusion::with_change(fusion::default_settings(), change).value();
  const fusion::PaletteTable& palette = fusion::find_palette(run.palette)->table;
  fusion::TemperatureAccumulator accumulator;
  accumulator.add(temperature);
  fusion::SceneTemperature facts;
  facts.summary = accumulator.summary();
  facts.histogram = [&](std::uint32_t bins) {
    fusion::Histogram histogram{facts.summary.minimum, facts.summary.maximum, std::vector<std::uint64_t>(bins)};
    fusion::add_to_histogram(temperature, histogram);
    return histogram;
  };
  std::vector<base::Rgb8> fused(temperature.size());
  // Half of all changes are beyond a span of 5 K.
  const std::vector<float> baseline(temperature.size(), 27.5F);
  fusion::FusionPlan::prepare(settings, facts, palette).value().fuse({temperature, visible, baseline}, fused);
  const test::FusionReference reference(settings, palette, facts.summary, temperature);
  Seen seen;
  for (std::size_t i = 0; i < fused.size(); ++i) {
    const auto exact = reference.fused(temperature[i], visible[i], baseline[i], 8);
    const std::uint8_t actual[3] = {fused[i].r, fused[i].g, fused[i].b};
    std::uint8_t rounded[3];
    bool differs = false;
    for (std::size_t c = 0; c < 3; ++c) {
      const test::FusionReference::Real bounded = std::clamp(exact[c], 0.0L, 255.0L);
      rounded[c] = static_cast<std::uint8_t>(bounded + 0.5L);
      seen.worst_levels = std::max(seen.worst_levels, static_cast<double>(std::fabs(actual[c] - bounded)));
      if (!test::within_accuracy(actual[c], exact[c])) ++seen.broken;
      if (actual[c] == rounded[c]) continue;
      ++seen.other_level;
      differs = true;
    }
    if (differs) {
      const double apart =
          fusion::ciede2000(fusion::lab_of(fused[i]), fusion::lab_of(base::Rgb8{rounded[0], rounded[1], rounded[2]}));
      seen.worst_ciede2000 = std::max(seen.worst_ciede2000, apart);
    }
  }
  return seen;
}

bool report(const Run& run, const std::vector<float>& temperature, const std::vector<base::Rgb8>& visible) {
  const Seen seen = compare(run, temperature, visible);
  std::printf("| %-24s | %-34s | %-13s | %9zu | %.5f | %7zu | %6zu | %.2f |\n", run.method, run.what, run.palette,
              temperature.size(), seen.worst_levels, seen.other_level, seen.broken, seen.worst_ciede2000);
  std::fflush(stdout);
  return seen.broken == 0 && seen.worst_levels <= 1;
}

std::vector<Run> runs() {
  using Integer = std::int64_t;
  return {
      {"inferno", "thermal_only", {}, "inferno"},
      {"steep palette", "thermal_only", {}, "high_contrast"},
      {"kelvin, 0.2 wide", "thermal_only", {}, "turbo", 299.9F, 300.1F},
      {"range of 6.8e38", "thermal_only", {}, "iron", -3.4e38F, 3.4e38F},
      {"alpha 0.5", "thermal_visible_blend", {{"alpha", 0.5}}},
      {"alpha 0.3", "thermal_visible_blend", {{"alpha", 0.3}}, "viridis"},
      {"hue 200, alpha 0.7", "monochrome_threshold", {{"hue", 200.0}, {"alpha", 0.7}, {"threshold", 20.0}}},
      {"inverted, alpha 0.5",
       "monochrome_threshold",
       {{"invert", true}, {"threshold", 35.0}, {"alpha", 0.5}, {"hue", 0.0}}},
      {"alpha 0.6", "colour_mapped_threshold", {{"alpha", 0.6}, {"threshold", 20.0}}},
      {"both sides, k 1", "thermal_highlighting", {{"low", 25.0}, {"high", 30.0}, {"k", 1.0}}},
      {"both sides, k 1e6", "thermal_highlighting", {{"low", 25.0}, {"high", 30.0}, {"k", 1e6}}},
      {"k 0.6", "intensity_hue", {{"k", 0.6}}, "iron_safe"},
      {"k 4", "intensity_hue", {{"k", 4.0}}, "rainbow_safe"},
      {"substitute, k 2.5", "inverse_intensity_hue", {{"k", 2.5}}},
      {"substitute, k 0.3", "inverse_intensity_hue", {{"k", 0.3}}},
      {"scale, k 100", "inverse_intensity_hue", {{"k", 100.0}, {"mode", std::string("scale")}}},
      {"64 bins, 32 shown, alpha 0.8", "histogram_bin", {{"n", Integer{32}}, {"alpha", 0.8}}},
      {"4096 bins, 2000 shown", "histogram_bin", {{"bins", Integer{4096}}, {"n", Integer{2000}}}},
      {"k 1, alpha 0.9", "histogram_distribution", {{"alpha", 0.9}, {"k", 1.0}}},
      {"span 5, alpha 0.8", "thermal_change", {}, "blue_red"},
      {"span 0.7, alpha 0.37", "thermal_change", {{"span", 0.7}, {"alpha", 0.37}}, "cyan_amber"},
  };
}

/// Each of the 2^24 colours once, all at one temperature of a scene from 15 to 40 degC.
std::vector<Run> colour_runs() {
  return {
      {"every colour, alpha 0.37", "thermal_visible_blend", {{"alpha", 0.37}}},
      {"every colour, k 0.6", "intensity_hue", {{"k", 0.6}}, "iron_safe"},
      {"every colour, k 4", "intensity_hue", {{"k", 4.0}}, "iron_safe"},
      {"every colour, substitute, k 2.5", "inverse_intensity_hue", {{"k", 2.5}}},
      {"every colour, scale, k 0.7", "inverse_intensity_hue", {{"k", 0.7}, {"mode", std::string("scale")}}},
  };
}

/// Mean and sigma of values at 300 with sigma 0.05, generated block by block: relative errors below 1e-12?
bool report_statistics(std::size_t count) {
  constexpr std::size_t kBlock = 100'000;
  std::vector<float> block(kBlock);
  std::mt19937 engine(7);
  std::normal_distribution<float> kelvin(300.0F, 0.05F);
  fusion::TemperatureAccumulator accumulator;
  // Shifted by 300 the float32 values are small and exact in extended precision.
  long double sum = 0;
  long double squares = 0;
  std::size_t done = 0;
  for (; done < count; done += kBlock) {
    for (float& value : block) {
      value = kelvin(engine);
      const long double above = static_cast<long double>(value) - 300.0L;
      sum += above;
      squares += above * above;
    }
    fusion::TemperatureAccumulator part;
    part.add(block);
    accumulator.merge(part);
  }
  const auto n = static_cast<long double>(done);
  const long double mean = 300.0L + sum / n;
  const long double sigma = std::sqrt(squares / n - (sum / n) * (sum / n));
  const fusion::TemperatureSummary summary = accumulator.summary();
  const auto mean_error = static_cast<double>(std::fabs(static_cast<long double>(summary.mean) / mean - 1));
  const auto sigma_error = static_cast<double>(std::fabs(static_cast<long double>(summary.sigma) / sigma - 1));
  std::printf("\n%zu values: relative error of the mean %.1e, of sigma %.1e\n", done, mean_error, sigma_error);
  return mean_error < 1e-12 && sigma_error < 1e-12;
}

int run_all(std::size_t count, const std::string& only) {
  std::printf("| method | parameters | palette | vertices | worst levels | near ties | broken | CIEDE2000 |\n");
  std::printf("| --- | --- | --- | --- | --- | --- | --- | --- |\n");
  bool good = true;
  std::mt19937 engine(2026);
  std::vector<base::Rgb8> visible(count);
  for (base::Rgb8& colour : visible) {
    const auto bits = static_cast<std::uint32_t>(engine());
    colour = {static_cast<std::uint8_t>(bits), static_cast<std::uint8_t>(bits >> 8),
              static_cast<std::uint8_t>(bits >> 16)};
  }
  std::vector<float> temperature(count);
  for (const Run& run : runs()) {
    if (!only.empty() && only != run.method) continue;
    // Drawn in double precision: the whole of the float32 range has no float32 width.
    std::uniform_real_distribution<double> degrees(double{run.low}, double{run.high});
    for (float& value : temperature) value = static_cast<float>(degrees(engine));
    good = report(run, temperature, visible) && good;
  }
  constexpr std::size_t kColours = std::size_t{1} << 24;
  visible.resize(kColours);
  temperature.assign(kColours, 31.7F);
  for (std::size_t i = 0; i < kColours; ++i) {
    visible[i] = {static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(i >> 8), static_cast<std::uint8_t>(i >> 16)};
  }
  temperature.front() = 15;
  temperature.back() = 40;
  for (const Run& run : colour_runs()) {
    if (only.empty() || only == run.method) good = report(run, temperature, visible) && good;
  }
  if (only.empty() || only == "statistics") {
    good = report_statistics(count) && good;
    good = report_statistics(10 * count) && good;
  }
  return good ? 0 : 1;
}

}  // namespace
}  // namespace spectra::fusion

int main(int argc, char** argv) {
  std::size_t count = 10'000'000;
  std::string only;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--vertices") == 0) count = std::strtoull(argv[i + 1], nullptr, 10);
    if (std::strcmp(argv[i], "--method") == 0) only = argv[i + 1];
  }
  return spectra::fusion::run_all(count, only);
}
