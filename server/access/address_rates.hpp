#pragma once

#include <cstddef>
#include <list>
#include <map>
#include <string>

#include "server/access/token_bucket.hpp"

namespace spectra::access {

/// As whom an address counts: one machine has all IPv6 addresses that begin with the same 64 bits.
std::string who_counts(const std::string& address);

/// A bucket of its own for each address. Remembers a bounded number of addresses, those that came last. Not thread-safe.
class AddressRates {
 public:
  AddressRates(double rate_per_s, double burst) : rate_per_s_(rate_per_s), burst_(burst) {}

  /// Good until the next call.
  TokenBucket& of(const std::string& address);

  static constexpr std::size_t kMostAddresses = 4096;

 private:
  struct Entry {
    std::string address;
    TokenBucket bucket;
  };
  const double rate_per_s_;
  const double burst_;
  std::list<Entry> entries_;  ///< The last that came in front.
  std::map<std::string, std::list<Entry>::iterator> by_address_;
};

}  // namespace spectra::access
