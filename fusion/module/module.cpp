// The library as a WebAssembly module: what a host without C++ needs to fuse by itself. A host writes into memory of the
// module and calls functions of numbers alone; there are no imports. One module has one scene, one set of settings and one
// plan at a time, and is used by one thread.
//
// Text goes in and out through one buffer, UTF-8 without an end mark. A function that can refuse returns an ErrorCode, and
// leaves the sentence in the buffer.

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "fusion/fusion_plan.hpp"
#include "fusion/temperature_codes.hpp"

#define SPECTRA_MODULE_EXPORT(name) extern "C" __attribute__((export_name(#name)))

namespace spectra::fusion {
namespace {

constexpr std::uint32_t kTextCapacity = 4096;
constexpr std::int32_t kReady = 0;
constexpr std::int32_t kFactsMissing = -1;

struct State {
  char text[kTextCapacity] = {};
  std::uint32_t text_length = 0;
  base::Error error = {};

  TemperatureSummary summary;
  std::map<std::uint32_t, std::vector<double>> counts_by_bins;  ///< As the host writes them; whole numbers below 2^53.
  std::optional<std::array<double, Hues::kSectors>> hues;
  std::array<double, 3 * 256> palette = {};

  FusionSettings settings = default_settings();
  FusionChange change;
  std::optional<FusionPlan> plan;
  std::set<std::uint32_t> wanted_bins;
  bool wanted_hues = false;
};

State& state() {
  static State* const only = new State;
  return *only;
}

std::string text_in(std::uint32_t begin, std::uint32_t end) {
  const std::uint32_t last = std::min(end, kTextCapacity);
  return begin < last ? std::string(state().text + begin, last - begin) : std::string();
}

void text_out(std::string_view text) {
  State& now = state();
  now.text_length = static_cast<std::uint32_t>(std::min<std::size_t>(text.size(), kTextCapacity));
  std::memcpy(now.text, text.data(), now.text_length);
}

std::int32_t refused(const base::Error& error) {
  state().error = error;
  text_out(error.message);
  return static_cast<std::int32_t>(error.code);
}

SceneTemperature scene() {
  State& now = state();
  SceneTemperature facts;
  facts.summary = now.summary;
  facts.histogram = [&now](std::uint32_t bins) {
    Histogram histogram{now.summary.minimum, now.summary.maximum, std::vector<std::uint64_t>(bins)};
    const auto found = now.counts_by_bins.find(bins);
    if (found == now.counts_by_bins.end()) {
      now.wanted_bins.insert(bins);
      return histogram;
    }
    std::transform(found->second.begin(), found->second.end(), histogram.counts.begin(),
                   [](double count) { return count > 0 ? static_cast<std::uint64_t>(count) : 0; });
    return histogram;
  };
  facts.hues = [&now] {
    Hues result;
    now.wanted_hues = now.wanted_hues || !now.hues;
    if (now.hues) {
      std::transform(now.hues->begin(), now.hues->end(), result.chroma.begin(),
                     [](double chroma) { return chroma > 0 ? static_cast<std::uint64_t>(chroma) : 0; });
    }
    return result;
  };
  return facts;
}

std::int32_t prepare_plan(const PaletteTable* palette) {
  State& now = state();
  now.wanted_bins.clear();
  now.wanted_hues = false;
  now.plan.reset();
  auto plan =
      palette ? FusionPlan::prepare(now.settings, scene(), *palette) : FusionPlan::prepare(now.settings, scene());
  if (!now.wanted_bins.empty() || now.wanted_hues) return kFactsMissing;
  if (!plan) return refused(plan.assume_error());
  now.plan = std::move(plan).assume_value();
  return kReady;
}

/// Parameter `index` of values, in the order of their names.
const std::pair<const std::string, ParameterValue>* parameter_at(const ParameterValues& values, std::uint32_t index) {
  return index < values.size() ? &*std::next(values.begin(), static_cast<std::ptrdiff_t>(index)) : nullptr;
}

double number_of(const ParameterValue& value) {
  if (const auto* number = std::get_if<double>(&value)) return *number;
  if (const auto* integer = std::get_if<std::int64_t>(&value)) return static_cast<double>(*integer);
  if (const auto* toggle = std::get_if<bool>(&value)) return *toggle ? 1 : 0;
  return std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

// ---- Memory. Addresses are bytes from the start of the module's memory; 0 = there is no room.

SPECTRA_MODULE_EXPORT(allocate) void* module_allocate(std::uint32_t bytes) {
  return std::aligned_alloc(64, (std::size_t{bytes} + 63) / 64 * 64);
}
SPECTRA_MODULE_EXPORT(release) void module_release(void* memory) {
  std::free(memory);
}
SPECTRA_MODULE_EXPORT(text) char* module_text() {
  return state().text;
}
SPECTRA_MODULE_EXPORT(text_capacity) std::uint32_t module_text_capacity() {
  return kTextCapacity;
}
SPECTRA_MODULE_EXPORT(text_length) std::uint32_t module_text_length() {
  return state().text_length;
}

// ---- Facts of the whole scene, from whoever holds it. Setting the summary forgets the others.

SPECTRA_MODULE_EXPORT(scene_summary)
void module_scene_summary(double finite_count, double missing_count, double over_range_count, double under_range_count,
                          double minimum, double maximum, double mean, double sigma) {
  State& now = state();
  now.summary = {.finite_count = static_cast<std::uint64_t>(finite_count),
                 .missing_count = static_cast<std::uint64_t>(missing_count),
                 .over_range_count = static_cast<std::uint64_t>(over_range_count),
                 .under_range_count = static_cast<std::uint64_t>(under_range_count),
                 .minimum = static_cast<float>(minimum),
                 .maximum = static_cast<float>(maximum),
                 .mean = mean,
                 .sigma = sigma};
  now.counts_by_bins.clear();
  now.hues.reset();
}

/// Where the counts of the histogram of so many bins are to be written, one double each; 0 when there are none such.
SPECTRA_MODULE_EXPORT(scene_histogram) double* module_scene_histogram(std::uint32_t bins) {
  if (bins == 0 || bins > kPercentileBins) return nullptr;
  auto& counts = state().counts_by_bins[bins];
  counts.assign(bins, 0);
  return counts.data();
}

SPECTRA_MODULE_EXPORT(hue_sectors) std::uint32_t module_hue_sectors() {
  return Hues::kSectors;
}

/// Where the chroma of every hue sector is to be written, one double each.
SPECTRA_MODULE_EXPORT(scene_hues) double* module_scene_hues() {
  return state().hues.emplace().data();
}

// ---- Settings: a change is begun, filled and applied. Names and values stand in the text buffer.

SPECTRA_MODULE_EXPORT(settings_reset) void module_settings_reset() {
  state().settings = default_settings();
}
SPECTRA_MODULE_EXPORT(change_begin) void module_change_begin() {
  state().change = {};
}
SPECTRA_MODULE_EXPORT(change_method) void module_change_method(std::uint32_t end) {
  state().change.method = text_in(0, end);
}
SPECTRA_MODULE_EXPORT(change_palette) void module_change_palette(std::uint32_t end) {
  state().change.palette = text_in(0, end);
}
SPECTRA_MODULE_EXPORT(change_automatic) void module_change_automatic(std::uint32_t name_end) {
  state().change.params[text_in(0, name_end)] = Automatic{};
}
SPECTRA_MODULE_EXPORT(change_number) void module_change_number(std::uint32_t name_end, double value) {
  state().change.params[text_in(0, name_end)] = value;
}
SPECTRA_MODULE_EXPORT(change_toggle) void module_change_toggle(std::uint32_t name_end, std::int32_t value) {
  state().change.params[text_in(0, name_end)] = value != 0;
}
SPECTRA_MODULE_EXPORT(change_choice) void module_change_choice(std::uint32_t name_end, std::uint32_t value_end) {
  state().change.params[text_in(0, name_end)] = text_in(name_end, value_end);
}
SPECTRA_MODULE_EXPORT(change_range_auto) void module_change_range_auto() {
  state().change.range = RangeSetting{};
}
SPECTRA_MODULE_EXPORT(change_range_manual) void module_change_range_manual(double minimum, double maximum) {
  state().change.range = RangeSetting::manual(minimum, maximum);
}
SPECTRA_MODULE_EXPORT(change_range_percentile) void module_change_range_percentile(double low, double high) {
  state().change.range = RangeSetting::percentile(low, high);
}
SPECTRA_MODULE_EXPORT(change_missing_visible) void module_change_missing_visible() {
  state().change.missing = MissingDisplay{};
}
SPECTRA_MODULE_EXPORT(change_missing_colour)
void module_change_missing_colour(std::uint8_t r, std::uint8_t g, std::uint8_t b) {
  state().change.missing = MissingDisplay{base::Rgb8{r, g, b}};
}

/// Applies the change to the settings in force: 0, or the code of the refusal, which leaves them as they were.
SPECTRA_MODULE_EXPORT(change_apply) std::int32_t module_change_apply() {
  auto changed = with_change(state().settings, state().change);
  if (!changed) return refused(changed.assume_error());
  state().settings = std::move(changed).assume_value();
  return kReady;
}

/// What the last refusal is about, into the text buffer.
SPECTRA_MODULE_EXPORT(error_field) void module_error_field() {
  text_out(state().error.field);
}

// ---- The plan.

/// Makes the settings ready for the scene: 0, the code of a refusal, or -1 when facts of the scene are wanted that have not been
/// given (wanted_bins, wants_hues).
SPECTRA_MODULE_EXPORT(prepare) std::int32_t module_prepare() {
  return prepare_plan(nullptr);
}

/// 256 rows of r, g, b for prepare_with_palette, one double each.
SPECTRA_MODULE_EXPORT(palette) double* module_palette() {
  return state().palette.data();
}
SPECTRA_MODULE_EXPORT(prepare_with_palette) std::int32_t module_prepare_with_palette() {
  PaletteTable table{};
  for (std::size_t i = 0; i < state().palette.size(); ++i) table[i / 3][i % 3] = state().palette[i];
  return prepare_plan(&table);
}

/// The smallest number of bins of which a histogram is wanted; 0 = none.
SPECTRA_MODULE_EXPORT(wanted_bins) std::uint32_t module_wanted_bins() {
  return state().wanted_bins.empty() ? 0 : *state().wanted_bins.begin();
}
SPECTRA_MODULE_EXPORT(wants_hues) std::int32_t module_wants_hues() {
  return state().wanted_hues ? 1 : 0;
}

SPECTRA_MODULE_EXPORT(range_minimum) double module_range_minimum() {
  return state().plan ? state().plan->range_minimum() : 0;
}
SPECTRA_MODULE_EXPORT(range_maximum) double module_range_maximum() {
  return state().plan ? state().plan->range_maximum() : 0;
}
SPECTRA_MODULE_EXPORT(highlighted_count) std::uint32_t module_highlighted_count() {
  return state().plan ? static_cast<std::uint32_t>(state().plan->highlighted().size()) : 0;
}
/// Two doubles for each highlighted interval.
SPECTRA_MODULE_EXPORT(highlighted) const TemperatureInterval* module_highlighted() {
  return state().plan ? state().plan->highlighted().data() : nullptr;
}

// ---- Parameters of the settings (automatic ones are no number) and of the plan (every one in force).

SPECTRA_MODULE_EXPORT(parameter_count) std::uint32_t module_parameter_count() {
  return static_cast<std::uint32_t>(state().settings.params.size());
}
/// The name, into the text buffer.
SPECTRA_MODULE_EXPORT(parameter_name) void module_parameter_name(std::uint32_t index) {
  const auto* parameter = parameter_at(state().settings.params, index);
  text_out(parameter ? parameter->first : std::string());
}
/// 0 automatic, 1 number, 2 whole number, 3 toggle, 4 choice; what it is set to.
SPECTRA_MODULE_EXPORT(parameter_kind) std::int32_t module_parameter_kind(std::uint32_t index) {
  const auto* parameter = parameter_at(state().settings.params, index);
  return parameter ? static_cast<std::int32_t>(parameter->second.index()) : 0;
}
SPECTRA_MODULE_EXPORT(parameter_number) double module_parameter_number(std::uint32_t index) {
  const auto* parameter = parameter_at(state().settings.params, index);
  return parameter ? number_of(parameter->second) : 0;
}
/// The id of the option that is chosen, into the text buffer.
SPECTRA_MODULE_EXPORT(parameter_choice) void module_parameter_choice(std::uint32_t index) {
  const auto* parameter = parameter_at(state().settings.params, index);
  const auto* option = parameter ? std::get_if<std::string>(&parameter->second) : nullptr;
  text_out(option ? *option : std::string());
}
SPECTRA_MODULE_EXPORT(parameter_in_force) double module_parameter_in_force(std::uint32_t index) {
  const auto* parameter = state().plan ? parameter_at(state().plan->params_in_force(), index) : nullptr;
  return parameter ? number_of(parameter->second) : std::numeric_limits<double>::quiet_NaN();
}

// ---- Fusing. Without a plan nothing is written.

SPECTRA_MODULE_EXPORT(fuse)
void module_fuse(const float* temperature_celsius, const base::Rgb8* visible, base::Rgb8* fused, std::uint32_t count) {
  if (state().plan) state().plan->fuse({temperature_celsius, count}, {visible, count}, {fused, count});
}

/// The same of temperatures that are given as TemperatureCodes.
SPECTRA_MODULE_EXPORT(fuse_codes)
void module_fuse_codes(const std::uint16_t* code, float scale, float offset, const base::Rgb8* visible,
                       base::Rgb8* fused, std::uint32_t count) {
  if (!state().plan) return;
  const TemperatureCodes codes{scale, offset};
  constexpr std::uint32_t kBlock = 4096;
  alignas(64) static float temperature[kBlock];
  for (std::uint32_t begin = 0; begin < count; begin += kBlock) {
    const std::uint32_t size = std::min(kBlock, count - begin);
    codes.decode({code + begin, size}, {temperature, size});
    state().plan->fuse({temperature, size}, {visible + begin, size}, {fused + begin, size});
  }
}

/// The same into red, green, blue and alpha. Alpha is 255; with marks it is 0 where the method highlights the temperature so
/// that it can be seen.
SPECTRA_MODULE_EXPORT(fuse_codes_rgba)
void module_fuse_codes_rgba(const std::uint16_t* code, float scale, float offset, const base::Rgb8* visible,
                            std::uint8_t* rgba, std::uint32_t count, std::int32_t with_marks) {
  if (!state().plan) return;
  const FusionPlan& plan = *state().plan;
  const TemperatureCodes codes{scale, offset};
  constexpr std::uint32_t kBlock = 1024;
  alignas(64) static float temperature[kBlock];
  static base::Rgb8 fused[kBlock];
  static std::uint8_t marked[kBlock];
  const bool has_marks = with_marks != 0 && plan.highlights();
  if (!has_marks) std::fill(marked, marked + kBlock, std::uint8_t{0});
  for (std::uint32_t begin = 0; begin < count; begin += kBlock) {
    const std::uint32_t size = std::min(kBlock, count - begin);
    codes.decode({code + begin, size}, {temperature, size});
    plan.fuse({temperature, size}, {visible + begin, size}, {fused, size});
    if (has_marks) plan.mark({temperature, size}, {}, {marked, size});
    std::uint8_t* to = rgba + 4 * std::size_t{begin};
    for (std::uint32_t i = 0; i < size; ++i, to += 4) {
      to[0] = fused[i].r;
      to[1] = fused[i].g;
      to[2] = fused[i].b;
      to[3] = marked[i] == 0 ? 255 : 0;
    }
  }
}

}  // namespace spectra::fusion
