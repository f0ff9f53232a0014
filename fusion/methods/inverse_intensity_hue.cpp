// Inverse intensity-hue mapping: the visible picture keeps its hue, the temperature gives the brightness.
//
//   I = t^k
//   substitute: hue and saturation of V, value I, that is F = 255 I V / max(V); grey 255 I where V is black
//   scale:      F = I V, which keeps dark print on light paper readable
//
// Source: Eqs. 11-12; the print raises T - Tmax, which is not a number for a fractional k. Cost: a normalisation and a
// power. Missing temperature: the visible colour, or the fixed colour that is set for it.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "fusion/methods/inverse_intensity_hue.cpp"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set

#include "fusion/methods/vertex_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::fusion::HWY_NAMESPACE {

/// c0 + x (c1 + x (c2 + ...)).
HWY_INLINE Doubles polynomial(Doubles, double c0) {
  return hn::Set(DoubleTag(), c0);
}
template <class... Rest>
HWY_INLINE Doubles polynomial(Doubles x, double c0, Rest... rest) {
  return hn::Add(hn::Set(DoubleTag(), c0), hn::Mul(x, polynomial(x, rest...)));
}

/// t^k for t in [0, 1] and k > 0, within 1.5e-7 of the exact power. t may be subnormal only where `lift` says so.
HWY_INLINE Doubles power(Doubles t, double k, bool lift) {
  const DoubleTag d;
  const hn::RebindToSigned<DoubleTag> di;
  // t = 2^e m with m in [sqrt(1/2), sqrt(2)).
  Doubles lifted = t;
  Doubles lifted_by = hn::Zero(d);
  if (lift) {
    const auto tiny = hn::Lt(t, hn::Set(d, 0x1p-1000));
    lifted = hn::IfThenElse(tiny, hn::Mul(t, hn::Set(d, 0x1p600)), t);
    lifted_by = hn::IfThenElseZero(tiny, hn::Set(d, 600));
  }
  const auto bits = hn::BitCast(di, lifted);
  const auto root_half = hn::Set(di, 0x3FE6A09E667F3BCDLL);
  const auto exponent = hn::ShiftRight<52>(hn::Sub(bits, root_half));
  const Doubles m = hn::BitCast(d, hn::Sub(bits, hn::ShiftLeft<52>(exponent)));
  // A small whole number added to the bits of kWholeDouble is that number added to it.
  const Doubles whole = hn::Set(d, kWholeDouble);
  Doubles e = hn::Sub(hn::BitCast(d, hn::Add(exponent, hn::BitCast(di, whole))), whole);
  if (lift) e = hn::Sub(e, lifted_by);
  // ln m = 2 artanh s with s = (m - 1) / (m + 1), |s| < 0.172: the series to s^7.
  const Doubles s = hn::Div(hn::Sub(m, hn::Set(d, 1)), hn::Add(m, hn::Set(d, 1)));
  constexpr double kScale = 2.8853900817779268;  // 2 / ln 2
  const Doubles log2 = hn::Add(e, hn::Mul(s, polynomial(hn::Mul(s, s), kScale, kScale / 3, kScale / 5, kScale / 7)));
  // 2^y = 2^n e^x with n whole and |x| <= ln 2 / 2: the series to x^6.
  const Doubles y = hn::Max(hn::Mul(log2, hn::Set(d, k)), hn::Set(d, -1000));
  const Doubles shifted = hn::Add(y, whole);
  const Doubles x = hn::Mul(hn::Sub(y, hn::Sub(shifted, whole)), hn::Set(d, 0.6931471805599453));
  const Doubles exp = polynomial(x, 1.0, 1.0, 1.0 / 2, 1.0 / 6, 1.0 / 24, 1.0 / 120, 1.0 / 720);
  const auto two_to_n = hn::ShiftLeft<52>(hn::BitCast(di, shifted));
  const Doubles result = hn::BitCast(d, hn::Add(hn::BitCast(di, exp), two_to_n));
  return hn::IfThenElseZero(hn::Gt(t, hn::Zero(d)), result);
}

void fuse_inverse(const Ramp& normalised, double k, bool lift, bool substitute, const VertexSpan& span) {
  const auto intensity = [&](Doubles temperature) SPECTRA_IN_LOOP {
    const Doubles t = on_ramp(normalised, temperature);
    return k == 1 ? t : power(t, k, lift);
  };
  fuse_shaded(span, intensity, [&](const Vertices& vertices, Floats scale) SPECTRA_IN_LOOP {
    const Colours& v = vertices.visible;
    Floats grey = all(0);
    if (substitute) {
      const Floats value = hn::Mul(all(255), scale);
      const Floats brightest = hn::Max(hn::Max(v.r, v.g), v.b);
      const auto black = hn::Eq(brightest, all(0));
      scale = hn::Div(value, hn::IfThenElse(black, all(1), brightest));
      grey = hn::IfThenElseZero(black, value);
    }
    return Colours{hn::Add(grey, hn::Mul(scale, v.r)), hn::Add(grey, hn::Mul(scale, v.g)),
                   hn::Add(grey, hn::Mul(scale, v.b))};
  });
}

}  // namespace spectra::fusion::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "fusion/parameter_schema.hpp"

namespace spectra::fusion::methods {
namespace {

enum class Mode { Substitute, Scale };

struct InverseIntensityHue {
  double k = 1;
  Mode mode = Mode::Substitute;
};

ParameterSchema<InverseIntensityHue> schema() {
  ParameterSchema<InverseIntensityHue> entries;
  entries
      .number(&InverseIntensityHue::k, {.name = "k",
                                        .label = "Exponent",
                                        .help = "Above 1 darkens all but the hottest, below 1 brightens the cold.",
                                        .min = 0,
                                        .max = 100,
                                        .step = 0.1,
                                        .exclusive_min = 0})
      .choice(&InverseIntensityHue::mode,
              {.name = "mode",
               .label = "Brightness",
               .help = "Whether the temperature takes the place of the visible brightness or scales it.",
               .options = {"substitute", "scale"}});
  return entries;
}

HWY_EXPORT(fuse_inverse);

PreparedMethod prepare(const InverseIntensityHue& params, const MethodContext& context) {
  const double half_span = context.range_maximum / 2 - context.range_minimum / 2;
  const auto fuse = [normalised = normalisation(context), k = params.k, lift = half_span > 1e200,
                     substitute = params.mode == Mode::Substitute](const VertexSpan& span) {
    HWY_DYNAMIC_DISPATCH(fuse_inverse)(normalised, k, lift, substitute, span);
  };
  return {lane_kernel(context, fuse), {}};
}

}  // namespace

Method inverse_intensity_hue() {
  Method method;
  method.id = "inverse_intensity_hue";
  method.label = "Inverse intensity-hue mapping";
  method.summary = "The visible picture gives the hue, the temperature the brightness.";
  method.uses_palette = false;
  method.hotter_is_lighter = true;
  return make_method(std::move(method), schema(), &prepare);
}

}  // namespace spectra::fusion::methods

#endif  // HWY_ONCE
