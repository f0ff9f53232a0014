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

/// What a kernel makes of a block; a whole register is written at the end.
constexpr std::size_t kRoom = kBlockVoxels + 16;
using SomeFloats = std::array<float, kRoom>;
using SomeInts = std::array<std::int32_t, kRoom>;

/// Voxels that lie near a surface: distances, and how they grow from a voxel to the next.
struct NearVoxels {
  std::size_t count = 0;
  alignas(64) SomeInts voxel;
  SomeFloats own, x, y, z;
};

/// Squares to draw: pixels that they cover, and the planes within them.
struct Squares {
  std::size_t count = 0;
  alignas(64) SomeInts left, right, top, bottom;
  SomeFloats u, v, z_m;
  SomeFloats per_u, per_v;  ///< How the depth grows with a pixel, metres.
};

/// Those of the lanes that are taken, after what is there: whole registers are written, as storing some lanes alone takes several times as long.
template <class V, class M, class T>
HWY_INLINE void append(V values, M is_taken, T* to) {
  const hn::DFromV<V> d;
  hn::StoreU(hn::Compress(values, hn::RebindMask(d, is_taken)), d, to);
}

void find_near(const VoxelBlock& block, float beside, NearVoxels& near) {
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
  const Ints within = hn::Set(di, kBlockEdge - 1);
  for (std::size_t i = 0; i < kBlockVoxels; i += lanes) {
    const std::size_t at = kMargin + i;
    const Floats own = hn::LoadU(d, &padded[at]);
    const auto is_taken = hn::Le(hn::Abs(own), all(beside));
    if (hn::AllFalse(d, is_taken)) continue;
    const Ints voxel = hn::Iota(di, static_cast<std::int32_t>(i));
    append(voxel, is_taken, &near.voxel[near.count]);
    append(own, is_taken, &near.own[near.count]);
    append(slope(padded, at, own, hn::And(voxel, within), 1), is_taken, &near.x[near.count]);
    append(slope(padded, at, own, hn::And(hn::ShiftRight<3>(voxel), within), kBlockEdge), is_taken,
           &near.y[near.count]);
    append(slope(padded, at, own, hn::ShiftRight<6>(voxel), std::size_t{kBlockEdge} * kBlockEdge), is_taken,
           &near.z[near.count]);
    near.count += hn::CountTrue(d, is_taken);
  }
}

/// Nearest depths of pixels, noted until there are enough of them: neighbouring squares draw the same ones.
class DepthNotes {
 public:
  explicit DepthNotes(float* depth_m) : depth_m_(depth_m) {}
  ~DepthNotes() { take(); }
  DepthNotes(const DepthNotes&) = delete;
  DepthNotes& operator=(const DepthNotes&) = delete;

  HWY_INLINE void add(Ints pixel, Floats depth, hn::Mask<FloatTag> is_taken) {
    append(pixel, is_taken, &pixel_[count_]);
    append(depth, is_taken, &noted_m_[count_]);
    count_ += hn::CountTrue(FloatTag(), is_taken);
    if (count_ > kBlockVoxels) take();
  }

 private:
  void take() {
    for (std::size_t i = 0; i < count_; ++i) {
      float& pixel = depth_m_[pixel_[i]];
      pixel = noted_m_[i] < pixel ? noted_m_[i] : pixel;
    }
    count_ = 0;
  }

  float* depth_m_;
  std::size_t count_ = 0;
  alignas(64) std::array<std::int32_t, kBlockVoxels + 32> pixel_;
  std::array<float, kBlockVoxels + 32> noted_m_;
};

void draw(const Squares& squares, std::int32_t width, float reach, float* depth_m) {
  const FloatTag d;
  const IntTag di;
  DepthNotes notes(depth_m);
  for (std::size_t i = 0; i < squares.count; i += hn::Lanes(d)) {
    const auto is_square = hn::FirstN(di, squares.count - i);
    const auto load = [&](const SomeInts& from)
                          HWY_ATTR { return hn::IfThenElseZero(is_square, hn::LoadU(di, &from[i])); };
    const auto load_floats = [&](const SomeFloats& from) HWY_ATTR { return hn::LoadU(d, &from[i]); };
    const Ints left = load(squares.left), right = load(squares.right), top = load(squares.top),
               bottom = load(squares.bottom);
    const Floats u = load_floats(squares.u), v = load_floats(squares.v), z = load_floats(squares.z_m),
                 per_u = load_floats(squares.per_u), per_v = load_floats(squares.per_v);
    const auto most = [di](Ints values) HWY_ATTR { return hn::GetLane(hn::MaxOfLanes(di, values)); };
    const std::int32_t across = most(hn::Sub(right, left)), down = most(hn::Sub(bottom, top));
    for (std::int32_t y = 0; y <= down; ++y) {
      const Ints row = hn::Add(top, hn::Set(di, y)), first = hn::Mul(row, hn::Set(di, width));
      const auto is_row = hn::AndNot(hn::Gt(row, bottom), is_square);
      const Floats of_row = hn::Mul(hn::Sub(hn::ConvertTo(d, row), v), per_v);
      for (std::int32_t x = 0; x <= across; ++x) {
        const Ints column = hn::Add(left, hn::Set(di, x));
        const Floats slope = hn::Add(of_row, hn::Mul(hn::Sub(hn::ConvertTo(d, column), u), per_u));
        const Floats depth = hn::Add(z, hn::Max(all(-reach), hn::Min(all(reach), slope)));
        // What is no number is no depth.
        const auto is_taken =
            hn::And(hn::RebindMask(d, hn::AndNot(hn::Gt(column, right), is_row)), hn::Eq(slope, slope));
        notes.add(hn::Add(first, column), depth, is_taken);
      }
    }
  }
}

void see(const KernelCamera& camera, const VoxelBlock& block, const std::array<float, 3>& corner, float voxel_m,
         float beside, float off_per_step, SeenVoxels& out, float* depth_m) {
  const FloatTag d;
  const IntTag di;
  const hn::Rebind<std::uint16_t, FloatTag> narrow;
  NearVoxels near;
  find_near(block, beside, near);
  Squares squares;
  const Lens& lens = camera.lens;
  const Ints within = hn::Set(di, kBlockEdge - 1);
  for (std::size_t i = 0; i < near.count; i += hn::Lanes(d)) {
    const Ints voxel = hn::LoadU(di, &near.voxel[i]);
    const Floats own = hn::LoadU(d, &near.own[i]);
    const Floats gx = hn::LoadU(d, &near.x[i]), gy = hn::LoadU(d, &near.y[i]), gz = hn::LoadU(d, &near.z[i]);
    const Floats squared = hn::Add(hn::Mul(gx, gx), hn::Add(hn::Mul(gy, gy), hn::Mul(gz, gz)));
    auto is_taken = hn::And(hn::FirstN(d, near.count - i), hn::Gt(squared, all(0)));
    // From the voxel along the normal to the surface; distances along lines of sight are longer than those to the surface, as the
    // gradient is larger.
    const Floats most = hn::Div(all(2), hn::Sqrt(squared));
    const Floats back = hn::Max(hn::Neg(most), hn::Min(most, hn::Neg(hn::Div(own, squared))));
    const auto turned = [&](std::size_t k) HWY_ATTR {
      return hn::Add(hn::Mul(gx, all(camera.view.step(0)[k])),
                     hn::Add(hn::Mul(gy, all(camera.view.step(1)[k])), hn::Mul(gz, all(camera.view.step(2)[k]))));
    };
    const Floats nx = turned(0), ny = turned(1), nz = turned(2);
    const Floats ix = hn::ConvertTo(d, hn::And(voxel, within)),
                 iy = hn::ConvertTo(d, hn::And(hn::ShiftRight<3>(voxel), within)),
                 iz = hn::ConvertTo(d, hn::ShiftRight<6>(voxel));
    const auto placed = [&](std::size_t k, Floats normal) HWY_ATTR {
      const Floats along =
          hn::Add(hn::Add(hn::Mul(ix, all(camera.view.step(0)[k])), hn::Mul(iy, all(camera.view.step(1)[k]))),
                  hn::Mul(iz, all(camera.view.step(2)[k])));
      return hn::Add(hn::Add(all(corner[k]), along), hn::Mul(back, normal));
    };
    const Floats px = placed(0, nx), py = placed(1, ny), pz = placed(2, nz);
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
    const Floats left = hn::Sub(u, half), right = hn::Add(u, half), top = hn::Sub(v, half), bottom = hn::Add(v, half);
    const auto is_across = hn::And(hn::Gt(right, all(0)), hn::Lt(left, all(static_cast<float>(camera.width))));
    const auto is_down = hn::And(hn::Gt(bottom, all(0)), hn::Lt(top, all(static_cast<float>(camera.height))));
    is_taken = hn::And(is_taken, hn::And(is_across, is_down));
    append(u, is_taken, &out.u[out.count]);
    append(v, is_taken, &out.v[out.count]);
    append(pz, is_taken, &out.z_m[out.count]);
    append(hn::Min(all(1), hn::Div(along, lengths)), is_taken, &out.cosine[out.count]);
    const Ints kept = hn::Compress(voxel, hn::RebindMask(di, is_taken));
    hn::StoreU(hn::DemoteTo(narrow, kept), narrow, &out.voxel[out.count]);
    out.count += hn::CountTrue(d, is_taken);

    // Where it is farther the surface is drawn by those next to it.
    const auto is_drawn = hn::And(is_taken, hn::Le(hn::Mul(hn::Abs(own), all(off_per_step)), all(voxel_m)));
    const Ints none = hn::Zero(di);
    const auto whole = [di](Floats value) HWY_ATTR { return hn::ConvertTo(di, value); };
    append(hn::Max(none, whole(hn::Ceil(left))), is_drawn, &squares.left[squares.count]);
    append(hn::Min(hn::Set(di, camera.width - 1), whole(hn::Floor(right))), is_drawn, &squares.right[squares.count]);
    append(hn::Max(none, whole(hn::Ceil(top))), is_drawn, &squares.top[squares.count]);
    append(hn::Min(hn::Set(di, camera.height - 1), whole(hn::Floor(bottom))), is_drawn, &squares.bottom[squares.count]);
    append(u, is_drawn, &squares.u[squares.count]);
    append(v, is_drawn, &squares.v[squares.count]);
    append(pz, is_drawn, &squares.z_m[squares.count]);
    // The plane n p = -along, along the line of sight of a pixel: z = -along / (n ray), to the first order.
    const Floats bend = hn::Div(hn::Mul(pz, pz), along);
    append(hn::Mul(hn::Mul(nx, bend), all(1 / lens.fx)), is_drawn, &squares.per_u[squares.count]);
    append(hn::Mul(hn::Mul(ny, bend), all(1 / lens.fy)), is_drawn, &squares.per_v[squares.count]);
    squares.count += hn::CountTrue(d, is_drawn);
  }
  draw(squares, camera.width, 2 * voxel_m, depth_m);
}

}  // namespace spectra::mapping::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace spectra::mapping {
namespace {
HWY_EXPORT(see);
}  // namespace

void see_voxels(const KernelCamera& camera, const VoxelBlock& block, const std::array<float, 3>& corner, float voxel_m,
                float beside, float off_per_step, SeenVoxels& out, float* depth_m) {
  constexpr std::size_t kMost = kBlockVoxels + 16;  // A whole register is written at the end.
  if (out.voxel.size() < out.count + kMost) {
    const std::size_t size = 2 * (out.count + kMost);
    out.voxel.resize(size);
    for (auto* values : {&out.u, &out.v, &out.z_m, &out.cosine}) values->resize(size);
  }
  HWY_DYNAMIC_DISPATCH(see)(camera, block, corner, voxel_m, beside, off_per_step, out, depth_m);
}

}  // namespace spectra::mapping

#endif  // HWY_ONCE
