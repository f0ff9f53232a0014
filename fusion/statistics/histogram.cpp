#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "fusion/statistics/histogram.cpp"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set

#include <cstring>

#include "fusion/statistics/histogram_bins-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::fusion::HWY_NAMESPACE {

/// Adds to four tables of bins + 1 counts in turn, so that equal neighbours do not wait for each other's store.
void count_bins(const HistogramBinning& binning, const float* temperature, std::size_t count, std::uint32_t* tables,
                std::size_t stride) {
  constexpr std::size_t kBlock = 1024;
  alignas(64) std::int32_t bin[kBlock];
  alignas(64) float padded[kBlock];
  for (std::size_t begin = 0; begin < count; begin += kBlock) {
    const std::size_t size = std::min(kBlock, count - begin);
    const float* block = temperature + begin;
    if (size < kBlock) {
      std::memcpy(padded, block, size * sizeof(float));
      std::fill(padded + size, padded + kBlock, 0.0F);
      block = padded;
    }
    histogram_bins<InfiniteBin::None>(binning, block, kBlock, bin);
    std::size_t i = 0;
    for (; i + 4 <= size; i += 4) {
      ++tables[bin[i]];
      ++tables[stride + static_cast<std::size_t>(bin[i + 1])];
      ++tables[2 * stride + static_cast<std::size_t>(bin[i + 2])];
      ++tables[3 * stride + static_cast<std::size_t>(bin[i + 3])];
    }
    for (; i < size; ++i) ++tables[bin[i]];
  }
}

}  // namespace spectra::fusion::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "fusion/statistics/temperature_statistics.hpp"

namespace spectra::fusion {
namespace {
HWY_EXPORT(count_bins);
}  // namespace

double histogram_edge(const Histogram& histogram, std::size_t index) {
  const double minimum = double{histogram.minimum};
  const double maximum = double{histogram.maximum};
  const std::size_t bins = histogram.counts.size();
  if (bins == 0 || index >= bins) return maximum;
  return minimum + (maximum - minimum) * (static_cast<double>(index) / static_cast<double>(bins));
}

double histogram_quantile(const Histogram& histogram, double part) {
  std::uint64_t total = 0;
  for (const std::uint64_t count : histogram.counts) total += count;
  if (total == 0) return 0;
  const double wanted = std::clamp(part, 0.0, 1.0) * static_cast<double>(total);
  double before = 0;
  for (std::size_t bin = 0; bin < histogram.counts.size(); ++bin) {
    const auto count = static_cast<double>(histogram.counts[bin]);
    if (count > 0 && before + count >= wanted) {
      // Exact at both edges, however far apart they are.
      return std::lerp(histogram_edge(histogram, bin), histogram_edge(histogram, bin + 1), (wanted - before) / count);
    }
    before += count;
  }
  return double{histogram.maximum};
}

void merge_histogram(const Histogram& other, Histogram& histogram) {
  for (std::size_t bin = 0; bin < std::min(other.counts.size(), histogram.counts.size()); ++bin) {
    histogram.counts[bin] += other.counts[bin];
  }
}

void add_to_histogram(std::span<const float> temperature_celsius, Histogram& histogram) {
  const std::size_t bins = histogram.counts.size();
  if (bins == 0 || temperature_celsius.empty()) return;
  const HistogramBinning binning(histogram);
  // A handful of values does not pay for the tables.
  if (temperature_celsius.size() < bins) {
    for (const float value : temperature_celsius) {
      if (std::isfinite(value)) ++histogram.counts[binning(value)];
    }
    return;
  }
  const std::size_t stride = bins + 1;
  constexpr std::size_t kMost = std::size_t{1} << 31;  // a count of 32 bits holds that many
  for (std::size_t begin = 0; begin < temperature_celsius.size(); begin += kMost) {
    const auto part = temperature_celsius.subspan(begin, std::min(kMost, temperature_celsius.size() - begin));
    std::vector<std::uint32_t> tables(4 * stride);
    HWY_DYNAMIC_DISPATCH(count_bins)(binning, part.data(), part.size(), tables.data(), stride);
    for (std::size_t bin = 0; bin < bins; ++bin) {
      histogram.counts[bin] +=
          std::uint64_t{tables[bin]} + tables[stride + bin] + tables[2 * stride + bin] + tables[3 * stride + bin];
    }
  }
}

}  // namespace spectra::fusion

#endif  // HWY_ONCE
