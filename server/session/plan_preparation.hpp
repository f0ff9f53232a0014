#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fusion/fusion_plan.hpp"
#include "fusion/settings.hpp"
#include "protocol/incoming_message.hpp"
#include "protocol/messages/fusion_messages.hpp"
#include "protocol/rpc_error.hpp"
#include "server/map/scene_snapshot.hpp"

namespace spectra::session {

/// A change of the settings that a viewer has asked for, or why it was not understood.
struct FusionRequest {
  std::optional<protocol::RpcId> id;
  protocol::Result<fusion::FusionChange> change;
};

/// One round of making settings ready, away from the viewer's strand: what goes in, and what comes out.
struct PlanPreparation {
  std::shared_ptr<const map::SceneSnapshot> scene;  ///< For which; null: none. Only kept here.
  bool is_new_scene = false;
  bool has_new_temperatures = false;  ///< The new scene asks for another plan.
  bool is_first_view = false;         ///< The viewer has changed nothing yet: a new scene brings its own first view.
  fusion::FusionSettings settings;
  std::vector<FusionRequest> requests;

  std::optional<fusion::FusionPlan> plan;  ///< Of the newest settings that hold.
  /// One a request: the settings in force after it, or why it changed nothing.
  std::vector<protocol::Result<protocol::FusionState>> outcomes;
  std::optional<std::string>
      reset_reason;  ///< The settings did not fit the new scene, and are those of its first view.

  /// `temperature` is that of `scene`. Takes milliseconds.
  void run(const fusion::SceneTemperature& temperature);

  /// In place of what run() made: every request has failed.
  void fail();

 private:
  protocol::Result<protocol::FusionState> apply(const FusionRequest& request,
                                                const fusion::SceneTemperature& temperature);
};

}  // namespace spectra::session
