#include "server/net/interface_addresses.hpp"

#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <iterator>

namespace spectra::net {
namespace asio = boost::asio;

std::vector<asio::ip::address> interface_addresses(bool with_v6) {
  std::vector<asio::ip::address> addresses;
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) return addresses;
  for (const bool loopback : {true, false}) {
    for (const ifaddrs* entry = list; entry != nullptr; entry = entry->ifa_next) {
      if (entry->ifa_addr == nullptr || (entry->ifa_flags & IFF_UP) == 0) continue;
      if (((entry->ifa_flags & IFF_LOOPBACK) != 0) != loopback) continue;
      const void* raw = entry->ifa_addr;
      if (entry->ifa_addr->sa_family == AF_INET) {
        addresses.push_back(asio::ip::address_v4(ntohl(static_cast<const sockaddr_in*>(raw)->sin_addr.s_addr)));
      } else if (entry->ifa_addr->sa_family == AF_INET6 && with_v6) {
        asio::ip::address_v6::bytes_type bytes;
        const auto& from = static_cast<const sockaddr_in6*>(raw)->sin6_addr.s6_addr;
        std::copy(std::begin(from), std::end(from), bytes.begin());
        const asio::ip::address_v6 address(bytes);
        if (!address.is_link_local()) addresses.push_back(address);
      }
    }
  }
  freeifaddrs(list);
  return addresses;
}

}  // namespace spectra::net
