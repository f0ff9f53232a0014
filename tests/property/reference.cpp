#include "tests/property/reference.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace spectra::fusion::test {
namespace {

using Real = FusionReference::Real;
using Colour = FusionReference::Colour;

Colour blend(Real a, const Colour& over, const Colour& under) {
  Colour result{};
  for (std::size_t c = 0; c < 3; ++c) result[c] = a * over[c] + (1 - a) * under[c];
  return result;
}

/// Textbook HSV to RGB; hue in degrees, the rest in 0..1, the answer in 0..255.
Colour from_hsv(Real hue, Real saturation, Real value) {
  hue = std::fmod(hue, 360.0L);
  if (hue < 0) hue += 360;
  const Real sextant = hue / 60;
  const Real chroma = value * saturation;
  const Real second = chroma * (1 - std::fabs(std::fmod(sextant, 2.0L) - 1));
  const Real base = value - chroma;
  Colour rgb{};
  switch (static_cast<int>(sextant)) {
    case 0:
      rgb = {chroma, second, 0};
      break;
    case 1:
      rgb = {second, chroma, 0};
      break;
    case 2:
      rgb = {0, chroma, second};
      break;
    case 3:
      rgb = {0, second, chroma};
      break;
    case 4:
      rgb = {second, 0, chroma};
      break;
    default:
      rgb = {chroma, 0, second};
      break;
  }
  for (Real& channel : rgb) channel = 255 * (channel + base);
  return rgb;
}

}  // namespace

FusionReference::FusionReference(const fusion::FusionSettings& settings, const fusion::PaletteTable& palette,
                                 const fusion::TemperatureSummary& summary, std::span<const float> temperature)
    : settings_(settings), palette_(palette), summary_(summary) {
  if (settings.range.mode == fusion::RangeMode::Manual) {
    lo_ = settings.range.minimum_celsius;
    hi_ = settings.range.maximum_celsius;
  } else if (summary.has_temperature()) {
    lo_ = double{summary.minimum};
    hi_ = double{summary.maximum};
  }
  if (settings.method == "histogram_bin") choose_bins(temperature);
}

double FusionReference::number(const char* name) const {
  const fusion::ParameterValue& value = settings_.params.at(name);
  if (const auto* integer = std::get_if<std::int64_t>(&value)) return static_cast<double>(*integer);
  return std::get<double>(value);
}

double FusionReference::temperature_or(const char* name, double sigmas) const {
  if (const auto* set = std::get_if<double>(&settings_.params.at(name))) return *set;
  return std::min(std::max(summary_.mean + sigmas * summary_.sigma, double{summary_.minimum}),
                  double{summary_.maximum});
}

bool FusionReference::toggle(const char* name) const {
  return std::get<bool>(settings_.params.at(name));
}

const std::string& FusionReference::choice(const char* name) const {
  return std::get<std::string>(settings_.params.at(name));
}

Real FusionReference::normalised(float temperature) const {
  if (std::isinf(temperature)) return temperature > 0 ? 1 : 0;
  if (lo_ == hi_) return 0.5L;
  const Real t =
      (static_cast<Real>(temperature) - static_cast<Real>(lo_)) / (static_cast<Real>(hi_) - static_cast<Real>(lo_));
  return std::clamp(t, 0.0L, 1.0L);
}

Colour FusionReference::thermal(float temperature) const {
  return palette_at(255 * normalised(temperature));
}

Colour FusionReference::palette_at(Real position) const {
  const auto row = static_cast<std::size_t>(position);
  const std::size_t next = std::min<std::size_t>(row + 1, 255);
  const Real part = position - static_cast<Real>(row);
  Colour colour{};
  for (std::size_t c = 0; c < 3; ++c) {
    colour[c] = (1 - part) * static_cast<Real>(palette_[row][c]) + part * static_cast<Real>(palette_[next][c]);
  }
  return colour;
}

std::size_t FusionReference::bin_of(float temperature) const {
  const double low = double{summary_.minimum};
  const double high = double{summary_.maximum};
  const double bins = number("bins");
  if (std::isinf(temperature)) return temperature > 0 ? static_cast<std::size_t>(bins) - 1 : 0;
  if (low == high) return 0;
  const double position = std::floor((double{temperature} - low) / (high - low) * bins);
  return static_cast<std::size_t>(std::clamp(position, 0.0, bins - 1));
}

void FusionReference::choose_bins(std::span<const float> temperature) {
  chosen_bins_.assign(static_cast<std::size_t>(number("bins")), false);
  std::map<std::size_t, long> counts;
  for (const float t : temperature) {
    if (std::isfinite(t)) ++counts[bin_of(t)];
  }
  std::vector<std::pair<long, std::size_t>> ranked;
  for (const auto& [bin, count] : counts) ranked.emplace_back(toggle("invert") ? -count : count, bin);
  std::sort(ranked.begin(), ranked.end());
  // How many of the ranked bins show where n is asked for, and how many temperatures are in them.
  const auto shown = [&](std::size_t n) {
    std::pair<std::size_t, double> result{0, 0};
    for (std::size_t i = 0; i < ranked.size(); ++i) {
      const bool tied = choice("ties") == "all" && n > 0 && i >= n && ranked[i].first == ranked[n - 1].first;
      if (i >= n && !tied) break;
      result = {i + 1, result.second + std::abs(static_cast<double>(ranked[i].first))};
    }
    return result;
  };
  std::size_t n = 0;
  if (std::holds_alternative<fusion::Automatic>(settings_.params.at("n"))) {
    const std::uint64_t allowed = summary_.finite_count / 10;
    while (n < ranked.size() && shown(n + 1).second <= static_cast<double>(allowed)) ++n;
  } else {
    n = static_cast<std::size_t>(number("n"));
  }
  for (std::size_t i = 0; i < shown(n).first; ++i) chosen_bins_[ranked[i].second] = true;
}

Colour FusionReference::fused(float temperature, base::Rgb8 visible, float baseline, std::uint8_t freshness) const {
  Colour colour = unfaded(temperature, visible, baseline);
  const Real grey = (299 * colour[0] + 587 * colour[1] + 114 * colour[2]) / 1000;
  for (Real& channel : colour) channel = grey + (channel - grey) * (Real(freshness) / 8);
  return colour;
}

Colour FusionReference::unfaded(float temperature, base::Rgb8 visible, float baseline) const {
  const std::string& method = settings_.method;
  const Colour v = {Real(visible.r), Real(visible.g), Real(visible.b)};
  if (method == "visible_only") return v;
  if (std::isnan(temperature)) {
    if (settings_.missing) {
      return {Real(settings_.missing->r), Real(settings_.missing->g), Real(settings_.missing->b)};
    }
    return v;
  }
  if (method == "thermal_only") return thermal(temperature);
  if (method == "thermal_visible_blend") return blend(Real(number("alpha")), thermal(temperature), v);
  if (method == "monochrome_threshold" || method == "colour_mapped_threshold") {
    const bool invert = toggle("invert");
    const auto threshold = static_cast<float>(temperature_or("threshold", invert ? -1.5 : 1.5));
    if (!(invert ? temperature < threshold : temperature > threshold)) return v;
    if (method == "colour_mapped_threshold") return blend(Real(number("alpha")), thermal(temperature), v);
    const Real t = normalised(temperature);
    // At a range of one point both t and 1 - t are one half for what is finite.
    const Real intensity = invert ? 1 - t : t;
    return blend(Real(number("alpha")), from_hsv(Real(number("hue")), intensity, intensity), v);
  }
  if (method == "thermal_highlighting") {
    const double low = temperature_or("low", -1.5);
    const double high = temperature_or("high", 1.5);
    const std::string& sides = choice("sides");
    Real u = 0;
    if (sides != "cold" && temperature > static_cast<float>(high)) {
      u = Real(hi_) > Real(high) ? (Real(temperature) - Real(high)) / (Real(hi_) - Real(high)) : 1;
    } else if (sides != "hot" && temperature < static_cast<float>(low)) {
      u = Real(low) > Real(lo_) ? (Real(low) - Real(temperature)) / (Real(low) - Real(lo_)) : 1;
    } else {
      return v;
    }
    u = std::clamp(u, 0.0L, 1.0L);
    const Real weight = std::isinf(temperature) ? 1 : std::min(1.0L, Real(number("k")) * u * u);
    return blend(weight, thermal(temperature), v);
  }
  if (method == "intensity_hue") {
    const Real grey = (299 * v[0] + 587 * v[1] + 114 * v[2]) / 1000;
    const Real lightness = std::clamp(Real(number("k")) * (2 * grey / 255 - 1), -1.0L, 1.0L);
    Colour colour = thermal(temperature);
    for (Real& m : colour) m += lightness > 0 ? lightness * (255 - m) : lightness * m;
    return colour;
  }
  if (method == "inverse_intensity_hue") {
    const Real intensity = std::pow(normalised(temperature), Real(number("k")));
    if (choice("mode") == "scale") return blend(intensity, v, {0, 0, 0});
    const Real brightest = std::max({v[0], v[1], v[2]});
    if (brightest == 0) return {255 * intensity, 255 * intensity, 255 * intensity};
    return {255 * intensity * v[0] / brightest, 255 * intensity * v[1] / brightest, 255 * intensity * v[2] / brightest};
  }
  if (method == "thermal_change") {
    const float change = temperature - baseline;
    const auto threshold = static_cast<float>(number("threshold"));
    const bool shows = toggle("invert") ? std::fabs(change) < threshold : std::fabs(change) > threshold;
    if (!shows) return v;
    const Real position = std::clamp((Real(change) / Real(number("span")) + 1) / 2, 0.0L, 1.0L) * 255;
    return blend(Real(number("alpha")), palette_at(position), v);
  }
  if (method == "histogram_bin") {
    return chosen_bins_[bin_of(temperature)] ? blend(Real(number("alpha")), thermal(temperature), v) : v;
  }
  const double lower = summary_.mean - number("k") * summary_.sigma;
  const double upper = summary_.mean + number("k") * summary_.sigma;
  const bool outside = double{temperature} < lower || double{temperature} > upper;
  if (summary_.sigma == 0 || outside == toggle("invert")) return v;
  return blend(Real(number("alpha")), thermal(temperature), v);
}

bool within_accuracy(std::uint8_t fused, FusionReference::Real exact) {
  const Real bounded = std::clamp(exact, 0.0L, 255.0L);
  const Real level = fused;
  if (std::fabs(level - bounded) > 1) return false;
  const Real to_tie = std::fabs(bounded - std::floor(bounded) - 0.5L);
  return to_tie <= 1e-3L || level == std::floor(bounded + 0.5L);
}

}  // namespace spectra::fusion::test
