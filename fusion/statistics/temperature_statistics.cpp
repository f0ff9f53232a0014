#include "fusion/statistics/temperature_statistics.hpp"

#include <bit>
#include <boost/multiprecision/cpp_int.hpp>
#include <cmath>
#include <limits>

namespace spectra::fusion {
namespace {

using boost::multiprecision::cpp_int;

/// Biased exponents of finite float32 values; 0 holds the subnormals.
constexpr std::size_t kExponents = 255;

/// Mantissas are whole multiples of 2^-149 at biased exponents 0 and 1, and twice that for each exponent above.
constexpr int kUnitExponent = -149;

unsigned shift_of(std::size_t exponent) {
  return exponent == 0 ? 0 : static_cast<unsigned>(exponent - 1);
}

/// numerator / denominator * 2^exponent, correctly rounded; both are positive.
double rounded_quotient(const cpp_int& numerator, const cpp_int& denominator, int exponent) {
  // A quotient of 62 or 63 bits whose last bit is set when anything is left over rounds to 53 bits as the exact one.
  const int shift = 62 + static_cast<int>(msb(denominator)) - static_cast<int>(msb(numerator));
  cpp_int dividend = numerator;
  cpp_int divisor = denominator;
  if (shift > 0) {
    dividend <<= static_cast<unsigned>(shift);
  } else {
    divisor <<= static_cast<unsigned>(-shift);
  }
  cpp_int quotient, rest;
  divide_qr(dividend, divisor, quotient, rest);
  auto bits = static_cast<std::uint64_t>(quotient);
  if (rest != 0) bits |= 1;
  return std::ldexp(static_cast<double>(bits), exponent - shift);
}

}  // namespace

TemperatureAccumulator::TemperatureAccumulator()
    : sum_by_exponent_(kExponents),
      square_low_by_exponent_(kExponents),
      square_high_by_exponent_(kExponents),
      minimum_(std::numeric_limits<float>::infinity()),
      maximum_(-std::numeric_limits<float>::infinity()) {}

void TemperatureAccumulator::add(std::span<const float> temperature_celsius) {
  // Temperatures of a scene share few exponents, so blocks of one exponent and no sign are summed in registers.
  constexpr std::size_t kBlock = 64;
  std::size_t begin = 0;
  for (; begin + kBlock <= temperature_celsius.size(); begin += kBlock) {
    const float* block = temperature_celsius.data() + begin;
    const std::uint32_t shared = std::bit_cast<std::uint32_t>(block[0]) >> 23;
    std::uint32_t different = 0;
    for (std::size_t i = 0; i < kBlock; ++i) different |= (std::bit_cast<std::uint32_t>(block[i]) >> 23) ^ shared;
    if (different != 0 || shared == 0 || shared >= 255) {
      for (std::size_t i = 0; i < kBlock; ++i) add_one(block[i]);
      continue;
    }
    std::uint32_t sum = 0;
    std::uint32_t lowest = ~0U;
    std::uint32_t highest = 0;
    std::uint64_t square_low = 0;
    std::uint64_t square_high = 0;
    for (std::size_t i = 0; i < kBlock; ++i) {
      const std::uint32_t mantissa = (std::bit_cast<std::uint32_t>(block[i]) & 0x7FFFFF) | 0x800000U;
      const std::uint64_t square = std::uint64_t{mantissa} * mantissa;
      sum += mantissa;
      lowest = std::min(lowest, mantissa);
      highest = std::max(highest, mantissa);
      square_low += square & 0xFFFFFF;
      square_high += square >> 24;
    }
    const auto value_of = [shared](std::uint32_t mantissa) {
      return std::bit_cast<float>((shared << 23) | (mantissa & 0x7FFFFF));
    };
    minimum_ = std::min(minimum_, value_of(lowest));
    maximum_ = std::max(maximum_, value_of(highest));
    finite_count_ += kBlock;
    sum_by_exponent_[shared] += sum;
    square_low_by_exponent_[shared] += square_low;
    square_high_by_exponent_[shared] += square_high;
  }
  for (; begin < temperature_celsius.size(); ++begin) add_one(temperature_celsius[begin]);
}

void TemperatureAccumulator::add_one(float value) {
  if (!std::isfinite(value)) {
    ++(std::isnan(value) ? missing_count_ : value > 0 ? over_range_count_ : under_range_count_);
    return;
  }
  ++finite_count_;
  // Adding zero turns -0 into 0: the extremes must not depend on the order of the two.
  minimum_ = std::min(minimum_, value + 0.0F);
  maximum_ = std::max(maximum_, value + 0.0F);
  const auto bits = std::bit_cast<std::uint32_t>(value);
  const std::size_t exponent = (bits >> 23) & 0xFF;
  const std::uint64_t mantissa = (bits & 0x7FFFFF) | (exponent == 0 ? 0U : 0x800000U);
  const std::uint64_t square = mantissa * mantissa;
  const auto magnitude = static_cast<std::int64_t>(mantissa);
  sum_by_exponent_[exponent] += (bits >> 31) != 0 ? -magnitude : magnitude;
  square_low_by_exponent_[exponent] += square & 0xFFFFFF;
  square_high_by_exponent_[exponent] += square >> 24;
}

void TemperatureAccumulator::merge(const TemperatureAccumulator& other) {
  for (std::size_t exponent = 0; exponent < kExponents; ++exponent) {
    sum_by_exponent_[exponent] += other.sum_by_exponent_[exponent];
    square_low_by_exponent_[exponent] += other.square_low_by_exponent_[exponent];
    square_high_by_exponent_[exponent] += other.square_high_by_exponent_[exponent];
  }
  finite_count_ += other.finite_count_;
  missing_count_ += other.missing_count_;
  over_range_count_ += other.over_range_count_;
  under_range_count_ += other.under_range_count_;
  minimum_ = std::min(minimum_, other.minimum_);
  maximum_ = std::max(maximum_, other.maximum_);
}

TemperatureSummary TemperatureAccumulator::summary() const {
  TemperatureSummary result;
  result.finite_count = finite_count_;
  result.missing_count = missing_count_;
  result.over_range_count = over_range_count_;
  result.under_range_count = under_range_count_;
  if (finite_count_ == 0) return result;
  result.minimum = minimum_;
  result.maximum = maximum_;

  cpp_int sum = 0;
  cpp_int squares = 0;
  for (std::size_t exponent = 0; exponent < kExponents; ++exponent) {
    sum += cpp_int(sum_by_exponent_[exponent]) << shift_of(exponent);
    squares += ((cpp_int(square_high_by_exponent_[exponent]) << 24) + square_low_by_exponent_[exponent])
               << 2 * shift_of(exponent);
  }
  const cpp_int count = finite_count_;
  if (sum != 0) {
    const double magnitude = rounded_quotient(abs(sum), count, kUnitExponent);
    result.mean = sum < 0 ? -magnitude : magnitude;
  }
  // n^2 times the variance, exact; sigma is its root over n.
  cpp_int spread = squares * count - sum * sum;
  if (spread > 0) {
    // An even shift to at least 128 bits leaves 64 good bits in the root.
    const int missing_bits = std::max(0, 128 - static_cast<int>(msb(spread)));
    const int half_shift = (missing_bits + 1) / 2;
    spread <<= static_cast<unsigned>(2 * half_shift);
    result.sigma = rounded_quotient(sqrt(spread), count, kUnitExponent - half_shift);
  }
  return result;
}

}  // namespace spectra::fusion
