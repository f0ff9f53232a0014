// Bins of a register of temperatures, compiled once per instruction set.

#if defined(SPECTRA_FUSION_HISTOGRAM_BINS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef SPECTRA_FUSION_HISTOGRAM_BINS_INL
#undef SPECTRA_FUSION_HISTOGRAM_BINS_INL
#else
#define SPECTRA_FUSION_HISTOGRAM_BINS_INL
#endif

#include <hwy/highway.h>

#include "fusion/statistics/temperature_statistics.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::fusion::HWY_NAMESPACE {

/// Writes the bin of each temperature as HistogramBinning defines it, and the number of bins for what is not finite.
/// `count` is a multiple of the lanes of a float register.
HWY_INLINE void histogram_bins(const HistogramBinning& binning, const float* temperature, std::size_t count,
                               std::int32_t* bin) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::ScalableTag<double> d;
  const hn::Rebind<float, decltype(d)> narrow;
  const hn::Rebind<std::int32_t, decltype(d)> index;
  const auto minimum = hn::Set(d, binning.minimum());
  const auto span = hn::Set(d, binning.span());
  const auto bins = hn::Set(d, binning.bins());
  const auto slope = hn::Set(d, binning.span() > 0 ? binning.bins() / binning.span() : 0);
  const auto last = hn::Set(d, binning.bins() - 0.5);
  const auto none = hn::Set(index, static_cast<std::int32_t>(binning.bins()));
  const auto whole = hn::Set(d, 6755399441055744.0);  // 1.5 * 2^52: adding it rounds to a whole number
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    const auto given = hn::LoadU(narrow, temperature + i);
    const auto finite = hn::IsFinite(given);
    const auto above = hn::Sub(hn::PromoteTo(d, hn::IfThenElseZero(finite, given)), minimum);
    auto position = hn::Min(hn::Max(hn::Mul(above, slope), hn::Zero(d)), last);
    // A product in place of the quotient can differ from the formula next to an edge only; there the formula decides.
    const auto edge = hn::Sub(hn::Add(position, whole), whole);
    const auto near_edge =
        hn::And(hn::Lt(hn::Abs(hn::Sub(position, edge)), hn::Set(d, 1e-9)), hn::Gt(position, hn::Set(d, 0.5)));
    if (HWY_UNLIKELY(!hn::AllFalse(d, near_edge))) {
      position = hn::Min(hn::Max(hn::Mul(hn::Div(above, span), bins), hn::Zero(d)), last);
    }
    const auto value = hn::DemoteTo(index, position);
    hn::StoreU(hn::IfThenElse(hn::RebindMask(index, finite), value, none), index, bin + i);
  }
}

}  // namespace spectra::fusion::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
