#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "server/mapping/depth_kernel.cpp"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include <algorithm>
#include <array>

#include "server/mapping/depth_kernel.hpp"
#include "server/mapping/lens_lanes-inl.hpp"
#include "server/mapping/voxel_map.hpp"

HWY_BEFORE_NAMESPACE();
namespace spectra::mapping::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// What the noise of the sensor says of pixels.
struct NoiseLanes {
  alignas(64) std::array<float, 16> sigma_m;  ///< -1: more than the truncation.
  alignas(64) std::array<float, 16> trust;    ///< (2 sigma_0 / sigma)^2, at most 1.
};

HWY_INLINE void find_noise(const DepthPixels& pixels, const float* depth_m, NoiseLanes& out) {
  const hn::CappedTag<double, 8> d;
  const hn::Rebind<float, decltype(d)> df;
  const auto set = [&](double value) HWY_ATTR { return hn::Set(d, value); };
  const double reference = 2 * pixels.noise.base_m;
  for (std::size_t i = 0; i < hn::Lanes(FloatTag()); i += hn::Lanes(d)) {
    const auto z = hn::PromoteTo(d, hn::LoadU(df, depth_m + i));
    const auto beyond = hn::Max(hn::Sub(z, set(pixels.noise.from_m)), set(0));
    const auto sigma =
        hn::Add(set(pixels.noise.base_m), hn::Mul(hn::Mul(set(pixels.noise.growth_per_m), beyond), beyond));
    const auto trust = hn::Min(set(1), hn::Div(set(reference * reference), hn::Mul(sigma, sigma)));
    const auto told = hn::IfThenElse(hn::Gt(sigma, set(pixels.truncation_m)), set(-1), sigma);
    hn::StoreU(hn::DemoteTo(df, told), df, &out.sigma_m[i]);
    hn::StoreU(hn::DemoteTo(df, trust), df, &out.trust[i]);
  }
}

/// The neighbour on one side: the farthest within kNormalReach that is on the same surface.
struct Neighbour {
  Floats z, ray_x, ray_y;
};

void weigh(const DepthPixels& pixels, std::size_t first, std::size_t count, float* weight) {
  const FloatTag d;
  const IntTag di;
  const Floats zero = hn::Zero(d);
  const std::size_t lanes = hn::Lanes(d);
  for (std::size_t i = 0; i < count; i += lanes) {
    // The last register begins earlier rather than reaching over the end.
    const std::size_t at = std::min(i, count - lanes);
    const float *depth = pixels.depth_m + first + at, *ray_x = pixels.ray_x + first + at,
                *ray_y = pixels.ray_y + first + at;
    const Floats z = hn::LoadU(d, depth);
    auto is_taken = hn::Gt(z, zero);
    if (hn::AllFalse(d, is_taken)) {
      hn::StoreU(zero, d, weight + at);
      continue;
    }
    NoiseLanes noise;
    find_noise(pixels, depth, noise);
    const Floats sigma = hn::LoadU(d, noise.sigma_m.data());
    is_taken = hn::And(is_taken, hn::Ge(sigma, zero));
    // Metres by which neighbours may differ that are so many pixels apart on one surface.
    const Floats steepest = hn::Mul(hn::Div(z, all(pixels.focal)), all(kSteepest));
    const auto largest_step = [&](float apart)
                                  HWY_ATTR { return hn::Add(hn::Mul(all(6), sigma), hn::Mul(all(apart), steepest)); };
    const std::array most{largest_step(1), largest_step(2), largest_step(3)};
    static_assert(kEdgeReach == 2 && kNormalReach == 3);
    const auto side = [&](std::ptrdiff_t step) HWY_ATTR {
      const Floats one = hn::LoadU(d, depth + step), two = hn::LoadU(d, depth + 2 * step),
                   three = hn::LoadU(d, depth + 3 * step);
      const auto off = [&](Floats other) HWY_ATTR { return hn::Abs(hn::Sub(other, z)); };
      // What is left is on the surface, at least with its next pixel.
      is_taken = hn::And(is_taken, hn::And(hn::Gt(one, zero), hn::Le(off(one), most[0])));
      const auto is_two_near = hn::Le(off(two), most[1]), has_two = hn::Gt(two, zero);
      is_taken = hn::And(is_taken, hn::Or(is_two_near, hn::Eq(two, zero)));
      const auto is_two = hn::And(has_two, is_two_near);
      const auto is_three = hn::And(hn::Gt(three, zero), hn::Le(off(three), most[2]));
      const auto ray = [&](const float* rays) HWY_ATTR {
        const Floats nearer = hn::IfThenElse(is_two, hn::LoadU(d, rays + 2 * step), hn::LoadU(d, rays + step));
        return hn::IfThenElse(is_three, hn::LoadU(d, rays + 3 * step), nearer);
      };
      return Neighbour{hn::IfThenElse(is_three, three, hn::IfThenElse(is_two, two, one)), ray(ray_x), ray(ray_y)};
    };
    const auto along = [&](std::ptrdiff_t step) HWY_ATTR {
      const Neighbour a = side(-step), b = side(step);
      return std::array{hn::Sub(hn::Mul(b.ray_x, b.z), hn::Mul(a.ray_x, a.z)),
                        hn::Sub(hn::Mul(b.ray_y, b.z), hn::Mul(a.ray_y, a.z)), hn::Sub(b.z, a.z)};
    };
    const auto a = along(1), b = along(pixels.width);
    if (hn::AllFalse(d, is_taken)) {
      hn::StoreU(zero, d, weight + at);
      continue;
    }
    const Floats nx = hn::Sub(hn::Mul(a[1], b[2]), hn::Mul(a[2], b[1])),
                 ny = hn::Sub(hn::Mul(a[2], b[0]), hn::Mul(a[0], b[2])),
                 nz = hn::Sub(hn::Mul(a[0], b[1]), hn::Mul(a[1], b[0]));
    const Floats rx = hn::LoadU(d, ray_x), ry = hn::LoadU(d, ray_y);
    const auto sum = [](Floats x, Floats y, Floats last) HWY_ATTR { return hn::Add(hn::Add(x, y), last); };
    const Floats length = hn::Sqrt(
        hn::Mul(sum(hn::Mul(nx, nx), hn::Mul(ny, ny), hn::Mul(nz, nz)), sum(hn::Mul(rx, rx), hn::Mul(ry, ry), all(1))));
    // Without a length it is no number, and nothing is not less.
    const Floats cosine = hn::Div(hn::Abs(sum(hn::Mul(nx, rx), hn::Mul(ny, ry), nz)), length);
    is_taken = hn::And(is_taken, hn::Ge(cosine, all(kLeastCosine)));
    const Floats share = hn::Mul(hn::Mul(all(kWeightOne), hn::LoadU(d, noise.trust.data())), cosine);
    const Floats whole = hn::ConvertTo(d, hn::ConvertTo(di, hn::Add(share, all(0.5F))));
    hn::StoreU(hn::IfThenElseZero(is_taken, hn::Max(all(1), whole)), d, weight + at);
  }
}

}  // namespace spectra::mapping::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace spectra::mapping {
namespace {
HWY_EXPORT(weigh);
}  // namespace

void weigh_pixels(const DepthPixels& pixels, std::size_t first, std::size_t count, float* weight) {
  HWY_DYNAMIC_DISPATCH(weigh)(pixels, first, count, weight);
}

}  // namespace spectra::mapping

#endif  // HWY_ONCE
