#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "server/mapping/look_kernel.cpp"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include "server/mapping/lens_lanes-inl.hpp"
#include "server/mapping/look_kernel.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::mapping::HWY_NAMESPACE {

constexpr float kPixelError = 0.7F;  ///< Of where a point falls in the picture, pixels.
constexpr float kReflection = 0.95F;

/// What a look's variance is made of: its own part, and what that is multiplied by.
struct Variance {
  Floats own, scale;
};

HWY_INLINE Variance weigh(const LookKernel& kernel, Floats u, Floats v, Floats z, Floats cosine, Floats celsius,
                          Floats gradient) {
  const Lens& lens = kernel.lens;
  const Floats c = hn::Max(cosine, all(0.05F));
  const Floats px = hn::Div(hn::Sub(u, all(lens.cx)), all(lens.fx)),
               py = hn::Div(hn::Sub(v, all(lens.cy)), all(lens.fy)), x = hn::Mul(px, z), y = hn::Mul(py, z);
  // What moves before the camera in the time of a pixel, pixels: the point's velocity seen from the camera.
  const auto moved = [&](std::size_t axis, std::size_t next, Floats at_last, std::size_t last,
                         Floats at_next) HWY_ATTR {
    const Floats turned =
        hn::Sub(hn::Mul(all(kernel.angular[next]), at_last), hn::Mul(all(kernel.angular[last]), at_next));
    return hn::Neg(hn::Add(all(kernel.linear[axis]), turned));
  };
  const Floats moved_x = moved(0, 1, z, 2, y), moved_y = moved(1, 2, x, 0, z), moved_z = moved(2, 0, y, 1, x);
  const Floats du = hn::Div(hn::Mul(all(lens.fx), hn::Sub(moved_x, hn::Mul(px, moved_z))), z),
               dv = hn::Div(hn::Mul(all(lens.fy), hn::Sub(moved_y, hn::Mul(py, moved_z))), z);
  const Floats uncertain = hn::Mul(all(kPixelError), gradient);
  const Floats from_above = hn::Sub(all(1), c), askew = hn::Mul(from_above, from_above);
  const Floats reflected = hn::Mul(hn::Mul(hn::Mul(hn::Mul(all(kReflection), askew), askew), from_above),
                                   hn::Sub(celsius, all(kernel.reflected_celsius)));
  const Floats speed = hn::Add(hn::Add(all(1), hn::Mul(du, du)), hn::Mul(dv, dv));
  return {hn::Add(hn::Add(all(kernel.noise), hn::Mul(uncertain, uncertain)), hn::Mul(reflected, reflected)),
          hn::Mul(hn::Mul(hn::Div(hn::Mul(z, z), c), speed), all(kernel.after_shutter))};
}

void find(const LookKernel& kernel, const SeenVoxels& seen, HeatSeen& out) {
  const FloatTag d;
  const IntTag di;
  const hn::Rebind<std::uint16_t, FloatTag> narrow;
  const Ints width = hn::Set(di, kernel.width);
  // Between four pixels.
  const Floats across = all(static_cast<float>(kernel.width - 1)), down = all(static_cast<float>(kernel.height - 1));
  std::size_t i = 0;
  for (const SeenVoxels::Block& block : seen.blocks) {
    const std::size_t before = out.count;
    for (; i < block.end; i += hn::Lanes(d)) {
      const Floats u = hn::LoadU(d, &seen.u[i]), v = hn::LoadU(d, &seen.v[i]), z = hn::LoadU(d, &seen.z_m[i]),
                   cosine = hn::LoadU(d, &seen.cosine[i]);
      auto is_taken = hn::And(hn::FirstN(d, block.end - i), hn::Ge(cosine, all(kernel.least_cosine)));
      is_taken = hn::And(is_taken, hn::And(hn::And(hn::Ge(u, all(0)), hn::Lt(u, across)),
                                           hn::And(hn::Ge(v, all(0)), hn::Lt(v, down))));
      if (hn::AllFalse(d, is_taken)) continue;
      const auto is_pixel = hn::RebindMask(di, is_taken);
      const Floats left = hn::Floor(u), top = hn::Floor(v);
      const auto pixel_at = [&](Floats column, Floats row) HWY_ATTR {
        const Ints pixel = hn::Add(hn::Mul(hn::ConvertTo(di, row), width), hn::ConvertTo(di, column));
        return hn::IfThenElseZero(is_pixel, pixel);
      };
      const Ints pixel = pixel_at(left, top), below = hn::Add(pixel, width);
      const Floats gradient = hn::GatherIndex(d, kernel.gradient, pixel);
      is_taken = hn::And(is_taken, hn::Ge(gradient, all(0)));
      if (kernel.depth_m != nullptr) {
        const auto rounded = [](Floats value) HWY_ATTR { return hn::Floor(hn::Add(value, all(0.5F))); };
        const Floats before_m = hn::GatherIndex(d, kernel.depth_m, pixel_at(rounded(u), rounded(v)));
        // A square lies across the line of sight whatever its surface does: what is askew has more depth within a voxel.
        const Floats c = hn::Max(cosine, all(0.1F));
        const Floats deep = hn::Div(hn::Mul(all(1.5F), hn::Sqrt(hn::Sub(all(1), hn::Mul(c, c)))), c);
        const Floats reach = hn::Mul(all(kernel.voxel_m), hn::Add(all(1.5F), deep));
        is_taken = hn::And(is_taken, hn::Lt(z, hn::Add(before_m, reach)));
      }
      if (hn::AllFalse(d, is_taken)) continue;
      const Floats a = hn::Sub(u, left), b = hn::Sub(v, top);
      const auto along_row = [&](Ints first) HWY_ATTR {
        return hn::Add(hn::Mul(hn::Sub(all(1), a), hn::GatherIndex(d, kernel.celsius, first)),
                       hn::Mul(a, hn::GatherIndex(d, kernel.celsius + 1, first)));
      };
      const Floats celsius = hn::Add(hn::Mul(hn::Sub(all(1), b), along_row(pixel)), hn::Mul(b, along_row(below)));
      Variance variance{all(kernel.noise), all(1)};
      if (kernel.is_weighed) {
        variance = weigh(kernel, u, v, z, cosine, celsius, gradient);
        const auto is_vague = hn::Gt(hn::Mul(variance.own, variance.scale), all(kernel.most_variance));
        is_taken = hn::AndNot(is_vague, is_taken);
      }
      // Whole registers are written: storing some lanes alone takes several times as long.
      const auto keep = [&](Floats values, std::vector<float>& to)
                            HWY_ATTR { hn::StoreU(hn::Compress(values, is_taken), d, &to[out.count]); };
      keep(celsius, out.celsius);
      keep(variance.own, out.own);
      keep(variance.scale, out.scale);
      const Ints voxel = hn::PromoteTo(di, hn::LoadU(narrow, &seen.voxel[i]));
      const Ints kept = hn::Compress(voxel, hn::RebindMask(di, is_taken));
      hn::StoreU(hn::DemoteTo(narrow, kept), narrow, &out.voxel[out.count]);
      out.count += hn::CountTrue(d, is_taken);
    }
    i = block.end;
    if (out.count > before) out.blocks.push_back({block.index, out.count});
  }
}

}  // namespace spectra::mapping::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace spectra::mapping {
namespace {
HWY_EXPORT(find);
}  // namespace

void find_looks(const LookKernel& kernel, const SeenVoxels& seen, HeatSeen& out) {
  const std::size_t room = seen.count + 16;  // A whole register is written at the end.
  if (out.voxel.size() < room) {
    out.voxel.resize(room);
    for (auto* values : {&out.celsius, &out.scale, &out.own}) values->resize(room);
  }
  out.blocks.clear();
  out.count = 0;
  HWY_DYNAMIC_DISPATCH(find)(kernel, seen, out);
}

}  // namespace spectra::mapping

#endif  // HWY_ONCE
