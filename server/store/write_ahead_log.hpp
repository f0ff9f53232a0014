#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "server/store/store_error.hpp"

namespace spectra::store {

/// What stands in the log beside a store file (FILE-wal). SQLite takes a frame with a wrong checksum for the end of the log, as
/// it is after a power cut; but it may also be damage in the middle, behind which acknowledged changes stand.
/// Format: https://www.sqlite.org/fileformat2.html, section 4.
struct WriteAheadLog {
  struct Frame {
    std::uint32_t page = 0;    ///< Counted from 1.
    std::uint64_t offset = 0;  ///< Of its bytes in the log.
  };
  bool exists = false;  ///< With at least one frame.
  bool has_right_header = false;
  std::vector<Frame> committed;            ///< Up to the last right commit, in order.
  std::vector<Frame> beyond;               ///< What follows and says that it belongs to the same log.
  std::uint64_t newest_commit_beyond = 0;  ///< The highest StoreState::commit in `beyond`; 0: none.
};

/// Reads FILE-wal. IoError when it cannot be read.
StoreResult<WriteAheadLog> read_log(const std::string& file);

}  // namespace spectra::store
