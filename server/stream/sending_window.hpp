#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>

namespace spectra::server {

/// How many bytes may be on their way to one viewer: given out and not yet acknowledged as decoded.
class SendingWindow {
 public:
  static constexpr std::size_t kDefaultBytes = 4u << 20;
  static constexpr std::size_t kSmallestBytes = 16u << 10;
  static constexpr std::size_t kLargestBytes = 8u << 20;

  /// Sets the size, held within the bounds above; 0 = the default.
  void set_size(std::size_t bytes);

  /// True when a frame of that size may go now. A frame larger than the window goes when nothing else is on its way.
  bool admits(std::size_t size_bytes) const;

  void on_sent(std::uint32_t sequence, std::size_t size_bytes);

  /// Everything up to `sequence` has arrived. Ignores a sequence that was never sent or is acknowledged already.
  void on_acknowledged(std::uint32_t sequence);

  std::size_t in_flight_bytes() const { return in_flight_bytes_; }

 private:
  struct Sent {
    std::uint32_t sequence;
    std::size_t size_bytes;
  };
  std::deque<Sent> sent_;
  std::size_t in_flight_bytes_ = 0;
  std::size_t size_bytes_ = kDefaultBytes;
};

}  // namespace spectra::server
