#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "server/store/store_error.hpp"

namespace spectra::store {

/// What came of a salvaging.
struct SalvageReport {
  std::uint64_t block_count = 0;    ///< In the map of the new store.
  std::uint64_t earlier_count = 0;  ///< Earlier revisions of blocks beside them.
  std::uint64_t constant_count = 0;
  std::vector<std::string> lost;  ///< What is not, in sentences; empty: nothing is lost.
};

/// Writes every block of a store with the right hash, in whatever state the file is, into a new store, with revisions, times and
/// constants. Looks at every page of the file and of its log for rows that prove themselves; never changes either, and holds one
/// block in memory. `into`: an empty file; whole when this returns without error. `progress` is told the share that is done.
/// Damaged when there is nothing to be found; errors of reading and writing.
StoreResult<SalvageReport> salvage(const std::string& file, const std::string& into,
                                   const std::function<void(double)>& progress);

}  // namespace spectra::store
