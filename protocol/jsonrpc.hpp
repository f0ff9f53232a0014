#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "protocol/rpc_error.hpp"

namespace spectra::protocol {

/// Bounds on what a client may say; checked before anything is built from the text.
struct JsonLimits {
  std::size_t max_size_bytes = 64 * 1024;
  int max_depth = 16;                 ///< Nested objects and arrays.
  std::size_t max_elements = 10'000;  ///< Values of every kind, containers included.
};

/// Parses untrusted text within the limits: no exceptions, no recursion, duplicate keys refused, numbers finite, UTF-8
/// only. Bombs are refused while they are read. ParseError otherwise.
Result<nlohmann::json> parsed_json(std::string_view text, const JsonLimits& limits = {});

/// Request id as JSON-RPC allows it: null is not used by us, a string or an integer.
using RpcId = std::variant<std::int64_t, std::string>;

/// A request (with id) or notification (without) from a client. protocol/incoming_message.hpp reads it from text.
struct RpcRequest {
  std::optional<RpcId> id;
  std::string method;
};

/// Texts of the outgoing messages; never throws on content (bad UTF-8 is replaced, numbers that are not finite become
/// null). The text of an error says the refusal's message twice, as error.message and as error.data.reason.
std::string result_text(const RpcId& id, const nlohmann::json& result);
std::string error_text(const std::optional<RpcId>& id, const RpcError& error);
std::string notification_text(std::string_view method, const nlohmann::json& params);

}  // namespace spectra::protocol
