#pragma once

#include <utility>

#include "protocol/rpc_error.hpp"

namespace spectra::session {

/// The error side of an answer.
inline auto refused(protocol::RpcError error) {
  return BOOST_OUTCOME_V2_NAMESPACE::failure(std::move(error));
}

inline auto no_scene() {
  return protocol::refusal(protocol::RpcErrorCode::NoScene, "there is no scene yet");
}

}  // namespace spectra::session
