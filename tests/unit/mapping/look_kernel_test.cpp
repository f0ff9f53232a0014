#include "server/mapping/look_kernel.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "tests/property/instruction_sets.hpp"

namespace spectra::mapping {
namespace {

/// A noisy picture before which voxels of three blocks lie anywhere, some outside, some behind what was drawn, some beside edges.
class LookKernelTest : public testing::Test {
 protected:
  LookKernelTest() {
    std::mt19937 random(3);
    const auto between = [&](float low, float high) {
      return low + (high - low) * static_cast<float>(random() % 10000) / 10000;
    };
    for (int i = 0; i < camera_.width * camera_.height; ++i) {
      celsius_.push_back(between(15, 35));
      gradient_.push_back(random() % 7 == 0 ? -1 : between(0, 2));
      depth_m_.push_back(random() % 9 == 0 ? std::numeric_limits<float>::infinity() : between(1.9F, 2.1F));
    }
    for (const std::size_t end : {75U, 78U, 400U}) {
      while (seen_.count < end) {
        ++seen_.count;
        seen_.voxel.push_back(static_cast<std::uint16_t>(random() % 512));
        seen_.u.push_back(between(-3, 66));
        seen_.v.push_back(between(-3, 50));
        seen_.z_m.push_back(between(1.9F, 2.1F));
        seen_.cosine.push_back(between(0.01F, 1));
      }
      seen_.blocks.push_back({static_cast<std::int32_t>(end), end});
    }
    // Of the second block nothing is seen.
    for (std::size_t i = 75; i < 78; ++i) seen_.u[i] = -1;
    for (auto* values : {&seen_.u, &seen_.v, &seen_.z_m, &seen_.cosine}) values->resize(seen_.count + 16);
    seen_.voxel.resize(seen_.count + 16);
  }

  LookKernel kernel() const {
    return {Lens(camera_),
            camera_.width,
            camera_.height,
            celsius_.data(),
            gradient_.data(),
            depth_m_.data(),
            0.01F,
            0.2588F,
            true,
            {0.001F, -0.002F, 0.003F},
            {0.004F, 0.01F, -0.005F},
            0.0025F,
            21,
            1,
            9};
  }

  /// What find_looks() is to find, voxel by voxel.
  HeatSeen one_by_one(const LookKernel& kernel) const {
    HeatSeen out;
    std::size_t i = 0;
    for (const SeenVoxels::Block& block : seen_.blocks) {
      const std::size_t before = out.count;
      for (; i < block.end; ++i) add(kernel, i, out);
      if (out.count > before) out.blocks.push_back({block.index, out.count});
    }
    return out;
  }

  void add(const LookKernel& kernel, std::size_t i, HeatSeen& out) const {
    const float u = seen_.u[i], v = seen_.v[i], z = seen_.z_m[i], cosine = seen_.cosine[i];
    const int x = static_cast<int>(std::floor(u)), y = static_cast<int>(std::floor(v));
    if (x < 0 || y < 0 || x + 1 >= kernel.width || y + 1 >= kernel.height || cosine < kernel.least_cosine) return;
    const auto pixel = static_cast<std::size_t>(y * kernel.width + x);
    const float gradient = kernel.gradient[pixel];
    if (gradient < 0) return;
    if (kernel.depth_m != nullptr) {
      const int column = static_cast<int>(std::floor(u + 0.5F)), row = static_cast<int>(std::floor(v + 0.5F));
      const float c = std::max(cosine, 0.1F);
      const float reach = kernel.voxel_m * (1.5F + 1.5F * std::sqrt(1 - c * c) / c);
      if (!(z < kernel.depth_m[row * kernel.width + column] + reach)) return;
    }
    const float a = u - static_cast<float>(x), b = v - static_cast<float>(y);
    const float *row = &kernel.celsius[pixel], *next = row + kernel.width;
    const float celsius = (1 - b) * ((1 - a) * row[0] + a * row[1]) + b * ((1 - a) * next[0] + a * next[1]);
    float own = kernel.noise, scale = 1;
    if (kernel.is_weighed) {
      const Lens& lens = kernel.lens;
      const auto& turn = kernel.angular;
      const float c = std::max(cosine, 0.05F), px = (u - lens.cx) / lens.fx, py = (v - lens.cy) / lens.fy;
      const float moved_x = -(kernel.linear[0] + (turn[1] * z - turn[2] * (py * z)));
      const float moved_y = -(kernel.linear[1] + (turn[2] * (px * z) - turn[0] * z));
      const float moved_z = -(kernel.linear[2] + (turn[0] * (py * z) - turn[1] * (px * z)));
      const float du = lens.fx * (moved_x - px * moved_z) / z, dv = lens.fy * (moved_y - py * moved_z) / z;
      const float uncertain = 0.7F * gradient, askew = (1 - c) * (1 - c);
      const float reflected = 0.95F * askew * askew * (1 - c) * (celsius - kernel.reflected_celsius);
      own = kernel.noise + uncertain * uncertain + reflected * reflected;
      scale = z * z / c * (1 + du * du + dv * dv) * kernel.after_shutter;
      if (own * scale > kernel.most_variance) return;
    }
    ++out.count;
    out.voxel.push_back(seen_.voxel[i]);
    out.celsius.push_back(celsius);
    out.own.push_back(own);
    out.scale.push_back(scale);
  }

  /// That every instruction set finds what the formula says.
  void expect_alike(const LookKernel& kernel, std::size_t least) const {
    const HeatSeen expected = one_by_one(kernel);
    ASSERT_GT(expected.count, least);
    for (const std::int64_t target : fusion::test::instruction_sets()) {
      const fusion::test::UsingInstructionSet using_it(target);
      HeatSeen found;
      found.blocks.push_back({7, 7});  // of before
      found.count = 7;
      find_looks(kernel, seen_, found);
      ASSERT_EQ(found.count, expected.count) << fusion::test::name_of(target);
      ASSERT_EQ(found.blocks.size(), expected.blocks.size());
      for (std::size_t k = 0; k < found.blocks.size(); ++k) {
        EXPECT_EQ(found.blocks[k].index, expected.blocks[k].index);
        EXPECT_EQ(found.blocks[k].end, expected.blocks[k].end);
      }
      for (std::size_t i = 0; i < found.count; ++i) {
        const auto values = [i](const HeatSeen& s) { return std::array{s.celsius[i], s.own[i], s.scale[i]}; };
        ASSERT_EQ(found.voxel[i], expected.voxel[i]);
        ASSERT_EQ(values(found), values(expected)) << fusion::test::name_of(target) << " " << i;
      }
    }
  }

  const CameraModel camera_{64, 48, 70, 72, 31, 24, {}};
  std::vector<float> celsius_, gradient_, depth_m_;
  SeenVoxels seen_;
};

TEST_F(LookKernelTest, EveryInstructionSetFindsTheLooksThatTheFormulaSays) {
  expect_alike(kernel(), 50);
  LookKernel strict = kernel();
  strict.most_variance = 2;
  strict.after_shutter = 10;
  EXPECT_LT(one_by_one(strict).count, one_by_one(kernel()).count / 2);
  expect_alike(strict, 2);
}

TEST_F(LookKernelTest, RulesCanBeLeftOut) {
  LookKernel through = kernel();
  through.depth_m = nullptr;
  EXPECT_GT(one_by_one(through).count, one_by_one(kernel()).count);
  expect_alike(through, 50);
  LookKernel alike = kernel();
  alike.is_weighed = false;
  alike.least_cosine = -1;
  EXPECT_GT(one_by_one(alike).count, one_by_one(kernel()).count);
  expect_alike(alike, 50);
}

}  // namespace
}  // namespace spectra::mapping
