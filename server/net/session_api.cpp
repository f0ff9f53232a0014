#include "server/net/session_api.hpp"

#include <nlohmann/json.hpp>

#include "server/net/block_refusal.hpp"
#include "server/net/request_right.hpp"

namespace spectra::net {
using nlohmann::json;

namespace {

HttpReply json_reply(unsigned status, const json& body) {
  return text_reply(status, body.dump() + "\n", "application/json");
}

/// The one text field of a small body.
std::optional<std::string> field_of(std::string_view body, const char* name) {
  // A body this small cannot be deep enough to harm.
  const json parsed = json::parse(body, nullptr, false);
  if (!parsed.is_object() || parsed.size() != 1 || !parsed.contains(name) || !parsed[name].is_string())
    return std::nullopt;
  return parsed[name].get<std::string>();
}

HttpReply bad_body(const std::string& wanted) {
  return refused({400, "bad_request", "body", "a JSON object " + wanted + " is wanted", ""});
}

HttpReply not_allowed(const char* methods) {
  auto reply = text_reply(405, std::string("only ") + methods + "\n");
  reply.headers.emplace_back("Allow", methods);
  return reply;
}

}  // namespace

HttpReply access_refusal(const access::AccessControl::Outcome& outcome) {
  if (outcome.identity) {
    return refused(
        {403, "forbidden", "", "that is not for the role " + std::string(to_string(outcome.identity->role)), ""});
  }
  if (outcome.refusal == access::AccessControl::Refusal::TooMany) {
    return refused(
        {429, "too_many_attempts", "", "too many wrong tokens came from this address; wait a few seconds", ""});
  }
  auto reply = refused({401, "unauthorised", "",
                        outcome.refusal == access::AccessControl::Refusal::Wrong
                            ? "that token, cookie or code is not known, or not any more"
                            : "a token is needed: Authorization: Bearer TOKEN, or log in at /login",
                        ""});
  reply.headers.emplace_back("WWW-Authenticate", "Bearer");
  return reply;
}

HttpReply session_reply(access::AccessControl& access, const std::optional<access::AccessControl::Identity>& who,
                        const SessionRequest& request, double now_s) {
  using Method = SessionRequest::Method;
  if (request.path == kCodesPath) {
    if (request.method != Method::Post) return not_allowed("POST");
    const auto name = field_of(request.body, "role");
    const auto role = name ? access::access_role(*name) : std::nullopt;
    if (!role) return bad_body("{\"role\": viewer, operator, ingest or admin}");
    if (!access.needs_token()) return refused({409, "not_needed", "", "this server asks nobody for a token", ""});
    const auto code = access.make_code(who.value_or(access::AccessControl::Identity{}), *role);
    if (!code) return access_refusal({who, access::AccessControl::Refusal::None});
    return json_reply(200, {{"code", *code},
                            {"path", "/login#" + *code},
                            {"seconds", std::chrono::seconds(access::AccessControl::kCodeLifetime).count()}});
  }
  switch (request.method) {
    case Method::Get:
      return json_reply(
          200, {{"needs_token", access.needs_token()}, {"role", who ? json(to_string(who->role)) : json(nullptr)}});
    case Method::Delete: {
      auto reply = json_reply(200, json::object());
      reply.headers.emplace_back("Set-Cookie", access.forgetting_cookie());
      return reply;
    }
    case Method::Post:
      break;
  }
  const auto token = field_of(request.body, "token");
  if (!token) return bad_body("{\"token\": TEXT}");
  if (!access.needs_token()) return refused({409, "not_needed", "", "this server asks nobody for a token", ""});
  const auto login = access.login(*token, request.address, request.is_secure, now_s);
  if (!login.outcome.identity) return access_refusal(login.outcome);
  auto reply = json_reply(200, {{"role", to_string(login.outcome.identity->role)}});
  reply.headers.emplace_back("Set-Cookie", login.set_cookie);
  return reply;
}

}  // namespace spectra::net
