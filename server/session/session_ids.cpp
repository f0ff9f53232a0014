#include "server/session/session_ids.hpp"

#include <random>

namespace spectra::session {
namespace {

/// 16 random hexadecimal digits.
std::string random_digits() {
  std::random_device random;
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string digits;
  for (int word = 0; word < 2; ++word) {
    unsigned bits = random();
    for (int digit = 0; digit < 8; ++digit, bits >>= 4U) digits += kDigits[bits & 15U];
  }
  return digits;
}

}  // namespace

SessionIds::SessionIds() : run_(random_digits()) {}

std::string SessionIds::next() const {
  return run_ + random_digits();
}

bool SessionIds::is_of_this_run(std::string_view session_id) const {
  return session_id.size() == 2 * run_.size() && session_id.starts_with(run_);
}

}  // namespace spectra::session
