// What Highway 1.0 leaves out on WebAssembly (double lanes, two to a register) or does byte by byte (table lookups, parts of a
// register in memory), as far as the methods use it. It is added to Highway's own namespace, so that a method is written once
// for every machine: a function that is no template goes before the template of its name. A later Highway has all of it; then
// this file goes.

#if defined(SPECTRA_FUSION_WASM_LANES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef SPECTRA_FUSION_WASM_LANES_INL
#undef SPECTRA_FUSION_WASM_LANES_INL
#else
#define SPECTRA_FUSION_WASM_LANES_INL
#endif

#include <hwy/highway.h>

#if HWY_TARGET == HWY_WASM
#if HWY_HAVE_FLOAT64
#error "this Highway has double lanes on WebAssembly: leave this file out"
#endif

HWY_BEFORE_NAMESPACE();
namespace hwy::HWY_NAMESPACE {

template <std::size_t N>
using DoubleVec = Vec128<double, N>;
template <std::size_t N>
using DoubleMask = Mask128<double, N>;

template <std::size_t N, HWY_IF_LE128(double, N)>
HWY_API DoubleVec<N> Set(Simd<double, N, 0>, double value) {
  return {wasm_f64x2_splat(value)};
}

template <std::size_t N>
HWY_API DoubleVec<N> operator+(DoubleVec<N> a, DoubleVec<N> b) {
  return {wasm_f64x2_add(a.raw, b.raw)};
}
template <std::size_t N>
HWY_API DoubleVec<N> operator-(DoubleVec<N> a, DoubleVec<N> b) {
  return {wasm_f64x2_sub(a.raw, b.raw)};
}
template <std::size_t N>
HWY_API DoubleVec<N> operator*(DoubleVec<N> a, DoubleVec<N> b) {
  return {wasm_f64x2_mul(a.raw, b.raw)};
}
template <std::size_t N>
HWY_API DoubleVec<N> operator/(DoubleVec<N> a, DoubleVec<N> b) {
  return {wasm_f64x2_div(a.raw, b.raw)};
}

template <std::size_t N>
HWY_API DoubleMask<N> operator==(DoubleVec<N> a, DoubleVec<N> b) {
  return {wasm_f64x2_eq(a.raw, b.raw)};
}
template <std::size_t N>
HWY_API DoubleMask<N> operator>(DoubleVec<N> a, DoubleVec<N> b) {
  return {wasm_f64x2_gt(a.raw, b.raw)};
}

// The second where one of both is not a number, as everywhere in Highway on x86, and one instruction there.
template <std::size_t N>
HWY_API DoubleVec<N> Min(DoubleVec<N> a, DoubleVec<N> b) {
  return {wasm_f64x2_pmin(b.raw, a.raw)};
}
template <std::size_t N>
HWY_API DoubleVec<N> Max(DoubleVec<N> a, DoubleVec<N> b) {
  return {wasm_f64x2_pmax(b.raw, a.raw)};
}

template <std::size_t N>
HWY_API DoubleVec<N> Abs(DoubleVec<N> value) {
  return {wasm_f64x2_abs(value.raw)};
}

template <std::size_t N, HWY_IF_LE128(double, N)>
HWY_API DoubleVec<N> PromoteTo(Simd<double, N, 0>, Vec128<float, N> value) {
  return {wasm_f64x2_promote_low_f32x4(value.raw)};
}
/// In assembly, because clang 14 takes the lanes apart when half of the answer is not looked at.
template <std::size_t N, HWY_IF_LE64(float, N)>
HWY_API Vec128<float, N> DemoteTo(Simd<float, N, 0>, DoubleVec<N> value) {
  const v128_t from = value.raw;
  v128_t narrow;
  __asm__("local.get %1\n\tf32x4.demote_zero_f64x2\n\tlocal.set %0" : "=r"(narrow) : "r"(from));
  return {narrow};
}

/// By a lookup, because clang 14 converts lane by lane what it knows to be bytes.
HWY_API Vec128<std::int32_t> PromoteTo(Simd<std::int32_t, 4, 0>, Vec128<std::uint8_t, 4> bytes) {
  return {wasm_i8x16_swizzle(bytes.raw, wasm_i8x16_const(0, -1, -1, -1, 1, -1, -1, -1, 2, -1, -1, -1, 3, -1, -1, -1))};
}
HWY_API Vec128<std::uint8_t, 4> TruncateTo(Simd<std::uint8_t, 4, 0>, Vec128<std::uint32_t> value) {
  return {wasm_i8x16_swizzle(value.raw, wasm_i8x16_const(0, 4, 8, 12, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1))};
}

HWY_API Vec128<std::uint8_t> TableLookupBytes(Vec128<std::uint8_t> bytes, Vec128<std::uint8_t> from) {
  return {wasm_i8x16_swizzle(bytes.raw, from.raw)};
}
HWY_API Vec128<std::int8_t> TableLookupBytes(Vec128<std::int8_t> bytes, Vec128<std::int8_t> from) {
  return {wasm_i8x16_swizzle(bytes.raw, from.raw)};
}
HWY_API Vec128<std::int32_t> TableLookupBytes(Vec128<std::int32_t> bytes, Vec128<std::int32_t> from) {
  return {wasm_i8x16_swizzle(bytes.raw, from.raw)};
}
HWY_API Vec128<std::uint8_t> TableLookupBytesOr0(Vec128<std::uint8_t> bytes, Vec128<std::uint8_t> from) {
  return {wasm_i8x16_swizzle(bytes.raw, from.raw)};
}

HWY_API Vec128<std::uint8_t, 8> ZeroExtendVector(Simd<std::uint8_t, 8, 0>, Vec128<std::uint8_t, 4> low) {
  return {wasm_v128_and(low.raw, wasm_i32x4_const(-1, 0, 0, 0))};
}

HWY_API Vec128<float, 2> Load(Simd<float, 2, 0>, const float* HWY_RESTRICT from) {
  return {wasm_v128_load64_zero(from)};
}
HWY_API Vec128<std::uint8_t, 8> Load(Simd<std::uint8_t, 8, 0>, const std::uint8_t* HWY_RESTRICT from) {
  return {wasm_v128_load64_zero(from)};
}
HWY_API Vec128<std::uint8_t, 4> Load(Simd<std::uint8_t, 4, 0>, const std::uint8_t* HWY_RESTRICT from) {
  return {wasm_v128_load32_zero(from)};
}
HWY_API void Store(Vec128<float, 2> value, Simd<float, 2, 0>, float* HWY_RESTRICT to) {
  wasm_v128_store64_lane(to, value.raw, 0);
}
HWY_API void Store(Vec128<std::uint32_t, 2> value, Simd<std::uint32_t, 2, 0>, std::uint32_t* HWY_RESTRICT to) {
  wasm_v128_store64_lane(to, value.raw, 0);
}
HWY_API void Store(Vec128<std::uint8_t, 8> value, Simd<std::uint8_t, 8, 0>, std::uint8_t* HWY_RESTRICT to) {
  wasm_v128_store64_lane(to, value.raw, 0);
}
HWY_API void Store(Vec128<std::uint8_t, 4> value, Simd<std::uint8_t, 4, 0>, std::uint8_t* HWY_RESTRICT to) {
  wasm_v128_store32_lane(to, value.raw, 0);
}

}  // namespace hwy::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif

#endif
