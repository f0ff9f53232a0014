#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string_view>
#include <variant>

#include "protocol/incoming_message.hpp"
#include "protocol/messages/fusion_messages.hpp"
#include "protocol/messages/quality_messages.hpp"
#include "protocol/messages/query_messages.hpp"
#include "protocol/messages/scene_messages.hpp"
#include "protocol/messages/stream_messages.hpp"

namespace {

using namespace spectra;
using namespace spectra::protocol;

void check(bool holds) {
  if (!holds) std::abort();
}

/// What is accepted is written as valid JSON and read back as the same message; a refusal says something.
template <class Message>
void pass(const nlohmann::json& value) {
  const auto message = from_json<Message>(value);
  if (!message) {
    check(message.error().code == protocol::RpcErrorCode::InvalidParams && !message.error().message.empty());
    return;
  }
  const nlohmann::json written = protocol::to_json(message.value());
  const auto again = from_json<Message>(written);
  check(again.has_value() && protocol::to_json(again.value()) == written);
  check(nlohmann::json::accept(protocol::notification_text("m", written)));
}

}  // namespace

/// Any text as a message of a client.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto message = protocol::incoming_message(text);
  if (const auto* refused = std::get_if<protocol::RefusedMessage>(&message)) {
    check(nlohmann::json::accept(protocol::error_text(refused->id, refused->error)));
    return 0;
  }
  const auto& incoming = std::get<protocol::IncomingMessage>(message);
  check(nlohmann::json::parse(text, nullptr, false).at("method") == incoming.method);
  if (incoming.id) check(nlohmann::json::accept(protocol::result_text(*incoming.id, incoming.params)));
  pass<protocol::FusionChange>(incoming.params);
  pass<protocol::FusionReply>(incoming.params);
  pass<protocol::QualityChange>(incoming.params);
  pass<protocol::QualityState>(incoming.params);
  pass<protocol::SubscribeRequest>(incoming.params);
  pass<protocol::CameraSet>(incoming.params);
  pass<protocol::StreamAck>(incoming.params);
  pass<protocol::StreamStats>(incoming.params);
  pass<protocol::HistogramRequest>(incoming.params);
  pass<protocol::HistogramReply>(incoming.params);
  pass<protocol::ProbeRequest>(incoming.params);
  pass<protocol::ProbeReply>(incoming.params);
  pass<protocol::Hello>(incoming.params);
  return 0;
}
