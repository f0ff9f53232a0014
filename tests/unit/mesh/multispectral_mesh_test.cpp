#include "fusion/mesh/multispectral_mesh.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "tests/unit/files/allocation_meter.hpp"

namespace spectra::mesh {
namespace {

TEST(MultispectralMesh, StartsEmpty) {
  const MultispectralMesh mesh;
  EXPECT_EQ(mesh.vertex_count(), 0U);
  EXPECT_EQ(mesh.triangle_count(), 0U);
  EXPECT_TRUE(mesh.is_point_cloud());
  EXPECT_TRUE(mesh.positions().empty());
}

TEST(MultispectralMesh, NewVerticesAreGreyAtTheOriginWithoutTemperature) {
  MultispectralMesh mesh;
  mesh.resize_vertices(2);
  mesh.positions()[1] = {1, 2, 3};
  mesh.visible()[1] = {4, 5, 6};
  mesh.temperature_celsius()[1] = 7;
  mesh.resize_vertices(3);
  EXPECT_EQ(mesh.vertex_count(), 3U);
  EXPECT_EQ(mesh.positions()[1], (base::Vec3f{1, 2, 3}));
  EXPECT_EQ(mesh.visible()[1], (base::Rgb8{4, 5, 6}));
  EXPECT_EQ(mesh.temperature_celsius()[1], 7);
  for (const std::size_t fresh : {std::size_t{0}, std::size_t{2}}) {
    EXPECT_EQ(mesh.positions()[fresh], base::Vec3f{});
    EXPECT_EQ(mesh.visible()[fresh], (base::Rgb8{128, 128, 128}));
    EXPECT_TRUE(std::isnan(mesh.temperature_celsius()[fresh]));
  }
  mesh.resize_vertices(1);
  EXPECT_EQ(mesh.positions().size(), 1U);
  EXPECT_EQ(mesh.visible().size(), 1U);
  EXPECT_EQ(mesh.temperature_celsius().size(), 1U);
}

TEST(MultispectralMesh, KeepsItsDataWhenMoved) {
  MultispectralMesh mesh;
  mesh.resize_vertices(1);
  mesh.positions()[0] = {1, 2, 3};
  MultispectralMesh other = std::move(mesh);
  EXPECT_EQ(other.positions()[0], (base::Vec3f{1, 2, 3}));
  mesh = MultispectralMesh();
  mesh.resize_vertices(4);
  EXPECT_EQ(mesh.vertex_count(), 4U);
}

TEST(MultispectralMesh, CostsNoMoreThanItsDataPerVertex) {
  const test::AllocationMeter meter;
  MultispectralMesh mesh;
  mesh.resize_vertices(100'000);
  // 19 bytes of data, and OpenMesh's own 5.
  EXPECT_LE(meter.peak_bytes(), 100'000U * 24 + 10'000);
}

}  // namespace
}  // namespace spectra::mesh
