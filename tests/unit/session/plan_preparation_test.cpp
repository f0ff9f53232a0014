#include "server/session/plan_preparation.hpp"

#include <gtest/gtest.h>

namespace spectra::session {
namespace {

FusionRequest wanting(std::string method) {
  fusion::FusionChange change;
  change.method = std::move(method);
  return {std::nullopt, std::move(change)};
}

PlanPreparation with(std::vector<FusionRequest> requests) {
  PlanPreparation preparation;
  preparation.settings = fusion::default_settings();
  preparation.is_first_view = true;
  preparation.requests = std::move(requests);
  return preparation;
}

TEST(PlanPreparation, AppliesChangesInTheirOrder) {
  PlanPreparation made = with({wanting("thermal_only"), wanting("visible_only")});
  made.run({});
  ASSERT_EQ(made.outcomes.size(), 2U);
  EXPECT_EQ(made.outcomes[0].value().method, "thermal_only");
  EXPECT_EQ(made.outcomes[1].value().method, "visible_only");
  EXPECT_EQ(made.plan.value().settings().method, "visible_only");
  EXPECT_FALSE(made.is_first_view);
}

TEST(PlanPreparation, ARefusedChangeLeavesWhatTheOthersMade) {
  PlanPreparation made = with({wanting("thermal_only"), wanting("no_such_method")});
  made.run({});
  EXPECT_EQ(made.outcomes[1].error().code, protocol::RpcErrorCode::InvalidParams);
  EXPECT_EQ(made.plan.value().settings().method, "thermal_only");
}

TEST(PlanPreparation, NothingButRefusalsIsNoPlanAndStillTheFirstView) {
  PlanPreparation made =
      with({wanting("no_such_method"),
            {std::nullopt, protocol::refusal(protocol::RpcErrorCode::InvalidParams, "not understood")}});
  made.run({});
  EXPECT_FALSE(made.plan);
  EXPECT_TRUE(made.is_first_view);
  EXPECT_EQ(made.outcomes[1].error().message, "not understood");
}

TEST(PlanPreparation, ANewSceneBringsItsFirstViewUnlessTheViewerHasChosen) {
  PlanPreparation made = with({});
  made.is_new_scene = made.has_new_temperatures = true;
  made.settings.method = "thermal_only";
  made.run({});
  EXPECT_EQ(made.plan.value().settings().method, "visible_only") << "the scene has no temperatures";

  PlanPreparation chosen = with({});
  chosen.is_new_scene = chosen.has_new_temperatures = true;
  chosen.is_first_view = false;
  chosen.settings.method = "thermal_only";
  chosen.run({});
  EXPECT_EQ(chosen.plan.value().settings().method, "thermal_only");
  EXPECT_FALSE(chosen.reset_reason);
}

TEST(PlanPreparation, SettingsThatDoNotFitTheSceneAreReset) {
  PlanPreparation made = with({});
  made.is_new_scene = made.has_new_temperatures = true;
  made.is_first_view = false;
  made.settings.method = "no_such_method";
  made.run({});
  EXPECT_EQ(made.plan.value().settings().method, "visible_only");
  EXPECT_TRUE(made.reset_reason);
}

TEST(PlanPreparation, AFailureAnswersEveryRequest) {
  PlanPreparation made = with({wanting("thermal_only"), wanting("visible_only")});
  made.run({});
  made.fail();
  EXPECT_FALSE(made.plan);
  ASSERT_EQ(made.outcomes.size(), 2U);
  for (const auto& outcome : made.outcomes) EXPECT_EQ(outcome.error().code, protocol::RpcErrorCode::InternalError);
}

}  // namespace
}  // namespace spectra::session
