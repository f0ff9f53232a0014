#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "server/mapping/mesh_kernels.cpp"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include <array>
#include <cstring>
#include <limits>

#include "server/mapping/mesh_kernels.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::mapping::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET == HWY_SCALAR

void bits(const VoxelBlock& block, std::uint16_t least_weight, BlockBits& out) {
  for (std::size_t row = 0; row < out.known.size(); ++row) {
    unsigned known = 0, inside = 0;
    for (std::size_t x = 0; x < kBlockEdge; ++x) {
      const bool is_known = block.weight[kBlockEdge * row + x] >= least_weight;
      known |= is_known ? 1U << x : 0;
      inside |= is_known && block.distance[kBlockEdge * row + x] < 0 ? 1U << x : 0;
    }
    out.known[row] = static_cast<std::uint8_t>(known);
    out.inside[row] = static_cast<std::uint8_t>(inside);
  }
}

#else

void bits(const VoxelBlock& block, std::uint16_t least_weight, BlockBits& out) {
  const hn::CappedTag<std::int16_t, 32> d;
  const hn::RebindToUnsigned<decltype(d)> du;
  const auto least = hn::Set(du, least_weight);
  const std::size_t rows = hn::Lanes(d) / kBlockEdge;
  std::array<std::uint8_t, 8> some;  // Up to 8 bytes may be written.
  for (std::size_t i = 0; i < out.known.size(); i += rows) {
    const auto weight = hn::LoadU(du, &block.weight[kBlockEdge * i]);
    const auto is_known = hn::RebindMask(d, hn::Eq(hn::Max(weight, least), weight));
    const auto is_inside = hn::And(is_known, hn::Lt(hn::LoadU(d, &block.distance[kBlockEdge * i]), hn::Zero(d)));
    hn::StoreMaskBits(d, is_known, some.data());
    std::memcpy(&out.known[i], some.data(), rows);
    hn::StoreMaskBits(d, is_inside, some.data());
    std::memcpy(&out.inside[i], some.data(), rows);
  }
}

#endif  // a row in a register

using DoubleTag = hn::CappedTag<double, 8>;
using HalfTag = hn::Rebind<float, DoubleTag>;
using HalfIntTag = hn::Rebind<std::int32_t, DoubleTag>;
using Doubles = hn::Vec<DoubleTag>;

HWY_INLINE Doubles doubles_of(const std::int32_t* from) {
  return hn::PromoteTo(DoubleTag(), hn::LoadU(HalfIntTag(), from));
}

/// How far along its edge each vertex lies, into `shares`; places and colours.
void places(CrossedEdges& edges, double voxel_m, CrossedEdges::Array<float>& shares) {
  const DoubleTag d;
  const HalfTag df;
  const HalfIntTag di;
  const Doubles zero = hn::Zero(d), one = hn::Set(d, 1.0), size = hn::Set(d, voxel_m);
  // Lanes beyond the last edge divide, too.
  for (std::size_t i = edges.count; i % hn::Lanes(d) != 0; ++i) {
    edges.first.distance[i] = 1;
    edges.second.distance[i] = -1;
  }
  auto is_on_voxel = hn::MaskFromVec(hn::Zero(df));
  for (std::size_t i = 0; i < edges.count; i += hn::Lanes(d)) {
    const Doubles first = doubles_of(&edges.first.distance[i]), second = doubles_of(&edges.second.distance[i]);
    const Doubles share = hn::Div(first, hn::Sub(first, second));
    hn::StoreU(hn::DemoteTo(df, share), df, &shares[i]);
    const Doubles axis = doubles_of(&edges.axis[i]);
    const auto place = [&](const std::int32_t* voxel, double along, float* to) HWY_ATTR {
      const auto is_along = hn::Eq(axis, hn::Set(d, along));
      const Doubles here = doubles_of(voxel);
      const auto metres = [&](Doubles step) HWY_ATTR {
        return hn::DemoteTo(df, hn::Mul(hn::Add(here, hn::IfThenElseZero(is_along, step)), size));
      };
      const auto at = metres(share);
      hn::StoreU(at, df, to);
      // Across the edge it is where both voxels are.
      const auto is_first = hn::Eq(at, metres(zero)), is_second = hn::Eq(at, metres(one));
      is_on_voxel = hn::Or(is_on_voxel, hn::AndNot(hn::And(is_first, is_second), hn::Or(is_first, is_second)));
    };
    place(&edges.x[i], 0, &edges.x_m[i]);
    place(&edges.y[i], 1, &edges.y_m[i]);
    place(&edges.z[i], 2, &edges.z_m[i]);

    const auto has_first = hn::Gt(doubles_of(&edges.first.colour_weight[i]), zero);
    const auto has_second = hn::Gt(doubles_of(&edges.second.colour_weight[i]), zero);
    const Doubles of_second = hn::IfThenElse(has_first, hn::IfThenElseZero(has_second, share), one);
    const Doubles of_first = hn::Sub(one, of_second);
    const auto has_any = hn::Or(has_first, has_second);
    const auto level = [&](const std::int32_t* of_a, const std::int32_t* of_b, std::int32_t* to) HWY_ATTR {
      const Doubles mixed = hn::Add(hn::Mul(of_first, doubles_of(of_a)), hn::Mul(of_second, doubles_of(of_b)));
      const Doubles rounded = hn::Add(hn::Mul(mixed, hn::Set(d, 1.0 / 256)), hn::Set(d, 0.5));
      const Doubles within = hn::IfThenElse(has_any, hn::Min(hn::Set(d, 255.0), rounded), hn::Set(d, -1.0));
      hn::StoreU(hn::DemoteTo(di, within), di, to);  // towards 0
    };
    level(&edges.first.red[i], &edges.second.red[i], &edges.red[i]);
    level(&edges.first.green[i], &edges.second.green[i], &edges.green[i]);
    level(&edges.first.blue[i], &edges.second.blue[i], &edges.blue[i]);
  }
  edges.has_one_on_voxel = !hn::AllFalse(df, is_on_voxel);
}

void temperatures(CrossedEdges& edges, float least_sigma_kelvin, const CrossedEdges::Array<float>& shares) {
  const hn::CappedTag<float, 16> d;
  using Floats = hn::Vec<decltype(d)>;
  const Floats infinite = hn::Set(d, std::numeric_limits<float>::infinity());
  const Floats none = hn::Set(d, std::numeric_limits<float>::quiet_NaN());
  // Never quite 0, so that a voxel that knows nothing leaves it to the other, however far that is.
  const Floats least_part = hn::Set(d, 1e-3F), least_variance = hn::Set(d, least_sigma_kelvin * least_sigma_kelvin);
  for (std::size_t i = 0; i < edges.count; i += hn::Lanes(d)) {
    const auto load = [&](const CrossedEdges::Array<float>& array) HWY_ATTR { return hn::LoadU(d, &array[i]); };
    const CrossedEdges::Ends &a = edges.first, &b = edges.second;
    const Floats share = load(shares), variance_a = load(a.variance), variance_b = load(b.variance);
    const Floats of_a = hn::Div(hn::Add(hn::Sub(hn::Set(d, 1.0F), share), least_part), variance_a);
    const Floats of_b = hn::Div(hn::Add(share, least_part), variance_b);
    const Floats sum = hn::Add(of_a, of_b);
    const auto is_known = hn::Gt(sum, hn::Zero(d));
    const auto is_b_alone = hn::Eq(variance_a, infinite), is_a_alone = hn::Eq(variance_b, infinite);
    const auto mean = [&](Floats value_a, Floats value_b)
                          HWY_ATTR { return hn::Div(hn::Add(hn::Mul(of_a, value_a), hn::Mul(of_b, value_b)), sum); };
    const auto either = [&](Floats value_a, Floats value_b, Floats both) HWY_ATTR {
      return hn::IfThenElse(is_b_alone, value_b, hn::IfThenElse(is_a_alone, value_a, both));
    };
    const auto store = [&](Floats values, CrossedEdges::Array<float>& to)
                           HWY_ATTR { hn::StoreU(hn::IfThenElse(is_known, values, none), d, &to[i]); };
    store(mean(load(a.celsius), load(b.celsius)), edges.celsius);
    // The looks of both are the same looks: together they know no more than the mean of what each knows.
    const Floats own_a = load(a.own_variance), own_b = load(b.own_variance);
    store(hn::Sqrt(hn::Add(either(own_a, own_b, mean(own_a, own_b)), least_variance)), edges.sigma_kelvin);
    const Floats seen_a = load(a.seen_s), seen_b = load(b.seen_s);
    store(either(seen_a, seen_b, hn::Max(seen_a, seen_b)), edges.seen_s);
  }
}

void vertices(CrossedEdges& edges, double voxel_m, float least_sigma_kelvin) {
  CrossedEdges::Array<float> shares;
  places(edges, voxel_m, shares);
  temperatures(edges, least_sigma_kelvin, shares);
}

}  // namespace spectra::mapping::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace spectra::mapping {
namespace {
HWY_EXPORT(bits);
HWY_EXPORT(vertices);
}  // namespace

void find_bits(const VoxelBlock& block, std::uint16_t least_weight, BlockBits& out) {
  HWY_DYNAMIC_DISPATCH(bits)(block, least_weight, out);
}

void find_vertices(CrossedEdges& edges, double voxel_m, float least_sigma_kelvin) {
  HWY_DYNAMIC_DISPATCH(vertices)(edges, voxel_m, least_sigma_kelvin);
}

}  // namespace spectra::mapping

#endif  // HWY_ONCE
