#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "server/mapping/place_kernel.cpp"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include <algorithm>
#include <limits>

#include "server/mapping/lens_lanes-inl.hpp"
#include "server/mapping/place_kernel.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::mapping::HWY_NAMESPACE {

void find(const PlaceKernel& kernel, const PackedPixels& pixels, RecentPlaces& recent, std::vector<GridPlace>& places) {
  const FloatTag d;
  const IntTag di;
  const Ints seven = hn::Set(di, 7);
  alignas(64) std::array<std::int32_t, 16> new_x, new_y, new_z, new_entry;
  for (std::size_t i = 0; i < pixels.count; i += hn::Lanes(d)) {
    const Floats z = hn::LoadU(d, pixels.depth_m + i), rx = hn::LoadU(d, pixels.ray_x + i),
                 ry = hn::LoadU(d, pixels.ray_y + i);
    const auto is_pixel = hn::Lt(hn::Iota(d, static_cast<float>(i)), all(static_cast<float>(pixels.count)));
    const auto turned = [&](std::size_t axis) HWY_ATTR {
      const std::array<float, 3>& row = kernel.turn[axis];
      return hn::Add(hn::Add(hn::Mul(all(row[0]), rx), hn::Mul(all(row[1]), ry)), all(row[2]));
    };
    const Floats x = turned(0), y = turned(1), along = turned(2);
    const Floats beyond = hn::Max(all(0), hn::Sub(z, all(kernel.from_m)));
    const Floats noise = hn::Add(all(kernel.base_m), hn::Mul(all(kernel.growth_per_m), hn::Mul(beyond, beyond)));
    const Floats begin = hn::Max(all(kernel.nearest_m), hn::Sub(z, all(kernel.before_m)));
    const Floats length = hn::Sub(hn::Add(z, hn::Max(all(kernel.behind_m), noise)), begin);
    const Floats norm = hn::Sqrt(hn::Add(hn::Add(hn::Mul(x, x), hn::Mul(y, y)), hn::Mul(along, along)));
    const Floats steps = hn::Max(all(1), hn::Ceil(hn::Mul(hn::Mul(length, norm), all(2))));
    const Floats step_m = hn::Div(length, steps);
    const Floats most = hn::MaxOfLanes(d, hn::IfThenElseZero(is_pixel, steps));
    const auto last = static_cast<std::int32_t>(hn::GetLane(most));
    for (std::int32_t s = 0; s <= last; ++s) {
      const Floats step = all(static_cast<float>(s)), at = hn::Add(begin, hn::Mul(step_m, step));
      const auto block = [&](float eye, Floats direction) HWY_ATTR {
        return hn::ConvertTo(di, hn::Floor(hn::Add(all(eye), hn::Mul(direction, at))));
      };
      const Ints bx = block(kernel.eye[0], x), by = block(kernel.eye[1], y), bz = block(kernel.eye[2], along);
      const Ints low = hn::Or(hn::And(bx, seven), hn::ShiftLeft<3>(hn::And(by, seven)));
      const Ints far = hn::And(hn::ShiftRight<3>(bx), hn::Set(di, 1));
      const Ints entry = hn::Or(hn::Or(low, hn::ShiftLeft<6>(hn::And(bz, seven))), hn::ShiftLeft<9>(far));
      const auto is_known = hn::And(hn::And(hn::Eq(hn::GatherIndex(di, recent.x.data(), entry), bx),
                                            hn::Eq(hn::GatherIndex(di, recent.y.data(), entry), by)),
                                    hn::Eq(hn::GatherIndex(di, recent.z.data(), entry), bz));
      const auto is_asked = hn::RebindMask(di, hn::And(is_pixel, hn::Le(step, steps)));
      const auto is_new = hn::AndNot(is_known, is_asked);
      if (hn::AllFalse(di, is_new)) continue;
      hn::StoreU(hn::Compress(bx, is_new), di, new_x.data());
      hn::StoreU(hn::Compress(by, is_new), di, new_y.data());
      hn::StoreU(hn::Compress(bz, is_new), di, new_z.data());
      hn::StoreU(hn::Compress(entry, is_new), di, new_entry.data());
      const std::size_t count = hn::CountTrue(di, is_new);
      for (std::size_t k = 0; k < count; ++k) {
        const auto e = static_cast<std::size_t>(new_entry[k]);
        if (recent.x[e] == new_x[k] && recent.y[e] == new_y[k] && recent.z[e] == new_z[k]) continue;
        recent.x[e] = new_x[k];
        recent.y[e] = new_y[k];
        recent.z[e] = new_z[k];
        places.push_back({new_x[k], new_y[k], new_z[k]});
      }
    }
  }
}

}  // namespace spectra::mapping::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace spectra::mapping {
namespace {
HWY_EXPORT(find);
}  // namespace

RecentPlaces::RecentPlaces() {
  x.fill(std::numeric_limits<std::int32_t>::min());
  y.fill(0);
  z.fill(0);
}

void find_places(const PlaceKernel& kernel, const PackedPixels& pixels, RecentPlaces& recent,
                 std::vector<GridPlace>& places) {
  HWY_DYNAMIC_DISPATCH(find)(kernel, pixels, recent, places);
}

}  // namespace spectra::mapping

#endif  // HWY_ONCE
