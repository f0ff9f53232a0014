#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "server/mapping/block_kernels.cpp"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include <algorithm>

#include "server/mapping/block_kernels.hpp"
#include "server/mapping/lens_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::mapping::HWY_NAMESPACE {

constexpr float kNearest = 0.05F;  ///< Metres before the camera.

template <class Narrow>
HWY_INLINE Floats load_narrow(const Narrow* from) {
  const hn::Rebind<Narrow, FloatTag> narrow;
  return hn::ConvertTo(FloatTag(), hn::PromoteTo(IntTag(), hn::LoadU(narrow, from)));
}

/// Whole numbers that fit.
template <class Narrow>
HWY_INLINE void store_narrow(Floats values, Narrow* to) {
  const hn::Rebind<Narrow, FloatTag> narrow;
  hn::StoreU(hn::DemoteTo(narrow, hn::ConvertTo(IntTag(), values)), narrow, to);
}

/// The pixels that voxels fall into; the one after the last where there is none. `z` becomes their depth.
HWY_INLINE Ints project(const KernelCamera& camera, const std::array<float, 3>& corner, std::size_t voxel, Floats& z) {
  const FloatTag d;
  const IntTag di;
  z = hn::Add(all(corner[2]), hn::LoadU(d, &camera.z[voxel]));
  const Floats inverse = hn::Div(all(1), hn::Max(z, all(kNearest)));
  Floats x = hn::Mul(hn::Add(all(corner[0]), hn::LoadU(d, &camera.x[voxel])), inverse);
  Floats y = hn::Mul(hn::Add(all(corner[1]), hn::LoadU(d, &camera.y[voxel])), inverse);
  const Lens& lens = camera.lens;
  if (camera.is_distorted) distort(lens, x, y);
  // Half a pixel more, so that cutting off the fraction rounds; what is outside is brought to the border first.
  const Floats across = all(static_cast<float>(camera.width)), down = all(static_cast<float>(camera.height));
  const Floats u = hn::Min(hn::Max(hn::Add(hn::Mul(all(lens.fx), x), all(lens.cx + 0.5F)), all(-1)), across);
  const Floats v = hn::Min(hn::Max(hn::Add(hn::Mul(all(lens.fy), y), all(lens.cy + 0.5F)), all(-1)), down);
  const auto is_inside = hn::And(hn::And(hn::Gt(z, all(kNearest)), hn::And(hn::Ge(u, all(0)), hn::Ge(v, all(0)))),
                                 hn::And(hn::Lt(u, across), hn::Lt(v, down)));
  const Ints pixel = hn::Add(hn::Mul(hn::ConvertTo(di, v), hn::Set(di, camera.width)), hn::ConvertTo(di, u));
  return hn::IfThenElse(hn::RebindMask(di, is_inside), pixel, hn::Set(di, camera.width * camera.height));
}

/// Means after one more value: rounded, at least one step of 1 towards it.
HWY_INLINE Floats mean_after(Floats mean, Floats value, Floats share) {
  const Floats difference = hn::Sub(value, mean), step = hn::Mul(difference, share);
  const Floats rounded = hn::Trunc(hn::Add(step, hn::CopySign(all(0.5F), step)));
  const Floats least = hn::Trunc(hn::Max(hn::Min(difference, all(1)), all(-1)));
  return hn::Add(mean, hn::IfThenElse(hn::Eq(rounded, all(0)), least, rounded));
}

/// Of pixels of DepthFrame::packed.
HWY_INLINE Floats weight_of(hn::Vec<hn::RebindToUnsigned<FloatTag>> packed) {
  const hn::RebindToUnsigned<FloatTag> du;
  return hn::ConvertTo(FloatTag(), hn::BitCast(IntTag(), hn::And(packed, hn::Set(du, 0xffffU))));
}

BlockChange distances(const DistanceKernel& kernel, const std::array<float, 3>& corner, VoxelBlock& block,
                      NearPixels& near) {
  const FloatTag d;
  const IntTag di;
  const hn::RebindToUnsigned<FloatTag> du;
  const Floats per_m = all(kDistanceOne / kernel.truncation_m), half = all(0.5F * kDistanceOne);
  Floats moved = all(0), nearest = all(kDistanceOne), least = all(kDistanceOne), largest = all(-kDistanceOne);
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(d)) {
    Floats z;
    const Ints pixel = project(kernel.camera, corner, i, z);
    const auto packed = hn::GatherIndex(du, kernel.pixels, pixel);
    const Floats seen = hn::Mul(hn::ConvertTo(d, hn::BitCast(di, hn::ShiftRight<16>(packed))), all(kernel.unit_m));
    const Floats trust = weight_of(packed);
    const Floats metres = hn::Sub(seen, z);
    // The same weight for all that may err, whether towards the camera or away: else the surface would move one way.
    const Floats beyond = hn::Max(all(0), hn::Sub(seen, all(kernel.from_m)));
    const Floats noise = hn::Add(all(kernel.base_m), hn::Mul(all(kernel.growth_per_m), hn::Mul(beyond, beyond)));
    const Floats behind = hn::Max(all(kernel.behind_m), noise);
    const Floats weight = hn::IfThenElseZero(hn::Gt(metres, hn::Neg(behind)), trust);
    const auto is_seen = hn::Gt(weight, all(0));
    const Floats old = load_narrow(&block.distance[i]);
    if (hn::AllFalse(d, is_seen)) {
      nearest = hn::Min(nearest, hn::Abs(old));
      least = hn::Min(least, old);
      largest = hn::Max(largest, old);
      hn::StoreU(hn::Set(di, -1), di, &near[i]);
      continue;
    }
    const Floats old_weight = load_narrow(&block.weight[i]), sum = hn::Add(old_weight, weight);
    store_narrow(hn::Min(all(kWeightMost), sum), &block.weight[i]);
    const Floats target = hn::Min(all(kDistanceOne), hn::Max(all(-kDistanceOne), hn::Mul(metres, per_m)));
    Floats next = old;
    // What is well before a surface mostly was before.
    if (!hn::AllFalse(d, hn::And(is_seen, hn::Ne(target, old)))) {
      const Floats mean = mean_after(old, target, hn::Div(weight, hn::Max(all(1), sum)));
      next = hn::IfThenElse(is_seen, mean, old);
      store_narrow(next, &block.distance[i]);
    }
    const Floats either = hn::Min(hn::Abs(next), hn::Abs(old));
    moved = hn::Max(moved, hn::IfThenElseZero(hn::Lt(either, half), hn::Abs(hn::Sub(next, old))));
    nearest = hn::Min(nearest, either);
    least = hn::Min(least, next);
    largest = hn::Max(largest, next);
    const auto is_near = hn::And(is_seen, hn::Lt(hn::Abs(metres), all(2 * kernel.voxel_m)));
    hn::StoreU(hn::IfThenElse(hn::RebindMask(di, is_near), pixel, hn::Set(di, -1)), di, &near[i]);
  }
  const auto lowest = [d](Floats values) HWY_ATTR { return hn::GetLane(hn::MinOfLanes(d, values)); };
  const auto highest = [d](Floats values) HWY_ATTR { return hn::GetLane(hn::MaxOfLanes(d, values)); };
  BlockChange change;
  change.moved = highest(moved);
  change.has_surface = lowest(nearest) < 0.5F * kDistanceOne;
  change.is_free = lowest(least) >= 0.5F * kDistanceOne;
  change.has_inside = lowest(least) < 0;
  change.has_outside = highest(largest) >= 0;
  return change;
}

float colours(const ColourKernel& kernel, const std::array<float, 3>& corner, VoxelBlock& block,
              const NearPixels& near) {
  const FloatTag d;
  const IntTag di;
  const hn::RebindToUnsigned<FloatTag> du;
  const Ints outside = hn::Set(di, kernel.camera.width * kernel.camera.height);
  Floats recoloured = all(0);
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(d)) {
    const Ints depth_pixel = hn::LoadU(di, &near[i]);
    auto is_seen = hn::Gt(depth_pixel, hn::Set(di, -1));
    if (hn::AllFalse(di, is_seen)) continue;
    Ints pixel = depth_pixel;
    if (!kernel.is_depth_camera) {
      Floats z;
      pixel = project(kernel.camera, corner, i, z);
      is_seen = hn::And(is_seen, hn::Lt(pixel, outside));
      if (hn::AllFalse(di, is_seen)) continue;
    }
    pixel = hn::IfThenElseZero(is_seen, pixel);
    const auto is_taken = hn::RebindMask(d, is_seen);
    // The nearer and the less askew, the more: the weight of the distance, of which little is left beyond 3 m, by its root.
    const Floats trust = weight_of(hn::GatherIndex(du, kernel.depth_pixels, hn::IfThenElseZero(is_seen, depth_pixel)));
    const Floats root = hn::Sqrt(hn::Mul(trust, all(1 / kWeightOne)));
    const Floats weight = hn::Max(all(1), hn::Trunc(hn::Add(hn::Mul(all(16), root), all(0.5F))));
    const Floats old_weight = load_narrow(&block.colour_weight[i]);
    const Floats sum = hn::Add(old_weight, weight);
    const Floats share = hn::Div(weight, sum);
    const auto seen = hn::BitCast(di, hn::GatherIndex(du, kernel.pixels, pixel));
    const auto fuse_channel = [&](Ints level, std::uint16_t* channel) HWY_ATTR {
      const Floats old = load_narrow(channel);
      const Floats mean = mean_after(old, hn::Mul(all(256), hn::ConvertTo(d, level)), share);
      const Floats next = hn::IfThenElse(is_taken, mean, old);
      store_narrow(next, channel);
      recoloured = hn::Max(recoloured, hn::Abs(hn::Sub(next, old)));
    };
    const Ints byte = hn::Set(di, 0xff);
    fuse_channel(hn::And(seen, byte), &block.red[i]);
    fuse_channel(hn::And(hn::ShiftRight<8>(seen), byte), &block.green[i]);
    fuse_channel(hn::And(hn::ShiftRight<16>(seen), byte), &block.blue[i]);
    store_narrow(hn::IfThenElse(is_taken, hn::Min(all(255), sum), old_weight), &block.colour_weight[i]);
  }
  return hn::GetLane(hn::MaxOfLanes(d, recoloured)) / 256;
}

}  // namespace spectra::mapping::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace spectra::mapping {
namespace {
HWY_EXPORT(distances);
HWY_EXPORT(colours);
}  // namespace

KernelCamera::KernelCamera(const CameraModel& camera, const Eigen::Isometry3d& world_from_camera, double voxel_m)
    : view(world_from_camera, voxel_m),
      lens(camera),
      is_distorted(camera.has_distortion()),
      width(camera.width),
      height(camera.height) {
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    const auto across = static_cast<float>(i % kBlockEdge), down = static_cast<float>(i / kBlockEdge % kBlockEdge),
               deep = static_cast<float>(i / kBlockEdge / kBlockEdge);
    const auto along = [&](std::size_t axis) {
      return across * view.step(0)[axis] + down * view.step(1)[axis] + deep * view.step(2)[axis];
    };
    x[i] = along(0);
    y[i] = along(1);
    z[i] = along(2);
  }
}

BlockChange fuse_distances(const DistanceKernel& kernel, const std::array<float, 3>& corner, VoxelBlock& block,
                           NearPixels& near) {
  return HWY_DYNAMIC_DISPATCH(distances)(kernel, corner, block, near);
}

float fuse_colours(const ColourKernel& kernel, const std::array<float, 3>& corner, VoxelBlock& block,
                   const NearPixels& near) {
  return HWY_DYNAMIC_DISPATCH(colours)(kernel, corner, block, near);
}

}  // namespace spectra::mapping

#endif  // HWY_ONCE
