#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace spectra::net {

/// The pings of one WebSocket connection. There is one at a time, from the beginning of its writing to its answer, and only a
/// pong with its payload is that answer: pongs that nobody asked for say nothing. Knows no clock; of one strand.
class PingWatch {
 public:
  using Clock = std::chrono::steady_clock;

  explicit PingWatch(Clock::time_point begin) : last_begin_(begin) {}

  /// The payload of the ping that is to be written now; nothing while one is out, or before the interval has passed since the last.
  std::optional<std::string> next(Clock::time_point now, Clock::duration interval) {
    if (is_out() || now - last_begin_ < interval) return std::nullopt;
    last_begin_ = now;
    is_being_written_ = is_unanswered_ = true;
    return std::to_string(++number_);
  }

  /// The ping has been written, or cannot be.
  void written() { is_being_written_ = false; }

  /// A pong has come: how long after its ping, if it answers that.
  std::optional<Clock::duration> answered(std::string_view payload, Clock::time_point now) {
    if (!is_unanswered_ || payload != std::to_string(number_)) return std::nullopt;
    is_unanswered_ = false;
    return now - last_begin_;
  }

  bool is_out() const { return is_being_written_ || is_unanswered_; }

 private:
  Clock::time_point last_begin_;
  std::uint64_t number_ = 0;
  bool is_being_written_ = false;
  bool is_unanswered_ = false;
};

}  // namespace spectra::net
