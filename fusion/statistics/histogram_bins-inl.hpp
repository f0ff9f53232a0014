// Bins of a register of temperatures, compiled once per instruction set.

#if defined(SPECTRA_FUSION_HISTOGRAM_BINS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef SPECTRA_FUSION_HISTOGRAM_BINS_INL
#undef SPECTRA_FUSION_HISTOGRAM_BINS_INL
#else
#define SPECTRA_FUSION_HISTOGRAM_BINS_INL
#endif

#include <hwy/highway.h>

#include <cmath>

#include "fusion/statistics/temperature_statistics.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::fusion::HWY_NAMESPACE {

/// What becomes of infinite temperatures.
enum class InfiniteBin { None, FirstOrLast };

/// Writes the bin of each temperature as HistogramBinning defines it, and the number of bins for what is in none.
/// `count` is a multiple of the lanes of a float register.
///
/// In float32 the position is off by at most three roundings, 1.8e-7 of the number of bins. That can change the bin next
/// to an edge only; there the defining formula decides.
template <InfiniteBin kInfinite>
HWY_INLINE void histogram_bins(const HistogramBinning& binning, const float* temperature, std::size_t count,
                               std::int32_t* bin) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::ScalableTag<float> d;
  const hn::RebindToSigned<decltype(d)> index;
  const std::size_t lanes = hn::Lanes(d);
  const auto no_bin = static_cast<std::int32_t>(binning.bins());
  const auto as_defined = [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const bool has_bin = kInfinite == InfiniteBin::None ? std::isfinite(temperature[i]) : !std::isnan(temperature[i]);
      bin[i] = has_bin ? static_cast<std::int32_t>(binning(temperature[i])) : no_bin;
    }
  };
  const bool is_usual = binning.bins() <= 4096 && binning.span() > 1e-30 && binning.span() < 1e30;
  if (!is_usual) {
    as_defined(0, count);
    return;
  }
  const auto minimum = hn::Set(d, static_cast<float>(binning.minimum()));
  const auto slope = hn::Set(d, static_cast<float>(binning.bins() / binning.span()));
  const auto last = hn::Set(d, static_cast<float>(binning.bins() - 0.5));
  const auto reach = hn::Set(d, static_cast<float>(binning.bins() * 2.4e-7));
  const auto half = hn::Set(d, 0.5F);
  const auto whole = hn::Set(d, 12582912.0F);  // 1.5 * 2^23: adding it rounds to a whole number, in the low bits
  const auto none = hn::Set(index, no_bin);
  for (std::size_t i = 0; i < count; i += lanes) {
    const auto given = hn::LoadU(d, temperature + i);
    const auto has_bin = kInfinite == InfiniteBin::None ? hn::IsFinite(given) : hn::Not(hn::IsNaN(given));
    const auto above = hn::Sub(hn::IfThenElse(has_bin, given, minimum), minimum);
    const auto position = hn::Min(hn::Max(hn::Mul(above, slope), hn::Zero(d)), last);
    const auto edge = hn::Sub(hn::Add(position, whole), whole);
    const auto near_edge = hn::And(hn::Lt(hn::Abs(hn::Sub(position, edge)), reach), hn::Gt(position, half));
    const auto value = hn::And(hn::BitCast(index, hn::Add(hn::Sub(position, half), whole)), hn::Set(index, 0x1FFF));
    hn::StoreU(hn::IfThenElse(hn::RebindMask(index, has_bin), value, none), index, bin + i);
    if (HWY_UNLIKELY(!hn::AllFalse(d, near_edge))) as_defined(i, i + lanes);
  }
}

}  // namespace spectra::fusion::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
