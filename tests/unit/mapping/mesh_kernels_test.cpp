#include "server/mapping/mesh_kernels.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <random>
#include <string>

#include "server/mapping/whole_numbers.hpp"
#include "tests/property/instruction_sets.hpp"

namespace spectra::mapping {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinite = std::numeric_limits<float>::infinity();

/// What a vertex is to be, one by one.
struct Vertex {
  float x_m, y_m, z_m, celsius = kNone, sigma_kelvin = kNone, seen_s = kNone;
  int red = -1, green = -1, blue = -1;
};

Vertex vertex_of(const CrossedEdges& edges, std::size_t i, double voxel_m, float least_sigma_kelvin) {
  const CrossedEdges::Ends &a = edges.first, &b = edges.second;
  const double of_a = static_cast<double>(a.distance[i]), of_b = static_cast<double>(b.distance[i]);
  const double share = of_a / (of_a - of_b);
  const auto metres = [&](std::int32_t voxel, int axis) {
    return static_cast<float>((voxel + (edges.axis[i] == axis ? share : 0)) * voxel_m);
  };
  Vertex vertex{metres(edges.x[i], 0), metres(edges.y[i], 1), metres(edges.z[i], 2)};
  const bool has_a = a.colour_weight[i] > 0, has_b = b.colour_weight[i] > 0;
  if (has_a || has_b) {
    const double second = !has_a ? 1 : !has_b ? 0 : share;
    const auto level = [&](const auto& first, const auto& other) {
      const double mixed = (1 - second) * static_cast<double>(first[i]) + second * static_cast<double>(other[i]);
      return static_cast<int>(std::min(255.0, mixed / 256 + 0.5));
    };
    vertex.red = level(a.red, b.red);
    vertex.green = level(a.green, b.green);
    vertex.blue = level(a.blue, b.blue);
  }
  const auto near = static_cast<float>(share);
  const float part_a = (1 - near + 1e-3F) / a.variance[i], part_b = (near + 1e-3F) / b.variance[i],
              sum = part_a + part_b;
  if (!(sum > 0)) return vertex;
  vertex.celsius = (part_a * a.celsius[i] + part_b * b.celsius[i]) / sum;
  const bool is_a = std::isinf(b.variance[i]), is_b = std::isinf(a.variance[i]);
  const float own = is_b   ? b.own_variance[i]
                    : is_a ? a.own_variance[i]
                           : (part_a * a.own_variance[i] + part_b * b.own_variance[i]) / sum;
  vertex.sigma_kelvin = std::sqrt(own + least_sigma_kelvin * least_sigma_kelvin);
  vertex.seen_s = is_b ? b.seen_s[i] : is_a ? a.seen_s[i] : std::max(a.seen_s[i], b.seen_s[i]);
  return vertex;
}

bool is_same(float a, float b) {
  return std::memcmp(&a, &b, sizeof a) == 0 || (std::isnan(a) && std::isnan(b));
}

TEST(MeshKernels, EveryInstructionSetFindsTheVerticesThatTheFormulaSays) {
  constexpr double kVoxel = 0.01;
  constexpr float kLeastSigma = 0.03F;
  std::mt19937 random(11);
  const auto below = [&](unsigned end) { return static_cast<int>(random() % end); };
  const auto edges = std::make_unique<CrossedEdges>();
  for (const std::size_t count :
       {std::size_t{0}, std::size_t{1}, std::size_t{7}, std::size_t{33}, CrossedEdges::kMost}) {
    edges->count = count;
    for (std::size_t i = 0; i < count; ++i) {
      edges->x[i] = below(2'000'000'000) - 1'000'000'000;
      edges->y[i] = below(200) - 100;
      edges->z[i] = -below(5);
      edges->axis[i] = below(3);
      for (auto* end : {&edges->first, &edges->second}) {
        // Some without a colour, some without a temperature.
        end->colour_weight[i] = below(3) == 0 ? 0 : below(256);
        for (auto* channel : {&end->red, &end->green, &end->blue}) (*channel)[i] = below(65536);
        const bool is_warm = below(3) > 0;
        end->celsius[i] = is_warm ? 0.01F * static_cast<float>(below(5000)) : 0;
        end->variance[i] = is_warm ? 1e-4F * static_cast<float>(1 + below(10000)) : kInfinite;
        end->own_variance[i] = is_warm ? 0.7F * end->variance[i] : 0;
        end->seen_s[i] = is_warm ? 0.1F * static_cast<float>(below(1000)) : 0;
      }
      const bool is_first_inside = below(2) == 0;
      edges->first.distance[i] = is_first_inside ? -1 - below(32767) : below(32768);
      edges->second.distance[i] = is_first_inside ? below(32768) : -1 - below(32767);
    }
    for (const std::int64_t target : fusion::test::instruction_sets()) {
      const fusion::test::UsingInstructionSet using_it(target);
      const auto found = std::make_unique<CrossedEdges>(*edges);
      find_vertices(*found, kVoxel, kLeastSigma);
      for (std::size_t i = 0; i < count; ++i) {
        const Vertex wanted = vertex_of(*edges, i, kVoxel, kLeastSigma);
        const std::string where =
            fusion::test::name_of(target) + " " + std::to_string(i) + " of " + std::to_string(count);
        ASSERT_TRUE(is_same(found->x_m[i], wanted.x_m) && is_same(found->y_m[i], wanted.y_m) &&
                    is_same(found->z_m[i], wanted.z_m))
            << where;
        ASSERT_EQ(found->red[i], wanted.red) << where;
        if (wanted.red >= 0) {
          ASSERT_EQ(found->green[i], wanted.green) << where;
          ASSERT_EQ(found->blue[i], wanted.blue) << where;
        }
        ASSERT_TRUE(is_same(found->celsius[i], wanted.celsius)) << where;
        ASSERT_TRUE(is_same(found->sigma_kelvin[i], wanted.sigma_kelvin)) << where;
        ASSERT_TRUE(is_same(found->seen_s[i], wanted.seen_s)) << where;
      }
    }
  }
}

TEST(MeshKernels, EveryInstructionSetFindsTheBitsOfABlock) {
  std::mt19937 random(3);
  VoxelBlock block{};
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    block.distance[i] = static_cast<std::int16_t>(static_cast<int>(random() % 5) - 2);
    block.weight[i] = static_cast<std::uint16_t>(random() % 3 == 0 ? 65535 - random() % 2 : random() % 8);
  }
  for (const std::uint16_t least : {std::uint16_t{0}, std::uint16_t{4}, std::uint16_t{65535}}) {
    for (const std::int64_t target : fusion::test::instruction_sets()) {
      const fusion::test::UsingInstructionSet using_it(target);
      BlockBits bits;
      find_bits(block, least, bits);
      for (std::size_t i = 0; i < kBlockVoxels; ++i) {
        const bool is_known = block.weight[i] >= least;
        ASSERT_EQ((bits.known[i / 8] >> i % 8 & 1) != 0, is_known) << fusion::test::name_of(target) << " " << i;
        ASSERT_EQ((bits.inside[i / 8] >> i % 8 & 1) != 0, is_known && block.distance[i] < 0) << i;
      }
    }
  }
}

TEST(WholeNumbers, AreThoseOfTheLibrary) {
  for (const float value : {0.0F, -0.0F, 0.5F, -0.5F, 1.0F, -1.0F, -1.0000001F, 2.9999998F, -7.0F, 1e9F, -1e9F}) {
    EXPECT_EQ(floor_of(value), static_cast<std::int32_t>(std::floor(value))) << value;
    EXPECT_EQ(ceil_of(value), static_cast<std::int32_t>(std::ceil(value))) << value;
  }
}

}  // namespace
}  // namespace spectra::mapping
