#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "fusion/base/vertex_types.hpp"
#include "fusion/files/ply_header.hpp"
#include "fusion/files/ply_schema.hpp"

namespace spectra::files {

/// How far the channels of a file's colours go.
struct ColourRange {
  double largest = 0;             ///< Of the finite ones.
  std::uint64_t lit_count = 0;    ///< Above 0.
  std::uint64_t share_count = 0;  ///< Above 0, up to 1.
  bool has_fractions = false;

  void add(std::span<const double> values);
  /// Most of them are shares of white, so that what is larger is over-exposed. Whole numbers are dark levels.
  bool has_mostly_shares() const { return has_fractions && 4 * share_count > 3 * lit_count; }
};

/// Turns the numbers of a file into visible colours: byte = round(factor * value + offset), or a packed one unpacked.
struct ColourConversion {
  bool is_packed = false;
  bool is_packed_floating = false;  ///< Packed into the bits of a float, not into a whole number.
  bool is_bytes = false;            ///< They are whole numbers from 0 to 255 already.
  bool is_wrapped = false;          ///< Bytes that were declared as char: negative ones are 128 to 255.
  double factor = 1;
  double offset = 0;

  /// `values` are as long as `colours` (packed ones: the first alone). Below black and above white are taken as those, NaN
  /// as mid grey, and so are packed ones that are no colour: how many vertices that concerns is added to `outside_count`; a
  /// hair outside does not count.
  void convert(std::array<std::span<const double>, 3> values, std::span<base::Rgb8> colours,
               std::uint64_t& outside_count) const;
};

/// The conversion for colours of that coding, type and range: to 255 as they are, larger ones of 10, 12 or 16 bits, floats up to about
/// 1, or nearly all of them, as shares of white. `white`: what people said is white, of channels. An error tells what is too large.
base::Result<ColourConversion> colour_conversion(ColourCoding coding, PlyScalar type, const ColourRange& range,
                                                 std::optional<double> white);

/// What was done to colours that are no bytes, for people; empty when nothing was.
std::string conversion_text(ColourCoding coding, PlyScalar type, const ColourRange& range, std::optional<double> white);

/// What else could be white of channels that were taken so, where that is not certain; empty: it is.
std::string white_doubt(PlyScalar type, const ColourRange& range);

}  // namespace spectra::files
