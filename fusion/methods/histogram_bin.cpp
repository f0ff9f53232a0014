// Histogram bin highlighting: the rarest temperatures of the scene stand out in palette colours.
//
//   bin = min(bins - 1, floor((T - min) / (max - min) * bins)) over the data's own extremes
//   F = alpha M + (1 - alpha) V   in the n occupied bins of lowest (inverted: highest) count, else V
//
// Source: section 3.7. Bins are defined by the formula, never by comparing edges, which would put a third of them one
// bin low; what is infinite is in the first or the last. Cost: a bin, a palette lookup and a mix, and once per plan a
// histogram. Missing temperature: the visible colour, or the fixed colour that is set for it.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "fusion/methods/histogram_bin.cpp"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set

#include "fusion/methods/bin_set.hpp"
#include "fusion/methods/vertex_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::fusion::HWY_NAMESPACE {

void fuse_histogram_bin(const ThermalTable& thermal, const HistogramBinning& binning, const BinSet& shown, float alpha,
                        const VertexSpan& span) {
  const auto fill = [&](const float* temperature, const std::uint8_t*, std::size_t count, float* weight) HWY_ATTR {
    const FloatTag d;
    const BitsTag bits;
    alignas(64) std::int32_t bin[kBlock];
    histogram_bins<InfiniteBin::FirstOrLast>(binning, temperature, count, bin);
    const bool fits_register = shown.word_count() <= kLanes;
    const auto first_words = hn::LoadU(bits, shown.words());
    for (std::size_t i = 0; i < count; i += kLanes) {
      const auto index = hn::Load(IntTag(), bin + i);
      const auto word_index = hn::ShiftRight<5>(index);
      const auto word = fits_register ? hn::TableLookupLanes(first_words, hn::IndicesFromVec(bits, word_index))
                                      : hn::GatherIndex(bits, shown.words(), word_index);
      const auto bit = hn::Shl(hn::Set(bits, 1), hn::And(hn::BitCast(bits, index), hn::Set(bits, 31)));
      const auto is_shown = hn::RebindMask(d, hn::TestBit(word, bit));
      hn::Store(hn::IfThenElseZero(is_shown, all(alpha)), d, weight + i);
    }
  };
  fuse_thermal(span, thermal, Weights(fill), Mix());
}

}  // namespace spectra::fusion::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include <algorithm>
#include <vector>

#include "fusion/parameter_schema.hpp"
#include "fusion/statistics/temperature_statistics.hpp"

namespace spectra::fusion::methods {
namespace {

enum class Ties { Index, All };

struct HistogramBin {
  std::int64_t bins = 64;
  std::optional<std::int64_t> n;
  double alpha = 1;
  bool invert = false;
  Ties ties = Ties::Index;
};

/// The scene's histogram of as many bins as are asked for; empty bins without temperature.
Histogram histogram_of(const HistogramBin& params, const SceneTemperature& scene) {
  Histogram histogram;
  if (scene.summary.has_temperature() && scene.histogram) {
    histogram = scene.histogram(static_cast<std::uint32_t>(params.bins));
  }
  histogram.counts.resize(static_cast<std::size_t>(params.bins));
  return histogram;
}

/// The occupied bins in the order in which they are highlighted.
std::vector<std::size_t> ranked_bins(const HistogramBin& params, const std::vector<std::uint64_t>& counts) {
  std::vector<std::size_t> order;
  for (std::size_t bin = 0; bin < counts.size(); ++bin) {
    if (counts[bin] > 0) order.push_back(bin);
  }
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return params.invert ? counts[a] > counts[b] : counts[a] < counts[b];
  });
  return order;
}

/// How many of the ranked bins are highlighted where `n` is asked for.
std::size_t chosen_count(const HistogramBin& params, std::int64_t n, const std::vector<std::size_t>& ranked,
                         const std::vector<std::uint64_t>& counts) {
  std::size_t chosen = std::min(ranked.size(), static_cast<std::size_t>(n));
  if (params.ties == Ties::All && chosen > 0) {
    const std::uint64_t last = counts[ranked[chosen - 1]];
    while (chosen < ranked.size() && counts[ranked[chosen]] == last) ++chosen;
  }
  return chosen;
}

/// The largest n with which at most a tenth of the finite temperatures is highlighted.
std::int64_t automatic_count(const HistogramBin& params, const SceneTemperature& scene) {
  const std::vector<std::uint64_t> counts = histogram_of(params, scene).counts;
  const std::vector<std::size_t> ranked = ranked_bins(params, counts);
  const std::uint64_t most = scene.summary.finite_count / 10;
  std::uint64_t shown = 0;
  std::size_t added = 0;
  std::int64_t n = 0;
  for (; n < static_cast<std::int64_t>(ranked.size()); ++n) {
    for (const std::size_t end = chosen_count(params, n + 1, ranked, counts); added < end; ++added) {
      shown += counts[ranked[added]];
    }
    if (shown > most) break;
  }
  return n;
}

ParameterSchema<HistogramBin> schema() {
  ParameterSchema<HistogramBin> entries;
  entries
      .integer(&HistogramBin::bins, {.name = "bins",
                                     .label = "Bins",
                                     .help = "How many equal bins divide the temperatures of the scene.",
                                     .min = 1,
                                     .max = 4096,
                                     .step = 1})
      .integer(&HistogramBin::n,
               {.name = "n",
                .label = "Highlighted bins",
                .help = "How many of the rarest bins are highlighted; automatic shows at most a tenth of the scene.",
                .min = 0,
                .max = 4096,
                .step = 1},
               &automatic_count)
      .number(&HistogramBin::alpha, {.name = "alpha",
                                     .label = "Opacity",
                                     .help = "How much of the highlight covers the visible picture.",
                                     .min = 0,
                                     .max = 1,
                                     .step = 0.01})
      .toggle(&HistogramBin::invert,
              {.name = "invert", .label = "Invert", .help = "Highlights the most frequent bins instead of the rarest."})
      .choice(&HistogramBin::ties,
              {.name = "ties",
               .label = "Equal counts",
               .help = "Whether of bins with equal counts the coldest come first, or all of them are highlighted.",
               .options = {"index", "all"}});
  return entries;
}

/// For every bin whether it is highlighted.
std::vector<std::uint8_t> highlighted_bins(const HistogramBin& params, const std::vector<std::uint64_t>& counts) {
  const std::vector<std::size_t> ranked = ranked_bins(params, counts);
  const std::size_t chosen = chosen_count(params, *params.n, ranked, counts);
  std::vector<std::uint8_t> flags(counts.size(), 0);
  for (std::size_t i = 0; i < chosen; ++i) flags[ranked[i]] = 1;
  return flags;
}

std::vector<TemperatureInterval> intervals(const std::vector<std::uint8_t>& flags, const Histogram& histogram) {
  std::vector<TemperatureInterval> result;
  for (std::size_t bin = 0; bin < flags.size(); ++bin) {
    if (!flags[bin]) continue;
    std::size_t end = bin + 1;
    while (end < flags.size() && flags[end]) ++end;
    result.push_back({histogram_edge(histogram, bin), histogram_edge(histogram, end)});
    bin = end;
  }
  return result;
}

HWY_EXPORT(fuse_histogram_bin);

PreparedMethod prepare(const HistogramBin& params, const MethodContext& context) {
  const Histogram histogram = histogram_of(params, context.scene);
  const std::vector<std::uint8_t> flags = highlighted_bins(params, histogram.counts);
  BinSet shown(flags.size());
  for (std::size_t index = 0; index < flags.size(); ++index) {
    if (flags[index]) shown.insert(index);
  }
  std::vector<TemperatureInterval> highlighted = intervals(flags, histogram);
  const auto fuse = [thermal = ThermalTable(context), bin = HistogramBinning(histogram), shown = std::move(shown),
                     alpha = static_cast<float>(params.alpha)](const VertexSpan& span) {
    HWY_DYNAMIC_DISPATCH(fuse_histogram_bin)(thermal, bin, shown, alpha, span);
  };
  return {lane_kernel(context, fuse), std::move(highlighted)};
}

}  // namespace

Method histogram_bin() {
  Method method;
  method.id = "histogram_bin";
  method.label = "Histogram bins";
  method.summary = "The rarest temperatures of the scene show palette colours; the rest stays visible.";
  method.highlights = true;
  return make_method(std::move(method), schema(), &prepare);
}

}  // namespace spectra::fusion::methods

#endif  // HWY_ONCE
