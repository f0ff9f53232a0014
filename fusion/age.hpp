#pragma once

#include <array>
#include <cstdint>

namespace spectra::fusion {

/// How the age of what was seen is shown, on top of any method.
enum class AgeMode {
  Off,   ///< Not at all.
  Fade,  ///< What was seen long ago loses its colour: F' = w F + (1 - w) luma(F), w = 2^(-age / half-life) in eighths.
};

inline constexpr double kShortestHalfLifeSeconds = 1;
inline constexpr double kLongestHalfLifeSeconds = 1e7;

struct AgeSetting {
  AgeMode mode = AgeMode::Off;
  double half_life_s = 300;  ///< kShortestHalfLifeSeconds..kLongestHalfLifeSeconds; of no meaning while off.

  /// Settings that show the same are equal.
  friend bool operator==(const AgeSetting& a, const AgeSetting& b) {
    return a.mode == b.mode && (a.mode == AgeMode::Off || a.half_life_s == b.half_life_s);
  }
};

/// The freshness w of EQUATIONS' fade, in eighths. It has nine values, so that colours change at eight moments of a vertex's
/// life and not with every second.
class AgeSteps {
 public:
  static constexpr std::uint8_t kFresh = 8;

  explicit AgeSteps(double half_life_s);

  /// 8 2^(-age / half-life), rounded half up; 8 where the age is not above 0 or not known (NaN).
  std::uint8_t freshness(double age_s) const;

  /// The largest age with at least this freshness, 1..8: beyond it the next step is shown.
  double last_age_s(std::uint8_t freshness) const { return last_age_s_[freshness - 1U]; }

 private:
  std::array<double, kFresh> last_age_s_{};
};

}  // namespace spectra::fusion
