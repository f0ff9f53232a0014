#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/net/request_target.hpp"

namespace spectra::net {

/// The blocks of the map, below which they can be put and deleted.
inline constexpr std::string_view kBlocksPath = "/api/v1/blocks";

/// What a request asks for; HEAD is a Get whose body is left away.
enum class HttpMethod { Get, Put, Delete };

/// A request that has passed every check of the network side, by somebody who may: Put and Delete come under kBlocksPath alone.
struct HttpRequest {
  RequestTarget target;
  std::string if_none_match = {};    ///< Empty when absent.
  std::string accept_encoding = {};  ///< All of them, joined by commas; empty when absent.
  HttpMethod method = HttpMethod::Get;
  std::shared_ptr<const std::string> body = {};  ///< Of a Put.
};

/// An answer; the network side adds length, date and the security headers, and leaves the body away for HEAD.
struct HttpReply {
  unsigned status = 200;
  std::string content_type = "text/plain; charset=utf-8";
  std::shared_ptr<const std::string> body;  ///< Null: empty.
  std::vector<std::pair<std::string, std::string>> headers;
};

/// A reply with a body of its own.
inline HttpReply text_reply(unsigned status, std::string text, std::string content_type = "text/plain; charset=utf-8") {
  return {status, std::move(content_type), std::make_shared<const std::string>(std::move(text)), {}};
}

/// Answers a request by calling `reply` exactly once, now or later, from any thread. Called on an I/O thread, so whatever
/// takes time goes to the worker pool. Dropping `reply` uncalled answers 503.
using HttpHandler = std::function<void(const HttpRequest& request, std::function<void(HttpReply)> reply)>;

}  // namespace spectra::net
