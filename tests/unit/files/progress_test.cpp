#include "fusion/base/progress.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include "fusion/demo/demo_scene.hpp"
#include "fusion/files/ply_fuse.hpp"
#include "fusion/files/ply_reader.hpp"
#include "fusion/files/ply_writer.hpp"
#include "fusion/mesh/topology.hpp"
#include "loaded.hpp"

namespace spectra::files {
namespace {

/// What was told, phase by phase.
struct Told {
  std::string phase;
  std::vector<double> shares;
};

/// Keeps all that is told to it.
class Listener {
 public:
  base::Progress progress() {
    return [this](std::string_view phase, double share) {
      if (told_.empty() || told_.back().phase != phase) told_.push_back({std::string(phase), {}});
      told_.back().shares.push_back(share);
    };
  }
  /// The phases in their order; each must go from its beginning ahead, and not beyond its end.
  std::vector<std::string> phases() const {
    std::vector<std::string> names;
    for (const auto& [phase, shares] : told_) {
      names.push_back(phase);
      EXPECT_LT(shares.front(), 0.5) << phase;
      EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end())) << phase;
      EXPECT_LE(shares.back(), 1) << phase;
    }
    return names;
  }
  const std::vector<Told>& told() const { return told_; }

 private:
  std::vector<Told> told_;
};

/// A square of `side` x `side` vertices, with temperatures.
mesh::MultispectralMesh sheet(std::uint32_t side) {
  mesh::MultispectralMesh mesh;
  mesh.has_temperature = true;
  mesh.resize_vertices(std::size_t{side} * side);
  for (std::uint32_t y = 0; y < side; ++y) {
    for (std::uint32_t x = 0; x < side; ++x) {
      const std::uint32_t v = y * side + x;
      mesh.positions()[v] = {static_cast<float>(x), static_cast<float>(y), 0};
      mesh.temperature_celsius()[v] = static_cast<float>(v);
      if (x > 0 && y > 0) {
        mesh.triangles().push_back({v - side - 1, v - side, v});
        mesh.triangles().push_back({v - side - 1, v, v - 1});
      }
    }
  }
  return mesh;
}

class ProgressOfFiles : public testing::Test {
 protected:
  void SetUp() override {
    const mesh::MultispectralMesh mesh = sheet(250);
    ASSERT_TRUE(write_ply(scene_, mesh, mesh.visible(), {}, written_.progress()));
  }
  static fusion::FusionSettings settings(const std::string& method) {
    fusion::FusionChange change;
    change.method = method;
    return fusion::with_change(fusion::default_settings(), change).value();
  }
  const test::TemporaryFolder folder_;
  const std::filesystem::path scene_ = folder_.path() / "scene.ply";
  Listener written_;
  Listener listener_;
  ReadOptions options_ = [this] {
    ReadOptions options;
    options.progress = listener_.progress();
    return options;
  }();
};

TEST_F(ProgressOfFiles, IsToldByTheBlocksThatAreRead) {
  ASSERT_TRUE(read_ply(scene_, options_));
  EXPECT_EQ(listener_.phases(), (std::vector<std::string>{"reading"}));
  EXPECT_GE(listener_.told()[0].shares.size(), std::filesystem::file_size(scene_) / (512 * 1024));
  EXPECT_GT(listener_.told()[0].shares.back(), 0.7);
}

TEST_F(ProgressOfFiles, HasAPhaseForEachPassOfFusing) {
  const auto out = folder_.path() / "out.ply";
  ASSERT_TRUE(fuse_ply(scene_, out, settings("thermal_only"), options_));
  ASSERT_TRUE(fuse_ply(scene_, out, settings("histogram_bin"), options_));
  EXPECT_EQ(listener_.phases(),
            (std::vector<std::string>{"reading", "fusing", "reading", "counting temperatures", "fusing"}));
}

TEST_F(ProgressOfFiles, HasAPhaseForASecondFile) {
  ASSERT_TRUE(read_ply_with_thermal(scene_, scene_, options_));
  EXPECT_EQ(listener_.phases(), (std::vector<std::string>{"reading temperatures", "reading", "joining temperatures"}));
}

TEST_F(ProgressOfFiles, IsToldByTheBytesThatAreWritten) {
  EXPECT_EQ(written_.phases(), (std::vector<std::string>{"writing"}));
  EXPECT_GT(written_.told()[0].shares.size(), 5U);
  EXPECT_GT(written_.told()[0].shares.back(), 0.99);
}

TEST(Progress, OfModellingAndOfTopologyGoesAhead) {
  Listener listener;
  const auto mesh = demo::demo_scene({40'000, 1}, listener.progress());
  mesh::topology_facts(mesh, listener.progress());
  EXPECT_EQ(listener.phases(), (std::vector<std::string>{"modelling", "examining the topology"}));
}

}  // namespace
}  // namespace spectra::files
