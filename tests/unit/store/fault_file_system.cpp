#include "tests/unit/store/fault_file_system.hpp"

#include <sqlite3.h>

#include <cerrno>
#include <mutex>
#include <new>
#include <utility>

namespace spectra::store::fault_file_system {
namespace {

std::mutex mutex;
Fault armed = Fault::None;
int calls_left = 0;
int failures = 0;
bool is_recording = false;
std::vector<Operation> operations;

struct File {
  sqlite3_file base;
  std::string* path;
  sqlite3_file* real;  // Behind this struct.
};

File* mine(sqlite3_file* file) {
  return reinterpret_cast<File*>(file);
}

sqlite3_file* real(sqlite3_file* file) {
  return mine(file)->real;
}

sqlite3_vfs* below() {
  static sqlite3_vfs* const vfs = sqlite3_vfs_find("unix");
  return vfs;
}

/// What a call is to answer in place of being done, or SQLITE_OK.
int answer(bool is_sync) {
  if (armed == Fault::None || (armed == Fault::SyncError) != is_sync || calls_left-- > 0) return SQLITE_OK;
  calls_left = 0;
  ++failures;
  if (is_sync) return SQLITE_IOERR_FSYNC;
  return armed == Fault::DiskFull ? SQLITE_FULL : SQLITE_IOERR_WRITE;
}

/// errno of the armed fault.
int fault_number() {
  switch (armed) {
    case Fault::DiskFull:
      return ENOSPC;
    case Fault::NoQuota:
      return EDQUOT;
    case Fault::ReadOnly:
      return EROFS;
    default:
      return EIO;
  }
}

void record(Operation operation) {
  if (is_recording) operations.push_back(std::move(operation));
}

int close_file(sqlite3_file* file) {
  const int code = real(file)->pMethods->xClose(real(file));
  delete mine(file)->path;
  return code;
}
int read_file(sqlite3_file* file, void* to, int count, sqlite3_int64 offset) {
  return real(file)->pMethods->xRead(real(file), to, count, offset);
}
int write_file(sqlite3_file* file, const void* from, int count, sqlite3_int64 offset) {
  const std::lock_guard lock(mutex);
  if (const int code = answer(false)) return code;
  const int code = real(file)->pMethods->xWrite(real(file), from, count, offset);
  record({Operation::Kind::Write, *mine(file)->path, static_cast<std::uint64_t>(offset),
          std::string(static_cast<const char*>(from), static_cast<std::size_t>(count))});
  return code;
}
int truncate_file(sqlite3_file* file, sqlite3_int64 size) {
  const std::lock_guard lock(mutex);
  if (const int code = answer(false)) return code;
  record({Operation::Kind::Truncate, *mine(file)->path, static_cast<std::uint64_t>(size), {}});
  return real(file)->pMethods->xTruncate(real(file), size);
}
int sync_file(sqlite3_file* file, int flags) {
  const std::lock_guard lock(mutex);
  if (const int code = answer(true)) return code;
  const int code = real(file)->pMethods->xSync(real(file), flags);
  record({Operation::Kind::Sync, *mine(file)->path, 0, {}});
  return code;
}
int size_of_file(sqlite3_file* file, sqlite3_int64* size) {
  return real(file)->pMethods->xFileSize(real(file), size);
}
int lock_file(sqlite3_file* file, int level) {
  return real(file)->pMethods->xLock(real(file), level);
}
int unlock_file(sqlite3_file* file, int level) {
  return real(file)->pMethods->xUnlock(real(file), level);
}
int check_reserved_lock(sqlite3_file* file, int* result) {
  return real(file)->pMethods->xCheckReservedLock(real(file), result);
}
int control_file(sqlite3_file* file, int operation, void* argument) {
  if (operation == SQLITE_FCNTL_LAST_ERRNO) {
    const std::lock_guard lock(mutex);
    if (failures > 0) {
      *static_cast<int*>(argument) = fault_number();
      return SQLITE_OK;
    }
  }
  return real(file)->pMethods->xFileControl(real(file), operation, argument);
}
int sector_size(sqlite3_file* file) {
  return real(file)->pMethods->xSectorSize(real(file));
}
int characteristics(sqlite3_file* file) {
  return real(file)->pMethods->xDeviceCharacteristics(real(file));
}

const sqlite3_io_methods kMethods = {1,
                                     close_file,
                                     read_file,
                                     write_file,
                                     truncate_file,
                                     sync_file,
                                     size_of_file,
                                     lock_file,
                                     unlock_file,
                                     check_reserved_lock,
                                     control_file,
                                     sector_size,
                                     characteristics,
                                     nullptr,
                                     nullptr,
                                     nullptr,
                                     nullptr,
                                     nullptr,
                                     nullptr};

int open_file(sqlite3_vfs* /*vfs*/, const char* path, sqlite3_file* file, int flags, int* out_flags) {
  File* opened = new (file) File{{nullptr}, nullptr, reinterpret_cast<sqlite3_file*>(mine(file) + 1)};
  const int code = below()->xOpen(below(), path, opened->real, flags, out_flags);
  if (code != SQLITE_OK) return code;
  opened->path = new std::string(path == nullptr ? "" : path);
  opened->base.pMethods = &kMethods;
  return code;
}
int delete_file(sqlite3_vfs* /*vfs*/, const char* path, int sync_folder) {
  const std::lock_guard lock(mutex);
  record({Operation::Kind::Remove, path, 0, {}});
  return below()->xDelete(below(), path, sync_folder);
}
int last_error(sqlite3_vfs* /*vfs*/, int count, char* text) {
  const std::lock_guard lock(mutex);
  return failures == 0 ? below()->xGetLastError(below(), count, text) : fault_number();
}

}  // namespace

std::string name() {
  static sqlite3_vfs* const vfs = [] {
    auto* made = new sqlite3_vfs(*below());
    made->iVersion = 1;
    made->szOsFile = static_cast<int>(sizeof(File)) + below()->szOsFile;
    made->zName = "spectra-faults";
    made->xOpen = open_file;
    made->xDelete = delete_file;
    made->xGetLastError = last_error;
    sqlite3_vfs_register(made, 0);
    return made;
  }();
  return vfs->zName;
}

void arm(Fault fault, int calls) {
  const std::lock_guard lock(mutex);
  armed = fault;
  calls_left = calls;
  failures = 0;
}

int failed_calls() {
  const std::lock_guard lock(mutex);
  return failures;
}

void start_recording() {
  const std::lock_guard lock(mutex);
  operations.clear();
  is_recording = true;
}

std::size_t recorded_count() {
  const std::lock_guard lock(mutex);
  return operations.size();
}

std::vector<Operation> stop_recording() {
  const std::lock_guard lock(mutex);
  is_recording = false;
  return std::exchange(operations, {});
}

}  // namespace spectra::store::fault_file_system
