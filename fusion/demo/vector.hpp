#pragma once

#include <cmath>
#include <cstdint>

#include "fusion/base/vector.hpp"

namespace spectra::demo {

/// A point or direction in metres: x to the right, y up, z towards the viewer.
using Vec = base::Vec3d;

/// The unit vector along `a`; a zero vector stays zero.
inline Vec normalised(Vec a) {
  const double l = length(a);
  return l > 0 ? a * (1 / l) : a;
}

inline double clamp01(double t) {
  return t < 0 ? 0 : t > 1 ? 1 : t;
}
inline double mix(double a, double b, double t) {
  return a + (b - a) * t;
}
inline Vec mix(Vec a, Vec b, double t) {
  return a + (b - a) * t;
}
/// 0 up to `from`, 1 from `to` on, smooth between.
inline double smooth_step(double from, double to, double x) {
  const double t = clamp01((x - from) / (to - from));
  return t * t * (3 - 2 * t);
}
/// 1 at 0, 0 from |x| = 1 on, smooth: a bell without an exponential, so that every machine agrees on it.
inline double bell(double x) {
  const double s = 1 - x * x;
  return s > 0 ? s * s : 0;
}

/// Sine and cosine from arithmetic alone, because the last bit of the C library's differs between machines.
double sine(double radians);
double cosine(double radians);

/// A red, green, blue colour, sRGB-encoded, 0..255.
struct Colour {
  double r = 0, g = 0, b = 0;
};
inline Colour mix(Colour a, Colour b, double t) {
  return {mix(a.r, b.r, t), mix(a.g, b.g, t), mix(a.b, b.b, t)};
}
inline Colour operator*(Colour c, double s) {
  return {c.r * s, c.g * s, c.b * s};
}

/// A place on the world with three orthogonal unit axes.
struct Frame {
  Vec origin;
  Vec right{1, 0, 0}, up{0, 1, 0}, out{0, 0, 1};

  Vec point(double x, double y, double z) const { return origin + right * x + up * y + out * z; }
  Vec point(Vec p) const { return point(p.x, p.y, p.z); }
  /// The same axes at another place, given in this frame.
  Frame moved(double x, double y, double z) const { return {point(x, y, z), right, up, out}; }
  /// Turned about its own `up` (yaw), then `right` (pitch), then `out` (roll), in degrees.
  Frame turned(double yaw, double pitch, double roll) const;
};

/// A frame whose `out` is along `out` and whose `up` is as near to `up` as that allows.
Frame facing(Vec origin, Vec out, Vec up = {0, 1, 0});

}  // namespace spectra::demo
