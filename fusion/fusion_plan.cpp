#include "fusion/fusion_plan.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <tuple>
#include <utility>

#include "fusion/registry.hpp"

namespace spectra::fusion {
namespace {

std::pair<double, double> active_range(const RangeSetting& range, const SceneTemperature& scene) {
  if (range.mode == RangeMode::Manual) return {range.minimum_celsius, range.maximum_celsius};
  if (!scene.summary.has_temperature()) return {0, 0};
  const double minimum = double{scene.summary.minimum};
  const double maximum = double{scene.summary.maximum};
  if (range.mode == RangeMode::Auto || !scene.histogram) return {minimum, maximum};
  const Histogram histogram = scene.histogram(kPercentileBins);
  return {std::clamp(histogram_quantile(histogram, range.low_percent / 100), minimum, maximum),
          std::clamp(histogram_quantile(histogram, range.high_percent / 100), minimum, maximum)};
}

/// A colour that no method makes of a highlight over kUnmarked.
constexpr base::Rgb8 kUnmarked = {0, 200, 100};

const PaletteTable& telling_palette() {
  static const PaletteTable table = [] {
    PaletteTable rows;
    rows.fill({250, 10, 10});
    return rows;
  }();
  return table;
}

/// What the sensor could not tell has no interval of its own: where it alone is highlighted, the extreme beyond which it
/// lies stands for it.
void add_beyond(const FusionPlan& plan, const TemperatureSummary& data, std::vector<TemperatureInterval>& highlighted) {
  const double minimum = double{data.minimum};
  const double maximum = double{data.maximum};
  if (!(minimum < maximum)) return;
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  constexpr std::array<float, 2> kBeyond = {-kInfinity, kInfinity};
  std::array<std::uint8_t, 2> marked{};
  plan.mark(kBeyond, {}, marked);
  const auto [under, over] = marked;
  if (under != 0 && data.under_range_count > 0 && (highlighted.empty() || highlighted.front().low > minimum)) {
    highlighted.insert(highlighted.begin(), {minimum, minimum});
  }
  if (over != 0 && data.over_range_count > 0 && (highlighted.empty() || highlighted.back().high < maximum)) {
    highlighted.push_back({maximum, maximum});
  }
}

}  // namespace

base::Result<FusionPlan> FusionPlan::prepare(const FusionSettings& settings, const SceneTemperature& scene) {
  const Palette* palette = find_palette(settings.palette);
  if (!palette) {
    return base::failure(base::ErrorCode::UnknownPalette, "palette '" + settings.palette + "' is unknown", "palette");
  }
  return prepare(settings, scene, palette->table);
}

base::Result<FusionPlan> FusionPlan::prepare(const FusionSettings& settings, const SceneTemperature& scene,
                                             const PaletteTable& palette) {
  const Method* method = find_method(settings.method);
  if (!method) {
    return base::failure(base::ErrorCode::UnknownMethod, "method '" + settings.method + "' is unknown", "method");
  }
  FusionPlan plan;
  std::tie(plan.range_minimum_, plan.range_maximum_) = active_range(settings.range, scene);
  ParameterValues in_force = method->resolve(settings.params, scene);
  // Without temperature nothing is compared, so automatic values cannot contradict anything.
  if (scene.summary.has_temperature()) {
    BOOST_OUTCOME_TRYV(method->check(in_force));
  }

  const MethodContext context{plan.range_minimum_, plan.range_maximum_, scene, palette, settings.missing};
  PreparedMethod prepared = method->prepare(in_force, context);
  plan.kernel_ = std::move(prepared.kernel);
  plan.change_scale_ = prepared.change_scale;
  plan.compares_with_baseline_ = method->compares_with_baseline;
  if (method->highlights) {
    const MethodContext telling{plan.range_minimum_, plan.range_maximum_, scene, telling_palette(), std::nullopt};
    plan.marking_kernel_ = method->prepare(in_force, telling).kernel;
  }
  plan.settings_ = std::make_shared<const FusionSettings>(settings);
  plan.params_in_force_ = std::make_shared<const ParameterValues>(std::move(in_force));
  if (!plan.compares_with_baseline_) add_beyond(plan, scene.summary, prepared.highlighted);
  plan.highlighted_ = std::make_shared<const std::vector<TemperatureInterval>>(std::move(prepared.highlighted));
  return plan;
}

void FusionPlan::fuse(const base::VertexValues& vertices, std::span<base::Rgb8> fused) const noexcept {
  kernel_->fuse(vertices, fused);
}

void FusionPlan::mark(std::span<const float> temperature_celsius, std::span<const float> baseline_celsius,
                      std::span<std::uint8_t> marked) const noexcept {
  if (!marking_kernel_) {
    std::fill(marked.begin(), marked.end(), std::uint8_t{0});
    return;
  }
  constexpr std::size_t kBlock = 1024;
  std::array<base::Rgb8, kBlock> colours;
  for (std::size_t begin = 0; begin < temperature_celsius.size(); begin += kBlock) {
    const std::size_t size = std::min(kBlock, temperature_celsius.size() - begin);
    const std::span<base::Rgb8> block = std::span(colours).first(size);
    std::fill(block.begin(), block.end(), kUnmarked);
    base::VertexValues vertices{temperature_celsius.subspan(begin, size), block};
    if (!baseline_celsius.empty()) vertices.baseline_celsius = baseline_celsius.subspan(begin, size);
    marking_kernel_->fuse(vertices, block);
    for (std::size_t i = 0; i < size; ++i) marked[begin + i] = block[i] == kUnmarked ? 0 : 1;
  }
}

}  // namespace spectra::fusion
