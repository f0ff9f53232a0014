#include "fusion/colour/colour_difference.hpp"

#include <cmath>
#include <numbers>

namespace spectra::fusion {

namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

double linear_of(double encoded) {
  const double c = encoded / 255.0;
  return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
}

double lab_curve(double ratio) {
  constexpr double kEpsilon = 216.0 / 24389.0;
  constexpr double kKappa = 24389.0 / 27.0;
  return ratio > kEpsilon ? std::cbrt(ratio) : (kKappa * ratio + 16.0) / 116.0;
}

/// Hue angle in degrees, 0..360; 0 for grey.
double hue_deg(double a, double b) {
  if (a == 0 && b == 0) return 0;
  const double angle = std::atan2(b, a) / kDegree;
  return angle < 0 ? angle + 360 : angle;
}

/// Chroma to the seventh over itself plus 25 to the seventh, under the root: how saturated a pair of colours is.
double saturation_term(double chroma) {
  const double seventh = std::pow(chroma, 7);
  return std::sqrt(seventh / (seventh + std::pow(25.0, 7)));
}

}  // namespace

Lab lab_of(const std::array<double, 3>& srgb) {
  const double r = linear_of(srgb[0]), g = linear_of(srgb[1]), b = linear_of(srgb[2]);
  const double x = (0.4124564 * r + 0.3575761 * g + 0.1804375 * b) / 0.95047;
  const double y = 0.2126729 * r + 0.7151522 * g + 0.0721750 * b;
  const double z = (0.0193339 * r + 0.1191920 * g + 0.9503041 * b) / 1.08883;
  const double fx = lab_curve(x), fy = lab_curve(y), fz = lab_curve(z);
  return {116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)};
}

Lab lab_of(base::Rgb8 colour) {
  return lab_of(std::array<double, 3>{static_cast<double>(colour.r), static_cast<double>(colour.g),
                                      static_cast<double>(colour.b)});
}

double ciede2000(const Lab& first, const Lab& second) {
  const double mean_chroma = (std::hypot(first[1], first[2]) + std::hypot(second[1], second[2])) / 2;
  const double stretch = 1 + 0.5 * (1 - saturation_term(mean_chroma));
  const double a1 = stretch * first[1], a2 = stretch * second[1];
  const double chroma1 = std::hypot(a1, first[2]), chroma2 = std::hypot(a2, second[2]);
  const double hue1 = hue_deg(a1, first[2]), hue2 = hue_deg(a2, second[2]);
  const bool grey = chroma1 * chroma2 == 0;

  double hue_step = grey ? 0 : hue2 - hue1;
  if (hue_step > 180) hue_step -= 360;
  if (hue_step < -180) hue_step += 360;
  double hue_mean = hue1 + hue2;
  if (!grey) {
    if (std::abs(hue1 - hue2) > 180) hue_mean += hue_mean < 360 ? 360 : -360;
    hue_mean /= 2;
  }

  const double lightness = (first[0] + second[0]) / 2;
  const double chroma = (chroma1 + chroma2) / 2;
  const double delta_l = second[0] - first[0];
  const double delta_c = chroma2 - chroma1;
  const double delta_h = 2 * std::sqrt(chroma1 * chroma2) * std::sin(hue_step / 2 * kDegree);

  const double t = 1 - 0.17 * std::cos((hue_mean - 30) * kDegree) + 0.24 * std::cos(2 * hue_mean * kDegree) +
                   0.32 * std::cos((3 * hue_mean + 6) * kDegree) - 0.20 * std::cos((4 * hue_mean - 63) * kDegree);
  const double from_mid = (lightness - 50) * (lightness - 50);
  const double scale_l = 1 + 0.015 * from_mid / std::sqrt(20 + from_mid);
  const double scale_c = 1 + 0.045 * chroma;
  const double scale_h = 1 + 0.015 * chroma * t;
  const double blue_turn = (hue_mean - 275) / 25;
  const double rotation = -2 * saturation_term(chroma) * std::sin(60 * kDegree * std::exp(-blue_turn * blue_turn));

  const double l = delta_l / scale_l, c = delta_c / scale_c, h = delta_h / scale_h;
  return std::sqrt(l * l + c * c + h * h + rotation * c * h);
}

}  // namespace spectra::fusion
