#include "fusion/files/ply_stream.hpp"

#include <algorithm>
#include <iterator>
#include <limits>
#include <system_error>
#include <utility>

#include "fusion/files/ply_body_reader.hpp"
#include "fusion/files/ply_notes.hpp"

namespace spectra::files {

namespace {

template <class T>
base::Result<T> located(base::Result<T> result, const std::string& name) {
  if (result) return result;
  base::Error error = std::move(result).error();
  error.message = name + ": " + error.message;
  if (error.field.empty()) error.field = name;
  return BOOST_OUTCOME_V2_NAMESPACE::failure(std::move(error));
}

/// Every line feed byte of a binary body stands after a carriage return, and there are several: the file went through a
/// transfer that took it for text and made two bytes of one. Moves the file.
bool is_damaged_as_text(BlockFile& file, const PlyHeader& header) {
  if (header.format == PlyFormat::Ascii) return false;
  constexpr std::uint64_t kFewest = 4;
  std::uint64_t count = 0;
  unsigned char last = 0;
  file.seek(header.size_bytes);
  for (auto bytes = file.ready(1); !bytes.empty(); bytes = file.ready(1)) {
    for (const unsigned char byte : bytes) {
      if (byte == '\n' && last != '\r') return false;
      count += byte == '\n' ? 1U : 0U;
      last = byte;
    }
    file.consume(bytes.size());
  }
  return count >= kFewest;
}

/// A binary body that is text in UTF-8, as numbers never are by chance: a program has read it as text and written it again.
bool is_recoded_as_utf8(BlockFile& file, const PlyHeader& header) {
  if (header.format == PlyFormat::Ascii) return false;
  constexpr std::size_t kLookedAt = 65'536;
  constexpr std::size_t kFewest = 16;
  file.seek(header.size_bytes);
  auto bytes = file.ready(kLookedAt);
  if (bytes.size() > kLookedAt) bytes = bytes.first(kLookedAt);
  std::size_t count = 0;
  int following = 0;
  for (const unsigned char byte : bytes) {
    if (following > 0) {
      if ((byte & 0xC0U) != 0x80U) return false;
      --following;
    } else if (byte >= 0x80U) {
      if (byte < 0xC2U || byte > 0xF4U) return false;
      following = byte >= 0xF0U ? 3 : byte >= 0xE0U ? 2 : 1;
      ++count;
    }
  }
  return count >= kFewest;
}

/// What the body is when it is not what the header says; empty when nothing is known.
std::string_view told_wrongly(BlockFile& file, const PlyHeader& header) {
  constexpr std::size_t kLookedAt = 4096;
  file.seek(header.size_bytes);
  auto bytes = file.ready(kLookedAt);
  if (bytes.size() > kLookedAt) bytes = bytes.first(kLookedAt);
  const auto is_text = [](unsigned char byte) {
    return byte == '\t' || byte == '\n' || byte == '\r' || (byte >= ' ' && byte <= '~');
  };
  const auto is_control = [](unsigned char byte) { return byte < '\t' || (byte > '\r' && byte < ' '); };
  if (header.format == PlyFormat::Ascii) {
    // One may be damage.
    constexpr std::ptrdiff_t kOneIn = 20;
    return std::count_if(bytes.begin(), bytes.end(), is_control) * kOneIn > std::ssize(bytes)
               ? "the header says ascii, but what follows is binary: give its format line "
                 "binary_little_endian or binary_big_endian"
               : "";
  }
  // A few bytes may look like text by chance.
  constexpr std::size_t kFewest = 16;
  return bytes.size() >= kFewest && std::all_of(bytes.begin(), bytes.end(), is_text)
             ? "the header says binary, but what follows is text: give its format line ascii"
             : "";
}

}  // namespace

base::Result<PlyStream> PlyStream::open(const std::filesystem::path& path, const ReadOptions& options) {
  BOOST_OUTCOME_TRY(check_read_options(options));
  const std::string name = path.filename().empty() ? path.string() : path.filename().string();
  BOOST_OUTCOME_TRY(auto file, located(BlockFile::open(path), name));
  PlyStream stream(std::move(file), name, options);
  if (options.progress) {
    stream.file_.set_watcher([progress = options.progress](double share) { progress(base::kReadingPhase, share); });
  }
  BOOST_OUTCOME_TRY(located(stream.interpret(), name));
  return stream;
}

base::Result<void> PlyStream::interpret() {
  const auto bytes = file_.ready(kMaxPlyHeaderBytes);
  if (file_.read_error() != 0) {
    return base::failure(base::ErrorCode::FileUnreadable,
                         "cannot be read: " + std::generic_category().message(file_.read_error()));
  }
  const std::string text(bytes.begin(),
                         bytes.begin() + static_cast<std::ptrdiff_t>(std::min(bytes.size(), kMaxPlyHeaderBytes)));
  BOOST_OUTCOME_TRY(header_, parse_ply_header(text));
  PlySchema& schema = interpretation_.schema;
  BOOST_OUTCOME_TRY(schema, ply_schema(header_, options_));
  BOOST_OUTCOME_TRY(check_size());
  if (std::string reason = misplaced_positions(file_, header_, schema); !reason.empty()) {
    return base::failure(base::ErrorCode::BadValue, std::move(reason));
  }
  schema.true_colour_type = true_colour_type(file_, header_, schema);
  if (needs_survey(header_, schema)) {
    BOOST_OUTCOME_TRY(interpretation_.survey, ply_survey(file_, header_, schema, options_));
    if (!interpretation_.survey.is_temperature_plausible) schema.vertex[kTemperature].reset();
  }
  if (schema.has_vertex_colours()) {
    const auto& properties = vertices().properties;
    const auto is_byte = [&](const auto& index) { return properties[*index].type == PlyScalar::UInt8; };
    const auto first = schema.vertex.begin() + kRed;
    // The widest type tells how the three are meant.
    PlyScalar type = properties[*schema.vertex[kRed]].type;
    for (auto index = first; index != first + 3; ++index) {
      if (!is_byte(*index)) type = properties[**index].type;
    }
    type = schema.true_colour_type.value_or(type);
    BOOST_OUTCOME_TRY(
        interpretation_.colours,
        colour_conversion(schema.colour_coding, type, interpretation_.survey.colour_range, options_.colour_white));
    interpretation_.colours.is_bytes = interpretation_.colours.factor == 1 &&
                                       schema.colour_coding == ColourCoding::Channels &&
                                       header_.format != PlyFormat::Ascii && std::all_of(first, first + 3, is_byte);
  }
  return base::success();
}

base::Result<void> PlyStream::check_size() {
  // The last separator of a text file may be missing.
  const bool is_text = header_.format == PlyFormat::Ascii;
  std::uint64_t left = file_.size_bytes() - header_.size_bytes + (is_text ? 1 : 0);
  for (const PlyElement& element : header_.elements) {
    const std::uint64_t entry_bytes = minimum_entry_bytes(element, header_.format);
    if (entry_bytes > 0 && element.count > left / entry_bytes) {
      const std::uint64_t bytes = left - (is_text ? 1 : 0);
      const std::string_view wrong = told_wrongly(file_, header_);
      if (!wrong.empty()) return base::failure(base::ErrorCode::BadValue, std::string(wrong));
      return base::failure(base::ErrorCode::Truncated,
                           "the header promises " + std::to_string(element.count) + " entries of '" +
                               printable(element.name) + "' of at least " + counted(entry_bytes, "byte", "bytes") +
                               " each, but " + counted(bytes, "byte is", "bytes are") + " left for them");
    }
    left -= element.count * entry_bytes;
  }
  constexpr std::uint64_t kMaxVertices = std::numeric_limits<std::int32_t>::max();
  if (vertex_count() > kMaxVertices) {
    return base::failure(base::ErrorCode::TooLarge, std::to_string(vertex_count()) + " vertices, at most " +
                                                        std::to_string(kMaxVertices) + " are read");
  }
  return base::success();
}

std::uint64_t PlyStream::triangle_count_limit() const {
  const auto& list = interpretation_.schema.corner_list;
  if (!list) return 0;
  const PlyElement& faces = *header_.find("face");
  const bool is_text = header_.format == PlyFormat::Ascii;
  const std::uint64_t corner_bytes = is_text ? 2 : size_bytes(faces.properties[*list].type);
  const std::uint64_t triangle_bytes = minimum_entry_bytes(faces, header_.format) + 3 * corner_bytes;
  return std::min(faces.count, (file_.size_bytes() - header_.size_bytes) / triangle_bytes + 1);
}

bool PlyStream::has_visible() const {
  return interpretation_.schema.has_vertex_colours() || interpretation_.schema.has_face_colours();
}

bool PlyStream::has_temperature() const {
  return interpretation_.schema.has_vertex_temperature() || interpretation_.schema.has_face_temperature();
}

bool PlyStream::has_double_positions() const {
  const PlySlots& slots = interpretation_.schema.vertex;
  return std::any_of(slots.begin() + kX, slots.begin() + kZ + 1, [this](const auto& index) {
    const PlyScalar type = vertices().properties[*index].type;
    return type != PlyScalar::Float32 && size_bytes(type) >= 4;
  });
}

base::Result<PlyBodyFacts> PlyStream::read(const PlyHandlers& handlers) {
  PlyBodyReader reader(file_, header_, interpretation_, handlers, polygon_positions_);
  base::Result<PlyBodyFacts> facts = reader.read();
  return reader.handler_has_failed() ? std::move(facts) : located(with_reason(std::move(facts)), name_);
}

bool PlyStream::leave_out_holes(const PlyBodyFacts& facts) {
  if (facts.holes.empty()) return false;
  interpretation_.holes = facts.holes;
  return true;
}

/// What does not fit in a damaged file, or is left over, is only what came of the damage.
base::Result<PlyBodyFacts> PlyStream::with_reason(base::Result<PlyBodyFacts> facts) {
  if (facts && facts.value().trailing_byte_count == 0) return facts;
  if (const std::string_view wrong = told_wrongly(file_, header_); !facts && !wrong.empty()) {
    return base::failure(base::ErrorCode::BadValue, std::string(wrong));
  }
  if (is_recoded_as_utf8(file_, header_)) {
    return base::failure(
        base::ErrorCode::BadValue,
        "the file was damaged by a program that took it for text and wrote it again in UTF-8; transfer "
        "it again as binary");
  }
  if (!is_damaged_as_text(file_, header_)) return facts;
  return base::failure(
      base::ErrorCode::BadValue,
      "the file was damaged on its way by a transfer that took it for text (every line feed byte has become "
      "two bytes); transfer it again as binary");
}

std::vector<Note> PlyStream::notes(const PlyBodyFacts& facts) const {
  return ply_notes(header_, interpretation_, options_, facts);
}

}  // namespace spectra::files
