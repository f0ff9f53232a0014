#include "fusion/demo/vector.hpp"

namespace spectra::demo {
namespace {

constexpr double kPi = 3.14159265358979323846;

void turn(Vec& a, Vec& b, double degrees) {
  const double c = cosine(degrees * kPi / 180), s = sine(degrees * kPi / 180);
  const Vec was_a = a;
  a = was_a * c + b * s;
  b = b * c - was_a * s;
}

}  // namespace

double sine(double radians) {
  double x = radians - 2 * kPi * std::floor(radians / (2 * kPi) + 0.5);
  if (x > kPi / 2) x = kPi - x;
  if (x < -kPi / 2) x = -kPi - x;
  const double q = x * x;
  return x * (1 - q / 6 * (1 - q / 20 * (1 - q / 42 * (1 - q / 72 * (1 - q / 110 * (1 - q / 156))))));
}

double cosine(double radians) {
  return sine(radians + kPi / 2);
}

Frame Frame::turned(double yaw, double pitch, double roll) const {
  Frame f = *this;
  turn(f.out, f.right, yaw);
  turn(f.up, f.out, pitch);
  turn(f.right, f.up, roll);
  return f;
}

Frame facing(Vec origin, Vec out, Vec up) {
  const Vec z = normalised(out);
  const Vec x = normalised(cross(up, z));
  return {origin, x, cross(z, x), z};
}

}  // namespace spectra::demo
