#include "server/mapping/block_kernels.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "server/mapping/depth_fusion.hpp"
#include "server/mapping/surface_kernel.hpp"
#include "tests/property/instruction_sets.hpp"

namespace spectra::mapping {
namespace {

constexpr double kVoxel = 0.01;
constexpr float kUnit = 0.0001F;

float mean_after(float mean, float value, float share) {
  const float step = (value - mean) * share;
  const float rounded = std::trunc(step + std::copysign(0.5F, step));
  return mean + (rounded == 0 ? std::trunc(std::clamp(value - mean, -1.0F, 1.0F)) : rounded);
}

void distort(const Lens& lens, float& x, float& y) {
  const float xx = x * x, yy = y * y, xy2 = 2 * (x * y), rr = xx + yy;
  const float radial = 1 + rr * (lens.k1 + rr * lens.k2);
  const float bent_x = lens.p1 * xy2 + lens.p2 * (rr + (xx + xx));
  const float bent_y = lens.p1 * (rr + (yy + yy)) + lens.p2 * xy2;
  x = x * radial + bent_x;
  y = y * radial + bent_y;
}

/// A wall that is nearer on one side, with holes, seen by a camera whose lens bends; a block that has seen something else.
class BlockKernels : public testing::TestWithParam<bool> {
 protected:
  BlockKernels() {
    if (GetParam()) camera_.distortion = {0.05, -0.02, 0.003, -0.002};
    const auto count = static_cast<std::size_t>(camera_.width * camera_.height);
    std::mt19937 random(7);
    depth_.assign(count + 1, 0);
    weight_.assign(count + 1, 0);
    packed_.assign(count + 1, 0);
    pixels_.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      pixels_[i] = random() & 0xffffff;
      if (random() % 9 == 0) continue;
      const auto steps =
          static_cast<std::uint32_t>(9700 + 10 * (i % static_cast<std::size_t>(camera_.width)) + random() % 100);
      const auto weight = static_cast<std::uint32_t>(1 + random() % 1024);
      depth_[i] = static_cast<float>(steps) * kUnit;
      weight_[i] = static_cast<float>(weight);
      packed_[i] = steps << 16 | weight;
    }
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      before_->distance[i] = static_cast<std::int16_t>(static_cast<int>(random() % 65535) - 32767);
      before_->weight[i] = static_cast<std::uint16_t>(random() % 65536);
      for (auto* channel : {&before_->red, &before_->green, &before_->blue})
        (*channel)[i] = static_cast<std::uint16_t>(random() % 65281);
      before_->colour_weight[i] = static_cast<std::uint8_t>(random() % 256);
    }
    pose_.linear() = Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  }

  std::unique_ptr<VoxelBlock> copy() const { return std::make_unique<VoxelBlock>(*before_); }
  static bool are_same(const VoxelBlock& a, const VoxelBlock& b) {
    return a.distance == b.distance && a.weight == b.weight && a.red == b.red && a.green == b.green &&
           a.blue == b.blue && a.colour_weight == b.colour_weight;
  }

  CameraModel camera_{64, 48, 70, 72, 31, 24, {}};
  Eigen::Isometry3d pose_ = Eigen::Isometry3d::Identity();
  std::vector<float> depth_, weight_;
  std::vector<std::uint32_t> packed_, pixels_;
  const std::array<float, 3> corner_{-0.03F, -0.02F, 0.95F};
  const std::unique_ptr<VoxelBlock> before_ = std::make_unique<VoxelBlock>();
};

TEST_P(BlockKernels, EveryInstructionSetGivesWhatTheFormulaSays) {
  const DistanceKernel kernel{
      KernelCamera(camera_, pose_, kVoxel), packed_.data(), kUnit, 0.04F, 0.01F, 0.03F, 0.003F, 0.005F, 0.4F};
  const ColourKernel colours{kernel.camera, false, pixels_.data(), packed_.data()};
  const auto wanted = copy();
  NearPixels wanted_near{};
  float recoloured = 0, moved = 0, nearest = kDistanceOne;
  const std::int32_t outside = camera_.width * camera_.height;
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    const KernelCamera& c = kernel.camera;
    const float z = corner_[2] + c.z[i], inverse = 1 / std::max(z, 0.05F);
    float x = (corner_[0] + c.x[i]) * inverse, y = (corner_[1] + c.y[i]) * inverse;
    if (c.is_distorted) distort(c.lens, x, y);
    const float u = c.lens.fx * x + (c.lens.cx + 0.5F), v = c.lens.fy * y + (c.lens.cy + 0.5F);
    const bool is_inside = u >= 0 && v >= 0 && u < static_cast<float>(c.width) && v < static_cast<float>(c.height);
    const std::int32_t pixel =
        is_inside ? static_cast<std::int32_t>(v) * c.width + static_cast<std::int32_t>(u) : outside;
    const float seen = depth_[static_cast<std::size_t>(pixel)], metres = seen - z;
    const float beyond = std::max(0.0F, seen - kernel.from_m);
    const float behind = std::max(kernel.behind_m, kernel.base_m + kernel.growth_per_m * (beyond * beyond));
    const float trust = weight_[static_cast<std::size_t>(pixel)], w = metres > -behind ? trust : 0;
    wanted_near[i] = -1;
    if (w == 0) continue;
    const float old = wanted->distance[i], sum = wanted->weight[i] + w;
    const float target = std::clamp(metres * (kDistanceOne / kernel.truncation_m), -kDistanceOne, kDistanceOne);
    wanted->distance[i] = static_cast<std::int16_t>(mean_after(old, target, w / std::max(1.0F, sum)));
    wanted->weight[i] = static_cast<std::uint16_t>(std::min(kWeightMost, sum));
    const float now = wanted->distance[i];
    if (std::min(std::abs(old), std::abs(now)) < 0.5F * kDistanceOne) moved = std::max(moved, std::abs(now - old));
    if (std::abs(metres) >= 2 * kernel.voxel_m) continue;
    wanted_near[i] = pixel;
    const float own = std::max(1.0F, std::trunc(16 * std::sqrt(trust * (1 / kWeightOne)) + 0.5F));
    const float all = wanted->colour_weight[i] + own;
    int shift = 0;
    for (auto* channel : {&wanted->red, &wanted->green, &wanted->blue}) {
      const float level = static_cast<float>(pixels_[static_cast<std::size_t>(pixel)] >> shift & 0xff);
      const float before = (*channel)[i], next = mean_after(before, 256 * level, own / all);
      (*channel)[i] = static_cast<std::uint16_t>(next);
      recoloured = std::max(recoloured, std::abs(next - before) / 256);
      shift += 8;
    }
    wanted->colour_weight[i] = static_cast<std::uint8_t>(std::min(255.0F, all));
  }
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    for (const std::int16_t distance : {before_->distance[i], wanted->distance[i]})
      nearest = std::min(nearest, std::abs(static_cast<float>(distance)));
  }
  ASSERT_GT(moved, 0);
  ASSERT_GT(std::count_if(wanted_near.begin(), wanted_near.end(), [](std::int32_t p) { return p >= 0; }), 50);
  for (const std::int64_t target : fusion::test::instruction_sets()) {
    const fusion::test::UsingInstructionSet using_it(target);
    const std::string name = fusion::test::name_of(target);
    const auto block = copy();
    NearPixels near;
    const BlockChange change = fuse_distances(kernel, corner_, *block, near);
    EXPECT_EQ(near, wanted_near) << name;
    const auto has = [&](auto is) { return std::any_of(block->distance.begin(), block->distance.end(), is); };
    EXPECT_EQ(change.moved, moved) << name;
    EXPECT_EQ(change.has_surface, nearest < 0.5F * kDistanceOne) << name;
    EXPECT_EQ(change.is_free, !has([](std::int16_t distance) { return distance < 0.5F * kDistanceOne; })) << name;
    EXPECT_EQ(change.has_inside, has([](std::int16_t distance) { return distance < 0; })) << name;
    EXPECT_EQ(change.has_outside, has([](std::int16_t distance) { return distance >= 0; })) << name;
    EXPECT_EQ(fuse_colours(colours, corner_, *block, near), recoloured) << name;
    EXPECT_TRUE(are_same(*block, *wanted)) << name;
  }
}

TEST_P(BlockKernels, EveryInstructionSetSaysTheSameOfBlocksOfEveryKind) {
  const DistanceKernel kernel{
      KernelCamera(camera_, pose_, kVoxel), packed_.data(), kUnit, 0.04F, 0.01F, 0.03F, 0.003F, 0.005F, 0.4F};
  constexpr std::int16_t kHalf = 16384;  // The first whole number that is not within half of the truncation.
  for (const std::int16_t lone : {std::int16_t{32767}, kHalf, std::int16_t{kHalf - 1}, std::int16_t{0},
                                  std::int16_t{-1}, std::int16_t{-kHalf}, std::int16_t{-32767}}) {
    for (const std::int16_t rest : {std::int16_t{32767}, std::int16_t{-32767}}) {
      before_->distance.fill(rest);
      before_->distance[300] = lone;
      // Far behind the camera: nothing of it is seen.
      for (const std::int64_t target : fusion::test::instruction_sets()) {
        const fusion::test::UsingInstructionSet using_it(target);
        const std::string name =
            fusion::test::name_of(target) + " " + std::to_string(lone) + " in " + std::to_string(rest);
        const auto block = copy();
        NearPixels near;
        const BlockChange change = fuse_distances(kernel, {0, 0, -3}, *block, near);
        EXPECT_TRUE(are_same(*block, *before_)) << name;
        EXPECT_EQ(change.moved, 0) << name;
        EXPECT_EQ(change.has_surface, std::abs(lone) < kHalf) << name;
        EXPECT_EQ(change.is_free, rest > 0 && lone >= kHalf) << name;
        EXPECT_EQ(change.has_inside, rest < 0 || lone < 0) << name;
        EXPECT_EQ(change.has_outside, rest >= 0 || lone >= 0) << name;
      }
    }
  }
}

/// What see_voxels() is to find, voxel by voxel.
void see_one_by_one(const KernelCamera& camera, const VoxelBlock& block, const std::array<float, 3>& corner,
                    float voxel_m, float beside, float off_per_step, SeenVoxels& out, std::vector<float>& depth_m) {
  for (int i = 0; i < static_cast<int>(kBlockVoxels); ++i) {
    const auto index = static_cast<std::size_t>(i);
    const float own = block.distance[index];
    if (std::abs(own) > beside || block.weight[index] == 0) continue;
    const auto slope = [&](int place, int stride) {
      const auto at = [&](int k) { return static_cast<std::size_t>(i + k * stride); };
      const bool has_low = place > 0 && block.weight[at(-1)] > 0, has_high = place < 7 && block.weight[at(1)] > 0;
      const float low = has_low ? static_cast<float>(block.distance[at(-1)]) : own;
      const float high = has_high ? static_cast<float>(block.distance[at(1)]) : own;
      return has_low && has_high ? 0.5F * (high - low) : high - low;
    };
    const std::array gradient{slope(i & 7, 1), slope(i >> 3 & 7, 8), slope(i >> 6, 64)};
    const float squared = gradient[0] * gradient[0] + (gradient[1] * gradient[1] + gradient[2] * gradient[2]);
    if (!(squared > 0)) continue;
    const float most = 2 / std::sqrt(squared), back = std::clamp(-(own / squared), -most, most);
    std::array<float, 3> n{}, p{};
    const std::array<float, 3> within{camera.x[index], camera.y[index], camera.z[index]};
    for (std::size_t k = 0; k < 3; ++k) {
      n[k] = gradient[0] * camera.view.step(0)[k] +
             (gradient[1] * camera.view.step(1)[k] + gradient[2] * camera.view.step(2)[k]);
      p[k] = corner[k] + within[k] + back * n[k];
    }
    const auto dot = [](const auto& a, const auto& b) { return a[0] * b[0] + (a[1] * b[1] + a[2] * b[2]); };
    const float along = -dot(n, p);
    if (p[2] < 0.1F || !(along > 0)) continue;
    const float inverse = 1 / p[2];
    float x = p[0] * inverse, y = p[1] * inverse;
    if (camera.is_distorted) distort(camera.lens, x, y);
    const float u = camera.lens.fx * x + camera.lens.cx, v = camera.lens.fy * y + camera.lens.cy;
    const float half = 0.75F * voxel_m * camera.lens.fx * inverse;
    if (!(u + half > 0 && u - half < static_cast<float>(camera.width) && v + half > 0 &&
          v - half < static_cast<float>(camera.height)))
      continue;
    const float bend = p[2] * p[2] / along;
    ++out.count;
    out.voxel.push_back(static_cast<std::uint16_t>(i));
    out.u.push_back(u);
    out.v.push_back(v);
    out.z_m.push_back(p[2]);
    out.cosine.push_back(std::min(1.0F, along / std::sqrt(dot(n, n) * dot(p, p))));
    if (std::abs(own) * off_per_step > voxel_m) continue;
    const float per_u = n[0] * bend * (1 / camera.lens.fx), per_v = n[1] * bend * (1 / camera.lens.fy);
    for (int row = 0; row < camera.height; ++row) {
      for (int column = 0; column < camera.width; ++column) {
        const auto x_at = static_cast<float>(column), y_at = static_cast<float>(row);
        if (x_at < u - half || x_at > u + half || y_at < v - half || y_at > v + half) continue;
        const float grows = std::clamp((y_at - v) * per_v + (x_at - u) * per_u, -2 * voxel_m, 2 * voxel_m);
        float& pixel = depth_m[static_cast<std::size_t>(row * camera.width + column)];
        pixel = std::min(pixel, p[2] + grows);
      }
    }
  }
}

TEST_P(BlockKernels, EveryInstructionSetSeesTheVoxelsThatTheFormulaSays) {
  // A wall askew through the block, of which a part was never seen.
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    const auto x = static_cast<float>(i % 8), y = static_cast<float>(i / 8 % 8), z = static_cast<float>(i / 64);
    const float steps = 8000 * (3.6F - z + 0.3F * x - 0.2F * y);
    before_->distance[i] = static_cast<std::int16_t>(std::clamp(steps, -kDistanceOne, kDistanceOne));
    before_->weight[i] = i % 11 == 0 ? 0 : 50;
  }
  const KernelCamera camera(camera_, Eigen::Isometry3d::Identity(), kVoxel);
  const std::vector<float> nothing(static_cast<std::size_t>(camera_.width * camera_.height),
                                   std::numeric_limits<float>::infinity());
  // After those of another block.
  SeenVoxels first;
  std::vector<float> first_drawn = nothing;
  const std::array<std::array<float, 3>, 2> corners{corner_, {corner_[0] - 0.08F, corner_[1], corner_[2] + 0.02F}};
  std::array<std::size_t, 2> ends{};
  for (std::size_t k = 0; k < corners.size(); ++k) {
    see_one_by_one(camera, *before_, corners[k], 0.01F, 12287, 0.04F / kDistanceOne, first, first_drawn);
    ends[k] = first.count;
  }
  ASSERT_GT(ends[0], 100U);
  ASSERT_GT(ends[1], ends[0] + 50);
  ASSERT_GT(std::count_if(first_drawn.begin(), first_drawn.end(), [](float z) { return std::isfinite(z); }), 50);
  for (const std::int64_t target : fusion::test::instruction_sets()) {
    const fusion::test::UsingInstructionSet using_it(target);
    SeenVoxels seen;
    std::vector<float> drawn = nothing;
    for (std::size_t k = 0; k < corners.size(); ++k) {
      see_voxels(camera, *before_, corners[k], 0.01F, 12287, 0.04F / kDistanceOne, seen, drawn.data());
      ASSERT_EQ(seen.count, ends[k]) << fusion::test::name_of(target);
    }
    ASSERT_EQ(drawn, first_drawn) << fusion::test::name_of(target);
    for (std::size_t i = 0; i < first.count; ++i) {
      ASSERT_EQ(seen.voxel[i], first.voxel[i]);
      const auto values = [i](const SeenVoxels& s) { return std::array{s.u[i], s.v[i], s.z_m[i], s.cosine[i]}; };
      ASSERT_EQ(values(seen), values(first)) << fusion::test::name_of(target) << " " << i;
    }
  }
  // On the plane: z = 0.95 + 0.01 (3.6 + 0.3 x - 0.2 y) with x, y in voxels from the corner.
  for (std::size_t i = 0; i < ends[0] && !GetParam(); ++i) {
    const float x = (first.u[i] - camera.lens.cx) / camera.lens.fx * first.z_m[i];
    const float y = (first.v[i] - camera.lens.cy) / camera.lens.fy * first.z_m[i];
    EXPECT_NEAR(first.z_m[i], corner_[2] + 0.036F + 0.3F * (x - corner_[0]) - 0.2F * (y - corner_[1]), 0.004F);
    EXPECT_GT(first.cosine[i], 0.9F);
  }
}

INSTANTIATE_TEST_SUITE_P(Lenses, BlockKernels, testing::Bool());

}  // namespace
}  // namespace spectra::mapping
