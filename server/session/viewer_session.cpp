#include "server/session/viewer_session.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <exception>
#include <functional>
#include <new>
#include <nlohmann/json.hpp>
#include <span>
#include <utility>
#include <vector>

#include "fusion/colour/palette.hpp"
#include "fusion/registry.hpp"
#include "protocol/messages/query_messages.hpp"
#include "protocol/messages/robot_messages.hpp"
#include "protocol/messages/scene_messages.hpp"
#include "server/jobs/priority.hpp"
#include "server/net/steady_seconds.hpp"
#include "server/session/conversions.hpp"
#include "server/session/refusals.hpp"
#include "server/session/version.hpp"

namespace spectra::session {
using nlohmann::json;
using protocol::refusal;
using protocol::RpcErrorCode;

namespace {

/// Answers that one viewer may have computing at once, and changes it may have waiting.
constexpr std::size_t kMaxComputing = 16;
constexpr std::size_t kMaxWaiting = 512;
/// The same of requests to begin or end a stream, which may be long.
constexpr std::size_t kMaxBehindChanges = 4;

/// What settings are prepared with.
fusion::SceneTemperature temperature_of(const std::shared_ptr<const map::SceneSnapshot>& scene) {
  return scene ? *scene->reference_temperature() : fusion::SceneTemperature{};
}

double unix_seconds() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

std::optional<double> if_positive(double value) {
  return value > 0 ? std::optional(value) : std::nullopt;
}

}  // namespace

struct ViewerSession::Computing {
  std::atomic<std::size_t> count{0};
  std::atomic<std::size_t> bytes{0};  ///< Of the answers, at most.
};

/// Counts one of them, as long as it is there; it may be lost where no memory is left to go on.
class ViewerSession::ComputingPlace {
 public:
  ComputingPlace(std::shared_ptr<Computing> all, std::size_t bytes) : all_(std::move(all)), bytes_(bytes) {
    all_->count += 1;
    all_->bytes += bytes_;
  }
  ~ComputingPlace() {
    all_->count -= 1;
    all_->bytes -= bytes_;
  }
  ComputingPlace(const ComputingPlace&) = delete;
  ComputingPlace& operator=(const ComputingPlace&) = delete;

 private:
  const std::shared_ptr<Computing> all_;
  const std::size_t bytes_;
};

ViewerSession::ViewerSession(const std::shared_ptr<net::ViewerPeer>& peer, ServedScene& served,
                             const net::NetLimits& limits)
    : peer_(*peer),
      weak_peer_(peer),
      served_(served),
      limits_(limits),
      id_(served.session_ids.next()),
      requests_(limits.requests_per_s, limits.requests_per_s * limits.message_burst_s),
      computing_(std::make_shared<Computing>()),
      statuses_([this](const protocol::Status& status) { notify("status", protocol::to_json(status)); }) {}

void ViewerSession::opened() {
  served_.viewer_count += 1;
  const auto weak_self = weak_from_this();
  const auto post = [weak_peer = weak_peer_, weak_self](auto job) {
    if (const auto peer = weak_peer.lock()) {
      peer->post([weak_self, job = std::move(job)] {
        if (const auto self = weak_self.lock()) job(*self);
      });
    }
  };
  scene_subscription_ = served_.scenes.subscribe([post](const std::shared_ptr<const map::SceneSnapshot>& scene) {
    post([scene](ViewerSession& self) { self.take_scene(scene); });
  });
  progress_subscription_ = served_.progress.subscribe([post](const std::optional<std::string>& message) {
    post([message](ViewerSession& self) { self.statuses_.set("scene_loading", protocol::StatusLevel::Info, message); });
  });
  const bool may_operate = access::may(peer_.role(), access::Right::Operate);
  if (may_operate) {
    store_subscription_ = served_.store_trouble.subscribe([post](const std::optional<std::string>& message) {
      post([message](ViewerSession& self) { self.tell_store_trouble(message); });
    });
    mapping_subscription_ = served_.mapping_trouble.subscribe([post](const std::optional<std::string>& message) {
      post([message](ViewerSession& self) { self.tell_mapping_trouble(message); });
    });
  }
  robot_subscription_ = served_.robot.subscribe([post] { post([](ViewerSession& self) { self.tell_robot(); }); });

  scene_ = served_.scenes.current();
  // The scene has the histogram of percentiles already, nearly always, so this takes microseconds.
  const auto temperature = temperature_of(scene_);
  plan_ = fusion::FusionPlan::prepare(fusion::first_view_settings(temperature.summary), temperature).value();
  if (scene_) begin_stream();

  protocol::Hello hello;
  hello.server = {"Spectra", std::string(kVersion)};
  hello.session_id = id_;
  hello.role = may_operate ? protocol::Role::Operator : protocol::Role::Viewer;
  hello.capabilities = {"histogram",   "probe", "extremes", "extremes_in_view", "exports", "subtract_green", "resume",
                        "cache_bytes", "marks", "age",      "baseline",         "robot"};
  hello.capabilities.emplace_back("temperature_sigma");
  if (gives_raw_layers()) hello.capabilities.emplace_back("raw_layers");
  hello.limits = {limits_.message_size_bytes, static_cast<std::uint32_t>(limits_.json_depth), limits_.requests_per_s};
  if (scene_) hello.scene = to_message(*scene_);
  hello.fusion = to_message(*plan_, temperature_of(scene_).summary);
  hello.quality = to_message(quality());
  peer_.send(served_.catalogue.hello_text(std::move(hello), peer_.hello_form()));
  if (stream_) set_plan(*plan_);
  tell_notes();
  if (const auto message = served_.progress.message()) {
    statuses_.set("scene_loading", protocol::StatusLevel::Info, message);
  }
  if (may_operate) {
    tell_store_trouble(served_.store_trouble.message());
    tell_mapping_trouble(served_.mapping_trouble.message());
  }
  tell_robot();
}

void ViewerSession::tell_store_trouble(const std::optional<std::string>& message) {
  statuses_.set("map_not_stored", protocol::StatusLevel::Error, message);
}

void ViewerSession::tell_mapping_trouble(const std::optional<std::string>& message) {
  statuses_.set("mapping_ended", protocol::StatusLevel::Error, message);
}

void ViewerSession::closed() {
  served_.viewer_count -= 1;
  scene_subscription_ = {};
  progress_subscription_.reset();
  store_subscription_.reset();
  mapping_subscription_.reset();
  robot_subscription_.reset();
  if (!stream_) return;
  try {
    served_.memories.ended(id_, stream_->memory(), net::steady_seconds());
  } catch (const std::bad_alloc&) {
    // It costs the viewer what it would be spared if it came back.
    spdlog::warn("no memory for what a viewer had: if it comes back it gets everything anew");
  }
  stream_->close();
}

void ViewerSession::text_received(std::string_view text) {
  const protocol::JsonLimits json_limits{.max_size_bytes = limits_.message_size_bytes,
                                         .max_depth = static_cast<int>(limits_.json_depth),
                                         .max_elements = limits_.json_elements};
  const auto message = protocol::incoming_message(text, json_limits);
  if (const auto* bad = std::get_if<protocol::RefusedMessage>(&message)) {
    peer_.send(protocol::error_text(bad->id, bad->error));
    return;
  }
  handle(std::get<protocol::IncomingMessage>(message));
}

void ViewerSession::binary_received() {
  peer_.send(protocol::error_text(
      std::nullopt, {RpcErrorCode::InvalidRequest, "binary messages are not accepted from a viewer", "", "JSON text"}));
}

template <auto function>
void ViewerSession::answered(const Id& id, const json& params) {
  answer(id, (this->*function)(params));
}

template <auto function>
void ViewerSession::behind_changes(const Id& id, const json& params) {
  if (changes_answered_ == changes_asked_) return answer(id, (this->*function)(params));
  if (behind_changes_.size() >= kMaxBehindChanges) {
    return answer(id, refusal(RpcErrorCode::Busy, "too many requests wait for a change of the settings", "",
                              std::to_string(kMaxBehindChanges) + " at once"));
  }
  behind_changes_.push_back({changes_asked_, [this, id, params] { answer(id, (this->*function)(params)); }});
}

void ViewerSession::go_on_behind_changes() {
  while (!behind_changes_.empty() && behind_changes_.front().changes <= changes_answered_) {
    const BehindChanges request = std::move(behind_changes_.front());
    behind_changes_.pop_front();
    request.carry_out();
  }
}

std::span<const ViewerSession::Request> ViewerSession::requests() {
  using Self = ViewerSession;
  static constexpr Request kRequests[] = {
      {"stream.ack", access::Right::Watch, Cost::Free, &Self::answered<&Self::acknowledge>},
      {"camera.set", access::Right::Watch, Cost::Free, &Self::answered<&Self::set_camera>},
      {"fusion.set", access::Right::Watch, Cost::Request, &Self::fusion_set},
      {"fusion.get", access::Right::Watch, Cost::Request, &Self::answered<&Self::fusion_get>},
      {"quality.set", access::Right::Watch, Cost::Request, &Self::answered<&Self::set_quality>},
      {"scene.get", access::Right::Watch, Cost::Request, &Self::answered<&Self::scene_get>},
      {"scene.subscribe", access::Right::Watch, Cost::Request, &Self::behind_changes<&Self::subscribe>},
      {"scene.unsubscribe", access::Right::Watch, Cost::Request, &Self::behind_changes<&Self::unsubscribe>},
      {"scene.histogram", access::Right::Watch, Cost::Request, &Self::asked<&histogram_question>},
      {"scene.probe", access::Right::Watch, Cost::Request, &Self::asked<&probe_question>},
      {"fusion.facts", access::Right::Watch, Cost::Request, &Self::asked<&facts_question>},
      {"scene.extremes", access::Right::Watch, Cost::Request, &Self::asked<&extremes_question>},
      {"scene.baseline", access::Right::Watch, Cost::Request, &Self::baseline},
  };
  return kRequests;
}

void ViewerSession::handle(const protocol::IncomingMessage& message) {
  const auto known = requests();
  const auto request = std::find_if(
      known.begin(), known.end(), [&message](const Request& candidate) { return candidate.method == message.method; });
  const bool is_known = request != known.end();
  if ((!is_known || request->cost != Cost::Free) && !requests_.take(net::steady_seconds())) {
    const auto allowed = static_cast<long>(limits_.requests_per_s);
    return answer(message.id,
                  refusal(RpcErrorCode::Busy, "too many requests", "", std::to_string(allowed) + " a second"));
  }
  if (!is_known) {
    return answer(message.id, refusal(RpcErrorCode::MethodNotFound,
                                      "there is no method \"" + message.method.substr(0, 64) + "\"", "method"));
  }
  if (!access::may(peer_.role(), request->right)) {
    return answer(message.id, refusal(RpcErrorCode::Forbidden,
                                      "that is not for the role " + std::string(to_string(peer_.role())), "method"));
  }
  (this->*request->handle)(message.id, message.params);
}

void ViewerSession::answer(const Id& id, const Answer& answer) {
  if (!answer) {
    peer_.send(protocol::error_text(id, answer.error()));
  } else if (id) {
    peer_.send(protocol::result_text(*id, answer.value()));
  }
}

void ViewerSession::notify(std::string_view method, const json& params) {
  peer_.send(protocol::notification_text(method, params));
}

ViewerSession::Answer ViewerSession::scene_get(const json& /*params*/) {
  if (!scene_) return no_scene();
  return protocol::to_json(to_message(*scene_));
}

ViewerSession::Answer ViewerSession::subscribe(const json& params) {
  BOOST_OUTCOME_TRY(const auto request, protocol::from_json<protocol::SubscribeRequest>(params));
  const auto has_channel = [&request](protocol::Channel channel) {
    return std::find(request.channels.begin(), request.channels.end(), channel) != request.channels.end();
  };
  const bool wants_raw = has_channel(protocol::Channel::Temperature) || has_channel(protocol::Channel::Visible);
  if (wants_raw && !gives_raw_layers()) {
    return refusal(RpcErrorCode::Forbidden,
                   limits_.gives_raw_layers
                       ? "a viewer is given fused colours only; raw layers take an operator's token"
                       : "this server gives fused colours only (serve --fused-only)",
                   "channels", "fused");
  }
  if (request.resume && is_subscribed_) {
    return refusal(RpcErrorCode::InvalidParams, "resume must come before the first frame, not while frames flow",
                   "resume", "the first scene.subscribe, or the first after scene.unsubscribe");
  }
  protocol::SubscribeReply reply;
  if (request.resume) reply = resume(*request.resume);
  is_subscribed_ = true;
  subscription_ = {.in_flight_bytes = request.in_flight_bytes.value_or(0),
                   .cache_bytes = request.cache_bytes.value_or(0),
                   .colour_transform = request.colour_transform.value_or(protocol::ColourTransform::None),
                   .fused = has_channel(protocol::Channel::Fused),
                   .temperature = has_channel(protocol::Channel::Temperature),
                   .visible = has_channel(protocol::Channel::Visible),
                   .temperature_sigma = has_channel(protocol::Channel::TemperatureSigma),
                   .temperature_step_celsius = request.temperature_step_celsius.value_or(0)};
  if (stream_) stream_->subscribe(subscription_);
  peer_.wake();
  return protocol::to_json(reply);
}

bool ViewerSession::gives_raw_layers() const {
  return limits_.gives_raw_layers && access::may(peer_.role(), access::Right::Operate);
}

protocol::SubscribeReply ViewerSession::resume(const protocol::ResumeRequest& request) {
  protocol::SubscribeReply reply;
  reply.resumed_tiles = 0;
  if (request.colours) {
    reply.current_colours.emplace();
    reply.generation = stream_ ? stream_->generation() : 0;
  }
  if (!stream_ || !served_.session_ids.is_of_this_run(request.session_id)) return reply;
  std::vector<stream::ResumedTile> tiles;
  tiles.reserve(request.tiles.size());
  for (const auto& [level, x, y, z, revision] : request.tiles) {
    tiles.push_back({{static_cast<std::uint8_t>(level), x, y, z}, revision});
  }
  for (const std::uint32_t place : request.raw.value_or(std::vector<std::uint32_t>())) {
    tiles[place].has_raw_layers = gives_raw_layers();
  }
  for (const std::uint32_t place : request.temperature_sigma.value_or(std::vector<std::uint32_t>())) {
    tiles[place].has_temperature_sigma = true;
  }
  if (request.colours) {
    for (const auto& [place, sequence] : *request.colours) tiles[place].colour_sequence = sequence;
  }
  auto resumed = request.colours
                     ? stream_->resume(tiles, *served_.memories.of(request.session_id, net::steady_seconds()))
                     : stream_->resume(tiles);
  reply.resumed_tiles = static_cast<int>(resumed.tile_count);
  if (request.colours) reply.current_colours = std::move(resumed.current_colours);
  return reply;
}

ViewerSession::Answer ViewerSession::unsubscribe(const json& /*params*/) {
  is_subscribed_ = false;
  if (stream_) {
    if (auto memory = stream_->memory(); !memory.empty()) {
      served_.memories.ended(id_, std::move(memory), net::steady_seconds());
    }
    stream_->unsubscribe();
  }
  return json::object();
}

ViewerSession::Answer ViewerSession::fusion_get(const json& /*params*/) {
  return protocol::to_json(fusion_reply());
}

ViewerSession::Answer ViewerSession::set_quality(const json& params) {
  BOOST_OUTCOME_TRY(const auto change, protocol::from_json<protocol::QualityChange>(params));
  BOOST_OUTCOME_TRY(const auto changed, with_change(quality(), change));
  quality_ = changed;
  if (stream_) stream_->set_quality(changed);
  peer_.wake();
  return protocol::to_json(protocol::QualityReply{to_message(quality())});
}

ViewerSession::Answer ViewerSession::set_camera(const json& params) {
  BOOST_OUTCOME_TRY(const auto message, protocol::from_json<protocol::CameraSet>(params));
  camera_ = from_message(message);
  if (stream_) stream_->set_camera(*camera_);
  peer_.wake();
  return json::object();
}

ViewerSession::Answer ViewerSession::acknowledge(const json& params) {
  BOOST_OUTCOME_TRY(const auto ack, protocol::from_json<protocol::StreamAck>(params));
  if (stream_) stream_->acknowledge(ack.sequence, net::steady_seconds());
  peer_.wake();
  return json::object();
}

void ViewerSession::fusion_set(const Id& id, const json& params) {
  if (waiting_.size() >= kMaxWaiting) {
    return answer(
        id, refusal(RpcErrorCode::Busy, "too many changes are waiting", "", std::to_string(kMaxWaiting) + " at once"));
  }
  auto message = protocol::from_json<protocol::FusionChange>(params);
  if (message) {
    waiting_.push_back({id, from_message(message.value())});
  } else {
    waiting_.push_back({id, refused(message.error())});
  }
  ++changes_asked_;
  start_preparation();
}

template <AskedQuestion question>
void ViewerSession::asked(const Id& id, const json& params) {
  ask(id, question(params, {scene_, plan_ ? &*plan_ : nullptr, unix_seconds()}));
}

void ViewerSession::ask(const Id& id, protocol::Result<SceneQuestion> made) {
  if (!made) return answer(id, refused(made.error()));
  auto& [size_bytes, compute] = made.value();
  if (computing_->count >= kMaxComputing) {
    return answer(id, refusal(RpcErrorCode::Busy, "too many answers are being computed", "",
                              std::to_string(kMaxComputing) + " at once"));
  }
  // Half of the lane stays free for what nobody asked for.
  if (computing_->bytes + peer_.queued_bytes() + size_bytes > limits_.control_queue_bytes / 2) {
    return answer(id, refusal(RpcErrorCode::Busy, "too many answers wait to be sent", "",
                              std::to_string(limits_.control_queue_bytes / 2) + " bytes at once"));
  }
  served_.pool.post(
      [weak_peer = weak_peer_, weak_self = weak_from_this(), id, size_bytes = size_bytes,
       most_bytes = limits_.queue_bytes_at_once, compute = std::move(compute),
       place = std::make_shared<const ComputingPlace>(computing_, size_bytes)]() mutable {
        Answer computed = refusal(RpcErrorCode::InternalError, "the answer could not be computed");
        std::shared_ptr<const void> room;
        try {
          if (const auto peer = weak_peer.lock()) room = peer->room_for(size_bytes);
          computed =
              room ? compute()
                   : refusal(RpcErrorCode::Busy, "too many answers wait to be sent, and to nobody more than to you", "",
                             std::to_string(most_bytes) + " bytes of all viewers");
        } catch (const std::exception& error) {
          spdlog::error("an answer failed: {}", error.what());
        }
        const auto peer = weak_peer.lock();
        if (!peer) return;
        peer->post([weak_self, id, computed = std::move(computed), place = std::move(place),
                    room = std::move(room)]() mutable {
          place.reset();
          room.reset();
          if (const auto self = weak_self.lock()) self->answer(id, computed);
        });
      },
      jobs::kAnswerPriority);
}

void ViewerSession::baseline(const Id& id, const json& params) {
  const auto request = protocol::from_json<protocol::BaselineRequest>(params);
  if (!request) return answer(id, refused(request.error()));
  if (!scene_) return answer(id, no_scene());
  if (request.value().action == protocol::BaselineAction::Get) {
    return answer(id, protocol::to_json(protocol::BaselineReply{scene_->baseline_marked_at(), scene_->revision()}));
  }
  if (!access::may(peer_.role(), access::Right::Operate)) {
    return answer(
        id, refusal(RpcErrorCode::Forbidden,
                    "to mark the baseline is not for the role " + std::string(to_string(peer_.role())), "action"));
  }
  if (!served_.mark_baseline) return answer(id, refusal(RpcErrorCode::Busy, "the map is not open yet"));
  served_.mark_baseline([weak_peer = weak_peer_, weak_self = weak_from_this(), id](const auto& outcome) {
    const auto peer = weak_peer.lock();
    if (!peer) return;
    peer->post([weak_self, id, outcome] {
      const auto self = weak_self.lock();
      if (!self) return;
      if (const auto* marked = std::get_if<sources::BaselineMarked>(&outcome)) {
        self->answer(id, protocol::to_json(protocol::BaselineReply{marked->marked_at, marked->revision}));
      } else {
        const auto& why = std::get<net::BlockRefusal>(outcome);
        const auto code = why.status == 503   ? RpcErrorCode::Busy
                          : why.status == 409 ? RpcErrorCode::InvalidRequest
                                              : RpcErrorCode::InternalError;
        self->answer(id, refusal(code, why.reason, why.field, why.limits));
      }
    });
  });
}

void ViewerSession::take_scene(const std::shared_ptr<const map::SceneSnapshot>& scene) {
  const auto& newest = coming_scene_ ? coming_scene_ : scene_;
  if (newest && scene->revision() <= newest->revision()) return;
  coming_scene_ = scene;
  start_preparation();
}

void ViewerSession::start_preparation() {
  if (is_preparing_ || (waiting_.empty() && !coming_scene_)) return;
  is_preparing_ = true;
  const auto preparation = std::make_shared<PlanPreparation>();
  preparation->is_new_scene = coming_scene_ != nullptr;
  preparation->scene = coming_scene_ ? std::exchange(coming_scene_, nullptr) : scene_;
  preparation->has_new_temperatures =
      preparation->is_new_scene &&
      (!scene_ || scene_->reference_temperature() != preparation->scene->reference_temperature());
  preparation->is_first_view = is_first_view_;
  preparation->settings = plan_->settings();
  preparation->requests = std::exchange(waiting_, {});
  served_.pool.post(
      [weak_peer = weak_peer_, weak_self = weak_from_this(), preparation] {
        try {
          preparation->run(temperature_of(preparation->scene));
        } catch (const std::exception& error) {
          spdlog::error("settings could not be prepared: {}", error.what());
          preparation->fail();
        }
        const auto peer = weak_peer.lock();
        if (!peer) return;
        peer->post([weak_self, preparation] {
          if (const auto self = weak_self.lock()) self->finish_preparation(preparation);
        });
      },
      jobs::kAnswerPriority);
}

void ViewerSession::finish_preparation(const std::shared_ptr<PlanPreparation>& preparation) {
  is_preparing_ = false;
  is_first_view_ = preparation->is_first_view;
  const bool is_taken = preparation->is_new_scene && (preparation->plan || !preparation->has_new_temperatures);
  if (is_taken) {
    scene_ = preparation->scene;
    if (preparation->plan) plan_ = preparation->plan;
    begin_stream();
    tell_method_limits();
    notify("scene.changed", protocol::to_json(protocol::SceneChanged{to_message(*scene_)}));
    tell_notes();
  }
  if (preparation->plan) set_plan(*preparation->plan);
  if (is_taken && preparation->has_new_temperatures) {
    notify("fusion.changed", protocol::to_json(fusion_reply()));
    statuses_.set("settings_reset", protocol::StatusLevel::Warning,
                  preparation->reset_reason
                      ? std::optional("The settings did not fit the new scene and are at their defaults: " +
                                      *preparation->reset_reason)
                      : std::nullopt);
  }
  const std::uint32_t generation = fusion_reply().generation;
  for (std::size_t i = 0; i < preparation->requests.size(); ++i) {
    const auto& outcome = preparation->outcomes[i];
    const Id& id = preparation->requests[i].id;
    if (outcome) {
      answer(id, protocol::to_json(protocol::FusionReply{generation, outcome.value()}));
    } else {
      answer(id, refused(outcome.error()));
    }
  }
  changes_answered_ += preparation->requests.size();
  go_on_behind_changes();
  start_preparation();
}

void ViewerSession::begin_stream() {
  if (stream_) {
    stream_->set_time(unix_seconds());
    stream_->set_scene(scene_);
    return;
  }
  stream_ = stream::ViewerStream::create(scene_, served_.cache, served_.pool, [weak_peer = weak_peer_] {
    if (const auto peer = weak_peer.lock()) peer->wake();
  });
  served_.memories.opened(id_, stream_);
  if (quality_ != stream::StreamQuality{}) stream_->set_quality(quality_);
  if (camera_) stream_->set_camera(*camera_);
  if (is_subscribed_) stream_->subscribe(subscription_);
}

void ViewerSession::tell_notes() {
  statuses_.set_notes(scene_ ? scene_->notes() : std::span<const files::Note>());
}

void ViewerSession::tell_robot() {
  const auto news = served_.robot.news(robot_told_);
  if (!news) return;
  const auto vector = [](const base::Vec3d& v) { return std::array{v.x, v.y, v.z}; };
  const sources::RobotPose& pose = news->pose;
  protocol::RobotMoved message{pose.at, vector(pose.position), vector(pose.forward), vector(pose.up), {}, {}};
  if (pose.is_lost) message.lost = true;
  message.path.first = static_cast<std::uint32_t>(news->first_point);
  for (const base::Vec3d& point : news->points) message.path.points.push_back(vector(point));
  notify("robot.moved", protocol::to_json(message));
}

void ViewerSession::set_plan(fusion::FusionPlan plan) {
  plan_ = plan;
  if (stream_) {
    stream_->set_time(unix_seconds());
    stream_->set_plan(std::move(plan));
  }
  peer_.wake();
  tell_method_limits();
}

void ViewerSession::tell_method_limits() {
  const auto& settings = plan_->settings();
  const fusion::Method* method = fusion::find_method(settings.method);
  // Beyond the sensor's range is no number, and not missing either.
  const auto has_readings = [](const fusion::TemperatureSummary& summary) {
    return summary.has_temperature() || summary.over_range_count + summary.under_range_count > 0;
  };
  const bool lacks_temperature =
      scene_ && scene_->vertex_count() > 0 && method->needs_temperature && !has_readings(scene_->temperature().summary);
  statuses_.set("no_temperature", protocol::StatusLevel::Warning,
                lacks_temperature
                    ? std::optional("This scene has no temperatures: " + method->label + " shows the visible colours.")
                    : std::nullopt);
  const bool lacks_baseline = scene_ && method->compares_with_baseline && !scene_->baseline_mark();
  statuses_.set("no_baseline", protocol::StatusLevel::Warning,
                lacks_baseline
                    ? std::optional("This scene has no baseline: " + method->label +
                                    " shows the visible colours. Put blocks into it, or mark a baseline: then "
                                    "what changes afterwards is shown.")
                    : std::nullopt);
  statuses_.set("palette_not_fusion_safe", protocol::StatusLevel::Warning,
                palette_warning(*method, fusion::find_palette(settings.palette)));
  statuses_.set("palette_not_diverging", protocol::StatusLevel::Warning,
                direction_warning(*method, fusion::find_palette(settings.palette)));
}

protocol::FusionReply ViewerSession::fusion_reply() const {
  return {stream_ ? stream_->generation() : 0, to_message(*plan_, temperature_of(scene_).summary)};
}

stream::StreamQuality ViewerSession::quality() const {
  return stream_ ? stream_->quality() : quality_;
}

std::optional<stream::OutgoingFrame> ViewerSession::next_frame() {
  if (!stream_) return std::nullopt;
  auto frame = stream_->next_frame(net::steady_seconds());
  if (!frame) {
    if (const auto complete = stream_->take_complete()) {
      notify("stream.complete", protocol::to_json(to_message(*complete)));
    }
  }
  return frame;
}

void ViewerSession::ticked() {
  if (!is_subscribed_ || !stream_) return;
  stream_->set_time(unix_seconds());
  const stream::StreamStats stats = stream_->stats();
  protocol::StreamStats message;
  message.round_trip_ms = if_positive(stats.round_trip_ms);
  if (!message.round_trip_ms) message.round_trip_ms = if_positive(peer_.round_trip_ms());
  message.throughput_bytes_per_s = if_positive(stats.throughput_bytes_per_s);
  message.queued_bytes = stats.queued_bytes + peer_.queued_bytes();
  message.skipped_frames = stats.skipped_frames;
  message.viewers = served_.viewer_count;
  message.generation = stats.generation;
  message.scene_revision = stats.shown_revision;
  message.accuracy.position_mm = if_positive(stats.position_mm);
  message.accuracy.colour_levels = stats.colour_levels;
  message.accuracy.temperature_celsius = stats.temperature_celsius;
  if (message.accuracy.position_mm) message.accuracy.pixel_error = stats.pixel_error;
  notify("stream.stats", protocol::to_json(message));
  statuses_.set("tiles_failed", protocol::StatusLevel::Error,
                stats.failed_tiles > 0 ? std::optional(std::to_string(stats.failed_tiles) +
                                                       " tiles of the scene could not be encoded and are not shown.")
                                       : std::nullopt);
}

}  // namespace spectra::session
