#include "server/sources/sender_clock.hpp"

#include <algorithm>
#include <cmath>

namespace spectra::sources {

namespace {

/// A link that breaks all the time is not kept account of for ever.
constexpr std::size_t kMostSpans = 256;

}  // namespace

void SenderClock::begin_sender() {
  if (span_) spans_before_.push_back(*span_);
  if (spans_before_.size() > kMostSpans) spans_before_.erase(spans_before_.begin());
  newest_before_s_ = newest_s_;
  forget_sender();
}

void SenderClock::forget_sender() {
  newest_s_ = newest_before_s_;
  span_.reset();
  stray_s_.reset();
  strays_in_row_ = 0;
}

bool SenderClock::has_said_near(double stamp_s) const {
  return span_ && std::abs(stamp_s - span_->last_s) <= kFarS;
}

double SenderClock::on_own_clock(double stamp_s) const {
  if (span_) return stamp_s + span_->shift_s;
  return newest_s_ && stamp_s < *newest_s_ ? *newest_s_ + kNewClockGapS : stamp_s;
}

double SenderClock::moment_of(double stamp_s) const {
  const auto has_said = [&](const Span& span) { return span.first_s <= stamp_s && stamp_s <= span.last_s; };
  if (span_ && has_said(*span_)) return stamp_s + span_->shift_s;
  const auto before = std::find_if(spans_before_.rbegin(), spans_before_.rend(), has_said);
  if (before != spans_before_.rend()) return stamp_s + before->shift_s;
  if (span_) return stamp_s + span_->shift_s;
  return spans_before_.empty() ? stamp_s : stamp_s + spans_before_.back().shift_s;
}

bool SenderClock::is_believed(double stamp_s) {
  const bool goes_on = stray_s_ && stamp_s >= *stray_s_ && stamp_s - *stray_s_ <= kFarS;
  strays_in_row_ = goes_on ? strays_in_row_ + 1 : 1;
  stray_s_ = stamp_s;
  return strays_in_row_ >= kBelieved;
}

SenderClock::Verdict SenderClock::look(double stamp_s, double now_s) {
  if (!(std::abs(stamp_s) < kLargestStampS)) return Verdict::NotInSeconds;
  // The first of a sender may be anything.
  if (!span_ || !newest_s_) return Verdict::Taken;
  const double ahead_s = on_own_clock(stamp_s) - *newest_s_;
  if (ahead_s < -kFarS && is_believed(stamp_s)) {
    begin_sender();
    return Verdict::BegunAnew;
  }
  // Whoever was silent for a while has stamps as much later.
  if (ahead_s > kFarS + (now_s - accepted_at_s_) && !is_believed(stamp_s)) return Verdict::Ahead;
  return Verdict::Taken;
}

void SenderClock::accept(double stamp_s, double now_s) {
  const double time_s = on_own_clock(stamp_s);
  if (!span_) span_ = Span{stamp_s, stamp_s, time_s - stamp_s};
  span_->first_s = std::min(span_->first_s, stamp_s);
  span_->last_s = std::max(span_->last_s, stamp_s);
  newest_s_ = std::max(newest_s_.value_or(time_s), time_s);
  accepted_at_s_ = now_s;
  stray_s_.reset();
  strays_in_row_ = 0;
}

}  // namespace spectra::sources
