#pragma once

#include <cstddef>
#include <optional>
#include <vector>

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
  /// What this sender has said so far was not meant: as if it had just begun.
  void forget_sender();

  enum class Verdict {
    Taken,         ///< Or behind: whoever asks compares it with those before.
    NotInSeconds,  ///< Or no number: never taken.
    Ahead,         ///< A stray, if nothing else comes near it.
    BegunAnew,  ///< The sender's clock was set back. It goes on later than all before, which the stamp is not to be compared with.
  };
  /// What to make of a stamp. `now_s`: of a steady clock. Of a stamp that then is taken, accept() is to be told.
  Verdict look(double stamp_s, double now_s);
  void accept(double stamp_s, double now_s);

  /// accept() was told of a stamp of this sender.
  bool has_said_any() const { return span_.has_value(); }
  /// This sender's newest stamp is at most kFarS from one.
  bool has_said_near(double stamp_s) const;
  /// A stamp of this sender on the clock of the map.
  double on_own_clock(double stamp_s) const;
  /// The same of one that speaks of what was: by the clock of the last sender that has said stamps before and after it, else by the newest that is
  /// known.
  double moment_of(double stamp_s) const;
  /// Of all stamps, on the clock of the map.
  std::optional<double> newest_s() const { return newest_s_; }

 private:
  /// What one clock has said.
  struct Span {
    double first_s, last_s;  ///< Stamps.
    double shift_s;          ///< Added to them.
  };
  bool is_believed(double stamp_s);

  std::optional<double> newest_s_;
  std::optional<double> newest_before_s_;  ///< When this sender began.
  std::optional<Span> span_;               ///< Of this sender, once it has said a stamp.
  std::vector<Span> spans_before_;         ///< Of those before, the newest last.
  double accepted_at_s_ = 0;
  std::optional<double> stray_s_;  ///< The last one.
  std::size_t strays_in_row_ = 0;
};

}  // namespace spectra::sources
