#include "fusion/files/ply_cursor.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <system_error>

#include "fusion/files/ply_values.hpp"

namespace spectra::files {

namespace {

/// A number in a text file must be written with at most this many characters.
constexpr std::size_t kMaxTokenBytes = 512;

bool is_line_end(unsigned char c) {
  return c == '\n' || c == '\r';
}
bool is_blank(unsigned char c) {
  return c == ' ' || c == '\t' || c == '\v' || c == '\f';
}
bool is_space(unsigned char c) {
  return is_blank(c) || is_line_end(c);
}

}  // namespace

bool has_no_list(const PlyElement& element) {
  return std::none_of(element.properties.begin(), element.properties.end(),
                      [](const PlyProperty& property) { return property.is_list; });
}

PlyCursor::PlyCursor(BlockFile& file, const PlyHeader& header)
    : file_(file),
      header_(header),
      is_text_(header.format == PlyFormat::Ascii),
      is_swapped_((header.format == PlyFormat::BinaryBigEndian) == (std::endian::native == std::endian::little)),
      line_(header.line_count) {
  file_.seek(header.size_bytes);
}

base::Result<void> PlyCursor::skip_element(const PlyElement& element) {
  if (element.properties.empty()) return base::success();
  if (!is_text_ && has_no_list(element)) {
    // The size of the file was seen to hold them.
    file_.skip(element.count * minimum_entry_bytes(element, header_.format));
    return base::success();
  }
  for (; entry < element.count; ++entry) {
    BOOST_OUTCOME_TRY(begin_entry(element));
    for (const PlyProperty& property : element.properties) {
      if (property.is_list) {
        BOOST_OUTCOME_TRY(skip_list(property));
      } else {
        BOOST_OUTCOME_TRY(skip_values(1, property.type));
      }
    }
    BOOST_OUTCOME_TRY(end_entry());
  }
  return base::success();
}

base::Result<void> PlyCursor::begin_entry(const PlyElement& element) {
  if (!is_text_ || element.properties.empty()) return base::success();
  for (auto bytes = file_.ready(1); !bytes.empty() && is_space(bytes[0]); bytes = file_.ready(1)) {
    if (bytes[0] == '\n') ++line_;
    file_.consume(1);
  }
  return base::success();
}

base::Result<void> PlyCursor::end_entry() {
  if (!is_text_) return base::success();
  for (auto bytes = file_.ready(1); !bytes.empty(); bytes = file_.ready(1)) {
    if (!is_space(bytes[0])) {
      return base::failure(base::ErrorCode::BadValue, where() + " has more values on its line than the header says");
    }
    // The line feed after a carriage return is passed over, and counted, before the next entry.
    const bool is_end = is_line_end(bytes[0]);
    if (bytes[0] == '\n') ++line_;
    file_.consume(1);
    if (is_end) break;
  }
  return base::success();
}

base::Result<std::string_view> PlyCursor::next_token() {
  auto bytes = file_.ready(1);
  while (!bytes.empty() && is_blank(bytes[0])) {
    file_.consume(1);
    bytes = file_.ready(1);
  }
  if (bytes.size() <= kMaxTokenBytes) bytes = file_.ready(kMaxTokenBytes + 1);
  if (bytes.empty()) return shortage();
  if (is_line_end(bytes[0])) {
    return base::failure(base::ErrorCode::BadValue, where() + " has fewer values on its line than the header says");
  }
  std::size_t size = 0;
  while (size < bytes.size() && size <= kMaxTokenBytes && !is_space(bytes[size])) ++size;
  if (size > kMaxTokenBytes) {
    return base::failure(base::ErrorCode::BadValue,
                         where() + " has a value of more than " + std::to_string(kMaxTokenBytes) + " characters");
  }
  file_.consume(size);
  return std::string_view(reinterpret_cast<const char*>(bytes.data()), size);
}

base::Error PlyCursor::not_a_number(std::string_view token) const {
  const std::string shown = "'" + printable(token) + "'";
  const auto commas = std::count(token.begin(), token.end(), ',');
  if (commas == 1 && token.front() != ',' && token.back() != ',') {
    return {base::ErrorCode::BadValue,
            where() + " has " + shown + ", a number with a decimal comma; write numbers with a decimal point",
            {}};
  }
  if (commas > 0 || token.find(';') != std::string_view::npos) {
    return {base::ErrorCode::BadValue,
            where() + " has " + shown + "; the values of a line are separated by blanks, not by commas or semicolons",
            {}};
  }
  return {base::ErrorCode::BadValue, where() + " has " + shown + ", which is not a number", {}};
}

base::Result<double> PlyCursor::read_value(PlyScalar type) {
  if (is_text_) {
    BOOST_OUTCOME_TRY(const std::string_view token, next_token());
    const auto value = parse_number(token);
    if (!value) return not_a_number(token);
    return *value;
  }
  const std::size_t size = size_bytes(type);
  const auto bytes = file_.ready(size);
  if (bytes.size() < size) return shortage();
  file_.consume(size);
  return is_swapped_ ? load_double<true>(type, bytes.data()) : load_double<false>(type, bytes.data());
}

base::Result<std::int64_t> PlyCursor::read_whole_number(PlyScalar type) {
  if (is_text_) {
    BOOST_OUTCOME_TRY(const std::string_view token, next_token());
    const auto value = parse_whole_number(token);
    if (!value) {
      return base::failure(base::ErrorCode::BadValue, where() + " has '" + printable(token) +
                                                          "' for a count or an index, which is not a whole number");
    }
    return *value;
  }
  BOOST_OUTCOME_TRY(const double value, read_value(type));
  constexpr double kLimit = 0x1p62;
  if (std::abs(value) > kLimit) {
    return base::failure(base::ErrorCode::BadValue, where() + " has a count or an index of " + number_text(value));
  }
  return static_cast<std::int64_t>(value);
}

base::Result<std::uint64_t> PlyCursor::read_list_count(const PlyProperty& property) {
  BOOST_OUTCOME_TRY(const std::int64_t count, read_whole_number(property.count_type));
  const std::uint64_t value_bytes = is_text_ ? 2 : size_bytes(property.type);
  if (count < 0) {
    return base::failure(base::ErrorCode::BadValue, where() + " has a list of " + std::to_string(count) + " values");
  }
  const std::uint64_t left = file_.remaining() + (is_text_ ? 1 : 0);
  if (static_cast<std::uint64_t>(count) > left / value_bytes) {
    return base::failure(base::ErrorCode::Truncated, where() + " has a list of " + std::to_string(count) +
                                                         " values, but only " + std::to_string(file_.remaining()) +
                                                         " bytes are left in the file");
  }
  return static_cast<std::uint64_t>(count);
}

base::Result<void> PlyCursor::skip_list(const PlyProperty& property) {
  BOOST_OUTCOME_TRY(const std::uint64_t count, read_list_count(property));
  return skip_values(count, property.type);
}

base::Result<void> PlyCursor::skip_values(std::uint64_t count, PlyScalar type) {
  if (!is_text_) {
    const std::uint64_t bytes = count * size_bytes(type);
    if (bytes > file_.remaining()) return shortage();
    file_.skip(bytes);
    return base::success();
  }
  for (std::uint64_t i = 0; i < count; ++i) {
    BOOST_OUTCOME_TRY(next_token());
  }
  return base::success();
}

std::uint64_t PlyCursor::trailing_bytes() {
  if (is_text_) {
    for (auto bytes = file_.ready(1); !bytes.empty() && is_space(bytes[0]); bytes = file_.ready(1)) {
      file_.consume(1);
    }
  }
  return file_.remaining();
}

base::Error PlyCursor::shortage() const {
  if (file_.read_error() != 0) {
    return {
        base::ErrorCode::FileUnreadable, "cannot be read: " + std::generic_category().message(file_.read_error()), {}};
  }
  return {base::ErrorCode::Truncated, "the file ends at " + where() + ", of " + std::to_string(element_->count), {}};
}

std::string PlyCursor::where() const {
  const std::string place = printable(element_->name) + " " + std::to_string(entry);
  return is_text_ ? "line " + std::to_string(line_ + 1) + ", " + place : place;
}

}  // namespace spectra::files
