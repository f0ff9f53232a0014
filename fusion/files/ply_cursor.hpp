#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "fusion/base/error.hpp"
#include "fusion/files/block_file.hpp"
#include "fusion/files/ply_header.hpp"

namespace spectra::files {

/// The place in the body of a PLY file where reading stands: gives single values, checks them against the bytes that are
/// there, and knows what to call the place in a message. The one that reads an element says so and counts its entries.
class PlyCursor {
 public:
  /// The file and the header must outlive the cursor. Moves the file to the beginning of the body.
  PlyCursor(BlockFile& file, const PlyHeader& header);

  BlockFile& file() { return file_; }
  bool is_text() const { return is_text_; }
  /// Binary values are in the other byte order than the machine's.
  bool is_swapped() const { return is_swapped_; }

  /// What is read from now on.
  void begin_element(const PlyElement& element) {
    element_ = &element;
    entry = 0;
  }
  /// Of the element, counted from 0; for whoever reads it to move on.
  std::uint64_t entry = 0;

  /// Passes over all entries of the element, of whatever properties.
  base::Result<void> skip_element(const PlyElement& element);

  /// In a text file every entry stands on a line of its own; empty lines are passed over.
  base::Result<void> begin_entry(const PlyElement& element);
  base::Result<void> end_entry();

  base::Result<double> read_value(PlyScalar type);
  /// A value of a type that is not floating. BadValue when it does not fit.
  base::Result<std::int64_t> read_whole_number(PlyScalar type);
  /// So many values of the list follow; they can be there.
  base::Result<std::uint64_t> read_list_count(const PlyProperty& property);
  base::Result<void> skip_list(const PlyProperty& property);
  base::Result<void> skip_values(std::uint64_t count, PlyScalar type);

  /// After the last element: bytes that belong to nothing; white space at the end of a text file does not count.
  std::uint64_t trailing_bytes();

  /// The file has fewer bytes than the header promises, or cannot be read.
  base::Error shortage() const;
  /// "vertex 12", counted from 0; with the line of a text file before it.
  std::string where() const;

 private:
  base::Result<std::string_view> next_token();
  base::Error not_a_number(std::string_view token) const;

  BlockFile& file_;
  const PlyHeader& header_;
  const bool is_text_;
  const bool is_swapped_;
  const PlyElement* element_ = nullptr;
  std::uint64_t line_ = 0;  ///< Line ends before this place, in a text file.
};

/// No property of the element is a list, so that all its entries have the same size in a binary file.
bool has_no_list(const PlyElement& element);

}  // namespace spectra::files
