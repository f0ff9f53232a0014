#include "fusion/mesh/ply_values.hpp"

#include <array>
#include <charconv>
#include <cstdlib>
#include <system_error>

namespace spectra::fusion {

namespace {

std::string_view without_plus(std::string_view token) {
  const bool has_plus = token.size() > 1 && token[0] == '+' && token[1] != '-' && token[1] != '+';
  return has_plus ? token.substr(1) : token;
}

}  // namespace

std::string number_text(double value) {
  std::array<char, 32> text;
  const auto [end, status] = std::to_chars(text.data(), text.data() + text.size(), value);
  return {text.data(), end};
}

std::optional<double> parse_number(std::string_view token) {
  token = without_plus(token);
  const char* const end = token.data() + token.size();
  double value = 0;
  const auto [stop, status] = std::from_chars(token.data(), end, value);
  if (status == std::errc::invalid_argument || stop != end) return std::nullopt;
  // from_chars does not say whether the value was too large or too small.
  if (status == std::errc::result_out_of_range) return std::strtod(std::string(token).c_str(), nullptr);
  return value;
}

std::optional<std::int64_t> parse_whole_number(std::string_view token) {
  token = without_plus(token);
  const char* const end = token.data() + token.size();
  std::int64_t value = 0;
  const auto [stop, status] = std::from_chars(token.data(), end, value);
  if (status != std::errc{} || stop != end) return std::nullopt;
  return value;
}

}  // namespace spectra::fusion
