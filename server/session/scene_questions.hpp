#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>

#include "fusion/fusion_plan.hpp"
#include "protocol/rpc_error.hpp"
#include "server/map/scene_snapshot.hpp"

namespace spectra::session {

/// What a request for something computed from a scene comes to: the answer is computed from what was in force when it was asked,
/// on any thread.
struct SceneQuestion {
  std::size_t size_bytes = 0;  ///< Of the answer as text, at most.
  std::function<protocol::Result<nlohmann::json>()> compute;
};

/// What it is asked about: the scene and the settings in force. A null scene is refused (NoScene), after parameters that
/// are not understood (InvalidParams).
struct AskedAbout {
  std::shared_ptr<const map::SceneSnapshot> scene;
  const fusion::FusionPlan* plan = nullptr;  ///< Not null where there is a scene; read before the call returns.
  double now_s = 0;                          ///< Unix seconds.
};

using AskedQuestion = protocol::Result<SceneQuestion> (*)(const nlohmann::json& params, const AskedAbout& about);

/// scene.histogram, fusion.facts, scene.probe and scene.extremes of the protocol.
protocol::Result<SceneQuestion> histogram_question(const nlohmann::json& params, const AskedAbout& about);
protocol::Result<SceneQuestion> facts_question(const nlohmann::json& params, const AskedAbout& about);
protocol::Result<SceneQuestion> probe_question(const nlohmann::json& params, const AskedAbout& about);
protocol::Result<SceneQuestion> extremes_question(const nlohmann::json& params, const AskedAbout& about);

}  // namespace spectra::session
