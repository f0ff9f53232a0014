#pragma once

#include <boost/asio/ip/address.hpp>
#include <vector>

namespace spectra::net {

/// The addresses of all interfaces that are up, loopback first; link-local IPv6 ones are left out, for no browser takes
/// them without a zone.
std::vector<boost::asio::ip::address> interface_addresses(bool with_v6);

}  // namespace spectra::net
