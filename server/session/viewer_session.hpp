#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "fusion/fusion_plan.hpp"
#include "fusion/settings.hpp"
#include "protocol/incoming_message.hpp"
#include "protocol/messages/fusion_messages.hpp"
#include "protocol/messages/stream_messages.hpp"
#include "server/access/token_bucket.hpp"
#include "server/net/net_options.hpp"
#include "server/net/viewer_link.hpp"
#include "server/session/plan_preparation.hpp"
#include "server/session/scene_questions.hpp"
#include "server/session/served_scene.hpp"
#include "server/session/status_board.hpp"
#include "server/stream/viewer_stream.hpp"

namespace spectra::session {

/// What one viewer says and is told: the messages of docs/protocol.md over its own settings, camera and stream. Runs on
/// its session's strand; what computes is posted to the worker pool and comes back through ViewerPeer::post().
class ViewerSession final : public net::ViewerClient, public std::enable_shared_from_this<ViewerSession> {
 public:
  /// The peer owns the session and outlives every call to it.
  ViewerSession(const std::shared_ptr<net::ViewerPeer>& peer, ServedScene& served, const net::NetLimits& limits);

  void opened() override;
  void text_received(std::string_view text) override;
  void binary_received() override;
  std::optional<stream::OutgoingFrame> next_frame() override;
  void ticked() override;
  void closed() override;

 private:
  using Id = std::optional<protocol::RpcId>;
  using Answer = protocol::Result<nlohmann::json>;

  /// What a request counts against.
  enum class Cost {
    Free,     ///< Nothing: it only steers what is sent anyway, and comes with every picture.
    Request,  ///< The requests a second of NetLimits.
  };
  /// One of the methods that a viewer may call.
  struct Request {
    std::string_view method;
    access::Right right;
    Cost cost;
    void (ViewerSession::*handle)(const Id& id, const nlohmann::json& params);
  };
  static std::span<const Request> requests();
  /// The handler that answers with what a function returns.
  template <auto function>
  void answered(const Id& id, const nlohmann::json& params);

  void handle(const protocol::IncomingMessage& message);
  void answer(const Id& id, const Answer& answer);
  void notify(std::string_view method, const nlohmann::json& params);

  Answer scene_get(const nlohmann::json& params);
  /// What begins or ends a stream, behind all changes of the settings that were asked for before it.
  template <auto function>
  void behind_changes(const Id& id, const nlohmann::json& params);
  /// Carries out what has waited for changes that have been answered.
  void go_on_behind_changes();
  Answer subscribe(const nlohmann::json& params);
  /// What need not be sent again.
  protocol::SubscribeReply resume(const protocol::ResumeRequest& request);
  Answer unsubscribe(const nlohmann::json& params);
  Answer fusion_get(const nlohmann::json& params);
  Answer set_quality(const nlohmann::json& params);
  Answer set_camera(const nlohmann::json& params);
  Answer acknowledge(const nlohmann::json& params);
  void fusion_set(const Id& id, const nlohmann::json& params);
  void baseline(const Id& id, const nlohmann::json& params);

  /// Of answers that are being made.
  struct Computing;
  class ComputingPlace;

  /// The handler that has what a question asks for computed.
  template <AskedQuestion question>
  void asked(const Id& id, const nlohmann::json& params);
  /// Computes an answer on the pool and sends it when it is there; refuses when too many are under way.
  void ask(const Id& id, protocol::Result<SceneQuestion> question);

  void take_scene(const std::shared_ptr<const map::SceneSnapshot>& scene);
  /// Prepares the waiting changes, or the settings for a scene that has come, on the pool; one at a time.
  void start_preparation();
  void finish_preparation(const std::shared_ptr<PlanPreparation>& preparation);
  void begin_stream();
  /// Says what was noticed while the scene was read, and takes back what was said of the one before.
  void tell_notes();
  void tell_store_trouble(const std::optional<std::string>& message);
  void tell_mapping_trouble(const std::optional<std::string>& message);
  /// Says where the robot is now, and of its way what the viewer does not know.
  void tell_robot();
  /// What the method of now cannot show in the scene of now, and what palette does not suit it.
  void tell_method_limits();
  void set_plan(fusion::FusionPlan plan);
  protocol::FusionReply fusion_reply() const;
  stream::StreamQuality quality() const;
  /// This viewer may have raw layers.
  bool gives_raw_layers() const;

  net::ViewerPeer& peer_;
  const std::weak_ptr<net::ViewerPeer> weak_peer_;
  ServedScene& served_;
  const net::NetLimits limits_;
  const std::string id_;  ///< Of the session.
  access::TokenBucket requests_;

  map::SceneStore::Subscription scene_subscription_;
  std::shared_ptr<const SharedMessage::Listener> progress_subscription_;
  std::shared_ptr<const SharedMessage::Listener> store_subscription_, mapping_subscription_;  ///< Of operators.
  std::shared_ptr<const sources::RobotTrack::Listener> robot_subscription_;
  sources::RobotTrack::Told robot_told_;
  std::shared_ptr<const map::SceneSnapshot> scene_;
  std::shared_ptr<const map::SceneSnapshot> coming_scene_;
  std::shared_ptr<stream::ViewerStream> stream_;
  std::optional<fusion::FusionPlan> plan_;
  std::vector<FusionRequest> waiting_;
  std::uint64_t changes_asked_ = 0;
  std::uint64_t changes_answered_ = 0;
  /// A request that waits until so many changes have been answered.
  struct BehindChanges {
    std::uint64_t changes = 0;
    std::function<void()> carry_out;
  };
  std::deque<BehindChanges> behind_changes_;
  bool is_preparing_ = false;
  bool is_first_view_ = true;  ///< The viewer has changed nothing yet: a new scene brings its own first view.
  const std::shared_ptr<Computing> computing_;

  bool is_subscribed_ = false;
  stream::Subscription subscription_;
  std::optional<stream::Camera> camera_;
  stream::StreamQuality quality_;
  StatusBoard statuses_;
};

}  // namespace spectra::session
