#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string_view>

#include "protocol/rpc_error.hpp"

namespace spectra::protocol {

/// Reads a message from JSON, strictly: a field that is missing, of the wrong type or out of its range gives
/// InvalidParams, which names the field and what is expected; fields that are not known are ignored. Safe on untrusted
/// input. `path` stands before the names of fields in errors; empty for the params of a request.
/// Specialised for every struct of protocol/messages.
template <class Message>
Result<Message> from_json(const nlohmann::json& value, std::string_view path = {});

}  // namespace spectra::protocol
