#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string_view>

#include "protocol/rpc_error.hpp"

namespace spectra::protocol {

/// How a message is read and written; defined for every struct of protocol/messages, beside its fields.
template <class Message>
struct Wire {
  static Result<Message> read(const nlohmann::json& value, std::string_view path);
  static nlohmann::json written(const Message& message);
};

/// Reads a message from JSON, strictly: a field that is missing, of the wrong type or out of its range gives
/// InvalidParams, which names the field and what is expected; fields that are not known are ignored. Safe on untrusted
/// input. `path` stands before the names of fields in errors; empty for the params of a request.
template <class Message>
Result<Message> from_json(const nlohmann::json& value, std::string_view path = {}) {
  return Wire<Message>::read(value, path);
}

/// The message as a nlohmann::json (a type that need not be known where nobody calls this).
template <class Message>
auto to_json(const Message& message) {
  return Wire<Message>::written(message);
}

}  // namespace spectra::protocol
