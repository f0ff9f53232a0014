// Lanes of floats and what a lens does to them, for the kernels: compiled once per instruction set, so that it is included again for each.
#if defined(SPECTRA_MAPPING_LENS_LANES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef SPECTRA_MAPPING_LENS_LANES_INL
#undef SPECTRA_MAPPING_LENS_LANES_INL
#else
#define SPECTRA_MAPPING_LENS_LANES_INL
#endif

#include <hwy/highway.h>

#include "server/mapping/camera.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::mapping::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using FloatTag = hn::CappedTag<float, 16>;
using IntTag = hn::RebindToSigned<FloatTag>;
using Floats = hn::Vec<FloatTag>;
using Ints = hn::Vec<IntTag>;

HWY_INLINE Floats all(float value) {
  return hn::Set(FloatTag(), value);
}

/// What the lens bends rays to: x / z and y / z become those of an ideal one that falls into the same pixel.
HWY_INLINE void distort(const Lens& lens, Floats& x, Floats& y) {
  const Floats xx = hn::Mul(x, x), yy = hn::Mul(y, y), xy2 = hn::Mul(all(2), hn::Mul(x, y)), rr = hn::Add(xx, yy);
  const Floats radial = hn::Add(all(1), hn::Mul(rr, hn::Add(all(lens.k1), hn::Mul(rr, all(lens.k2)))));
  const Floats bent_x = hn::Add(hn::Mul(all(lens.p1), xy2), hn::Mul(all(lens.p2), hn::Add(rr, hn::Add(xx, xx))));
  const Floats bent_y = hn::Add(hn::Mul(all(lens.p1), hn::Add(rr, hn::Add(yy, yy))), hn::Mul(all(lens.p2), xy2));
  x = hn::Add(hn::Mul(x, radial), bent_x);
  y = hn::Add(hn::Mul(y, radial), bent_y);
}

}  // namespace spectra::mapping::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // lanes of this instruction set
