#include "server/stream/sending_window.hpp"

#include <algorithm>

namespace spectra::stream {
namespace {

constexpr std::uint64_t kRateMemoryRounds = 10;
constexpr double kRateMemory_s = 3;
constexpr double kRoundTripMemory_s = 10;
constexpr double kStartGain = 2;
constexpr double kProbeGain = 1.25;
constexpr double kDrainGain = 0.75;
constexpr std::uint64_t kProbePeriodRounds = 8;
constexpr double kGrowthOfAStart = 1.25;
constexpr int kRoundsToEndAStart = 3;
constexpr std::uint64_t kRoundsToTrustTheRate = 2;
constexpr double kShortestInterval_s = 1e-4;

}  // namespace

void SendingWindow::set_ceiling(std::size_t bytes) {
  ceiling_bytes_ = bytes == 0 ? kDefaultCeilingBytes : std::min(bytes, kDefaultCeilingBytes);
}

std::size_t SendingWindow::size_bytes() const {
  double wanted = kInitialBytes;
  if (!rates_.empty() && !round_trips_.empty()) {
    wanted = gain() * rate_bytes_per_s() * shortest_round_trip_s() + static_cast<double>(largest_frame_bytes_);
    if (round_ < kRoundsToTrustTheRate) wanted = std::max(wanted, static_cast<double>(kInitialBytes));
  }
  wanted = std::max(wanted, static_cast<double>(kFloorBytes));
  return static_cast<std::size_t>(std::min(wanted, static_cast<double>(ceiling_bytes_)));
}

bool SendingWindow::admits(std::size_t size_bytes, Urgency urgency) const {
  std::size_t most_bytes = this->size_bytes();
  if (urgency == Urgency::Detail && is_calm()) most_bytes -= std::min(most_bytes, largest_frame_bytes_);
  return in_flight_bytes_ == 0 || in_flight_bytes_ + size_bytes <= most_bytes;
}

bool SendingWindow::admits_first_picture(std::size_t size_bytes) const {
  return in_flight_bytes_ == 0 || in_flight_bytes_ + size_bytes <= ceiling_bytes_;
}

void SendingWindow::on_sent(std::uint32_t sequence, std::size_t size_bytes, double now_s) {
  if (in_flight_bytes_ == 0) delivered_s_ = now_s;  // The link was empty: time starts to count now.
  sent_.push_back({sequence, size_bytes, now_s, delivered_bytes_, delivered_s_, delivered_bytes_ < idle_until_bytes_});
  in_flight_bytes_ += size_bytes;
  // The largest of recent frames, slowly forgotten.
  largest_frame_bytes_ = std::max(size_bytes, largest_frame_bytes_ - largest_frame_bytes_ / 64);
}

void SendingWindow::on_overtaken() {
  calm_until_bytes_ = delivered_bytes_ + in_flight_bytes_ + 1;
}

void SendingWindow::on_idle() {
  idle_until_bytes_ = delivered_bytes_ + in_flight_bytes_ + 1;
}

bool SendingWindow::on_acknowledged(std::uint32_t sequence, double now_s) {
  if (sent_.empty() || sequence > sent_.back().sequence || sequence < sent_.front().sequence) return false;
  Sent newest = sent_.front();
  while (!sent_.empty() && sent_.front().sequence <= sequence) {
    newest = sent_.front();
    in_flight_bytes_ -= newest.size_bytes;
    delivered_bytes_ += newest.size_bytes;
    sent_.pop_front();
  }
  delivered_s_ = now_s;
  take_rate_sample(newest, now_s);
  take_round_trip_sample(newest, now_s);
  if (newest.delivered_bytes >= round_end_bytes_) end_round();
  return true;
}

double SendingWindow::rate_bytes_per_s() const {
  return rates_.empty() ? 0 : rates_.front().value;
}

void SendingWindow::take_rate_sample(const Sent& sent, double now_s) {
  const double interval_s = std::max({now_s - sent.delivered_s, now_s - sent.sent_s, kShortestInterval_s});
  const double rate = static_cast<double>(delivered_bytes_ - sent.delivered_bytes) / interval_s;
  if (sent.is_idle_sample && rate < rate_bytes_per_s()) return;
  while (!rates_.empty() && rates_.back().value <= rate) rates_.pop_back();
  rates_.push_back({rate, now_s, round_});
  while (rates_.front().round + kRateMemoryRounds < round_ || rates_.front().at_s + kRateMemory_s < now_s) {
    rates_.pop_front();
  }
}

void SendingWindow::take_round_trip_sample(const Sent& sent, double now_s) {
  last_round_trip_s_ = std::max(now_s - sent.sent_s, kShortestInterval_s);
  while (!round_trips_.empty() && round_trips_.back().value >= last_round_trip_s_) round_trips_.pop_back();
  round_trips_.push_back({last_round_trip_s_, now_s, round_});
  while (round_trips_.front().at_s + kRoundTripMemory_s < now_s) round_trips_.pop_front();
}

void SendingWindow::end_round() {
  ++round_;
  round_end_bytes_ = delivered_bytes_;
  if (!is_starting_) return;
  if (rate_bytes_per_s() >= start_rate_ * kGrowthOfAStart) {
    start_rate_ = rate_bytes_per_s();
    rounds_without_growth_ = 0;
  } else if (delivered_bytes_ >= idle_until_bytes_ && ++rounds_without_growth_ >= kRoundsToEndAStart) {
    is_starting_ = false;
  }
}

double SendingWindow::shortest_round_trip_s() const {
  return round_trips_.empty() ? 0 : round_trips_.front().value;
}

bool SendingWindow::is_calm() const {
  return delivered_bytes_ < calm_until_bytes_;
}

double SendingWindow::gain() const {
  if (is_calm()) return 1;
  if (is_starting_) return kStartGain;
  switch (round_ % kProbePeriodRounds) {
    case 0:
      return kProbeGain;
    case 1:
      return kDrainGain;
    default:
      return 1;
  }
}

}  // namespace spectra::stream
