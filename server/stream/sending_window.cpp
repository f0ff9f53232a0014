#include "server/stream/sending_window.hpp"

#include <algorithm>

namespace spectra::server {

void SendingWindow::set_size(std::size_t bytes) {
  size_bytes_ = bytes == 0 ? kDefaultBytes : std::clamp(bytes, kSmallestBytes, kLargestBytes);
}

bool SendingWindow::admits(std::size_t size_bytes) const {
  return in_flight_bytes_ == 0 || in_flight_bytes_ + size_bytes <= size_bytes_;
}

void SendingWindow::on_sent(std::uint32_t sequence, std::size_t size_bytes) {
  sent_.push_back({sequence, size_bytes});
  in_flight_bytes_ += size_bytes;
}

void SendingWindow::on_acknowledged(std::uint32_t sequence) {
  if (sent_.empty() || sequence > sent_.back().sequence) return;
  while (!sent_.empty() && sent_.front().sequence <= sequence) {
    in_flight_bytes_ -= sent_.front().size_bytes;
    sent_.pop_front();
  }
}

}  // namespace spectra::server
