#pragma once

#include <algorithm>

namespace spectra::access {

/// Lets `rate_per_s` things through in the long run and `burst` at once. Time is handed in (seconds of a steady clock).
class TokenBucket {
 public:
  TokenBucket(double rate_per_s, double burst) : rate_per_s_(rate_per_s), burst_(burst), tokens_(burst) {}

  /// Takes so many tokens, at most `burst` of them; false when they are not there.
  bool take(double now_s, double count = 1) {
    refill(now_s);
    count = std::min(count, burst_);
    if (tokens_ < count) return false;
    tokens_ -= count;
    return true;
  }

  /// Takes tokens that may not be there yet; returns the seconds after which they are. Who reserves later waits longer.
  double reserve_s(double now_s, double count = 1) {
    refill(now_s);
    tokens_ -= count;
    return std::max(0.0, -tokens_ / rate_per_s_);
  }

  /// Seconds until take() succeeds; 0 = now.
  double wait_s(double now_s, double count = 1) {
    refill(now_s);
    return std::max(0.0, (std::min(count, burst_) - tokens_) / rate_per_s_);
  }

 private:
  void refill(double now_s) {
    tokens_ = std::min(burst_, tokens_ + std::max(0.0, now_s - last_s_) * rate_per_s_);
    last_s_ = now_s;
  }

  double rate_per_s_;
  double burst_;
  double tokens_;
  double last_s_ = 0;
};

}  // namespace spectra::access
