#pragma once

#include <array>
#include <span>
#include <vector>

#include "fusion/fusion_plan.hpp"

namespace spectra::fusion::test {

/// The exact, unrounded fused colour of every vertex in extended precision, written straight from the equations of the
/// methods and apart from the library: it shares the summary of the data and the settings, nothing else.
class FusionReference {
 public:
  using Real = long double;
  using Colour = std::array<Real, 3>;

  /// `temperature` are all temperatures of the scene. The range is not a percentile and the hue is a number: those of a plan
  /// are held to their meaning elsewhere.
  FusionReference(const fusion::FusionSettings& settings, const fusion::PaletteTable& palette,
                  const fusion::TemperatureSummary& summary, std::span<const float> temperature);

  /// `baseline` is NaN where there is none; `freshness` in eighths.
  Colour fused(float temperature, base::Rgb8 visible, float baseline, std::uint8_t freshness) const;

 private:
  Colour unfaded(float temperature, base::Rgb8 visible, float baseline) const;
  double number(const char* name) const;
  double temperature_or(const char* name, double sigmas) const;
  bool toggle(const char* name) const;
  const std::string& choice(const char* name) const;
  Real normalised(float temperature) const;
  Colour thermal(float temperature) const;
  Colour palette_at(Real position) const;
  std::size_t bin_of(float temperature) const;
  void choose_bins(std::span<const float> temperature);

  fusion::FusionSettings settings_;
  fusion::PaletteTable palette_;
  fusion::TemperatureSummary summary_;
  double lo_ = 0;
  double hi_ = 0;
  std::vector<bool> chosen_bins_;
};

/// Whether a fused channel is within the accuracy that is promised: at most 1 level from the exact answer, and equal to
/// it rounded half up unless the answer lies within 1e-3 of a rounding tie.
bool within_accuracy(std::uint8_t fused, FusionReference::Real exact);

}  // namespace spectra::fusion::test
