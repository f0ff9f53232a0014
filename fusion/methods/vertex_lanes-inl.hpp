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

/// Vertices that are worked on at a time: what is staged for them stays in the first-level cache.
constexpr std::size_t kBlock = 256;

/// First stage of the methods that show palette colours: row and part of the way to the next row.
class PaletteStage {
 public:
  explicit PaletteStage(const ThermalTable& table) : table_(table) {}

  HWY_INLINE void prepare(const float* temperature, std::size_t count) {
    const DoubleTag d;
    const hn::Rebind<float, DoubleTag> narrow;
    const hn::RebindToUnsigned<DoubleTag> bits64;
    const hn::Rebind<std::uint32_t, DoubleTag> bits32;
    const Doubles whole = hn::Set(d, kWholeDouble);
    const Doubles half = hn::Set(d, 0.5);
    const Ramp& ramp = table_.position;
    for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
      const Doubles position = on_ramp(ramp, hn::PromoteTo(d, hn::LoadU(narrow, temperature + i)));
      // A whole position may take the row below with a part of 1: the same colour.
      const Doubles shifted = hn::Add(hn::Sub(position, half), whole);
      const Doubles row = hn::Sub(shifted, whole);
      hn::StoreU(hn::DemoteTo(narrow, hn::Sub(position, row)), narrow, part_ + i);
      // The mask keeps even the row of a NaN within the table.
      const auto index = hn::And(hn::TruncateTo(bits32, hn::BitCast(bits64, shifted)), hn::Set(bits32, 255));
      hn::StoreU(hn::ShiftLeft<3>(index), bits32, offset_ + i);
    }
  }

  /// The palette colours of the vertices that start at `i` of the block.
  HWY_INLINE Colours colours(std::size_t i) const {
    const FloatTag d;
    const float* rows = table_.rows[0].data();
    const std::uint32_t* offset = offset_ + i;
#if HWY_TARGET == HWY_SCALAR
    const float* row = rows + offset[0];
    const Floats part = hn::Load(d, part_ + i);
    const auto channel = [&](std::size_t c)
                             HWY_ATTR { return hn::Add(hn::Set(d, row[c]), hn::Mul(part, hn::Set(d, row[4 + c]))); };
    return {channel(0), channel(1), channel(2)};
#else
    // Register k holds r, g, b, pad of vertices k, k + 4, k + 8 ...; a transposition makes planes of them.
    const Floats part = hn::Load(d, part_ + i);
    const Floats v0 =
        hn::Add(gathered(d, rows, offset), hn::Mul(hn::Broadcast<0>(part), gathered(d, rows + 4, offset)));
    const Floats v1 =
        hn::Add(gathered(d, rows, offset + 1), hn::Mul(hn::Broadcast<1>(part), gathered(d, rows + 4, offset + 1)));
    const Floats v2 =
        hn::Add(gathered(d, rows, offset + 2), hn::Mul(hn::Broadcast<2>(part), gathered(d, rows + 4, offset + 2)));
    const Floats v3 =
        hn::Add(gathered(d, rows, offset + 3), hn::Mul(hn::Broadcast<3>(part), gathered(d, rows + 4, offset + 3)));
    const Floats low02 = hn::InterleaveLower(d, v0, v2);
    const Floats low13 = hn::InterleaveLower(d, v1, v3);
    const Floats high02 = hn::InterleaveUpper(d, v0, v2);
    const Floats high13 = hn::InterleaveUpper(d, v1, v3);
    return {hn::InterleaveLower(d, low02, low13), hn::InterleaveUpper(d, low02, low13),
            hn::InterleaveLower(d, high02, high13)};
#endif
  }

  /// weight * palette colour + (1 - weight) * visible; the palette is left alone where no weight asks for it.
  HWY_INLINE Colours highlighted(Floats weight, const Vertices& vertices, std::size_t i) const {
    if (hn::AllTrue(FloatTag(), hn::Eq(weight, all(0)))) return vertices.visible;
    return mixed(weight, colours(i), vertices.visible);
  }

 private:
#if HWY_TARGET != HWY_SCALAR
  /// Four floats from each of rows + offset[0], rows + offset[4], ...
  template <class Tag>
  static HWY_INLINE hn::Vec<Tag> gathered(Tag d, const float* rows, const std::uint32_t* offset) {
    if constexpr (hn::MaxLanes(Tag()) == 4) {
      return hn::Load(d, rows + offset[0]);
    } else {
      const hn::Half<Tag> half;
      return hn::Combine(d, gathered(half, rows, offset + hn::MaxLanes(Tag()) / 2), gathered(half, rows, offset));
    }
  }
#endif

  const ThermalTable& table_;
  alignas(64) std::uint32_t offset_[kBlock];
  alignas(64) float part_[kBlock];
};

/// First stage of a method that needs one number per vertex, computed in double precision by `Function`: from a
/// register of temperatures to a register of values.
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

/// First stage of a method that shows or hides whole bins of a histogram.
class BinStage {
 public:
  explicit BinStage(const HistogramBinning& binning) : binning_(binning) {}
  HWY_INLINE void prepare(const float* temperature, std::size_t count) {
    histogram_bins(binning_, temperature, count, bin_);
  }
  HWY_INLINE hn::Vec<IntTag> bins(std::size_t i) const { return hn::Load(IntTag(), bin_ + i); }

 private:
  const HistogramBinning& binning_;
  alignas(64) std::int32_t bin_[kBlock];
};

/// Two first stages, one after the other.
template <class First, class Second>
class BothStages {
 public:
  BothStages(First& first, Second& second) : first_(first), second_(second) {}
  HWY_INLINE void prepare(const float* temperature, std::size_t count) {
    first_.prepare(temperature, count);
    second_.prepare(temperature, count);
  }

 private:
  First& first_;
  Second& second_;
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
/// shade(Vertices, index in the block) -> Colours.
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
    const Colours colours = shade(vertices, i);
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

/// Fuses all vertices of a span block by block. Every vertex goes through the same arithmetic wherever it stands.
template <class Stage, class Shade>
HWY_INLINE void fuse_vertices(const VertexSpan& span, Stage& stage, const Shade& shade) {
  std::size_t begin = 0;
  for (; begin + kBlock <= span.count; begin += kBlock) {
    fuse_block(span.temperature_celsius + begin, span.visible + 3 * begin, span.fused + 3 * begin, kBlock, span.missing,
               stage, shade);
  }
  const std::size_t rest = span.count - begin;
  if (rest == 0) return;
  const std::size_t lanes = hn::Lanes(hn::ScalableTag<std::uint8_t>());
  const std::size_t padded = (rest + lanes - 1) / lanes * lanes;
  alignas(64) float temperature[kBlock] = {};
  alignas(64) std::uint8_t colours[3 * kBlock] = {};
  std::memcpy(temperature, span.temperature_celsius + begin, rest * sizeof(float));
  std::memcpy(colours, span.visible + 3 * begin, 3 * rest);
  fuse_block(temperature, colours, colours, padded, span.missing, stage, shade);
  std::memcpy(span.fused + 3 * begin, colours, 3 * rest);
}

}  // namespace spectra::fusion::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
