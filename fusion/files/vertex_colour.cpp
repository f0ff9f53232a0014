#include "fusion/files/vertex_colour.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>

#include "fusion/files/ply_values.hpp"

namespace spectra::files {

namespace {

/// The first spherical harmonic, which is constant.
constexpr double kSplatFactor = 0.28209479177387814;
/// Floats up to here are shares of white, some of them a little too bright.
constexpr double kMostShare = 2;
constexpr double kMostByte = 255.5;
/// Interpolated and sharpened levels are over-exposed here and there, as shares are.
constexpr double kMostLevel = 2 * 255;
constexpr double kWhite10Bit = 1023, kWhite12Bit = 4095, kWhite14Bit = 16383;
constexpr double kMost16Bit = 65535.5;
constexpr double kSixteenToEight = 1.0 / 257;
/// In levels of 255.
constexpr double kHair = 8;

/// nullopt: no colour. A float with alpha in it is often NaN; as text that says "nan", and its colour is lost.
std::optional<std::uint32_t> packed_bits(double value, bool is_floating) {
  constexpr double kMost = std::numeric_limits<std::uint32_t>::max();
  if (value == std::floor(value) && value >= 0 && value <= kMost) return static_cast<std::uint32_t>(value);
  constexpr double kLeast = std::numeric_limits<std::int32_t>::min();
  if (value == std::floor(value) && value < 0 && value >= kLeast) {
    return static_cast<std::uint32_t>(static_cast<std::int32_t>(value));
  }
  constexpr double kFloatMax = std::numeric_limits<float>::max();
  if (!is_floating || std::abs(value) > kFloatMax) return std::nullopt;
  const auto bits = std::bit_cast<std::uint32_t>(static_cast<float>(value));
  constexpr std::uint32_t kSign = 0x8000'0000;
  constexpr std::uint32_t kNanOfAText = 0x7FC0'0000;
  return (bits & ~kSign) == kNanOfAText ? std::nullopt : std::optional(bits);
}

bool are_shares(PlyScalar type, const ColourRange& range) {
  return is_floating(type) && (range.largest <= kMostShare || range.has_mostly_shares());
}

/// What is white where that is neither 1 nor 255, by the bits that the largest number needs. Counts of 10 or 12 bits in a larger type would
/// all be nearly black as 16 bits.
double white_of_many_bits(double largest) {
  for (const double white : {kWhite10Bit, kWhite12Bit}) {
    if (largest < white + 0.5) return white;
  }
  return std::numeric_limits<std::uint16_t>::max();
}

bool are_levels(PlyScalar type, const ColourRange& range) {
  return range.largest <= (is_floating(type) ? kMostLevel : kMostByte);
}

}  // namespace

void ColourRange::add(std::span<const double> values) {
  constexpr double kMost = std::numeric_limits<double>::max();
  double most = largest;
  for (const double value : values) {
    const double finite = value <= kMost ? value : 0;
    most = most < finite ? finite : most;
  }
  largest = most;
  // A cheaper floor: added to kWhole a number loses what is behind the point; beyond a quarter of that it has nothing there.
  constexpr double kWhole = 0x1.8p52;
  std::uint64_t lit = 0, shares = 0, fractions = 0;
  for (const double value : values) {
    lit += value > 0 && value <= kMost ? 1U : 0U;
    shares += value > 0 && value <= 1 ? 1U : 0U;
    fractions += value > 0 && value < kWhole / 4 && value + kWhole - kWhole != value ? 1U : 0U;
  }
  lit_count += lit;
  share_count += shares;
  has_fractions = has_fractions || fractions > 0;
}

void ColourConversion::convert(std::array<std::span<const double>, 3> values, std::span<base::Rgb8> colours,
                               std::uint64_t& outside_count) const {
  constexpr std::uint8_t kMidGrey = 128;
  if (is_packed) {
    for (std::size_t i = 0; i < colours.size(); ++i) {
      const std::optional<std::uint32_t> bits = packed_bits(values[0][i], is_packed_floating);
      outside_count += bits ? 0U : 1U;
      colours[i] = bits ? base::Rgb8{static_cast<std::uint8_t>(*bits >> 16), static_cast<std::uint8_t>(*bits >> 8),
                                     static_cast<std::uint8_t>(*bits)}
                        : base::Rgb8{kMidGrey, kMidGrey, kMidGrey};
    }
    return;
  }
  constexpr std::array<std::uint8_t base::Rgb8::*, 3> kMembers = {&base::Rgb8::r, &base::Rgb8::g, &base::Rgb8::b};
  if (is_bytes) {
    for (std::size_t channel = 0; channel < 3; ++channel) {
      for (std::size_t i = 0; i < colours.size(); ++i) {
        colours[i].*kMembers[channel] = static_cast<std::uint8_t>(values[channel][i]);
      }
    }
    return;
  }
  for (std::size_t i = 0; i < colours.size(); ++i) {
    bool is_outside = false;
    for (std::size_t channel = 0; channel < 3; ++channel) {
      const double value = values[channel][i];
      const double level = factor * (is_wrapped && value < 0 ? value + 256 : value) + offset;
      is_outside = is_outside || !(level >= -kHair && level <= 255 + kHair);
      colours[i].*kMembers[channel] =
          std::isnan(level) ? kMidGrey : static_cast<std::uint8_t>(std::floor(std::clamp(level, 0.0, 255.0) + 0.5));
    }
    outside_count += is_outside ? 1U : 0U;
  }
}

base::Result<ColourConversion> colour_conversion(ColourCoding coding, PlyScalar type, const ColourRange& range,
                                                 std::optional<double> white) {
  const double largest = range.largest;
  ColourConversion conversion;
  conversion.is_wrapped = coding == ColourCoding::Channels && type == PlyScalar::Int8;
  if (coding == ColourCoding::Packed) {
    conversion.is_packed = true;
    conversion.is_packed_floating = is_floating(type);
  } else if (coding == ColourCoding::Splat) {
    conversion.factor = 255 * kSplatFactor;
    conversion.offset = 255 * 0.5;
  } else if (white) {
    conversion.factor = 255 / *white;
  } else if (are_shares(type, range)) {
    conversion.factor = 255;
  } else if (are_levels(type, range)) {
    conversion.factor = 1;
  } else if (largest < kWhite12Bit + 0.5 && size_bytes(type) > 1) {
    conversion.factor = 255 / white_of_many_bits(largest);
  } else if (largest < kMost16Bit && type != PlyScalar::UInt8 && type != PlyScalar::Int8) {
    conversion.factor = kSixteenToEight;
  } else {
    return base::failure(base::ErrorCode::BadValue,
                         "the colours go up to " + number_text(largest) +
                             (type == PlyScalar::UInt8 ? "; those of type uchar end at 255"
                                                       : "; 255 or 65535 is the most that is read"));
  }
  return conversion;
}

std::string conversion_text(ColourCoding coding, PlyScalar type, const ColourRange& range_of_all,
                            std::optional<double> white) {
  const std::string name(to_string(type));
  switch (coding) {
    case ColourCoding::Packed:
      return "Colours unpacked from one number of type " + name + " a vertex (0xRRGGBB)";
    case ColourCoding::Splat:
      return "Colours made of the splats' f_dc_0 to f_dc_2 (0.5 + 0.2821 f_dc)";
    case ColourCoding::Channels:
      break;
  }
  const double largest = range_of_all.largest;
  const std::string range =
      "Colours of type " + name + (largest > 0 ? " with values up to " + number_text(largest) : "") + " taken as ";
  if (white) return range + "0 to " + number_text(*white);
  if (type == PlyScalar::UInt8) return {};
  if (type == PlyScalar::Int8) return "Colours of type char taken as bytes: negative ones are 128 to 255";
  if (are_shares(type, range_of_all)) return range + "shares of 1, times 255";
  if (are_levels(type, range_of_all)) return range + "0 to 255";
  if (largest < kWhite10Bit + 0.5) return range + "10 bits, 0 to 1023";
  if (largest < kWhite12Bit + 0.5) return range + "12 bits, 0 to 4095";
  return range + "16 bits, divided by 257";
}

std::string white_doubt(PlyScalar type, const ColourRange& range) {
  if (are_shares(type, range) || are_levels(type, range) || range.largest > kWhite14Bit + 0.5) return {};
  const std::string level = number_text(std::ceil(range.largest * kSixteenToEight)) + " of 255";
  if (range.largest < kWhite12Bit + 0.5) {
    return "As 16 bits no colour would be brighter than " + level + "; where they are, --colour-white 65535";
  }
  return "No colour is brighter than " + level + "; where 16383 is white in the file (14 bits), --colour-white 16383";
}

}  // namespace spectra::files
