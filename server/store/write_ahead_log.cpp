#include "server/store/write_ahead_log.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <system_error>

#include "server/store/page_rows.hpp"

namespace spectra::store {
namespace {

constexpr std::size_t kHeaderBytes = 32;
constexpr std::size_t kFrameHeaderBytes = 24;

std::uint32_t word(std::string_view bytes, std::size_t at, bool is_big_endian = true) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto byte = std::uint32_t{static_cast<unsigned char>(bytes[at + i])};
    value |= byte << (8 * (is_big_endian ? 3 - i : i));
  }
  return value;
}

/// SQLite's running sum over pairs of words.
struct LogSum {
  bool is_big_endian = false;
  std::uint32_t a = 0, b = 0;

  void add(std::string_view bytes) {
    for (std::size_t at = 0; at + 8 <= bytes.size(); at += 8) {
      a += word(bytes, at, is_big_endian) + b;
      b += word(bytes, at + 4, is_big_endian) + a;
    }
  }
  bool is(std::uint32_t first, std::uint32_t second) const { return a == first && b == second; }
};

std::uint64_t commit_on(std::string_view page) {
  std::uint64_t commit = 0;
  for (const PageRow& row : rows_of(page, false)) {
    const auto fields = checksummed_bytes(row.local);
    if (!is_right(RowKind::State, row.number, fields)) continue;
    if (const auto state = decode_state(fields.bytes)) commit = std::max(commit, state->commit);
  }
  return commit;
}

}  // namespace

StoreResult<WriteAheadLog> read_log(const std::string& file) {
  const std::string path = file + "-wal";
  WriteAheadLog log;
  std::error_code error;
  const auto size = std::filesystem::file_size(path, error);
  if (error || size <= kHeaderBytes) return log;
  std::ifstream stream(path, std::ios::binary);
  std::array<char, kHeaderBytes> header_bytes{};
  if (!stream.read(header_bytes.data(), kHeaderBytes)) {
    return failure(StoreErrorCode::IoError, path + " cannot be read");
  }
  const std::string_view header(header_bytes.data(), header_bytes.size());
  log.exists = true;
  constexpr std::uint32_t kMagic = 0x377f0682;
  LogSum sum;
  sum.is_big_endian = (word(header, 0) & 1U) != 0;
  sum.add(header.substr(0, 24));
  log.has_right_header = (word(header, 0) & ~std::uint32_t{1}) == kMagic && word(header, 8) == kPageBytes &&
                         sum.is(word(header, 24), word(header, 28));
  std::string salts(header.substr(16, 8));

  std::string bytes(kFrameHeaderBytes + kPageBytes, '\0');
  const std::string_view frame(bytes);
  std::size_t committed = 0;
  bool is_right = log.has_right_header;
  for (std::uint64_t offset = kHeaderBytes; stream.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
       offset += bytes.size()) {
    // Frames of an earlier round of the log may follow; the first is of the newest.
    if (!log.has_right_header && offset == kHeaderBytes) salts = frame.substr(8, 8);
    const bool is_of_this_log = frame.substr(8, 8) == salts;
    if (is_right) {
      sum.add(frame.substr(0, 8));
      sum.add(frame.substr(kFrameHeaderBytes));
      is_right = is_of_this_log && word(frame, 0) != 0 && sum.is(word(frame, 16), word(frame, 20));
    }
    if (!is_of_this_log) continue;
    log.beyond.push_back({word(frame, 0), offset + kFrameHeaderBytes});
    if (is_right && word(frame, 4) != 0) committed = log.beyond.size();
    if (!is_right)
      log.newest_commit_beyond = std::max(log.newest_commit_beyond, commit_on(frame.substr(kFrameHeaderBytes)));
  }
  if (stream.bad()) return failure(StoreErrorCode::IoError, path + " cannot be read");
  const auto end = log.beyond.begin() + static_cast<std::ptrdiff_t>(committed);
  log.committed.assign(log.beyond.begin(), end);
  log.beyond.erase(log.beyond.begin(), end);
  return log;
}

}  // namespace spectra::store
