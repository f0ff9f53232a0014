#include "server/store/page_rows.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>

namespace spectra::store {
namespace {

constexpr std::uint64_t kFileHeaderBytes = 100;
constexpr char kTableLeaf = 0x0d;

/// SQLite's integers of 1 to 9 bytes; nullopt where the bytes end before they do.
std::optional<std::uint64_t> take_varint(std::string_view& bytes) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < 9 && i < bytes.size(); ++i) {
    const auto byte = static_cast<unsigned char>(bytes[i]);
    value = i == 8 ? value << 8U | byte : value << 7U | (byte & 0x7fU);
    if (i == 8 || byte < 0x80) {
      bytes.remove_prefix(i + 1);
      return value;
    }
  }
  return std::nullopt;
}

std::size_t u16(std::string_view bytes, std::size_t at) {
  return static_cast<std::size_t>(static_cast<unsigned char>(bytes[at])) << 8U |
         static_cast<unsigned char>(bytes[at + 1]);
}

std::optional<PageRow> row_at(std::string_view page, std::size_t at) {
  auto rest = page.substr(at);
  const auto size = take_varint(rest);
  const auto number = size ? take_varint(rest) : std::nullopt;
  if (!number) return std::nullopt;
  PageRow row{*number, *size, {}, 0};
  constexpr std::uint64_t kMostLocal = kPageBytes - 35;
  constexpr std::uint64_t kLeastLocal = (kPageBytes - 12) * 32 / 255 - 23;
  std::uint64_t local = row.record_bytes;
  if (local > kMostLocal) {
    local = kLeastLocal + (row.record_bytes - kLeastLocal) % (kPageBytes - 4);
    if (local > kMostLocal) local = kLeastLocal;
    if (rest.size() < local + 4) return std::nullopt;
    for (std::size_t i = 0; i < 4; ++i) {
      row.overflow_page = row.overflow_page << 8U | static_cast<unsigned char>(rest[local + i]);
    }
  }
  if (rest.size() < local) return std::nullopt;
  row.local = rest.substr(0, local);
  return row;
}

/// The sizes of the blobs of a record whose first column is its row number, and where they begin.
struct Blobs {
  std::array<std::uint64_t, 2> sizes{};
  std::size_t count = 0;
  std::uint64_t offset = 0;
};

std::optional<Blobs> blobs_of(std::string_view start_of_record) {
  auto rest = start_of_record;
  const auto header_bytes = take_varint(rest);
  if (!header_bytes || *header_bytes > start_of_record.size()) return std::nullopt;
  const std::size_t length_bytes = start_of_record.size() - rest.size();
  if (*header_bytes < length_bytes) return std::nullopt;
  auto types = start_of_record.substr(length_bytes, *header_bytes - length_bytes);
  if (take_varint(types) != std::uint64_t{0}) return std::nullopt;
  Blobs blobs;
  blobs.offset = *header_bytes;
  while (!types.empty()) {
    const auto type = take_varint(types);
    if (!type || *type < 12 || *type % 2 != 0 || blobs.count == blobs.sizes.size()) return std::nullopt;
    blobs.sizes[blobs.count++] = (*type - 12) / 2;
  }
  return blobs;
}

}  // namespace

std::vector<PageRow> rows_of(std::string_view page, bool is_first) {
  std::vector<PageRow> rows;
  const std::size_t start = is_first ? kFileHeaderBytes : 0;
  if (page.size() != kPageBytes || page[start] != kTableLeaf) return rows;
  const std::size_t count = u16(page, start + 3);
  const std::size_t places = start + 8;
  for (std::size_t i = 0; i < count && places + 2 * i + 2 <= page.size(); ++i) {
    const std::size_t at = u16(page, places + 2 * i);
    if (at >= page.size()) continue;
    if (auto row = row_at(page, at)) rows.push_back(*row);
  }
  return rows;
}

ChecksummedBytes checksummed_bytes(std::string_view record) {
  const auto blobs = blobs_of(record);
  if (!blobs || blobs->count != 2) return {};
  const std::uint64_t room = record.size() - blobs->offset;
  if (blobs->sizes[0] > room || blobs->sizes[1] != room - blobs->sizes[0]) return {};
  return {record.substr(blobs->offset, blobs->sizes[0]), record.substr(blobs->offset + blobs->sizes[0])};
}

BlobPlace only_blob(const PageRow& row) {
  const auto blobs = blobs_of(row.local);
  if (!blobs || blobs->count != 1 || blobs->offset + blobs->sizes[0] != row.record_bytes) return {};
  return {true, blobs->offset, blobs->sizes[0]};
}

bool is_right(RowKind kind, std::uint64_t number, const ChecksummedBytes& row) {
  const Checksum wanted = row_checksum(kind, number, row.bytes);
  return row.checksum.size() == wanted.size() &&
         std::equal(wanted.begin(), wanted.end(), row.checksum.begin(),
                    [](unsigned char a, char b) { return a == static_cast<unsigned char>(b); });
}

}  // namespace spectra::store
