#include "fused_in_memory.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <sstream>
#include <vector>

#include "fusion/files/ply_writer.hpp"
#include "fusion/fusion_plan.hpp"

namespace spectra::test {

std::string fused_in_memory(const files::LoadedScene& scene, const fusion::FusionSettings& settings) {
  const mesh::MultispectralMesh& mesh = scene.mesh;
  fusion::TemperatureAccumulator temperatures;
  temperatures.add(mesh.temperature_celsius());
  fusion::SceneTemperature temperature;
  temperature.summary = temperatures.summary();
  temperature.histogram = [&](std::uint32_t bins) {
    fusion::Histogram histogram{temperature.summary.minimum, temperature.summary.maximum,
                                std::vector<std::uint64_t>(bins)};
    fusion::add_to_histogram(mesh.temperature_celsius(), histogram);
    return histogram;
  };
  const auto plan = fusion::FusionPlan::prepare(settings, temperature);
  EXPECT_TRUE(plan);
  std::vector<base::Rgb8> fused(mesh.vertex_count());
  plan.value().fuse(mesh.temperature_celsius(), mesh.visible(), fused);
  std::ostringstream out;
  EXPECT_TRUE(files::write_ply(out, mesh, fused));
  return out.str();
}

}  // namespace spectra::test
