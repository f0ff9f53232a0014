#include "fusion/files/ply_header.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <optional>
#include <set>
#include <utility>

#include "fusion/files/file_kind.hpp"

namespace spectra::files {

namespace {

constexpr int kMostOfOneName = 100;

struct TypeName {
  std::string_view name;
  PlyScalar type;
};

constexpr std::array<TypeName, 22> kTypeNames = {
    {{"char", PlyScalar::Int8},       {"uchar", PlyScalar::UInt8},    {"short", PlyScalar::Int16},
     {"ushort", PlyScalar::UInt16},   {"int", PlyScalar::Int32},      {"uint", PlyScalar::UInt32},
     {"float", PlyScalar::Float32},   {"double", PlyScalar::Float64}, {"int8", PlyScalar::Int8},
     {"uint8", PlyScalar::UInt8},     {"int16", PlyScalar::Int16},    {"uint16", PlyScalar::UInt16},
     {"int32", PlyScalar::Int32},     {"uint32", PlyScalar::UInt32},  {"float32", PlyScalar::Float32},
     {"float64", PlyScalar::Float64}, {"int64", PlyScalar::Int64},    {"uint64", PlyScalar::UInt64},
     {"long", PlyScalar::Int64},      {"ulong", PlyScalar::UInt64},   {"longlong", PlyScalar::Int64},
     {"ulonglong", PlyScalar::UInt64}}};

std::optional<PlyScalar> scalar_type(std::string_view word) {
  const std::string name = lower_case(word);
  for (const TypeName& entry : kTypeNames) {
    if (entry.name == name) return entry.type;
  }
  return std::nullopt;
}

std::string quoted(std::string_view text) {
  return "'" + printable(text) + "'";
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  std::size_t begin = 0;
  while ((begin = line.find_first_not_of(" \t", begin)) != std::string_view::npos) {
    const std::size_t end = std::min(line.find_first_of(" \t", begin), line.size());
    words.push_back(line.substr(begin, end - begin));
    begin = end;
  }
  return words;
}

struct CodeRange {
  std::uint32_t first, last;
};

/// Characters that are not seen themselves, but move a terminal, turn the text beside them round, or make two names look the
/// same: controls and formats (categories Cc, Cf, Zl and Zp of Unicode).
constexpr std::array<CodeRange, 20> kUnseen = {
    {{0, 0x9F},          {0xAD, 0xAD},       {0x600, 0x605},     {0x61C, 0x61C},     {0x6DD, 0x6DD},
     {0x70F, 0x70F},     {0x890, 0x891},     {0x8E2, 0x8E2},     {0x180E, 0x180E},   {0x200B, 0x200F},
     {0x2028, 0x202E},   {0x2060, 0x206F},   {0xFEFF, 0xFEFF},   {0xFFF9, 0xFFFB},   {0x110BD, 0x110BD},
     {0x110CD, 0x110CD}, {0x13430, 0x1343F}, {0x1BCA0, 0x1BCA3}, {0x1D173, 0x1D17A}, {0xE0000, 0xE007F}}};

/// The bytes of the UTF-8 character that the text begins with; 0 when it is none, or one that a terminal obeys or that turns
/// the text beside it round.
std::size_t visible_character_bytes(std::string_view text) {
  const auto byte = [text](std::size_t i) { return static_cast<std::uint32_t>(static_cast<unsigned char>(text[i])); };
  const std::uint32_t first = byte(0);
  if (first < 0x80U) return first >= ' ' && first <= '~' ? 1 : 0;
  const std::size_t size = first >= 0xF0U ? 4 : first >= 0xE0U ? 3 : 2;
  if (first < 0xC2U || first > 0xF4U || text.size() < size) return 0;
  std::uint32_t code = first & (0x7FU >> size);
  for (std::size_t i = 1; i < size; ++i) {
    if ((byte(i) & 0xC0U) != 0x80U) return 0;
    code = code << 6U | (byte(i) & 0x3FU);
  }
  constexpr std::array<std::uint32_t, 5> kLeast = {0, 0, 0x80, 0x800, 0x10000};
  const bool is_well_formed = code >= kLeast[size] && code <= 0x10FFFFU && (code < 0xD800U || code > 0xDFFFU);
  const bool is_control = std::any_of(kUnseen.begin(), kUnseen.end(), [code](const CodeRange& range) {
    return code >= range.first && code <= range.last;
  });
  return is_well_formed && !is_control ? size : 0;
}

class HeaderParser {
 public:
  explicit HeaderParser(std::string_view text) : text_(text) {}

  base::Result<PlyHeader> parse() {
    if (text_.empty()) return base::failure(base::ErrorCode::BadHeader, "the file is empty");
    BOOST_OUTCOME_TRY(read_first_line());
    std::string_view line;
    while (next_line(line)) {
      const std::vector<std::string_view> words = words_of(line);
      if (words.empty()) continue;
      const std::string keyword = lower_case(words[0]);
      if (keyword == "comment" || keyword == "obj_info") {
        header_.comments.emplace_back(line);
        continue;
      }
      if (keyword == "end_header") return finished();
      BOOST_OUTCOME_TRY(read_line(keyword, words));
    }
    if (text_.size() >= kMaxPlyHeaderBytes) {
      return base::failure(base::ErrorCode::BadHeader,
                           "no end_header within the first " + std::to_string(kMaxPlyHeaderBytes) + " bytes");
    }
    return base::failure(base::ErrorCode::BadHeader, "the file ends before end_header");
  }

 private:
  /// Passes over what editors put before the word, and finds out how lines end.
  base::Result<void> read_first_line() {
    constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
    if (text_.substr(0, kByteOrderMark.size()) == kByteOrderMark) position_ = kByteOrderMark.size();
    const std::size_t begin = text_.find_first_not_of(" \t\r\n", position_);
    const std::size_t end = begin == std::string_view::npos ? begin : text_.find_first_of("\r\n", begin);
    if (end != std::string_view::npos) {
      const std::size_t after = text_.find_first_not_of('\r', end);
      line_end_ = text_[end] == '\n' || (after != std::string_view::npos && text_[after] == '\n') ? '\n' : '\r';
    }
    std::string_view line;
    std::vector<std::string_view> words;
    while (words.empty() && next_line(line)) words = words_of(line);
    if (words.size() == 1 && lower_case(words[0]) == "ply") return base::success();
    const std::string_view kind = file_kind(text_);
    return base::failure(base::ErrorCode::BadHeader, kind.empty() ? "not a PLY file: the first line is not 'ply'"
                                                                  : "not a PLY file, but " + std::string(kind));
  }

  bool next_line(std::string_view& line) {
    const std::size_t end = text_.find(line_end_, position_);
    if (end == std::string_view::npos) return false;
    line = text_.substr(position_, end - position_);
    while (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    position_ = end + 1;
    ++line_number_;
    return true;
  }

  auto bad(base::ErrorCode code, const std::string& what) const {
    return base::failure(code, "header line " + std::to_string(line_number_) + ": " + what);
  }

  base::Result<void> read_line(const std::string& keyword, const std::vector<std::string_view>& words) {
    if (keyword == "format") return read_format(words);
    if (keyword == "element") return read_element(words);
    if (keyword == "property") return read_property(words);
    return bad(base::ErrorCode::BadHeader, "unknown keyword " + quoted(words[0]));
  }

  base::Result<void> read_format(const std::vector<std::string_view>& words) {
    if (has_format_) return bad(base::ErrorCode::BadHeader, "a second format line");
    if (words.size() != 3) return bad(base::ErrorCode::BadHeader, "a format line has a name and a version");
    const std::string format = lower_case(words[1]);
    if (format == "ascii") {
      header_.format = PlyFormat::Ascii;
    } else if (format == "binary_little_endian") {
      header_.format = PlyFormat::BinaryLittleEndian;
    } else if (format == "binary_big_endian") {
      header_.format = PlyFormat::BinaryBigEndian;
    } else {
      return bad(base::ErrorCode::Unsupported, "unknown format " + quoted(words[1]));
    }
    if (words[2] != "1.0") {
      return bad(base::ErrorCode::Unsupported, "PLY version " + quoted(words[2]) + ", only 1.0 is known");
    }
    has_format_ = true;
    return base::success();
  }

  base::Result<void> read_element(const std::vector<std::string_view>& words) {
    if (words.size() != 3) return bad(base::ErrorCode::BadHeader, "an element line has a name and a count");
    PlyElement element;
    element.name = words[1];
    const char* const end = words[2].data() + words[2].size();
    const auto [stop, status] = std::from_chars(words[2].data(), end, element.count);
    if (status != std::errc{} || stop != end) {
      return bad(base::ErrorCode::BadHeader, "element " + quoted(words[1]) + " has the count " + quoted(words[2]) +
                                                 ", which is not a whole number from 0 to 2^64 - 1");
    }
    if (!element_names_.insert(element.name).second) {
      return bad(base::ErrorCode::BadHeader, "a second element " + quoted(words[1]));
    }
    property_names_.clear();
    header_.elements.push_back(std::move(element));
    return base::success();
  }

  base::Result<void> read_property(const std::vector<std::string_view>& words) {
    if (header_.elements.empty()) return bad(base::ErrorCode::BadHeader, "a property before any element");
    PlyProperty property;
    property.is_list = words.size() > 1 && lower_case(words[1]) == "list";
    const std::size_t word_count = property.is_list ? 5 : 3;
    if (words.size() != word_count) {
      return bad(base::ErrorCode::BadHeader,
                 "a property line is 'property TYPE NAME' or "
                 "'property list COUNT_TYPE TYPE NAME'");
    }
    if (property.is_list) {
      const auto count_type = scalar_type(words[2]);
      if (!count_type || is_floating(*count_type)) {
        return bad(base::ErrorCode::BadHeader,
                   "a list's count has the type " + quoted(words[2]) + ", which is not a whole number's");
      }
      property.count_type = *count_type;
    }
    const auto type = scalar_type(words[word_count - 2]);
    if (!type) return bad(base::ErrorCode::BadHeader, "unknown type " + quoted(words[word_count - 2]));
    property.type = *type;
    property.name = words[word_count - 1];
    // Only the first one of a name is found by it.
    for (int number = 2; !property_names_.insert(property.name).second; ++number) {
      property.name = std::string(words[word_count - 1]) + " (" + std::to_string(number) + ")";
      if (number > kMostOfOneName) {
        return bad(base::ErrorCode::BadHeader, "too many properties " + quoted(words[word_count - 1]) + " in element " +
                                                   quoted(header_.elements.back().name));
      }
    }
    header_.elements.back().properties.push_back(std::move(property));
    return base::success();
  }

  base::Result<PlyHeader> finished() {
    if (!has_format_) return base::failure(base::ErrorCode::BadHeader, "the header has no format line");
    header_.size_bytes = position_;
    header_.line_count = line_number_;
    return std::move(header_);
  }

  std::string_view text_;
  std::size_t position_ = 0;
  char line_end_ = '\n';
  std::uint64_t line_number_ = 0;
  bool has_format_ = false;
  std::set<std::string> element_names_;
  std::set<std::string> property_names_;  ///< Of the last element.
  PlyHeader header_;
};

}  // namespace

std::string lower_case(std::string_view text) {
  std::string result(text);
  for (char& c : result) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return result;
}

std::string printable(std::string_view name) {
  constexpr std::size_t kMaxShown = 40;
  std::string shown;
  for (std::size_t count = 0; !name.empty() && count < kMaxShown; ++count) {
    const std::size_t size = visible_character_bytes(name);
    shown += size > 0 ? name.substr(0, size) : "?";
    name.remove_prefix(std::max<std::size_t>(1, size));
  }
  if (!name.empty()) shown += "...";
  return shown;
}

std::size_t size_bytes(PlyScalar type) {
  switch (type) {
    case PlyScalar::Int8:
    case PlyScalar::UInt8:
      return 1;
    case PlyScalar::Int16:
    case PlyScalar::UInt16:
      return 2;
    case PlyScalar::Int32:
    case PlyScalar::UInt32:
    case PlyScalar::Float32:
      return 4;
    case PlyScalar::Int64:
    case PlyScalar::UInt64:
    case PlyScalar::Float64:
      return 8;
  }
  return 0;
}

bool is_floating(PlyScalar type) {
  return type == PlyScalar::Float32 || type == PlyScalar::Float64;
}

std::string_view to_string(PlyScalar type) {
  return std::find_if(kTypeNames.begin(), kTypeNames.end(),
                      [type](const TypeName& entry) { return entry.type == type; })
      ->name;
}

const PlyElement* PlyHeader::find(std::string_view name) const {
  const auto found = std::find_if(
      elements.begin(), elements.end(),
      [wanted = lower_case(name)](const PlyElement& element) { return lower_case(element.name) == wanted; });
  return found == elements.end() ? nullptr : &*found;
}

base::Result<PlyHeader> parse_ply_header(std::string_view text) {
  return HeaderParser(text.substr(0, kMaxPlyHeaderBytes)).parse();
}

std::uint64_t minimum_entry_bytes(const PlyElement& element, PlyFormat format) {
  // In a text file every value takes a character and a separator.
  if (format == PlyFormat::Ascii) return 2 * element.properties.size();
  std::uint64_t bytes = 0;
  for (const PlyProperty& property : element.properties) {
    bytes += size_bytes(property.is_list ? property.count_type : property.type);
  }
  return bytes;
}

}  // namespace spectra::files
