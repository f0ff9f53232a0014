#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace spectra::fusion {

/// Temperatures as whole numbers of 16 bits. Where the scale is a whole part of a degree (lattice()), a code stands for the float that is
/// nearest to a multiple of that part; elsewhere degC = code * scale + offset in float32, each operation rounded. The last three
/// codes stand for what has no number.
struct TemperatureCodes {
  float scale = 1;
  float offset = 0;

  static constexpr std::uint16_t kLargest = 65532;
  static constexpr std::uint16_t kUnderRange = 65533;  ///< -infinity.
  static constexpr std::uint16_t kOverRange = 65534;   ///< +infinity.
  static constexpr std::uint16_t kMissing = 65535;     ///< NaN.

  /// The step where nothing else is asked for, degC; a span that needs more than kLargest of them gets larger ones.
  static constexpr double kDefaultStepCelsius = 0.01;

  /// Codes for finite temperatures from minimum to maximum: the step that is asked for, or the smallest with which they have
  /// room. Steps stand at whole multiples of themselves, so that equal temperatures of neighbours stay equal; one temperature
  /// alone is its own offset.
  static TemperatureCodes covering(float minimum_celsius, float maximum_celsius, double step_celsius);

  /// The nearest code of each; what lies outside of what is covered takes the nearest that is in.
  void encode(std::span<const float> temperature_celsius, std::span<std::uint16_t> code) const;

  /// What each code stands for; any code is allowed.
  void decode(std::span<const std::uint16_t> code, std::span<float> temperature_celsius) const;

 private:
  /// degC = (first + code) / per_degree. With steps of 0.01 a temperature that was written with two decimals comes back as it was, and stands
  /// on the same side of a threshold.
  struct Lattice {
    double per_degree = 1;
    double first = 0;
  };
  /// Scale and offset are the floats that are nearest to 1 / per_degree and to first / per_degree.
  std::optional<Lattice> lattice() const;
};

}  // namespace spectra::fusion
