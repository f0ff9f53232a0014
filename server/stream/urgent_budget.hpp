#pragma once

#include <algorithm>
#include <chrono>

namespace spectra::stream {

/// How much one viewer may have computed before others: what is coarse goes first, over all viewers, so that everybody has a picture
/// soon; but who asks for coarse pictures without end would leave nothing for others. Beyond it his jobs take turns with theirs.
class UrgentBudget {
 public:
  using Clock = std::chrono::steady_clock;

  static constexpr double kShare = 0.2;  ///< Of a processor, in the long run.
  static constexpr double kBurst_s = 0.5;

  bool is_left(Clock::time_point now) {
    refill(now);
    return spent_s_ < kBurst_s;
  }

  void spend(Clock::duration time, Clock::time_point now) {
    refill(now);
    // What is far beyond it is forgotten after some seconds all the same.
    spent_s_ = std::min(2 * kBurst_s, spent_s_ + std::chrono::duration<double>(time).count());
  }

 private:
  void refill(Clock::time_point now) {
    spent_s_ = std::max(0.0, spent_s_ - kShare * std::chrono::duration<double>(now - last_).count());
    last_ = now;
  }

  double spent_s_ = 0;
  Clock::time_point last_ = Clock::now();
};

}  // namespace spectra::stream
