#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>

#include "server/access/access_control.hpp"
#include "server/net/host_list.hpp"
#include "server/net/request_target.hpp"
#include "server/net/session_api.hpp"

namespace {

using namespace spectra;

constexpr std::string_view kToken = "spectra_operator_AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA";

void check(bool holds) {
  if (!holds) std::abort();
}

bool has(std::string_view text, std::string_view part) {
  return text.find(part) != std::string_view::npos;
}

void check_target(std::string_view text) {
  const auto target = net::parsed_target(text);
  if (!target) return;
  check(target->path.starts_with('/') && !has(target->path, "//") && !has(target->path, "/../") &&
        !has(target->path, "/./") && !target->path.ends_with("/..") && !has(target->path, "\\"));
  const auto again = net::parsed_target('/' + net::target_text(target->path.substr(1), target->query));
  check(again && again->path == target->path && again->query == target->query);
}

void check_hosts(std::string_view host, std::string_view origin) {
  net::HostList hosts;
  hosts.add("robot");
  const auto name = net::host_name(host);
  check(!hosts.allows_host(host, "10.0.0.1") || (name && !name->empty()));
  // Nothing is let in but what is on the list, whatever stands around it.
  constexpr std::array kNames{std::string_view("robot"), std::string_view("localhost"), std::string_view("127.0.0.1"),
                              std::string_view("::1"), std::string_view("10.0.0.1")};
  const auto is_listed = [&kNames](const std::optional<std::string>& found) {
    for (const auto one : kNames) {
      if (found == one) return true;
    }
    return false;
  };
  check(hosts.allows_host(host, "10.0.0.1") == is_listed(name));
  check(hosts.allows_origin(origin, "10.0.0.1") == is_listed(net::origin_host_name(origin)));
}

}  // namespace

/// Lines: target, Host, Origin, Authorization, Cookie, method, body of a request.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string_view rest(reinterpret_cast<const char*>(data), size);
  std::array<std::string_view, 7> fields;
  for (auto& field : fields) {
    const auto end = std::min(rest.find('\n'), rest.size());
    field = rest.substr(0, end);
    rest.remove_prefix(std::min(rest.size(), end + 1));
  }
  const auto& [target, host, origin, authorization, cookie, method, body] = fields;
  check_target(target);
  check_hosts(host, origin);

  access::AccessControl access(
      {{{"bridge", access::AccessRole::Operator, access::digest_of(kToken)}}, std::string(43, 's')}, "spectra_8080",
      [] { return std::chrono::sys_seconds(std::chrono::seconds(1'800'000'000)); });
  static const std::string kCookie = [] {
    access::AccessControl maker(
        {{{"bridge", access::AccessRole::Operator, access::digest_of(kToken)}}, std::string(43, 's')}, "spectra_8080",
        [] { return std::chrono::sys_seconds(std::chrono::seconds(1'800'000'000)); });
    const std::string set = maker.login(kToken, "a", false, 0).set_cookie;
    return set.substr(0, set.find(';'));
  }();
  const auto who = access.identify(authorization, cookie, "10.0.0.9", false, 0);
  check(!who.identity || has(authorization, kToken) || has(cookie, kCookie));
  net::SessionRequest request{.path = "/api/v1/session", .body = body, .address = "10.0.0.9"};
  request.method = method == "POST"     ? net::SessionRequest::Method::Post
                   : method == "DELETE" ? net::SessionRequest::Method::Delete
                                        : net::SessionRequest::Method::Get;
  const auto reply = net::session_reply(access, who.identity, request, 1);
  check(reply.status >= 200 && reply.status < 500);
  for (const auto& [name, value] : reply.headers) {
    check(!has(value, "\n") && !has(value, "\r") && !has(value, kToken));
    // Only who shows the token is given a cookie.
    check(name != "Set-Cookie" || request.method != net::SessionRequest::Method::Post || reply.status >= 400 ||
          has(body, kToken));
  }
  return 0;
}
