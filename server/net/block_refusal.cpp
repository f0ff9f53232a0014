#include "server/net/block_refusal.hpp"

#include <nlohmann/json.hpp>

namespace spectra::net {

HttpReply refused(const BlockRefusal& refusal) {
  nlohmann::json error{{"code", refusal.code}, {"field", refusal.field}, {"reason", refusal.reason}};
  if (!refusal.limits.empty()) error["limits"] = refusal.limits;
  // What is quoted may be no UTF-8.
  const auto text =
      nlohmann::json{{"error", std::move(error)}}.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  auto reply = text_reply(refusal.status, text + "\n", "application/json");
  if (refusal.status == 503) reply.headers.emplace_back("Retry-After", "1");
  return reply;
}

}  // namespace spectra::net
