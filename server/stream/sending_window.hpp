#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>

namespace spectra::stream {

/// How many bytes may be on their way to one viewer: given out and not yet acknowledged as decoded.
///
/// The window follows the link, in the manner of BBR. Each acknowledgement gives a sample of the delivery rate (bytes
/// acknowledged since the frame was sent, over the time they took) and of the round trip. The rate in force is the largest
/// sample of the last ten round trips, at most three seconds; samples taken while there was too little to send count only when they are larger.
/// The round trip in force is the smallest of the last ten seconds; it contains the time that the frame itself takes on
/// the link. The window is one bandwidth-delay product and one frame. At first, as long as each round trip brings a
/// quarter more than the one before, it is twice the product; later every eighth round trip probes with a quarter more,
/// and the next one takes a quarter less. It stays between a floor and a ceiling, and never starves: a frame larger
/// than the window goes when nothing else is on its way.
class SendingWindow {
 public:
  static constexpr std::size_t kInitialBytes = 64u << 10;
  static constexpr std::size_t kFloorBytes = 16u << 10;
  static constexpr std::size_t kDefaultCeilingBytes = 4u << 20;

  /// The most it may ever be; 0 = the default, which is also the largest that is heeded.
  void set_ceiling(std::size_t bytes);

  enum class Urgency {
    Answer,  ///< What is seen first.
    Detail,  ///< What may be outdated before it arrives: after on_overtaken() it gets no more than the product alone.
  };
  bool admits(std::size_t size_bytes, Urgency urgency = Urgency::Answer) const;
  /// The same for a frame that goes at once, however little is known of the link: only the ceiling holds it back.
  bool admits_first_picture(std::size_t size_bytes) const;

  /// `now_s` is a steady clock, the same as in on_acknowledged().
  void on_sent(std::uint32_t sequence, std::size_t size_bytes, double now_s);

  /// There is room, but nothing to send: what is measured from here on says nothing about the link.
  void on_idle();

  /// What is on its way is outdated: until it and the next frame have arrived, a short queue matters more than a faster
  /// link, and nothing is probed.
  void on_overtaken();

  /// Everything up to `sequence` has arrived. False, and nothing happens, for a sequence that was never sent or is
  /// acknowledged already.
  bool on_acknowledged(std::uint32_t sequence, double now_s);

  std::size_t in_flight_bytes() const { return in_flight_bytes_; }
  std::size_t size_bytes() const;
  double round_trip_s() const { return last_round_trip_s_; }  ///< 0 = not known yet.
  double rate_bytes_per_s() const;                            ///< 0 = not known yet.

 private:
  struct Sent {
    std::uint32_t sequence;
    std::size_t size_bytes;
    double sent_s;
    std::uint64_t delivered_bytes;  // When it was sent, as is the next.
    double delivered_s;
    bool is_idle_sample;
  };
  struct Sample {
    double value;
    double at_s;
    std::uint64_t round;
  };

  void take_rate_sample(const Sent& sent, double now_s);
  void take_round_trip_sample(const Sent& sent, double now_s);
  void end_round();
  double shortest_round_trip_s() const;
  bool is_calm() const;
  double gain() const;

  std::deque<Sent> sent_;
  std::size_t in_flight_bytes_ = 0;
  std::size_t ceiling_bytes_ = kDefaultCeilingBytes;
  std::size_t largest_frame_bytes_ = 0;
  std::uint64_t delivered_bytes_ = 0;
  double delivered_s_ = 0;
  std::uint64_t idle_until_bytes_ = 0;  // Frames sent before this much is delivered measure an idle link.
  std::uint64_t calm_until_bytes_ = 0;
  std::uint64_t round_end_bytes_ = 0;  // The round ends when this much is delivered.
  std::uint64_t round_ = 0;
  std::deque<Sample> rates_;        // Falling values, rising rounds: the front is the largest.
  std::deque<Sample> round_trips_;  // Rising values, rising times: the front is the smallest.
  double last_round_trip_s_ = 0;
  bool is_starting_ = true;
  double start_rate_ = 0;
  int rounds_without_growth_ = 0;
};

}  // namespace spectra::stream
