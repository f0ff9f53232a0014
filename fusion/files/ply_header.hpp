#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "fusion/base/error.hpp"

namespace spectra::files {

enum class PlyFormat { Ascii, BinaryLittleEndian, BinaryBigEndian };

enum class PlyScalar : std::uint8_t { Int8, UInt8, Int16, UInt16, Int32, UInt32, Int64, UInt64, Float32, Float64 };

/// Bytes of one value in a binary file.
std::size_t size_bytes(PlyScalar type);
bool is_floating(PlyScalar type);
/// The type's name as headers have it: "uchar", "float" ...
std::string_view to_string(PlyScalar type);

struct PlyProperty {
  std::string name;
  PlyScalar type = PlyScalar::Float32;  ///< Of the value, or of a list's items.
  bool is_list = false;
  PlyScalar count_type = PlyScalar::UInt8;  ///< Lists only; never floating.
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;
};

/// The header of a PLY file: what its body is said to hold.
struct PlyHeader {
  PlyFormat format = PlyFormat::Ascii;
  std::vector<PlyElement>
      elements;  ///< In the order of the body; names are unique, as are those of properties in each:
                 ///< a second one of a name is called "name (2)".
  std::vector<std::string> comments;  ///< The lines "comment ..." and "obj_info ...", whole, in order.
  std::uint64_t size_bytes = 0;       ///< The body begins here.
  std::uint64_t line_count = 0;

  /// The element of that name, in any case, or nullptr.
  const PlyElement* find(std::string_view name) const;
};

/// A header must end within this many bytes.
inline constexpr std::size_t kMaxPlyHeaderBytes = std::size_t{256} * 1024;

/// Reads a header from the first bytes of a file, which must be at least kMaxPlyHeaderBytes of it or all there is.
/// Lines may end in LF, CR LF or CR; a byte order mark, blanks and empty lines are passed over, and keywords and types are
/// known in any case. What is no PLY file is called by its own name where that is known. Safe on untrusted input; BadHeader and Unsupported name the line.
base::Result<PlyHeader> parse_ply_header(std::string_view text);

/// A word in lower case; ASCII only.
std::string lower_case(std::string_view text);

/// A name from a file for a message, in UTF-8: short, and with '?' for what is no UTF-8 or what a terminal would obey.
std::string printable(std::string_view name);

/// The fewest bytes that the element's entries can take in the body, each; for ascii with its separators.
std::uint64_t minimum_entry_bytes(const PlyElement& element, PlyFormat format);

}  // namespace spectra::files
