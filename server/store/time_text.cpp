#include "server/store/time_text.hpp"

#include <charconv>
#include <chrono>
#include <cmath>
#include <ctime>

namespace spectra::store {
namespace {

constexpr double kLastSecond = 253'402'300'799;  // Of the year 9999.

std::optional<double> number_of(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// Seconds east of UTC.
std::optional<int> offset_of(std::string_view zone) {
  if (zone == "Z" || zone == "z") return 0;
  const auto digit = [zone](std::size_t i) { return zone[i] >= '0' && zone[i] <= '9' ? zone[i] - '0' : -100; };
  if (zone.size() != 6 || (zone[0] != '+' && zone[0] != '-') || zone[3] != ':') return std::nullopt;
  const int hours = digit(1) * 10 + digit(2), minutes = digit(4) * 10 + digit(5);
  if (hours < 0 || hours > 23 || minutes < 0 || minutes > 59) return std::nullopt;
  return (zone[0] == '-' ? -60 : 60) * (hours * 60 + minutes);
}

std::optional<double> seconds_of_date(std::string text) {
  constexpr std::size_t kToSeconds = 19;  // 2026-01-31T12:34:56
  if (text.size() <= kToSeconds) return std::nullopt;
  if (text[10] == ' ' || text[10] == 't') text[10] = 'T';
  const std::string_view rest = std::string_view(text).substr(kToSeconds);
  const std::string date = text.substr(0, kToSeconds);
  std::tm parts{};
  const char* end = strptime(date.c_str(), "%Y-%m-%dT%H:%M:%S", &parts);
  if (end == nullptr || *end != '\0') return std::nullopt;
  const std::time_t whole = timegm(&parts);
  // There is no 30th of February.
  std::string again(32, '\0');
  again.resize(std::strftime(again.data(), again.size(), "%Y-%m-%dT%H:%M:%S", &parts));
  if (again != date) return std::nullopt;
  const std::size_t zone_at = rest.find_first_of("Zz+-");
  if (zone_at == std::string_view::npos) return std::nullopt;
  const auto offset = offset_of(rest.substr(zone_at));
  if (!offset) return std::nullopt;
  double fraction = 0;
  if (zone_at > 0) {
    if (rest[0] != '.' || zone_at == 1 || rest.find_first_not_of("0123456789", 1) != zone_at) return std::nullopt;
    const auto value = number_of("0" + std::string(rest.substr(0, zone_at)));
    if (!value) return std::nullopt;
    fraction = *value;
  }
  return static_cast<double>(whole - *offset) + fraction;
}

}  // namespace

std::optional<StoreTime> time_of(std::string_view text) {
  auto seconds = number_of(text);
  if (!seconds) seconds = seconds_of_date(std::string(text));
  if (!seconds || !(*seconds >= 0) || !(*seconds < kLastSecond + 1)) return std::nullopt;
  return StoreTime(std::chrono::microseconds(static_cast<std::int64_t>(std::floor(*seconds * 1e6))));
}

std::string utc_text(StoreTime time) {
  const std::time_t seconds = std::chrono::floor<std::chrono::seconds>(time).time_since_epoch().count();
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  std::string text(32, '\0');
  text.resize(std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &parts));
  return text;
}

}  // namespace spectra::store
