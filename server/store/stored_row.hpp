#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "server/store/block_record.hpp"

/// Every small row of the store file is a number, some bytes that say everything, and a checksum over both. A row is believed
/// when its checksum is right, wherever in the file it was found: SQLite's pages have no checksums of their own.
namespace spectra::store {

/// The first half of a SHA-256.
using Checksum = std::array<unsigned char, 16>;

/// What a row is; part of its checksum, so that a row of one table is never taken for one of another.
enum class RowKind : char { Change = 'C', Constant = 'K', State = 'S' };

Checksum row_checksum(RowKind kind, std::uint64_t number, std::string_view bytes);

/// Unites checksums of any number of rows into one, in any order; the second time takes a row out again.
void toggle(Checksum& sum, const Checksum& of_row);

/// One change of the map: a block put, or its deletion (`is_removal`; then only id, revision and time mean something).
struct Change {
  BlockFacts facts;
  bool is_removal = false;
  friend bool operator==(const Change&, const Change&) = default;
};

std::string encode(const Change& change);
/// nullopt when the bytes are no change.
std::optional<Change> decode_change(Revision revision, std::string_view bytes);

/// One of the map's constants.
struct Constant {
  std::string key;
  std::string value;
};

std::string encode(const Constant& constant);
std::optional<Constant> decode_constant(std::string_view bytes);

/// Says what else must be there, so that a row that went missing is missed.
struct StoreState {
  std::uint64_t commit = 0;  ///< Counts transactions.
  bool is_open = false;      ///< Not closed in order since: a log must be beside the file.
  Revision last_revision = 0;
  Revision history_floor = 0;   ///< The map is known as it was at this revision and after.
  StoreTime history_floor_at;   ///< When that was accepted.
  std::uint64_t row_count = 0;  ///< Of changes and constants.
  Checksum rows{};              ///< Their checksums, united.
  friend bool operator==(const StoreState&, const StoreState&) = default;
};

std::string encode(const StoreState& state);
std::optional<StoreState> decode_state(std::string_view bytes);

}  // namespace spectra::store
