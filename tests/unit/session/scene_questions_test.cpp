#include "server/session/scene_questions.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>
#include <optional>

#include "server/jobs/worker_pool.hpp"

namespace spectra::session {
namespace {

using nlohmann::json;
using protocol::RpcErrorCode;

/// Three vertices of 10, 20 and 30 degrees Celsius, and one without a temperature.
class SceneQuestions : public testing::Test {
 protected:
  SceneQuestions() {
    mesh::MultispectralMesh mesh;
    mesh.has_visible = true;
    mesh.has_temperature = true;
    mesh.resize_vertices(4);
    for (std::size_t v = 0; v < 4; ++v) {
      mesh.positions()[v] = {static_cast<float>(v), 0, 0};
      mesh.temperature_celsius()[v] =
          v < 3 ? 10.0F * static_cast<float>(v + 1) : std::numeric_limits<float>::quiet_NaN();
    }
    jobs::WorkerPool pool(1);
    scene_ = map::SceneSnapshot::build(std::move(mesh), 1, pool);
    plan_.emplace(fusion::FusionPlan::prepare(settings("thermal_only"), *scene_->reference_temperature()).value());
  }

  static fusion::FusionSettings settings(std::string method) {
    fusion::FusionSettings settings = fusion::default_settings();
    settings.method = std::move(method);
    return settings;
  }
  AskedAbout about() const { return {scene_, &*plan_, 0}; }
  static json answer_to(const protocol::Result<SceneQuestion>& question) { return question.value().compute().value(); }

  std::shared_ptr<const map::SceneSnapshot> scene_;
  std::optional<fusion::FusionPlan> plan_;
};

TEST_F(SceneQuestions, WhatIsNotUnderstoodIsRefusedBeforeASceneIsMissed) {
  for (const AskedQuestion question : {histogram_question, facts_question, probe_question, extremes_question}) {
    EXPECT_EQ(question(json::array({1}), {}).error().code, RpcErrorCode::InvalidParams);
  }
  EXPECT_EQ(histogram_question(json{{"bins", 4}}, {}).error().code, RpcErrorCode::NoScene);
  EXPECT_EQ(probe_question(json{{"position", {0, 0, 0}}}, {}).error().code, RpcErrorCode::NoScene);
  EXPECT_EQ(facts_question(json::object(), {}).error().code, RpcErrorCode::NoScene);
  EXPECT_EQ(extremes_question(json::object(), {}).error().code, RpcErrorCode::NoScene);
}

TEST_F(SceneQuestions, AHistogramCountsAndKeepsWithinItsPromisedSize) {
  const auto question = histogram_question(json{{"bins", 4}}, about());
  const json answer = answer_to(question);
  EXPECT_EQ(answer.at("counts"), json({1, 0, 1, 1}));
  EXPECT_LE(answer.dump().size(), question.value().size_bytes);
  EXPECT_FALSE(answer.contains("highlighted_share"));
  const auto many = histogram_question(json{{"bins", 4096}}, about());
  EXPECT_GT(many.value().size_bytes, question.value().size_bytes);
  EXPECT_LE(answer_to(many).dump().size(), many.value().size_bytes);
}

TEST_F(SceneQuestions, AHighlightingMethodSaysHowMuchItHighlights) {
  plan_.emplace(
      fusion::FusionPlan::prepare(settings("monochrome_threshold"), *scene_->reference_temperature()).value());
  EXPECT_TRUE(answer_to(histogram_question(json{{"bins", 4}}, about())).contains("highlighted_share"));
}

TEST_F(SceneQuestions, AProbeReadsTheNearestVertex) {
  const json answer = answer_to(probe_question(json{{"position", {1.2, 0.1, 0}}}, about()));
  EXPECT_EQ(answer.at("temperature"), 20);
  EXPECT_EQ(answer_to(probe_question(json{{"position", {3, 0, 0}}}, about())).at("temperature"), nullptr);
}

TEST_F(SceneQuestions, AnAnswerIsAboutWhatWasInForceWhenItWasAsked) {
  const auto question = histogram_question(json{{"bins", 4}}, about());
  plan_.reset();
  scene_.reset();
  EXPECT_EQ(answer_to(question).at("counts"), json({1, 0, 1, 1}));
}

}  // namespace
}  // namespace spectra::session
