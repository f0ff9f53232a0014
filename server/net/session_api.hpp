#pragma once

#include <string>
#include <string_view>

#include "server/access/access_control.hpp"
#include "server/net/http_types.hpp"

namespace spectra::net {

/// What the paths below kSessionPath do: say who one is, log in, log out, and let others in.
struct SessionRequest {
  std::string_view path;
  enum class Method { Get, Post, Delete } method = Method::Get;
  std::string_view body;
  std::string address;  ///< Of the peer.
  bool is_secure = false;
};

/// docs/protocol.md, "Who may". `who` is as whom the request came, if as anybody.
HttpReply session_reply(access::AccessControl& access, const std::optional<access::AccessControl::Identity>& who,
                        const SessionRequest& request, double now_s);

/// Why somebody who has not the right to something is refused.
HttpReply access_refusal(const access::AccessControl::Outcome& outcome);

}  // namespace spectra::net
