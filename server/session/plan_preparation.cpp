#include "server/session/plan_preparation.hpp"

#include <utility>

#include "server/session/conversions.hpp"

namespace spectra::session {

void PlanPreparation::run(const fusion::SceneTemperature& temperature) {
  if (has_new_temperatures) {
    if (is_first_view) settings = fusion::first_view_settings(temperature.summary);
    auto prepared = fusion::FusionPlan::prepare(settings, temperature);
    if (!prepared) {
      reset_reason = prepared.error().message;
      settings = fusion::first_view_settings(temperature.summary);
      prepared = fusion::FusionPlan::prepare(settings, temperature);
    }
    if (prepared) plan = std::move(prepared).value();
  }
  for (const auto& request : requests) outcomes.push_back(apply(request, temperature));
}

void PlanPreparation::fail() {
  plan.reset();
  outcomes.assign(requests.size(),
                  protocol::refusal(protocol::RpcErrorCode::InternalError, "the settings could not be prepared"));
}

protocol::Result<protocol::FusionState> PlanPreparation::apply(const FusionRequest& request,
                                                               const fusion::SceneTemperature& temperature) {
  if (!request.change) return request.change.as_failure();
  auto changed = fusion::with_change(settings, request.change.value());
  if (!changed) return BOOST_OUTCOME_V2_NAMESPACE::failure(to_rpc_error(changed.error()));
  auto prepared = fusion::FusionPlan::prepare(changed.value(), temperature);
  if (!prepared) return BOOST_OUTCOME_V2_NAMESPACE::failure(to_rpc_error(prepared.error()));
  settings = std::move(changed).value();
  plan = std::move(prepared).value();
  is_first_view = false;
  return to_message(*plan, temperature.summary);
}

}  // namespace spectra::session
