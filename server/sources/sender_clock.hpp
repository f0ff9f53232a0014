#pragma once

#include <cstddef>
#include <optional>

namespace spectra::sources {

/// Brings the stamps of one sender after another onto one clock, and keeps it from being set by a stamp that cannot be meant. Not thread-safe.
class SenderClock {
 public:
  /// Stamps so much ahead of, or behind, all others of a sender are strays. Seconds.
  static constexpr double kFarS = 10;
  /// In seconds no stamp is larger, whatever it counts from.
  static constexpr double kLargestStampS = 1e11;
  /// So many strays in a row, each at most kFarS after the one before, are no strays: the clock of the sender was set.
  static constexpr std::size_t kBelieved = 3;
  /// A clock that begins anew and is behind goes on so much later.
  static constexpr double kNewClockGapS = 1;

  /// Another sender, whose clock may count from anything.
  void begin_sender();

  enum class Verdict {
    Taken,         ///< Or behind: whoever asks compares it with those before.
    NotInSeconds,  ///< Or no number: never taken.
    Ahead,         ///< A stray.
    BegunAnew,  ///< The sender's clock was set back. It goes on later than all before, which the stamp is not to be compared with.
  };
  /// What to make of a stamp. `now_s`: of a steady clock. `may_jump`: a stamp ahead is no stray. Of a stamp that then is taken, accept() is to be told.
  Verdict look(double stamp_s, double now_s, bool may_jump);
  void accept(double stamp_s, double now_s);

  /// A stamp of this sender on the clock of the map.
  double on_own_clock(double stamp_s) const;
  /// The same of one that says nothing of the clock: that of the sender before, until this one has been heard.
  double moment_before(double stamp_s) const { return stamp_s + shift_s_.value_or(last_shift_s_); }
  /// Of all stamps, on the clock of the map.
  std::optional<double> newest_s() const { return newest_s_; }

 private:
  bool is_believed(double stamp_s);

  std::optional<double> newest_s_;
  std::optional<double> shift_s_;  ///< Added to the stamps of this sender, once it has said one.
  double last_shift_s_ = 0;
  double accepted_at_s_ = 0;
  std::optional<double> stray_s_;  ///< The last one.
  std::size_t strays_in_row_ = 0;
};

}  // namespace spectra::sources
