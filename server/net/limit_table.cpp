#include "server/net/limit_table.hpp"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <variant>

namespace spectra::net {
namespace {

enum class Unit { Count, Bytes, Seconds, PerSecond, BytesPerSecond };

struct Entry {
  std::string_view name;
  Unit unit;
  std::variant<std::uint64_t NetLimits::*, double NetLimits::*, std::chrono::milliseconds NetLimits::*> member;
  double least;
  double most;
  std::string_view help;
};

constexpr double kKilo = 1e3, kMega = 1e6, kGiga = 1e9;

constexpr std::array kEntries{
    Entry{"connections", Unit::Count, &NetLimits::max_connections, 1, 1e6,
          "connections in all; further ones are closed"},
    Entry{"connections-per-address", Unit::Count, &NetLimits::connections_per_address, 1, 1e6,
          "connections from one address (of IPv6: from a network of 64 bits); further ones are closed"},
    Entry{"header-bytes", Unit::Bytes, &NetLimits::header_size_bytes, 512, kMega, "header of a request: 431"},
    Entry{"body-bytes", Unit::Bytes, &NetLimits::body_size_bytes, 1024, kGiga,
          "body of a request that has none to have: 413"},
    Entry{"block-bytes", Unit::Bytes, &NetLimits::block_size_bytes, 1024, 4 * kGiga, "one block of the map: 413"},
    Entry{"block-bytes-at-once", Unit::Bytes, &NetLimits::block_bytes_at_once, 1024, 64 * kGiga,
          "all blocks that are being received or answered: 503, or the stream waits"},
    Entry{"block-bytes-per-second", Unit::BytesPerSecond, &NetLimits::block_bytes_per_s, 1024, 100 * kGiga,
          "bodies of blocks (PUT) from one address; then they are read more slowly"},
    Entry{"senders", Unit::Count, &NetLimits::ingest_sessions, 0, 1e4, "streams of blocks at a time: 503"},
    Entry{"credit-blocks", Unit::Count, &NetLimits::ingest_credit_blocks, 1, 1e6,
          "blocks of a stream that wait for their answers: 4001"},
    Entry{"credit-bytes", Unit::Bytes, &NetLimits::ingest_credit_bytes, 1024, 64 * kGiga, "their bytes: 4001"},
    Entry{"message-bytes", Unit::Bytes, &NetLimits::message_size_bytes, 1024, 16 * kMega,
          "one message of a viewer: 1009"},
    Entry{"queue-bytes", Unit::Bytes, &NetLimits::control_queue_bytes, 64 * 1024, kGiga,
          "messages that wait for one viewer: 1008"},
    Entry{"queue-bytes-at-once", Unit::Bytes, &NetLimits::queue_bytes_at_once, kMega, 64 * kGiga,
          "messages that wait for all viewers together, and answers that are being made; beyond it whoever leaves most "
          "of "
          "them unread is cut (1008), or refused as busy if he asks for more himself"},
    Entry{"messages-per-second", Unit::PerSecond, &NetLimits::messages_per_s, 1, 1e6,
          "messages of one viewer; then they are read more slowly"},
    Entry{"message-bytes-per-second", Unit::BytesPerSecond, &NetLimits::message_bytes_per_s, 1024, kGiga,
          "their bytes; likewise"},
    Entry{"requests-per-second", Unit::PerSecond, &NetLimits::requests_per_s, 1, 1e6,
          "requests of one viewer: refused as busy"},
    Entry{"http-requests-per-second", Unit::PerSecond, &NetLimits::http_requests_per_s, 1, 1e6,
          "requests over HTTP of one address; then they are read more slowly"},
    Entry{"json-depth", Unit::Count, &NetLimits::json_depth, 8, 256,
          "objects and arrays in each other, in a viewer's message: refused (-32700)"},
    Entry{"json-elements", Unit::Count, &NetLimits::json_elements, 100, 1e6,
          "values in it, of every kind: refused (-32700)"},
    Entry{"exports", Unit::Count, &NetLimits::exports_at_once, 1, 64, "whole files that are being made: 503"},
    Entry{"export-bytes", Unit::Bytes, &NetLimits::export_bytes, kMega, 64 * kGiga,
          "whole files that are being sent, together; beyond it none is made: 503"},
    Entry{"cache-bytes", Unit::Bytes, &NetLimits::cache_bytes, kMega, 64 * kGiga,
          "encoded frames that are kept for further viewers; beyond it the oldest go"},
    Entry{"scene-bytes", Unit::Bytes, &NetLimits::scene_bytes, kMega, 1024 * kGiga,
          "the scene, counted as 100 bytes a vertex and 70 a triangle: a block is refused (507), a file not served"},
    Entry{"descriptors", Unit::Count, &NetLimits::descriptors, 64, 1e9,
          "files and connections that are open; where the system gives fewer, those"},
    Entry{"header-seconds", Unit::Seconds, &NetLimits::header_timeout, 0.1, 3600,
          "until a request is complete, and the handshake before the first"},
    Entry{"body-seconds", Unit::Seconds, &NetLimits::body_timeout, 0.1, 3600,
          "for which the body of a block may stand still"},
    Entry{"write-seconds", Unit::Seconds, &NetLimits::write_timeout, 0.1, 3600,
          "for which a write may stand still; then the connection is cut"},
    Entry{"pong-seconds", Unit::Seconds, &NetLimits::pong_timeout, 0.1, 3600,
          "for which a viewer may read nothing and answer no ping; likewise"},
    Entry{"idle-seconds", Unit::Seconds, &NetLimits::idle_timeout, 1, 1e6,
          "for which nothing may move on a viewer's connection; likewise"},
    Entry{"download-bytes-per-second", Unit::BytesPerSecond, &NetLimits::download_bytes_per_s, 0, kGiga,
          "that a long answer must move at; else it is cut"},
    Entry{"download-patience-seconds", Unit::Seconds, &NetLimits::download_patience, 1, 1e6, "before that counts"},
};

double value_of(const Entry& entry, const NetLimits& limits) {
  return std::visit(
      [&limits](auto member) {
        if constexpr (std::is_same_v<decltype(member), std::chrono::milliseconds NetLimits::*>) {
          return std::chrono::duration<double>(limits.*member).count();
        } else {
          return static_cast<double>(limits.*member);
        }
      },
      entry.member);
}

void set_value(const Entry& entry, NetLimits& limits, double value) {
  std::visit(
      [&limits, value](auto member) {
        if constexpr (std::is_same_v<decltype(member), std::chrono::milliseconds NetLimits::*>) {
          limits.*member = std::chrono::milliseconds(std::llround(1000 * value));
        } else if constexpr (std::is_same_v<decltype(member), double NetLimits::*>) {
          limits.*member = value;
        } else {
          limits.*member = static_cast<std::uint64_t>(value);
        }
      },
      entry.member);
}

std::string bytes_text(double bytes) {
  for (const auto& [size, name] : {std::pair{kGiga, "GB"}, std::pair{kMega, "MB"}, std::pair{kKilo, "kB"}}) {
    if (bytes >= size) return fmt::format("{:.4g} {}", bytes / size, name);
  }
  return fmt::format("{:g} bytes", bytes);
}

std::string text_of(const Entry& entry, double value) {
  switch (entry.unit) {
    case Unit::Bytes:
      return bytes_text(value);
    case Unit::BytesPerSecond:
      return bytes_text(value) + "/s";
    case Unit::Seconds:
      return fmt::format("{:g} s", value);
    case Unit::PerSecond:
      return fmt::format("{:g}/s", value);
    case Unit::Count:
      break;
  }
  return fmt::format("{:g}", value);
}

/// A number, with kB, MB or GB behind it where bytes are meant.
std::optional<double> parsed(std::string_view text, Unit unit) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || !std::isfinite(value)) return std::nullopt;
  const std::string_view behind(end, static_cast<std::size_t>(text.data() + text.size() - end));
  if (behind.empty()) return value;
  if (unit != Unit::Bytes && unit != Unit::BytesPerSecond) return std::nullopt;
  if (behind == "kB") return kKilo * value;
  if (behind == "MB") return kMega * value;
  if (behind == "GB") return kGiga * value;
  return std::nullopt;
}

}  // namespace

std::vector<LimitLine> limit_lines(const NetLimits& limits) {
  std::vector<LimitLine> lines;
  for (const Entry& entry : kEntries) {
    lines.push_back({std::string(entry.name), text_of(entry, value_of(entry, limits)), std::string(entry.help)});
  }
  return lines;
}

std::optional<std::string> set_limit(NetLimits& limits, std::string_view text) {
  const auto equals = text.find('=');
  const std::string_view name = text.substr(0, equals);
  for (const Entry& entry : kEntries) {
    if (entry.name != name) continue;
    const auto value = equals == std::string_view::npos ? std::nullopt : parsed(text.substr(equals + 1), entry.unit);
    if (value && *value >= entry.least && *value <= entry.most &&
        (entry.unit == Unit::Seconds || !std::holds_alternative<std::uint64_t NetLimits::*>(entry.member) ||
         *value == std::floor(*value))) {
      set_value(entry, limits, *value);
      return std::nullopt;
    }
    return fmt::format("{}: {}=VALUE is wanted, from {} to {}", text, entry.name, text_of(entry, entry.least),
                       text_of(entry, entry.most));
  }
  std::string names;
  for (const Entry& entry : kEntries) names += (names.empty() ? "" : ", ") + std::string(entry.name);
  return fmt::format("{}: there is no such limit; there are {}", text, names);
}

}  // namespace spectra::net
