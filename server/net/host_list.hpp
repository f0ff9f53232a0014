#pragma once

#include <optional>
#include <set>
#include <string>
#include <string_view>

namespace spectra::net {

/// The name part of a `Host` value ("localhost:8080", "[::1]:80", "10.0.0.7"): lower case, IPv6 without brackets, no
/// port, no dot at the end. Nothing when the text is no host with an optional port. Safe on untrusted input.
std::optional<std::string> host_name(std::string_view host);

/// The same for an `Origin` value ("http://robot:8080"); nothing for "null" and for schemes other than http and https.
std::optional<std::string> origin_host_name(std::string_view origin);

/// The names this server answers to. A page of another site that was given our address (DNS rebinding) carries its own
/// name in Host and Origin alike, so only a list of names tells it apart.
class HostList {
 public:
  /// Starts with the loopback names.
  HostList();

  /// A name or address, as a person writes it (a port is ignored); false when it is none.
  bool add(std::string_view name);

  /// The machine's own name, as gethostname() has it: whole, up to its first dot, and that with ".local", as which it is found
  /// on a link without name servers. What is no name is left out.
  void add_machine(std::string_view name);

  /// True when the value of a Host header names one of the list, or `local_address`, the address that the connection
  /// arrived at.
  bool allows_host(std::string_view host, std::string_view local_address) const;

  /// The same for an Origin header.
  bool allows_origin(std::string_view origin, std::string_view local_address) const;

 private:
  bool allows_name(const std::optional<std::string>& name, std::string_view local_address) const;
  std::set<std::string, std::less<>> names_;
};

}  // namespace spectra::net
