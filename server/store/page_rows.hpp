#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "server/store/stored_row.hpp"

/// Rows read from the pages of a store file without SQLite: what a damaged file is searched with, and its log.
/// Format: https://www.sqlite.org/fileformat2.html, sections 1.6 and 2.1. Safe on any bytes.
namespace spectra::store {

/// Of every store file.
inline constexpr std::uint32_t kPageBytes = 8192;

/// One row on a leaf of a table: its number and its record, the rest of which may stand on other pages.
struct PageRow {
  std::uint64_t number = 0;
  std::uint64_t record_bytes = 0;
  std::string_view local;           ///< The part of the record on this page.
  std::uint32_t overflow_page = 0;  ///< Where it goes on; 0: nowhere.
};

/// The rows of a page; none when it is no leaf of a table. `is_first`: the page begins with the header of the file.
std::vector<PageRow> rows_of(std::string_view page, bool is_first);

/// The two blobs of a record (number, bytes, checksum) that is whole, or empty views.
struct ChecksummedBytes {
  std::string_view bytes;
  std::string_view checksum;
};
ChecksummedBytes checksummed_bytes(std::string_view record);

/// Where the blob of a record (number, bytes) begins, and how long it is.
struct BlobPlace {
  bool is_one = false;  ///< Whether it is such a record.
  std::uint64_t offset = 0;
  std::uint64_t size = 0;
};
BlobPlace only_blob(const PageRow& row);

/// Whether the row says this of itself and its checksum is right.
bool is_right(RowKind kind, std::uint64_t number, const ChecksummedBytes& row);

}  // namespace spectra::store
