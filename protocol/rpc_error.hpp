#pragma once

#include <boost/outcome/basic_result.hpp>
#include <boost/outcome/policy/throw_bad_result_access.hpp>
#include <boost/outcome/try.hpp>
#include <string>
#include <utility>

namespace spectra::protocol {

/// JSON-RPC error codes of the wire (docs/protocol.md); never reused.
enum class RpcErrorCode : int {
  ParseError = -32700,
  InvalidRequest = -32600,
  MethodNotFound = -32601,
  InvalidParams = -32602,
  InternalError = -32603,
  Unauthorised = -32001,
  Forbidden = -32002,
  Busy = -32003,
  NoScene = -32004,
};

/// A refusal as it goes over the wire: error.data = {field, reason, limits?}.
struct RpcError {
  RpcErrorCode code = RpcErrorCode::InternalError;
  std::string message;
  std::string field;   ///< Path of what is wrong, for example "params.alpha"; empty when it is the message itself.
  std::string limits;  ///< What would be accepted, for a person; may be empty.
};

template <class T>
using Result = BOOST_OUTCOME_V2_NAMESPACE::basic_result<
    T, RpcError, BOOST_OUTCOME_V2_NAMESPACE::policy::throw_bad_result_access<RpcError, void>>;

inline auto refusal(RpcErrorCode code, std::string message, std::string field = {}, std::string limits = {}) {
  return BOOST_OUTCOME_V2_NAMESPACE::failure(RpcError{code, std::move(message), std::move(field), std::move(limits)});
}

inline auto success() {
  return BOOST_OUTCOME_V2_NAMESPACE::success();
}

}  // namespace spectra::protocol
