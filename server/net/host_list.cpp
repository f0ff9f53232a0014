#include "server/net/host_list.hpp"

#include <algorithm>
#include <boost/asio/ip/address.hpp>
#include <cctype>

namespace spectra::net {
namespace {

bool is_port(std::string_view text) {
  return !text.empty() && text.size() <= 5 &&
         std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
}

bool is_name(std::string_view text) {
  return !text.empty() && text.size() <= 253 && std::all_of(text.begin(), text.end(), [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '-' || c == '.' || c == '_';
  });
}

/// One spelling per address: "::0001" and "::1" are the same host, and so are an IPv4 address and its mapped form.
std::string canonical(std::string_view name) {
  std::string text(name);
  if (text.size() > 1 && text.ends_with('.')) text.pop_back();
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  boost::system::error_code error;
  const auto address = boost::asio::ip::make_address(text, error);
  if (error) return text;
  if (address.is_v6() && address.to_v6().is_v4_mapped()) {
    return boost::asio::ip::make_address_v4(boost::asio::ip::v4_mapped, address.to_v6()).to_string();
  }
  return address.to_string();
}

}  // namespace

std::optional<std::string> host_name(std::string_view host) {
  if (host.starts_with('[')) {
    const auto end = host.find(']');
    if (end == std::string_view::npos) return std::nullopt;
    const auto address = host.substr(1, end - 1);
    const auto rest = host.substr(end + 1);
    if (!rest.empty() && !(rest.starts_with(':') && is_port(rest.substr(1)))) return std::nullopt;
    boost::system::error_code error;
    boost::asio::ip::make_address_v6(std::string(address), error);
    if (error) return std::nullopt;
    return canonical(address);
  }
  const auto colon = host.find(':');
  if (colon != std::string_view::npos && !is_port(host.substr(colon + 1))) return std::nullopt;
  const auto name = host.substr(0, colon);
  if (!is_name(name)) return std::nullopt;
  return canonical(name);
}

std::optional<std::string> origin_host_name(std::string_view origin) {
  for (const std::string_view scheme : {"http://", "https://"}) {
    if (origin.starts_with(scheme)) return host_name(origin.substr(scheme.size()));
  }
  return std::nullopt;
}

HostList::HostList() : names_{"localhost", "127.0.0.1", "::1"} {}

bool HostList::add(std::string_view name) {
  boost::system::error_code error;
  boost::asio::ip::make_address_v6(std::string(name), error);
  const auto parsed = error ? host_name(name) : std::optional(canonical(name));
  if (parsed) names_.insert(*parsed);
  return parsed.has_value();
}

void HostList::add_machine(std::string_view name) {
  const auto short_name = name.substr(0, name.find('.'));
  if (short_name.empty()) return;
  add(name);
  add(short_name);
  add(std::string(short_name) + ".local");
}

bool HostList::allows_name(const std::optional<std::string>& name, std::string_view local_address) const {
  return name && (names_.contains(*name) || *name == canonical(local_address));
}

bool HostList::allows_host(std::string_view host, std::string_view local_address) const {
  return allows_name(host_name(host), local_address);
}

bool HostList::allows_origin(std::string_view origin, std::string_view local_address) const {
  return allows_name(origin_host_name(origin), local_address);
}

}  // namespace spectra::net
