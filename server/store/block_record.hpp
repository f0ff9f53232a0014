#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "fusion/base/vertex_types.hpp"
#include "server/store/sha256.hpp"
#include "server/store/store_error.hpp"

namespace spectra::store {

/// Counts the changes of a store, over all of its blocks: 1, 2, 3 and so on; a deletion is a change, too.
using Revision = std::uint64_t;

/// The server's clock at the moment a change was accepted.
using StoreTime = std::chrono::sys_time<std::chrono::microseconds>;

/// Bytes that several may hold and nobody changes.
using SharedBytes = std::shared_ptr<const std::string>;

/// Smallest and largest coordinates of a block, metres, as the file has them after its reading options.
struct BlockBounds {
  base::Vec3d min, max;
  friend bool operator==(const BlockBounds&, const BlockBounds&) = default;
};

/// What is known of a block beside its bytes and what the store itself adds.
struct BlockDescription {
  std::string id;                     ///< 1 to 64 of a-z A-Z 0-9 . _ -
  std::optional<double> observed_at;  ///< When the sensor saw it, Unix seconds.
  std::optional<base::Vec3d> sensor;  ///< Where the sensor was, metres.
  std::string read_options;           ///< How the bytes are to be read, as text; the store does not look into it.
  std::uint64_t vertex_count = 0;
  std::uint64_t triangle_count = 0;
  BlockBounds bounds;
  friend bool operator==(const BlockDescription&, const BlockDescription&) = default;
};

/// A block as it is handed to the store.
struct BlockRecord {
  BlockDescription description;
  SharedBytes ply;  ///< Exactly as received.
  SharedBytes
      baseline;  ///< What belongs to this revision beside it; the store does not look into it. May be null: nothing.
};

/// A block as the store lists it: without its bytes.
struct BlockFacts {
  BlockDescription description;
  Revision revision = 0;
  StoreTime accepted_at;
  std::uint64_t size_bytes = 0;
  Sha256 sha256{};  ///< Of the bytes.
  std::uint64_t baseline_bytes = 0;
  Sha256 baseline_sha256{};  ///< Where there are any.

  /// What is written of it beside its row.
  std::uint64_t body_bytes() const { return size_bytes + baseline_bytes; }
  friend bool operator==(const BlockFacts&, const BlockFacts&) = default;
};

/// A block with its bytes, whose hash was found right.
struct StoredBlock {
  BlockFacts facts;
  SharedBytes ply;
  SharedBytes baseline;  ///< Null: nothing.
};

/// The bytes that are written of a block: those of its PLY, then those of its baseline.
SharedBytes body_of(const BlockRecord& record);
/// Whether they are what these facts tell of.
bool is_body_of(const BlockFacts& facts, std::string_view body);

/// The largest block, bytes: SQLite's bound on a row, less room for what stands beside.
inline constexpr std::uint64_t kLargestBlockBytes = 999'000'000;
/// The longest text of reading options, bytes.
inline constexpr std::size_t kLongestReadOptions = 64 * 1024;

bool is_block_id(std::string_view id);

/// InvalidRecord or TooLarge, naming what is wrong. Safe on untrusted input.
StoreResult<void> check_record(const BlockRecord& record);

}  // namespace spectra::store
