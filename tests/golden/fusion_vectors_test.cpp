#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "fusion/fusion_plan.hpp"

namespace spectra::fusion {
namespace {

using Json = nlohmann::json;

fusion::ParameterValue parameter_value(const Json& json) {
  if (json.is_null()) return fusion::Automatic{};
  if (json.is_boolean()) return json.get<bool>();
  if (json.is_number_integer()) return json.get<std::int64_t>();
  if (json.is_number()) return json.get<double>();
  return json.get<std::string>();
}

struct Vectors {
  std::vector<base::Rgb8> visible;
  std::vector<float> temperature;
  fusion::PaletteTable palette{};
  Json cases;
};

Vectors load() {
  std::ifstream file(SPECTRA_GOLDEN_DIR "/fusion.json");
  Json json = Json::parse(file);
  Vectors vectors;
  for (const Json& row : json["visible"]) {
    vectors.visible.push_back({row[0].get<std::uint8_t>(), row[1].get<std::uint8_t>(), row[2].get<std::uint8_t>()});
  }
  for (const Json& value : json["temperature"]) {
    vectors.temperature.push_back(value.is_null() ? std::numeric_limits<float>::quiet_NaN() : value.get<float>());
  }
  for (std::size_t row = 0; row < 256; ++row) {
    for (std::size_t channel = 0; channel < 3; ++channel) {
      vectors.palette[row][channel] = json["palette"][row][channel].get<double>();
    }
  }
  vectors.cases = json["cases"];
  return vectors;
}

fusion::SceneTemperature scene_of(const std::vector<float>& temperature) {
  fusion::TemperatureAccumulator accumulator;
  accumulator.add(temperature);
  fusion::SceneTemperature scene;
  scene.summary = accumulator.summary();
  scene.histogram = [&temperature, summary = scene.summary](std::uint32_t bins) {
    fusion::Histogram histogram{summary.minimum, summary.maximum, std::vector<std::uint64_t>(bins)};
    fusion::add_to_histogram(temperature, histogram);
    return histogram;
  };
  return scene;
}

TEST(FusionVectors, EveryChannelEqualsTheGoldenAnswer) {
  const Vectors vectors = load();
  ASSERT_EQ(vectors.visible.size(), 48U);
  ASSERT_EQ(vectors.cases.size(), 31U);
  const fusion::SceneTemperature scene = scene_of(vectors.temperature);

  for (std::size_t number = 0; number < vectors.cases.size(); ++number) {
    const Json& one = vectors.cases[number];
    SCOPED_TRACE("case " + std::to_string(number) + ": " + one["method"].get<std::string>() + " " +
                 one["params"].dump());
    fusion::FusionChange change;
    change.method = one["method"].get<std::string>();
    for (const auto& [name, value] : one["params"].items()) change.params[name] = parameter_value(value);
    if (!one["range"].is_null()) {
      change.range = fusion::RangeSetting::manual(one["range"][0].get<double>(), one["range"][1].get<double>());
    }
    const auto settings = fusion::with_change(fusion::default_settings(), change);
    ASSERT_TRUE(settings.has_value()) << settings.error().message;
    const auto plan = fusion::FusionPlan::prepare(settings.value(), scene, vectors.palette);
    ASSERT_TRUE(plan.has_value()) << plan.error().message;
    std::vector<base::Rgb8> fused(vectors.visible.size());
    plan.value().fuse(vectors.temperature, vectors.visible, fused);

    std::set<std::pair<std::size_t, std::size_t>> near_tie;
    for (const Json& pair : one["near_tie"]) {
      near_tie.emplace(pair[0].get<std::size_t>(), pair[1].get<std::size_t>());
    }
    for (std::size_t vertex = 0; vertex < fused.size(); ++vertex) {
      const int actual[3] = {fused[vertex].r, fused[vertex].g, fused[vertex].b};
      for (std::size_t channel = 0; channel < 3; ++channel) {
        const int tolerance = near_tie.contains({vertex, channel}) ? 1 : 0;
        EXPECT_NEAR(actual[channel], one["rgb8"][vertex][channel].get<int>(), tolerance)
            << "vertex " << vertex << " channel " << channel << " exact "
            << one["float"][vertex][channel].get<double>();
      }
    }
  }
}

}  // namespace
}  // namespace spectra::fusion
