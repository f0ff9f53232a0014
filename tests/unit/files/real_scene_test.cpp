// The real scenes, when SPECTRA_TEST_DATA names the folder they are in.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "allocation_meter.hpp"
#include "fusion/files/ply_reader.hpp"
#include "fusion/files/ply_writer.hpp"
#include "fusion/mesh/topology.hpp"
#include "loaded.hpp"

namespace spectra::files {
namespace {

struct RealScene {
  const char* file;
  std::size_t vertices;
  std::size_t triangles;
  bool has_temperature;
};

class RealScenes : public testing::TestWithParam<RealScene> {
 protected:
  void SetUp() override {
    const char* const folder = std::getenv("SPECTRA_TEST_DATA");
    if (folder == nullptr) GTEST_SKIP() << "SPECTRA_TEST_DATA does not name a folder with the real scenes";
    path_ = std::filesystem::path(folder) / GetParam().file;
    if (!std::filesystem::exists(path_)) GTEST_SKIP() << path_ << " is not there";
  }
  std::filesystem::path path_;
};

TEST_P(RealScenes, AreReadWholeAndCheaply) {
  const test::AllocationMeter meter;
  const auto scene = read_ply(path_);
  ASSERT_TRUE(scene) << scene.error().message;
  const mesh::MultispectralMesh& mesh = scene.value().mesh;
  EXPECT_EQ(mesh.vertex_count(), GetParam().vertices);
  EXPECT_EQ(mesh.triangle_count(), GetParam().triangles);
  EXPECT_EQ(mesh.has_temperature, GetParam().has_temperature);
  EXPECT_TRUE(mesh.has_visible);
  EXPECT_LT(meter.peak_bytes(), 1'500'000 + 49 * mesh.vertex_count());
  EXPECT_EQ(test::note_count(scene.value(), "trailing_bytes"), 0U);
}

TEST_P(RealScenes, ComeBackByteByByte) {
  const auto scene = read_ply(path_);
  ASSERT_TRUE(scene);
  const test::TemporaryFolder folder;
  ASSERT_TRUE(write_ply(folder.path() / "out.ply", scene.value().mesh, scene.value().mesh.visible()));
  const auto body = [](const std::string& bytes) { return bytes.substr(bytes.find("end_header\n")); };
  EXPECT_TRUE(body(test::file_bytes(folder.path() / "out.ply")) == body(test::file_bytes(path_)));
}

TEST_P(RealScenes, HaveATopology) {
  const auto scene = read_ply(path_);
  ASSERT_TRUE(scene);
  const mesh::TopologyFacts facts = mesh::topology_facts(scene.value().mesh);
  EXPECT_GT(facts.boundary_edge_count, 0U);
  EXPECT_GT(facts.component_count, 0U);
  EXPECT_EQ(facts.unreferenced_vertex_count, test::note_count(scene.value(), "unreferenced_vertices"));
}

INSTANTIATE_TEST_SUITE_P(, RealScenes,
                         testing::Values(RealScene{"arco_castle_1m.ply", 990'044, 1'968'483, true},
                                         RealScene{"arco_castle_250k.ply", 256'268, 506'816, true},
                                         RealScene{"mm5_256.ply", 285'014, 559'035, true},
                                         RealScene{"mm5_098.ply", 240'997, 470'805, true},
                                         RealScene{"landsat7_pa_july.ply", 90'000, 178'802, true},
                                         RealScene{"autzen_visible_only.ply", 159'060, 316'465, false}),
                         [](const auto& scene) {
                           const std::string file = scene.param.file;
                           return file.substr(0, file.find('.'));
                         });

}  // namespace
}  // namespace spectra::files
