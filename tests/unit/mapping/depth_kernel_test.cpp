#include "server/mapping/depth_kernel.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "server/mapping/depth_frame.hpp"
#include "server/mapping/voxel_map.hpp"
#include "tests/property/instruction_sets.hpp"

namespace spectra::mapping {
namespace {

/// A floor that runs away from the camera, a box on it, noise, and holes.
class DepthKernel : public testing::Test {
 protected:
  DepthKernel() {
    std::mt19937 random(5);
    for (int y = 0; y < camera_.height; ++y) {
      for (int x = 0; x < camera_.width; ++x) {
        const float noise = 1e-4F * static_cast<float>(random() % 100);
        const bool is_box = x > 60 && x < 90 && y > 20 && y < 40;
        const float z =
            is_box ? 1.2F : 0.5F + 0.02F * static_cast<float>(y) + (y > 44 ? 0.6F * static_cast<float>(y - 44) : 0);
        depth_.push_back(random() % 37 == 0 ? 0 : z + noise);
      }
    }
  }

  float at(int x, int y) const { return depth_[static_cast<std::size_t>(y * camera_.width + x)]; }

  /// What a pixel is to weigh.
  float weight_of(int x, int y) const {
    const float z = at(x, y);
    const double sigma = noise_.sigma_m(static_cast<double>(z));
    if (z <= 0 || sigma > kTruncation) return 0;
    const auto most = [&](int apart) {
      return 6 * static_cast<float>(sigma) + static_cast<float>(apart) * z / 70 * kSteepest;
    };
    for (const auto& [dx, dy] : {std::array{1, 0}, std::array{-1, 0}, std::array{0, 1}, std::array{0, -1}}) {
      const float one = at(x + dx, y + dy), two = at(x + 2 * dx, y + 2 * dy);
      if (one == 0 || std::abs(one - z) > most(1) || (two > 0 && std::abs(two - z) > most(2))) return 0;
    }
    const auto end = [&](int dx, int dy) {
      for (int reach = kNormalReach;; --reach) {
        const int u = x + reach * dx, v = y + reach * dy;
        const float other = at(u, v);
        if (reach > 1 && !(other > 0 && std::abs(other - z) <= most(reach))) continue;
        const auto pixel = static_cast<std::size_t>(v * camera_.width + u);
        return std::array{rays_.x[pixel] * other, rays_.y[pixel] * other, other};
      }
    };
    const auto step = [&](int dx, int dy) {
      const auto from = end(-dx, -dy), to = end(dx, dy);
      return std::array{to[0] - from[0], to[1] - from[1], to[2] - from[2]};
    };
    const auto a = step(1, 0), b = step(0, 1);
    const float nx = a[1] * b[2] - a[2] * b[1], ny = a[2] * b[0] - a[0] * b[2], nz = a[0] * b[1] - a[1] * b[0];
    const auto pixel = static_cast<std::size_t>(y * camera_.width + x);
    const float rx = rays_.x[pixel], ry = rays_.y[pixel];
    const float length = std::sqrt((nx * nx + ny * ny + nz * nz) * (rx * rx + ry * ry + 1));
    const float cosine = length > 0 ? std::abs(nx * rx + ny * ry + nz) / length : 0;
    if (cosine < kLeastCosine) return 0;
    const double trust = std::min(1.0, 4 * noise_.base_m * noise_.base_m / (sigma * sigma));
    return static_cast<float>(std::max(1, static_cast<int>(kWeightOne * static_cast<float>(trust) * cosine + 0.5F)));
  }

  static constexpr double kTruncation = 0.02;
  const CameraModel camera_{120, 64, 70, 72, 59, 30, {}};
  const RayTable rays_{camera_};
  const DepthNoise noise_;
  std::vector<float> depth_;
};

TEST_F(DepthKernel, EveryInstructionSetWeighsAsTheFormulaSays) {
  const DepthPixels pixels{depth_.data(), rays_.x.data(), rays_.y.data(), camera_.width, 70, noise_, kTruncation};
  std::size_t taken = 0, left_out = 0;
  for (const std::int64_t target : fusion::test::instruction_sets()) {
    const fusion::test::UsingInstructionSet using_it(target);
    for (int y = kNormalReach; y + kNormalReach < camera_.height; ++y) {
      // Of every length that registers do not divide.
      const int begin = kNormalReach + y % 5, room = camera_.width - kNormalReach - begin;
      const int count = std::min(room, static_cast<int>(kLeastWeighed) + 7 * (y % 15));
      std::vector<float> weights(static_cast<std::size_t>(count) + 1, -7);
      weigh_pixels(pixels, static_cast<std::size_t>(y * camera_.width + begin), static_cast<std::size_t>(count),
                   weights.data());
      for (int i = 0; i < count; ++i) {
        const float wanted = weight_of(begin + i, y);
        ++(wanted > 0 ? taken : left_out);
        ASSERT_EQ(weights[static_cast<std::size_t>(i)], wanted)
            << fusion::test::name_of(target) << " " << begin + i << " " << y << " of " << count;
      }
      ASSERT_EQ(weights.back(), -7) << "nothing beyond";
    }
  }
  EXPECT_GT(taken, 1000U);
  EXPECT_GT(left_out, 1000U);
}

}  // namespace
}  // namespace spectra::mapping
