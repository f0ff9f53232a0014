#include "server/sources/sender_clock.hpp"

#include <algorithm>
#include <cmath>

namespace spectra::sources {

void SenderClock::begin_sender() {
  if (shift_s_) last_shift_s_ = *shift_s_;
  shift_s_.reset();
  stray_s_.reset();
  strays_in_row_ = 0;
}

double SenderClock::on_own_clock(double stamp_s) const {
  if (shift_s_) return stamp_s + *shift_s_;
  return newest_s_ && stamp_s < *newest_s_ ? *newest_s_ + kNewClockGapS : stamp_s;
}

bool SenderClock::is_believed(double stamp_s) {
  const bool goes_on = stray_s_ && stamp_s >= *stray_s_ && stamp_s - *stray_s_ <= kFarS;
  strays_in_row_ = goes_on ? strays_in_row_ + 1 : 1;
  stray_s_ = stamp_s;
  return strays_in_row_ >= kBelieved;
}

SenderClock::Verdict SenderClock::look(double stamp_s, double now_s, bool may_jump) {
  if (!(std::abs(stamp_s) < kLargestStampS)) return Verdict::NotInSeconds;
  // The first of a sender may be anything.
  if (!shift_s_ || !newest_s_) return Verdict::Taken;
  const double ahead_s = on_own_clock(stamp_s) - *newest_s_;
  if (ahead_s < -kFarS && is_believed(stamp_s)) {
    begin_sender();
    return Verdict::BegunAnew;
  }
  // Whoever was silent for a while has stamps as much later.
  if (!may_jump && ahead_s > kFarS + (now_s - accepted_at_s_) && !is_believed(stamp_s)) return Verdict::Ahead;
  return Verdict::Taken;
}

void SenderClock::accept(double stamp_s, double now_s) {
  const double time_s = on_own_clock(stamp_s);
  if (!shift_s_) shift_s_ = time_s - stamp_s;
  newest_s_ = std::max(newest_s_.value_or(time_s), time_s);
  accepted_at_s_ = now_s;
  stray_s_.reset();
  strays_in_row_ = 0;
}

}  // namespace spectra::sources
