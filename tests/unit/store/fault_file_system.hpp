#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace spectra::store {

/// SQLite's own file system with a layer in front that fails on demand and writes down what goes to the disk. One for the whole
/// process; to be used by one store at a time.
namespace fault_file_system {

/// To be given as StoreOptions::vfs. Registered by the first call.
std::string name();

enum class Fault { None, DiskFull, NoQuota, ReadOnly, WriteError, SyncError };

/// Lets `calls` writes, syncs and truncations through, then fails all that the fault is about until the next arm().
void arm(Fault fault, int calls);
/// How many calls failed since the last arm().
int failed_calls();

/// What went to the disk.
struct Operation {
  enum class Kind { Write, Sync, Truncate, Remove };
  Kind kind = Kind::Write;
  std::string path;
  std::uint64_t offset = 0;  ///< Of a truncation, the new size.
  std::string bytes;
};

void start_recording();
/// How many operations were recorded so far.
std::size_t recorded_count();
std::vector<Operation> stop_recording();

}  // namespace fault_file_system
}  // namespace spectra::store
