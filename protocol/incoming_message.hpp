#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <variant>

#include "protocol/jsonrpc.hpp"

namespace spectra::protocol {

/// A message of a client: a request when it has an id, else a notification. `params` is an object (empty when absent).
struct IncomingMessage : RpcRequest {
  nlohmann::json params;
};

/// A text that is no message for us: what to answer, and to which id as far as one could be made out.
struct RefusedMessage {
  std::optional<RpcId> id;
  RpcError error;
};

/// Reads one text message. Safe on untrusted input. Refusals: ParseError (not JSON within the limits), InvalidRequest (no
/// object, a batch, wrong `jsonrpc`, an id that is neither string nor integer, no method), InvalidParams (`params` that
/// is no object). Unknown members are ignored.
std::variant<IncomingMessage, RefusedMessage> incoming_message(std::string_view text, const JsonLimits& limits = {});

}  // namespace spectra::protocol
