#include "server/access/address_rates.hpp"

#include <algorithm>
#include <boost/asio/ip/address.hpp>
#include <cstdint>

namespace spectra::access {

std::string who_counts(const std::string& address) {
  boost::system::error_code error;
  const auto parsed = boost::asio::ip::make_address(address, error);
  if (error || !parsed.is_v6() || parsed.to_v6().is_v4_mapped()) return address;
  auto bytes = parsed.to_v6().to_bytes();
  std::fill(bytes.begin() + 8, bytes.end(), std::uint8_t{0});
  return boost::asio::ip::address_v6(bytes).to_string();
}

TokenBucket& AddressRates::of(const std::string& address) {
  const std::string key = who_counts(address);
  const auto known = by_address_.find(key);
  if (known != by_address_.end()) {
    entries_.splice(entries_.begin(), entries_, known->second);
  } else {
    if (entries_.size() >= kMostAddresses) {
      by_address_.erase(entries_.back().address);
      entries_.pop_back();
    }
    entries_.push_front({key, TokenBucket(rate_per_s_, burst_)});
    by_address_[key] = entries_.begin();
  }
  return entries_.front().bucket;
}

}  // namespace spectra::access
