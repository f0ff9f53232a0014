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

#include "fusion/methods/vertex_lanes.hpp"
#include "fusion/statistics/histogram_bins-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::fusion::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using FloatTag = hn::ScalableTag<float>;
using Floats = hn::Vec<FloatTag>;
using IntTag = hn::RebindToSigned<FloatTag>;
using DoubleTag = hn::ScalableTag<double>;
using Doubles = hn::Vec<DoubleTag>;

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

/// Interleaving three channels: lane e of register j belongs to vertex (j * lanes + e) / 3.
class ChannelOrder {
 public:
  ChannelOrder() {
    for (std::size_t j = 0; j < 3; ++j) {
      for (std::size_t e = 0; e < kLanes; ++e) vertex_[j][e] = static_cast<std::int32_t>((j * kLanes + e) / 3);
    }
  }
  /// One value per vertex, spread over its channels in register j.
  HWY_INLINE Floats spread(Floats values, std::size_t j) const {
    return hn::TableLookupLanes(values, hn::SetTableIndices(FloatTag(), vertex_[j]));
  }
  /// Register j of one colour over and over.
  HWY_INLINE Floats repeated(Rgb8 colour, std::size_t j) const {
    alignas(64) float lanes[kLanes];
    for (std::size_t e = 0; e < kLanes; ++e) {
      const std::size_t channel = (j * kLanes + e) % 3;
      lanes[e] = static_cast<float>(channel == 0 ? colour.r : channel == 1 ? colour.g : colour.b);
    }
    return hn::Load(FloatTag(), lanes);
  }

 private:
  alignas(64) std::int32_t vertex_[3][kLanes];
};

/// The palette colours of a block of vertices, interleaved like the colours of the vertices.
class ThermalColours {
 public:
  explicit ThermalColours(const ThermalTable& table) : table_(table) {
    for (std::size_t e = 0; e < kLanes; ++e) {
      without_pad_[e] = static_cast<std::int32_t>(e < 3 * kRowsPerRegister ? e / 3 * 4 + e % 3 : 0);
      for (std::size_t k = 0; k < kLanes / kRowsPerRegister; ++k) {
        vertex_[k][e] = static_cast<std::int32_t>(k * kRowsPerRegister + e / 4);
      }
    }
  }

  HWY_INLINE void prepare(const float* temperature, std::size_t count) {
    if (table_.single_precision) {
      locate_in_float(temperature, count);
    } else {
      locate_in_double(temperature, count);
    }
    const float* rows = table_.rows[0].data();
#if HWY_TARGET == HWY_SCALAR
    for (std::size_t i = 0; i < count; ++i) {
      const float* row = rows + 8 * (static_cast<std::uint8_t>(row_[i]));
      for (std::size_t c = 0; c < 3; ++c) colour_[3 * i + c] = row[c] + part_[i] * row[4 + c];
    }
#else
    const FloatTag d;
    const auto without_pad = hn::SetTableIndices(d, without_pad_);
    for (std::size_t i = 0; i < count; i += kLanes) {
      const Floats part = hn::Load(d, part_ + i);
      for (std::size_t k = 0; k < kLanes / kRowsPerRegister; ++k) {
        const std::size_t first = i + k * kRowsPerRegister;
        const Floats way = hn::TableLookupLanes(part, hn::SetTableIndices(d, vertex_[k]));
        const Floats padded =
            hn::Add(gathered(d, rows, row_ + first), hn::Mul(way, gathered(d, rows + 4, row_ + first)));
        // The lanes beyond the last channel are overwritten by the next store.
        hn::StoreU(hn::TableLookupLanes(padded, without_pad), d, colour_ + 3 * first);
      }
    }
#endif
  }

  /// Register number `index` of the block's channels.
  HWY_INLINE Floats channels(std::size_t index) const {
    return hn::Load(FloatTag(), colour_ + index * kLanes);
  }

 private:
  /// Colours with their pad that fit a register.
  static constexpr std::size_t kRowsPerRegister = kLanes >= 4 ? kLanes / 4 : 1;

  /// Row and part of the way to the next row, to within 6.1e-5 rows where ThermalTable allows it. A whole position may
  /// take the row below with a part of 1: the same colour. The low byte is the row even of a NaN.
  HWY_INLINE void locate_in_float(const float* temperature, std::size_t count) {
    const FloatTag d;
    const hn::RebindToUnsigned<FloatTag> bits;
    for (std::size_t i = 0; i < count; i += kLanes) {
      const Floats above = hn::Sub(hn::Sub(hn::LoadU(d, temperature + i), all(table_.origin)), all(table_.origin_rest));
      const Floats position = hn::Min(hn::Max(hn::Mul(above, all(table_.slope)), all(0)), all(255));
      const Floats shifted = hn::Add(hn::Sub(position, all(0.5F)), all(kWholeFloat));
      hn::Store(hn::BitCast(bits, shifted), bits, row_ + i);
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
      hn::StoreU(hn::TruncateTo(bits, hn::BitCast(bits64, shifted)), bits, row_ + i);
      hn::StoreU(hn::DemoteTo(narrow, hn::Sub(position, hn::Sub(shifted, whole))), narrow, part_ + i);
    }
  }

#if HWY_TARGET != HWY_SCALAR
  /// Four floats of the rows of as many vertices as fit.
  template <class Tag>
  static HWY_INLINE hn::Vec<Tag> gathered(Tag d, const float* rows, const std::uint32_t* row) {
    if constexpr (hn::MaxLanes(Tag()) == 4) {
      return hn::Load(d, rows + 8 * static_cast<std::uint8_t>(row[0]));
    } else {
      const hn::Half<Tag> half;
      return hn::Combine(d, gathered(half, rows, row + hn::MaxLanes(Tag()) / 8), gathered(half, rows, row));
    }
  }
#endif

  const ThermalTable& table_;
  alignas(64) std::int32_t without_pad_[kLanes];
  alignas(64) std::int32_t vertex_[kLanes / kRowsPerRegister][kLanes];
  alignas(64) std::uint32_t row_[kBlock];
  alignas(64) float part_[kBlock];
  alignas(64) float colour_[3 * kBlock + kLanes];
};

/// The same weight for every vertex.
class ConstantWeight {
 public:
  explicit ConstantWeight(float weight) : weight_(weight) {}
  HWY_INLINE bool prepare(const float*, const std::uint8_t*, std::size_t) { return weight_ != 0; }
  HWY_INLINE Floats spread(const ChannelOrder&, std::size_t, std::size_t) const { return all(weight_); }

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
  HWY_INLINE Floats spread(const ChannelOrder& order, std::size_t i, std::size_t j) const {
    return order.spread(hn::Load(FloatTag(), weight_ + i), j);
  }

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

/// The one rounding: half up, for values within 1 of 0..255. Whatever comes within 2^-13 of the next level from below
/// counts as that tie, which makes up for the rounding of the arithmetic before.
HWY_INLINE hn::Vec<hn::Rebind<std::uint8_t, FloatTag>> levels(Floats value) {
  const hn::Rebind<std::uint8_t, FloatTag> bytes;
  const hn::RebindToUnsigned<FloatTag> bits;
  const Floats whole = hn::Add(hn::Add(value, all(0x1p-13F)), all(kWholeFloat));
  return hn::TruncateTo(bytes, hn::BitCast(bits, whole));
}

/// Fuses `count` vertices, a multiple of the lanes of a byte register and at most kBlock.
/// shade(Vertices, their values) -> Colours.
template <class Stage, class Shade>
HWY_INLINE void fuse_block(const float* temperature, const std::uint8_t* visible, std::uint8_t* fused,
                           std::size_t count, const MissingDisplay& missing, Stage& stage, const Shade& shade) {
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
                           HWY_ATTR { return hn::ConvertTo(d, hn::PromoteTo(di, hn::Load(quarter, from + i))); };
    const Vertices vertices{hn::LoadU(d, temperature + i), {plane(r), plane(g), plane(b)}};
    const Colours colours = shade(vertices, stage.values(i));
    Colours without = vertices.visible;
    if (missing) without = {all(missing->r), all(missing->g), all(missing->b)};
    const auto finite = hn::IsFinite(vertices.temperature);
    hn::Store(levels(hn::IfThenElse(finite, colours.r, without.r)), quarter, r + i);
    hn::Store(levels(hn::IfThenElse(finite, colours.g, without.g)), quarter, g + i);
    hn::Store(levels(hn::IfThenElse(finite, colours.b, without.b)), quarter, b + i);
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

/// Whether every temperature of a block is finite.
HWY_INLINE bool all_finite(const float* temperature, std::size_t count) {
  const FloatTag d;
  const hn::RebindToUnsigned<FloatTag> bits;
  auto largest = hn::Zero(bits);
  for (std::size_t i = 0; i < count; i += kLanes) {
    // Without its sign bit, what is not finite is at least the pattern of infinity.
    largest = hn::Max(largest, hn::ShiftLeft<1>(hn::BitCast(bits, hn::LoadU(d, temperature + i))));
  }
  return hn::AllTrue(bits, hn::Lt(largest, hn::Set(bits, 0xFF000000U)));
}

/// combine(weight, palette channel, visible channel) for every channel of a block, as they lie in memory.
template <bool kSomeMissing, class Weight, class Combine>
HWY_INLINE void combine_block(const ThermalColours& thermal, const Weight& weight, const ChannelOrder& order,
                              const Combine& combine, const float* temperature, const std::uint8_t* visible,
                              std::uint8_t* fused, std::size_t count, const MissingDisplay& missing) {
  const FloatTag d;
  const IntTag di;
  const hn::Rebind<std::uint8_t, FloatTag> quarter;
  for (std::size_t i = 0; i < count; i += kLanes) {
    for (std::size_t j = 0; j < 3; ++j) {
      const std::size_t begin = 3 * i + j * kLanes;
      const Floats v = hn::ConvertTo(d, hn::PromoteTo(di, hn::LoadU(quarter, visible + begin)));
      Floats f = combine(weight.spread(order, i, j), thermal.channels(begin / kLanes), v);
      if constexpr (kSomeMissing) {
        const auto finite = hn::IsFinite(hn::LoadU(d, temperature + i));
        const auto keep = hn::Gt(order.spread(hn::IfThenElseZero(finite, all(1)), j), all(0));
        f = hn::IfThenElse(keep, f, missing ? order.repeated(*missing, j) : v);
      }
      hn::StoreU(levels(f), quarter, fused + begin);
    }
  }
}

/// weight * palette + (1 - weight) * visible; exactly one of them where the weight is 0 or 1.
struct Mix {
  HWY_INLINE Floats operator()(Floats weight, Floats palette, Floats visible) const {
    return hn::Add(hn::Mul(weight, palette), hn::Mul(hn::Sub(all(1), weight), visible));
  }
};

/// Fuses a block with its palette colours. Where `Weight` has nothing to show the palette is left alone.
template <class Weight, class Combine>
struct ThermalBlock {
  ThermalColours thermal;
  Weight weight;
  Combine combine;
  ChannelOrder order = {};

  HWY_INLINE void operator()(const float* temperature, const std::uint8_t* visible, std::uint8_t* fused,
                             std::size_t count, const MissingDisplay& missing) {
    const bool complete = all_finite(temperature, count);
    if (!weight.prepare(temperature, visible, count) && (complete || !missing)) {
      if (fused != visible) std::memcpy(fused, visible, 3 * count);
      return;
    }
    thermal.prepare(temperature, count);
    if (complete) {
      combine_block<false>(thermal, weight, order, combine, temperature, visible, fused, count, missing);
    } else {
      combine_block<true>(thermal, weight, order, combine, temperature, visible, fused, count, missing);
    }
  }
};

/// Fuses all vertices of a span block by block. Every vertex goes through the same arithmetic wherever it stands.
/// block(temperature, visible, fused, count, missing); count is a multiple of the lanes of a byte register.
template <class Block>
HWY_INLINE void for_each_block(const VertexSpan& span, Block& block) {
  std::size_t begin = 0;
  for (; begin + kBlock <= span.count; begin += kBlock) {
    block(span.temperature_celsius + begin, span.visible + 3 * begin, span.fused + 3 * begin, kBlock, span.missing);
  }
  const std::size_t rest = span.count - begin;
  if (rest == 0) return;
  const std::size_t lanes = hn::Lanes(hn::ScalableTag<std::uint8_t>());
  const std::size_t padded = (rest + lanes - 1) / lanes * lanes;
  alignas(64) float temperature[kBlock] = {};
  alignas(64) std::uint8_t colours[3 * kBlock] = {};
  std::memcpy(temperature, span.temperature_celsius + begin, rest * sizeof(float));
  std::memcpy(colours, span.visible + 3 * begin, 3 * rest);
  const std::uint8_t* visible = colours;
  block(temperature, visible, colours, padded, span.missing);
  std::memcpy(span.fused + 3 * begin, colours, 3 * rest);
}

/// Fuses with the palette: combine(weight, palette channel, visible channel) for every channel.
template <class Weight, class Combine>
HWY_INLINE void fuse_thermal(const VertexSpan& span, const ThermalTable& table, const Weight& weight,
                             const Combine& combine) {
  ThermalBlock<Weight, Combine> block{ThermalColours(table), weight, combine};
  for_each_block(span, block);
}

/// Fuses without the palette: shade(Vertices, value) -> Colours, with a value per vertex from
/// value(temperatures in double precision).
template <class Value, class Shade>
HWY_INLINE void fuse_shaded(const VertexSpan& span, const Value& value, const Shade& shade) {
  ValueStage stage(value);
  const auto block = [&](const float* temperature, const std::uint8_t* visible, std::uint8_t* fused, std::size_t count,
                         const MissingDisplay& missing)
                         HWY_ATTR { fuse_block(temperature, visible, fused, count, missing, stage, shade); };
  for_each_block(span, block);
}

}  // namespace spectra::fusion::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
