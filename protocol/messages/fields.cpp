#include "protocol/messages/fields.hpp"

#include <regex>

namespace spectra::protocol {

bool matches(const std::string& text, const char* pattern) {
  return std::regex_match(text, std::regex(pattern));
}

}  // namespace spectra::protocol
