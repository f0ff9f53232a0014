#include "fusion/files/ply_values.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <system_error>

namespace spectra::files {

namespace {

std::string_view without_plus(std::string_view token) {
  const bool has_plus = token.size() > 1 && token[0] == '+' && token[1] != '-' && token[1] != '+';
  return has_plus ? token.substr(1) : token;
}

/// What C++ does not call a number, but programs write for one.
std::optional<double> unusual_number(std::string_view token) {
  constexpr std::size_t kMaxLength = 64;
  if (token.size() > kMaxLength) return std::nullopt;
  std::string text(token);
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  const bool is_negative = text[0] == '-';
  std::string_view word = text;
  if (word[0] == '-' || word[0] == '+') word.remove_prefix(1);
  if (word.starts_with("1.#inf")) {
    const double infinity = std::numeric_limits<double>::infinity();
    return is_negative ? -infinity : infinity;
  }
  constexpr std::array<std::string_view, 8> kNanBeginnings = {"nan",    "1.#qnan", "1.#snan", "1.#ind",
                                                              "1.#nan", "1.#qo",   "1.#j",    "#n/a"};
  constexpr std::array<std::string_view, 17> kNanWords = {
      "null",      "(null)",  "<null>",  "none",   "na",    "n/a",  "<na>", "nil", "undef",
      "undefined", "missing", "no_data", "nodata", "#qnan", "#nan", "*",    "?"};
  if (text.find_first_not_of('-') == std::string::npos) return std::numeric_limits<double>::quiet_NaN();
  if (std::any_of(kNanBeginnings.begin(), kNanBeginnings.end(),
                  [word](std::string_view beginning) { return word.starts_with(beginning); }) ||
      std::find(kNanWords.begin(), kNanWords.end(), word) != kNanWords.end() || word == "qnan" || word == "snan") {
    return std::numeric_limits<double>::quiet_NaN();
  }
  const std::size_t exponent = text.find_first_of("dq");
  if (exponent == std::string::npos || exponent == 0) return std::nullopt;
  text[exponent] = 'e';
  double value = 0;
  const auto [stop, status] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (status == std::errc::invalid_argument || stop != text.data() + text.size()) return std::nullopt;
  if (status == std::errc::result_out_of_range) return std::strtod(text.c_str(), nullptr);
  return value;
}

}  // namespace

std::string number_text(double value) {
  std::array<char, 32> text;
  const auto [end, status] = std::to_chars(text.data(), text.data() + text.size(), value);
  return {text.data(), end};
}

std::string short_number(double value, int digits) {
  std::array<char, 32> text;
  const auto [end, status] =
      std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::general, digits);
  return {text.data(), end};
}

std::string value_text(double value, PlyScalar type) {
  if (type == PlyScalar::Float64) return number_text(value);
  std::array<char, 32> text;
  const bool is_float = type == PlyScalar::Float32 && std::abs(value) <= double{std::numeric_limits<float>::max()};
  const auto [end, status] = is_float ? std::to_chars(text.data(), text.data() + text.size(), static_cast<float>(value))
                                      : std::to_chars(text.data(), text.data() + text.size(), value);
  return {text.data(), end};
}

std::optional<double> parse_number(std::string_view token) {
  token = without_plus(token);
  const char* const end = token.data() + token.size();
  double value = 0;
  const auto [stop, status] = std::from_chars(token.data(), end, value);
  if (status == std::errc::invalid_argument || stop != end) return unusual_number(token);
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

}  // namespace spectra::files
