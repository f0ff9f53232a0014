// The loop around every fusion method, compiled once per instruction set: a method's file includes this after
// hwy/foreach_target.h. Multiplications and additions stay apart (no fused multiply-add), so that every instruction
// set gives the same bytes.

#if defined(SPECTRA_FUSION_VERTEX_LANES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef SPECTRA_FUSION_VERTEX_LANES_INL
#undef SPECTRA_FUSION_VERTEX_LANES_INL
#else
#define SPECTRA_FUSION_VERTEX_LANES_INL
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include "fusion/methods/vertex_lanes.hpp"
#include "fusion/statistics/histogram_bins-inl.hpp"
#include "fusion/wasm_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::fusion::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using FloatTag = hn::ScalableTag<float>;
using Floats = hn::Vec<FloatTag>;
using IntTag = hn::RebindToSigned<FloatTag>;
using BitsTag = hn::RebindToUnsigned<FloatTag>;
using DoubleTag = hn::ScalableTag<double>;
using Doubles = hn::Vec<DoubleTag>;
using ByteTag = hn::ScalableTag<std::uint8_t>;

/// Of a lambda for one register: part of the loop around it, also where a compiler that saves bytes would call it.
#define SPECTRA_IN_LOOP HWY_ATTR __attribute__((always_inline))

/// Adding it makes a float of small magnitude a whole number, rounded half to even, in the low bits.
constexpr float kWholeFloat = 12582912.0F;           // 1.5 * 2^23
constexpr double kWholeDouble = 6755399441055744.0;  // 1.5 * 2^52

/// Vertices that are worked on at a time: what is staged for them stays in the first-level cache.
constexpr std::size_t kBlock = 256;
constexpr std::size_t kLanes = hn::MaxLanes(FloatTag());

/// A colour of as many vertices as a register holds, 0..255.
struct Colours {
  Floats r, g, b;
};

/// As many vertices as a register holds. In lanes without temperature every result is dropped.
struct Vertices {
  Floats temperature;
  Colours visible;
};

HWY_INLINE Floats all(float value) {
  return hn::Set(FloatTag(), value);
}

/// weight * over + (1 - weight) * under; exactly `under` where the weight is 0, exactly `over` where it is 1.
HWY_INLINE Colours mixed(Floats weight, const Colours& over, const Colours& under) {
  const Floats rest = hn::Sub(all(1), weight);
  return {hn::Add(hn::Mul(weight, over.r), hn::Mul(rest, under.r)),
          hn::Add(hn::Mul(weight, over.g), hn::Mul(rest, under.g)),
          hn::Add(hn::Mul(weight, over.b), hn::Mul(rest, under.b))};
}

/// The luma of a colour.
HWY_INLINE Floats luma(Floats r, Floats g, Floats b) {
  return hn::Add(hn::Add(hn::Mul(r, all(0.299F)), hn::Mul(g, all(0.587F))), hn::Mul(b, all(0.114F)));
}

HWY_INLINE Doubles on_ramp(const Ramp& ramp, Doubles temperature) {
  const DoubleTag d;
  const Doubles value =
      hn::Add(hn::Mul(hn::Sub(temperature, hn::Set(d, ramp.origin)), hn::Set(d, ramp.slope)), hn::Set(d, ramp.offset));
  return hn::Min(hn::Max(value, hn::Zero(d)), hn::Set(d, ramp.top));
}

/// Writes function(temperature) for `count` temperatures, computed in double precision. `count` is a multiple of the
/// lanes of a float register.
template <class Function>
HWY_INLINE void map_in_double(const float* temperature, std::size_t count, float* result, const Function& function) {
  const DoubleTag d;
  const hn::Rebind<float, DoubleTag> narrow;
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    hn::StoreU(hn::DemoteTo(narrow, function(hn::PromoteTo(d, hn::LoadU(narrow, temperature + i)))), narrow,
               result + i);
  }
}

/// As many vertices as a float register has lanes are a group; its colours are four registers of padded colours: block k
/// (128 bits) of register j holds r, g, b and a pad of vertex 4 k + j. What stands per vertex then reaches its channels
/// by a broadcast within blocks.
constexpr std::size_t kRegisters = 4;

/// Of one value per vertex of a group: those of register j, for each channel.
template <int kRegister>
HWY_INLINE Floats spread(Floats values) {
#if HWY_TARGET == HWY_SCALAR
  return values;
#else
  return hn::Broadcast<kRegister>(values);
#endif
}

/// One colour for every vertex of a register.
HWY_INLINE Floats repeated(base::Rgb8 colour) {
  alignas(64) float lanes[kLanes];
  const float channels[4] = {static_cast<float>(colour.r), static_cast<float>(colour.g), static_cast<float>(colour.b),
                             0};
  for (std::size_t e = 0; e < kLanes; ++e) lanes[e] = channels[e % 4];
  return hn::Load(FloatTag(), lanes);
}

/// Where the palette colours of a block of vertices stand in the table.
class ThermalColours {
 public:
  explicit ThermalColours(const ThermalTable& table) : table_(table) {}

  HWY_INLINE void prepare(const float* temperature, std::size_t count) {
    if (table_.single_precision) {
      locate_in_float(temperature, count);
    } else {
      locate_in_double(temperature, count);
    }
  }

#if HWY_TARGET == HWY_SCALAR
  HWY_INLINE float channel(std::size_t vertex, std::size_t index) const {
    const float* row = row_at(vertex);
    return row[index] + part_[vertex] * row[4 + index];
  }
#else
  /// Register `kRegister` of the group that begins at vertex `first`.
  template <int kRegister>
  HWY_INLINE Floats colours(std::size_t first) const {
    const FloatTag d;
    const Floats way = spread<kRegister>(hn::Load(d, part_ + first));
    return hn::Add(gathered(d, first + kRegister, 0), hn::Mul(way, gathered(d, first + kRegister, 4)));
  }
#endif

 private:
  static constexpr int kRowBytesLog2 = 5;
  static_assert(sizeof(ThermalTable::rows) == 256 << kRowBytesLog2);

  HWY_INLINE const float* row_at(std::size_t vertex) const {
    return reinterpret_cast<const float*>(reinterpret_cast<const std::byte*>(table_.rows.data()) + row_bytes_[vertex]);
  }

  /// Row and part of the way to the next row, to within 6.1e-5 rows where ThermalTable allows it. A whole position may
  /// take the row below with a part of 1: the same colour. The row is within the table even for a NaN.
  HWY_INLINE void locate_in_float(const float* temperature, std::size_t count) {
    const FloatTag d;
    const hn::RebindToUnsigned<FloatTag> bits;
    for (std::size_t i = 0; i < count; i += kLanes) {
      const Floats above = hn::Sub(hn::Sub(hn::LoadU(d, temperature + i), all(table_.origin)), all(table_.origin_rest));
      const Floats position = hn::Min(hn::Max(hn::Mul(above, all(table_.slope)), all(0)), all(255));
      const Floats shifted = hn::Add(hn::Sub(position, all(0.5F)), all(kWholeFloat));
      hn::Store(row_bytes(bits, hn::BitCast(bits, shifted)), bits, row_bytes_ + i);
      hn::Store(hn::Sub(position, hn::Sub(shifted, all(kWholeFloat))), d, part_ + i);
    }
  }

  HWY_INLINE void locate_in_double(const float* temperature, std::size_t count) {
    const DoubleTag d;
    const hn::Rebind<float, DoubleTag> narrow;
    const hn::RebindToUnsigned<DoubleTag> bits64;
    const hn::Rebind<std::uint32_t, DoubleTag> bits;
    const Doubles whole = hn::Set(d, kWholeDouble);
    for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
      const Doubles position = on_ramp(table_.position, hn::PromoteTo(d, hn::LoadU(narrow, temperature + i)));
      const Doubles shifted = hn::Add(hn::Sub(position, hn::Set(d, 0.5)), whole);
      hn::StoreU(row_bytes(bits, hn::TruncateTo(bits, hn::BitCast(bits64, shifted))), bits, row_bytes_ + i);
      hn::StoreU(hn::DemoteTo(narrow, hn::Sub(position, hn::Sub(shifted, whole))), narrow, part_ + i);
    }
  }

  /// From a row in the low byte.
  template <class Tag, class Row>
  static HWY_INLINE Row row_bytes(Tag d, Row row) {
    return hn::ShiftLeft<kRowBytesLog2>(hn::And(row, hn::Set(d, 0xFFU)));
  }

#if HWY_TARGET != HWY_SCALAR
  /// Four floats, from number `offset` on, of the rows of every fourth vertex from `first` on, as many as fit.
  template <class Tag>
  HWY_INLINE hn::Vec<Tag> gathered(Tag d, std::size_t first, std::size_t offset) const {
    if constexpr (hn::MaxLanes(Tag()) == 4) {
      return hn::Load(d, row_at(first) + offset);
    } else {
      const hn::Half<Tag> half;
      return hn::Combine(d, gathered(half, first + hn::MaxLanes(Tag()) / 2, offset), gathered(half, first, offset));
    }
  }
#endif

  const ThermalTable& table_;
  alignas(64) std::uint32_t row_bytes_[kBlock];
  alignas(64) float part_[kBlock];
};

/// A block of vertices; `count` is a multiple of the lanes of a byte register and at most kBlock.
struct Block {
  const float* temperature;
  const float* baseline;  ///< nullptr: none.
  const std::uint8_t* visible;
  std::uint8_t* fused;
  std::size_t count;
  const MissingDisplay& missing;
  const float* freshness;  ///< In 0..1, aligned; nullptr: 1 for every vertex.
};

/// The same weight for every vertex.
class ConstantWeight {
 public:
  explicit ConstantWeight(float weight) : weight_(weight) {}
  HWY_INLINE bool prepare(const float*, const std::uint8_t*, std::size_t) { return weight_ != 0; }
  HWY_INLINE Floats values(std::size_t) const { return all(weight_); }

 private:
  float weight_;
};

/// A weight per vertex, written by `Fill`: fill(temperature, visible, count, weights).
template <class Fill>
class Weights {
 public:
  explicit Weights(const Fill& fill) : fill_(fill) {}

  /// False when every weight of the block is 0.
  HWY_INLINE bool prepare(const float* temperature, const std::uint8_t* visible, std::size_t count) {
    fill_(temperature, visible, count, static_cast<float*>(weight_));
    const FloatTag d;
    Floats any = all(0);
    for (std::size_t i = 0; i < count; i += kLanes) any = hn::Or(any, hn::Load(d, weight_ + i));
    return !hn::AllTrue(d, hn::Eq(any, all(0)));
  }
  HWY_INLINE Floats values(std::size_t i) const { return hn::Load(FloatTag(), weight_ + i); }

 private:
  Fill fill_;
  alignas(64) float weight_[kBlock];
};

/// One value per vertex of a block, computed in double precision by `Function`: from a register of temperatures to a
/// register of values.
template <class Function>
class ValueStage {
 public:
  explicit ValueStage(const Function& function) : function_(function) {}
  HWY_INLINE void prepare(const float* temperature, std::size_t count) {
    map_in_double(temperature, count, value_, function_);
  }
  HWY_INLINE Floats values(std::size_t i) const { return hn::Load(FloatTag(), value_ + i); }

 private:
  Function function_;
  alignas(64) float value_[kBlock];
};

/// The one rounding: half up, for values within 0..255. Whatever comes within 2^-13 of the next level from below counts
/// as that tie, which makes up for the rounding of the arithmetic before. The level is the low byte; above it stands
/// kAboveLevel.
HWY_INLINE hn::Vec<BitsTag> levels(Floats value) {
  return hn::BitCast(BitsTag(), hn::Add(hn::Add(value, all(0x1p-13F)), all(kWholeFloat)));
}
constexpr std::uint32_t kAboveLevel = 0x4B400000;  // The bits of kWholeFloat.

/// shade(Vertices, their values) -> Colours.
template <bool kFade, class Stage, class Shade>
HWY_INLINE void fuse_block(const Block& block, Stage& stage, const Shade& shade) {
  const float* const temperature = block.temperature;
  const std::uint8_t* const visible = block.visible;
  std::uint8_t* const fused = block.fused;
  const std::size_t count = block.count;
  const MissingDisplay& missing = block.missing;
  [[maybe_unused]] const float* const freshness = block.freshness;
  const FloatTag d;
  const IntTag di;
  const hn::Rebind<std::uint8_t, FloatTag> quarter;
  const hn::ScalableTag<std::uint8_t> bytes;
  alignas(64) std::uint8_t r[kBlock];
  alignas(64) std::uint8_t g[kBlock];
  alignas(64) std::uint8_t b[kBlock];
  for (std::size_t i = 0; i < count; i += hn::Lanes(bytes)) {
    hn::Vec<decltype(bytes)> vr, vg, vb;
    hn::LoadInterleaved3(bytes, visible + 3 * i, vr, vg, vb);
    hn::Store(vr, bytes, r + i);
    hn::Store(vg, bytes, g + i);
    hn::Store(vb, bytes, b + i);
  }
  stage.prepare(temperature, count);
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    const auto plane = [&](const std::uint8_t* from)
                           SPECTRA_IN_LOOP { return hn::ConvertTo(d, hn::PromoteTo(di, hn::Load(quarter, from + i))); };
    const Vertices vertices{hn::LoadU(d, temperature + i), {plane(r), plane(g), plane(b)}};
    const Colours shaded = shade(vertices, stage.values(i));
    Colours without = vertices.visible;
    if (missing) without = {all(missing->r), all(missing->g), all(missing->b)};
    const auto missing_here = hn::IsNaN(vertices.temperature);
    Colours colours{hn::IfThenElse(missing_here, without.r, shaded.r),
                    hn::IfThenElse(missing_here, without.g, shaded.g),
                    hn::IfThenElse(missing_here, without.b, shaded.b)};
    if constexpr (kFade) {
      const Floats grey = luma(colours.r, colours.g, colours.b);
      colours = mixed(hn::Load(d, freshness + i), colours, {grey, grey, grey});
    }
    hn::Store(hn::TruncateTo(quarter, levels(colours.r)), quarter, r + i);
    hn::Store(hn::TruncateTo(quarter, levels(colours.g)), quarter, g + i);
    hn::Store(hn::TruncateTo(quarter, levels(colours.b)), quarter, b + i);
  }
  for (std::size_t i = 0; i < count; i += hn::Lanes(bytes)) {
    hn::StoreInterleaved3(hn::Load(bytes, r + i), hn::Load(bytes, g + i), hn::Load(bytes, b + i), bytes, fused + 3 * i);
  }
}

/// Weights whose 0 still shows something.
template <class Weight>
class AlwaysShown : public Weight {
 public:
  explicit AlwaysShown(const Weight& weight) : Weight(weight) {}
  HWY_INLINE bool prepare(const float* temperature, const std::uint8_t* visible, std::size_t count) {
    static_cast<void>(Weight::prepare(temperature, visible, count));
    return true;
  }
};

/// Whether no temperature of a block is missing.
HWY_INLINE bool none_missing(const float* temperature, std::size_t count) {
  const FloatTag d;
  const hn::RebindToUnsigned<FloatTag> bits;
  auto largest = hn::Zero(bits);
  for (std::size_t i = 0; i < count; i += kLanes) {
    // Without its sign bit, what is not a number is above the pattern of infinity.
    largest = hn::Max(largest, hn::ShiftLeft<1>(hn::BitCast(bits, hn::LoadU(d, temperature + i))));
  }
  return hn::AllTrue(bits, hn::Lt(largest, hn::Set(bits, 0xFF000001U)));
}

#if HWY_TARGET == HWY_SCALAR
struct PaddedColours {};
#else
/// Where lanes and bytes of a group of colours go between memory, 3 bytes a vertex, and its registers.
struct ColourMoves {
  static constexpr std::uint8_t kNone = 0x80;
  alignas(64) std::int32_t apart[kLanes] = {};
  alignas(64) std::int32_t together[kLanes] = {};
  alignas(64) std::uint8_t channel[kRegisters][4 * kLanes] = {};
  alignas(64) std::uint8_t without_pad[4 * kLanes] = {};

  constexpr ColourMoves() {
    for (std::size_t e = 0; e < kLanes; ++e) {
      const std::size_t block = e / 4;
      const std::size_t within = e % 4;
      apart[e] = static_cast<std::int32_t>(within < 3 ? 3 * block + within : 0);
      together[e] = static_cast<std::int32_t>(e < 3 * (kLanes / 4) ? e / 3 * 4 + e % 3 : 0);
      for (std::size_t c = 0; c < 4; ++c) {  // Byte c of lane e.
        for (std::size_t j = 0; j < kRegisters; ++j) {
          channel[j][4 * e + c] = static_cast<std::uint8_t>(c == 0 && within < 3 ? 3 * j + within : kNone);
        }
        const std::size_t to = 4 * within + c;
        without_pad[4 * e + c] = static_cast<std::uint8_t>(to < 12 ? 4 * (to % 3) + to / 3 : kNone);
      }
    }
  }
};
inline constexpr ColourMoves kColourMoves;

/// Colours of a group between memory and its registers.
class PaddedColours {
 public:
  /// Four vertices to a block, 12 bytes of it.
  HWY_INLINE hn::Vec<ByteTag> load(const std::uint8_t* from) const {
    const ByteTag d;
    const hn::Half<ByteTag> half;
    const hn::Half<decltype(half)> quarter;
    const auto near = hn::LoadU(half, from);
    const auto far = hn::ZeroExtendVector(half, hn::LoadU(quarter, from + 2 * kLanes));
    return moved(hn::Combine(d, far, near), kColourMoves.apart);
  }

  /// Register `kRegister` of what load() gave.
  template <int kRegister>
  HWY_INLINE Floats channels(hn::Vec<ByteTag> loaded) const {
    const auto bytes = hn::TableLookupBytesOr0(loaded, hn::Load(ByteTag(), kColourMoves.channel[kRegister]));
    return hn::ConvertTo(FloatTag(), hn::BitCast(IntTag(), bytes));
  }

  /// Writes what levels() gave for four registers.
  HWY_INLINE void store(const hn::Vec<BitsTag> (&level)[kRegisters], std::uint8_t* to) const {
    const ByteTag d;
    const hn::Half<ByteTag> half;
    const hn::Half<decltype(half)> quarter;
    constexpr std::uint32_t kAbove = kAboveLevel ^ (kAboveLevel << 8) ^ (kAboveLevel << 16) ^ (kAboveLevel << 24);
    const auto even = hn::Xor(level[0], hn::ShiftLeft<16>(level[2]));
    const auto odd = hn::Xor(hn::ShiftLeft<8>(level[1]), hn::ShiftLeft<24>(level[3]));
    const auto bytes = hn::BitCast(d, hn::Xor(hn::Xor(even, odd), hn::Set(BitsTag(), kAbove)));
    const auto packed =
        moved(hn::TableLookupBytesOr0(bytes, hn::Load(d, kColourMoves.without_pad)), kColourMoves.together);
    hn::StoreU(hn::LowerHalf(half, packed), half, to);
    hn::StoreU(hn::LowerHalf(quarter, hn::UpperHalf(half, packed)), quarter, to + 2 * kLanes);
  }

 private:
  static HWY_INLINE hn::Vec<ByteTag> moved(hn::Vec<ByteTag> bytes, const std::int32_t* lane) {
    if (kLanes == 4) return bytes;  // Of one block everything is where it belongs.
    const IntTag d;
    return hn::BitCast(ByteTag(), hn::TableLookupLanes(hn::BitCast(d, bytes), hn::SetTableIndices(d, lane)));
  }
};
#endif

/// weight * palette + (1 - weight) * visible; exactly one of them where the weight is 0 or 1.
struct Mix {
  HWY_INLINE Floats operator()(Floats weight, Floats palette, Floats visible) const {
    return hn::Add(hn::Mul(weight, palette), hn::Mul(hn::Sub(all(1), weight), visible));
  }
};

/// combine(weight, palette channel, visible channel) for every channel of a block.
template <bool kSomeMissing, bool kFade, class Weight, class Combine>
HWY_INLINE void combine_block(const ThermalColours& thermal, const Weight& weight, const Combine& combine,
                              [[maybe_unused]] const PaddedColours& padded, const Block& block) {
  const FloatTag d;
  const float* const temperature = block.temperature;
  const std::uint8_t* const visible = block.visible;
  std::uint8_t* const fused = block.fused;
  const std::size_t count = block.count;
  const MissingDisplay& missing = block.missing;
  [[maybe_unused]] const float* const freshness = block.freshness;
#if HWY_TARGET == HWY_SCALAR
  for (std::size_t i = 0; i < count; ++i) {
    const bool missing_here = kSomeMissing && hn::AllTrue(d, hn::IsNaN(hn::LoadU(d, temperature + i)));
    const base::Rgb8 fixed = missing.value_or(base::Rgb8{visible[3 * i], visible[3 * i + 1], visible[3 * i + 2]});
    const std::uint8_t without[3] = {fixed.r, fixed.g, fixed.b};
    Floats f[3];
    for (std::size_t c = 0; c < 3; ++c) {
      f[c] = missing_here ? all(without[c])
                          : combine(weight.values(i), all(thermal.channel(i, c)), all(visible[3 * i + c]));
    }
    const Floats grey = luma(f[0], f[1], f[2]);
    for (std::size_t c = 0; c < 3; ++c) {
      if (kFade) f[c] = Mix()(hn::Load(d, freshness + i), f[c], grey);
      fused[3 * i + c] = static_cast<std::uint8_t>(hn::GetLane(levels(f[c])) & 0xFF);
    }
  }
#else
  const Floats fixed = repeated(missing.value_or(base::Rgb8{}));
  for (std::size_t i = 0; i < count; i += kLanes) {
    const auto loaded = padded.load(visible + 3 * i);
    const Floats weights = weight.values(i);
    Floats present = all(1);
    if constexpr (kSomeMissing) present = hn::IfThenZeroElse(hn::IsNaN(hn::LoadU(d, temperature + i)), present);
    Floats fresh = all(1);
    if constexpr (kFade) fresh = hn::Load(d, freshness + i);
    const auto level = [&]<int kRegister>(std::integral_constant<int, kRegister>) SPECTRA_IN_LOOP {
      const Floats v = padded.template channels<kRegister>(loaded);
      Floats f = combine(spread<kRegister>(weights), thermal.template colours<kRegister>(i), v);
      if constexpr (kSomeMissing) {
        f = hn::IfThenElse(hn::Gt(spread<kRegister>(present), all(0)), f, missing ? fixed : v);
      }
      if constexpr (kFade) {
        const Floats grey = luma(hn::Broadcast<0>(f), hn::Broadcast<1>(f), hn::Broadcast<2>(f));
        f = Mix()(spread<kRegister>(fresh), f, grey);
      }
      return levels(f);
    };
    padded.store({level(std::integral_constant<int, 0>()), level(std::integral_constant<int, 1>()),
                  level(std::integral_constant<int, 2>()), level(std::integral_constant<int, 3>())},
                 fused + 3 * i);
  }
#endif
}

/// The same with what is faded, which is rare: apart, so that the loops without stay as they are.
template <class Weight, class Combine>
HWY_NOINLINE void combine_faded(const ThermalColours& thermal, const Weight& weight, const Combine& combine,
                                const PaddedColours& padded, const Block& block) {
  combine_block<true, true>(thermal, weight, combine, padded, block);
}

/// What the palette shows of a vertex: its temperature.
struct OwnTemperature {
  HWY_INLINE const float* prepare(const Block& block) { return block.temperature; }
};

/// Fuses a block with its palette colours. Where `Weight` has nothing to show the palette is left alone. `Shown` gives what
/// stands in place of the temperature for palette and weight; no value of it is missing unless the temperature is.
template <class Shown, class Weight, class Combine>
struct ThermalBlock {
  ThermalColours thermal;
  Shown shown;
  Weight weight;
  Combine combine;
  PaddedColours padded = {};

  HWY_INLINE void operator()(const Block& block) {
    const bool complete = none_missing(block.temperature, block.count);
    const float* value = shown.prepare(block);
    if (!weight.prepare(value, block.visible, block.count) && (complete || !block.missing) && !block.freshness) {
      if (block.fused != block.visible) std::memcpy(block.fused, block.visible, 3 * block.count);
      return;
    }
    thermal.prepare(value, block.count);
    if (block.freshness) {
      combine_faded(thermal, weight, combine, padded, block);
    } else if (complete) {
      combine_block<false, false>(thermal, weight, combine, padded, block);
    } else {
      combine_block<true, false>(thermal, weight, combine, padded, block);
    }
  }
};

/// Freshness of vertices as weights: eighths of `count` vertices, 1 for those that fill up the block. False when every
/// one is fresh.
HWY_INLINE bool freshness_weights(const std::uint8_t* eighths, std::size_t count, float* weight) {
  std::uint8_t all_of_them = 8;
  for (std::size_t i = 0; i < kBlock; ++i) {
    const std::uint8_t here = i < count ? std::min<std::uint8_t>(eighths[i], 8) : std::uint8_t{8};
    all_of_them = std::min(all_of_them, here);
    weight[i] = static_cast<float>(here) / 8;
  }
  return all_of_them < 8;
}

/// Fuses all vertices of a span block by block: fuse(Block). Every vertex goes through the same arithmetic wherever it
/// stands.
template <class Fuse>
HWY_INLINE void for_each_block(const VertexSpan& span, Fuse& fuse) {
  alignas(64) float weights[kBlock];
  const auto freshness_from = [&](std::size_t begin, std::size_t count) -> const float* {
    if (!span.freshness || !freshness_weights(span.freshness + begin, count, weights)) return nullptr;
    return weights;
  };
  std::size_t begin = 0;
  for (; begin + kBlock <= span.count; begin += kBlock) {
    fuse(Block{span.temperature_celsius + begin, span.baseline_celsius ? span.baseline_celsius + begin : nullptr,
               span.visible + 3 * begin, span.fused + 3 * begin, kBlock, span.missing, freshness_from(begin, kBlock)});
  }
  const std::size_t rest = span.count - begin;
  if (rest == 0) return;
  const std::size_t lanes = hn::Lanes(hn::ScalableTag<std::uint8_t>());
  const std::size_t padded = (rest + lanes - 1) / lanes * lanes;
  alignas(64) float temperature[kBlock] = {};
  alignas(64) float baseline[kBlock] = {};
  alignas(64) std::uint8_t colours[3 * kBlock] = {};
  std::memcpy(temperature, span.temperature_celsius + begin, rest * sizeof(float));
  if (span.baseline_celsius) std::memcpy(baseline, span.baseline_celsius + begin, rest * sizeof(float));
  std::memcpy(colours, span.visible + 3 * begin, 3 * rest);
  fuse(Block{temperature, span.baseline_celsius ? baseline : nullptr, colours, colours, padded, span.missing,
             freshness_from(begin, rest)});
  std::memcpy(span.fused + 3 * begin, colours, 3 * rest);
}

/// Fuses with the palette: combine(weight, palette channel, visible channel) for every channel. What the palette shows
/// and what the weight is given is the temperature, or what `Shown` makes of a vertex.
template <class Shown = OwnTemperature, class Weight, class Combine>
HWY_INLINE void fuse_thermal(const VertexSpan& span, const ThermalTable& table, const Weight& weight,
                             const Combine& combine, const Shown& shown = {}) {
  ThermalBlock<Shown, Weight, Combine> fuse{ThermalColours(table), shown, weight, combine};
  for_each_block(span, fuse);
}

/// Fuses without the palette: shade(Vertices, value) -> Colours, with a value per vertex from
/// value(temperatures in double precision).
template <class Value, class Shade>
HWY_INLINE void fuse_shaded(const VertexSpan& span, const Value& value, const Shade& shade) {
  ValueStage stage(value);
  const auto fuse = [&](const Block& block) HWY_ATTR {
    if (block.freshness) {
      fuse_block<true>(block, stage, shade);
    } else {
      fuse_block<false>(block, stage, shade);
    }
  };
  for_each_block(span, fuse);
}

}  // namespace spectra::fusion::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
