#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "server/mapping/surface_kernel.cpp"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include "server/mapping/lens_lanes-inl.hpp"
#include "server/mapping/surface_kernel.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::mapping::HWY_NAMESPACE {

constexpr float kSurfaceNearest = 0.1F;  ///< Metres before the camera.
constexpr std::size_t kMargin = 64;      ///< Voxels to the farthest neighbour, in the order of a block.

constexpr float kUnseen = 1e9F;  ///< In place of a distance.

/// Distances of a block with room on both sides.
using Padded = std::array<float, kBlockVoxels + 2 * kMargin>;

/// Half the difference across voxels along an axis, or the whole one to the neighbour that is in the block and was seen.
HWY_INLINE Floats slope(const Padded& block, std::size_t at, Floats own, Ints place, std::size_t stride) {
  const FloatTag d;
  const IntTag di;
  const Floats below = hn::LoadU(d, &block[at - stride]), above = hn::LoadU(d, &block[at + stride]);
  const auto has_low = hn::And(hn::RebindMask(d, hn::Gt(place, hn::Zero(di))), hn::Lt(below, hn::Set(d, kUnseen)));
  const auto has_high =
      hn::And(hn::RebindMask(d, hn::Lt(place, hn::Set(di, kBlockEdge - 1))), hn::Lt(above, hn::Set(d, kUnseen)));
  const Floats low = hn::IfThenElse(has_low, below, own), high = hn::IfThenElse(has_high, above, own);
  const Floats difference = hn::Sub(high, low);
  return hn::IfThenElse(hn::And(has_low, has_high), hn::Mul(hn::Set(d, 0.5F), difference), difference);
}

void see(const KernelCamera& camera, const VoxelBlock& block, const std::array<float, 3>& corner, float voxel_m,
         float beside, float off_per_step, SeenVoxels& out) {
  const FloatTag d;
  const IntTag di;
  const hn::Rebind<std::int16_t, FloatTag> narrow;
  const hn::Rebind<std::uint16_t, FloatTag> narrow_weight;
  const std::size_t lanes = hn::Lanes(d);
  alignas(64) Padded padded;
  for (std::size_t i = 0; i < kMargin; i += lanes) {
    hn::StoreU(hn::Zero(d), d, &padded[i]);
    hn::StoreU(hn::Zero(d), d, &padded[kMargin + kBlockVoxels + i]);
  }
  for (std::size_t i = 0; i < kBlockVoxels; i += lanes) {
    const Ints distance = hn::PromoteTo(di, hn::LoadU(narrow, &block.distance[i]));
    const Ints weight = hn::PromoteTo(di, hn::LoadU(narrow_weight, &block.weight[i]));
    const auto is_seen = hn::RebindMask(d, hn::Gt(weight, hn::Zero(di)));
    hn::StoreU(hn::IfThenElse(is_seen, hn::ConvertTo(d, distance), all(kUnseen)), d, &padded[kMargin + i]);
  }
  out.count = 0;
  const Lens& lens = camera.lens;
  const Ints within = hn::Set(di, kBlockEdge - 1);
  for (std::size_t i = 0; i < kBlockVoxels; i += lanes) {
    const std::size_t at = kMargin + i;
    const Floats own = hn::LoadU(d, &padded[at]);
    auto is_taken = hn::Le(hn::Abs(own), all(beside));
    if (hn::AllFalse(d, is_taken)) continue;
    const Ints voxel = hn::Iota(di, static_cast<std::int32_t>(i));
    const Floats gx = slope(padded, at, own, hn::And(voxel, within), 1);
    const Floats gy = slope(padded, at, own, hn::And(hn::ShiftRight<3>(voxel), within), kBlockEdge);
    const Floats gz = slope(padded, at, own, hn::ShiftRight<6>(voxel), std::size_t{kBlockEdge} * kBlockEdge);
    const Floats squared = hn::Add(hn::Mul(gx, gx), hn::Add(hn::Mul(gy, gy), hn::Mul(gz, gz)));
    is_taken = hn::And(is_taken, hn::Gt(squared, all(0)));
    // From the voxel along the normal to the surface; distances along lines of sight are longer than those to the surface, as the
    // gradient is larger.
    const Floats most = hn::Div(all(2), hn::Sqrt(squared));
    const Floats back = hn::Max(hn::Neg(most), hn::Min(most, hn::Neg(hn::Div(own, squared))));
    const auto turned = [&](std::size_t k) HWY_ATTR {
      return hn::Add(hn::Mul(gx, all(camera.view.step(0)[k])),
                     hn::Add(hn::Mul(gy, all(camera.view.step(1)[k])), hn::Mul(gz, all(camera.view.step(2)[k]))));
    };
    const Floats nx = turned(0), ny = turned(1), nz = turned(2);
    const Floats px = hn::Add(hn::Add(all(corner[0]), hn::LoadU(d, &camera.x[i])), hn::Mul(back, nx));
    const Floats py = hn::Add(hn::Add(all(corner[1]), hn::LoadU(d, &camera.y[i])), hn::Mul(back, ny));
    const Floats pz = hn::Add(hn::Add(all(corner[2]), hn::LoadU(d, &camera.z[i])), hn::Mul(back, nz));
    const auto dot = [](Floats ax, Floats ay, Floats az, Floats bx, Floats by, Floats bz)
                         HWY_ATTR { return hn::Add(hn::Mul(ax, bx), hn::Add(hn::Mul(ay, by), hn::Mul(az, bz))); };
    const Floats along = hn::Neg(dot(nx, ny, nz, px, py, pz));
    is_taken = hn::And(is_taken, hn::And(hn::Ge(pz, all(kSurfaceNearest)), hn::Gt(along, all(0))));
    if (hn::AllFalse(d, is_taken)) continue;
    const Floats lengths = hn::Sqrt(hn::Mul(dot(nx, ny, nz, nx, ny, nz), dot(px, py, pz, px, py, pz)));
    const Floats inverse = hn::Div(all(1), pz);
    Floats x = hn::Mul(px, inverse), y = hn::Mul(py, inverse);
    if (camera.is_distorted) distort(lens, x, y);
    const Floats u = hn::Add(hn::Mul(all(lens.fx), x), all(lens.cx));
    const Floats v = hn::Add(hn::Mul(all(lens.fy), y), all(lens.cy));
    // The square reaches its neighbours' even where they are apart by a diagonal.
    const Floats half = hn::Mul(all(0.75F * voxel_m * lens.fx), inverse);
    const auto is_across =
        hn::And(hn::Gt(hn::Add(u, half), all(0)), hn::Lt(hn::Sub(u, half), all(static_cast<float>(camera.width))));
    const auto is_down =
        hn::And(hn::Gt(hn::Add(v, half), all(0)), hn::Lt(hn::Sub(v, half), all(static_cast<float>(camera.height))));
    is_taken = hn::And(is_taken, hn::And(is_across, is_down));
    // The plane n p = -along, along the line of sight of a pixel: z = -along / (n ray), to the first order.
    const Floats bend = hn::Div(hn::Mul(pz, pz), along);
    // Whole registers are written: storing some lanes alone takes several times as long.
    const auto keep = [&](Floats values, std::array<float, SeenVoxels::kRoom>& to)
                          HWY_ATTR { hn::StoreU(hn::Compress(values, is_taken), d, &to[out.count]); };
    keep(u, out.u);
    keep(v, out.v);
    keep(pz, out.z_m);
    keep(hn::Min(all(1), hn::Div(along, lengths)), out.cosine);
    keep(hn::Mul(hn::Mul(nx, bend), all(1 / lens.fx)), out.per_u);
    keep(hn::Mul(hn::Mul(ny, bend), all(1 / lens.fy)), out.per_v);
    keep(half, out.half);
    keep(hn::Mul(hn::Abs(own), all(off_per_step)), out.off_m);
    hn::StoreU(hn::Compress(voxel, hn::RebindMask(di, is_taken)), di, &out.voxel[out.count]);
    out.count += hn::CountTrue(d, is_taken);
  }
}

}  // namespace spectra::mapping::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace spectra::mapping {
namespace {
HWY_EXPORT(see);
}  // namespace

void see_voxels(const KernelCamera& camera, const VoxelBlock& block, const std::array<float, 3>& corner, float voxel_m,
                float beside, float off_per_step, SeenVoxels& out) {
  HWY_DYNAMIC_DISPATCH(see)(camera, block, corner, voxel_m, beside, off_per_step, out);
}

}  // namespace spectra::mapping

#endif  // HWY_ONCE
