// Nanoseconds per vertex of every fusion method beside memcpy, a scalar double loop and OpenCV, in one run on one core.
//
//   fusion_bench [--vertices N]... [--method ID]...
//
// memcpy copies half the bytes that a method reads and writes, so that both move the same bytes. Before anything is
// timed, the method's colours are compared with those of the double loop: at most 1 level apart anywhere, and that in
// few channels only. The status is 1 when they are not.

#include <time.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <random>

#include "fusion/registry.hpp"
#include "tests/bench/fusion/scalar_loops.hpp"

namespace spectra::fusion::bench {
namespace {

using Clock = std::chrono::steady_clock;

Scene make_scene(std::size_t count) {
  Scene scene;
  scene.temperature.resize(count);
  scene.baseline.resize(count);
  scene.visible.resize(count);
  std::mt19937 engine(1);
  std::uniform_real_distribution<float> celsius(15, 40);
  std::uniform_real_distribution<float> drift(-2, 2);  // Of which half is below a threshold of 1 K.
  for (std::size_t i = 0; i < count; ++i) {
    scene.temperature[i] = celsius(engine);
    scene.baseline[i] = scene.temperature[i] + drift(engine);
    const auto bits = static_cast<std::uint32_t>(engine());
    scene.visible[i] = {static_cast<std::uint8_t>(bits), static_cast<std::uint8_t>(bits >> 8),
                        static_cast<std::uint8_t>(bits >> 16)};
  }
  fusion::TemperatureAccumulator accumulator;
  accumulator.add(scene.temperature);
  scene.summary = accumulator.summary();
  fusion::Histogram histogram{scene.summary.minimum, scene.summary.maximum, std::vector<std::uint64_t>(64)};
  fusion::add_to_histogram(scene.temperature, histogram);
  scene.counts = histogram.counts;
  return scene;
}

/// Settings that make a method work: thresholds in the middle of the range, half of the bins, a fractional power.
fusion::FusionSettings working_settings(const std::string& method) {
  fusion::FusionChange change;
  change.method = method;
  change.palette = "inferno";
  if (method == "thermal_visible_blend") change.params["alpha"] = 0.3;
  if (method.ends_with("threshold")) change.params = {{"threshold", 27.5}, {"alpha", 0.5}};
  if (method == "monochrome_threshold") change.params["hue"] = 0.0;
  if (method == "thermal_highlighting") change.params = {{"low", 24.0}, {"high", 31.0}, {"k", 1.0}};
  if (method == "inverse_intensity_hue") change.params["k"] = 2.5;
  if (method == "histogram_bin") change.params["n"] = std::int64_t{32};
  if (method == "histogram_distribution") change.params["k"] = 1.0;
  if (method == "thermal_change") change.params["threshold"] = 1.0;
  return fusion::with_change(fusion::default_settings(), change).value();
}

/// Seconds of this thread's own, so that a busy machine does not count.
double thread_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double seconds(const std::function<void()>& work) {
  const double begin = thread_seconds();
  work();
  return thread_seconds() - begin;
}

/// Runs all in turn, again and again, and keeps the best time of each: whatever else the machine does meets them alike.
std::vector<double> best_times(const std::vector<std::function<void()>>& works, std::size_t count) {
  std::vector<double> best(works.size(), 1e9);
  const auto rounds = std::clamp<std::size_t>(60'000'000 / count, 7, 2000);
  const auto end = Clock::now() + std::chrono::seconds(8);
  for (std::size_t round = 0; round < rounds && (round < 5 || Clock::now() < end); ++round) {
    for (std::size_t i = 0; i < works.size(); ++i) {
      if (works[i]) best[i] = std::min(best[i], seconds(works[i]));
    }
  }
  return best;
}

struct Difference {
  int worst = 0;
  std::size_t channels = 0;
};

Difference difference(std::span<const base::Rgb8> a, std::span<const base::Rgb8> b) {
  Difference result;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (const int apart : {a[i].r - b[i].r, a[i].g - b[i].g, a[i].b - b[i].b}) {
      result.worst = std::max(result.worst, std::abs(apart));
      result.channels += apart != 0;
    }
  }
  return result;
}

bool run(std::size_t count, const std::vector<std::string>& wanted) {
  const Scene scene = make_scene(count);
  const fusion::PaletteTable& palette = fusion::find_palette("inferno")->table;
  fusion::SceneTemperature facts;
  facts.summary = scene.summary;
  facts.histogram = [&scene](std::uint32_t bins) {
    fusion::Histogram histogram{scene.summary.minimum, scene.summary.maximum, std::vector<std::uint64_t>(bins)};
    fusion::add_to_histogram(scene.temperature, histogram);
    return histogram;
  };
  std::vector<base::Rgb8> fused(count), scalar(count), composed(count);
  std::vector<std::uint8_t> from(5 * count, 1), to(5 * count, 2);
  bool equal = true;

  std::printf("\n%zu vertices; ns per vertex\n%-24s %8s %8s %8s %8s %8s | %8s %8s %8s %8s\n", count, "method", "kernel",
              "memcpy", "double", "plain", "opencv", "/memcpy", "double/", "plain/", "opencv/");
  for (const fusion::Method* method : fusion::all_methods()) {
    if (!wanted.empty() && std::find(wanted.begin(), wanted.end(), method->id) == wanted.end()) continue;
    const fusion::FusionPlan plan = fusion::FusionPlan::prepare(working_settings(method->id), facts, palette).value();
    const Loop as_double = scalar_double_loop(scene, plan, palette);
    const Loop plain = plain_float_blend(scene, plan, palette);
    const Loop opencv = opencv_composition(scene, plan, palette);
    plan.fuse({scene.temperature, scene.visible, scene.baseline}, fused);
    if (as_double) {
      as_double(scalar);
      const Difference apart = difference(fused, scalar);
      // A tenth of a thousand channels may lie within a rounding tie's reach.
      if (apart.worst > 1 || apart.channels > 3 * count / 1000 + 3) {
        std::printf("%s differs from the double loop: worst %d levels, %zu channels\n", method->id.c_str(), apart.worst,
                    apart.channels);
        equal = false;
        continue;
      }
    }
    const auto call = [](const Loop& loop, std::vector<base::Rgb8>& out) -> std::function<void()> {
      if (!loop) return {};
      return [&loop, &out] { loop(out); };
    };
    const auto best = best_times({[&] {
                                    plan.fuse({scene.temperature, scene.visible, scene.baseline}, fused);
                                  },
                                  [&] { std::memcpy(to.data(), from.data(), from.size()); }, call(as_double, scalar),
                                  call(plain, scalar), call(opencv, composed)},
                                 count);
    const auto ns = [&](std::size_t i) { return best[i] * 1e9 / static_cast<double>(count); };
    const auto cell = [](bool has, double value, const char* format) {
      if (has) {
        std::printf(format, value);
      } else {
        std::printf("%9s", "-");
      }
    };
    std::printf("%-24s %8.3f %8.3f", method->id.c_str(), ns(0), ns(1));
    cell(bool(as_double), ns(2), " %8.2f");
    cell(bool(plain), ns(3), " %8.2f");
    cell(bool(opencv), ns(4), " %8.2f");
    std::printf(" | %8.2f", ns(1) / ns(0));
    cell(bool(as_double), ns(2) / ns(0), " %8.1f");
    cell(bool(plain), ns(3) / ns(0), " %8.1f");
    cell(bool(opencv), ns(4) / ns(0), " %8.1f");
    if (opencv) {
      plan.fuse({scene.temperature, scene.visible, scene.baseline}, fused);
      const Difference apart = difference(fused, composed);
      std::printf("  (OpenCV is off by up to %d levels)", apart.worst);
    }
    std::printf("\n");
    std::fflush(stdout);
  }
  const auto best = best_times(
      {[&] {
         fusion::Histogram histogram{scene.summary.minimum, scene.summary.maximum, std::vector<std::uint64_t>(64)};
         fusion::add_to_histogram(scene.temperature, histogram);
       },
       [&] {
         fusion::TemperatureAccumulator accumulator;
         accumulator.add(scene.temperature);
       }},
      count);
  std::printf("histogram of 64 bins %.3f, summary %.3f\n", best[0] * 1e9 / static_cast<double>(count),
              best[1] * 1e9 / static_cast<double>(count));
  return equal;
}

}  // namespace
}  // namespace spectra::fusion::bench

int main(int argc, char** argv) {
  std::vector<std::size_t> counts;
  std::vector<std::string> methods;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--vertices") == 0) counts.push_back(std::strtoull(argv[i + 1], nullptr, 10));
    if (std::strcmp(argv[i], "--method") == 0) methods.emplace_back(argv[i + 1]);
  }
  if (counts.empty()) counts = {10'000, 1'000'000, 10'000'000};
  bool equal = true;
  for (const std::size_t count : counts) equal = spectra::fusion::bench::run(count, methods) && equal;
  return equal ? 0 : 1;
}
