#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/store/catalogue.hpp"
#include "server/store/sqlite.hpp"
#include "server/store/stored_row.hpp"

namespace spectra::store {

using Constants = std::map<std::string, std::string, std::less<>>;

/// What one transaction writes.
struct Transaction {
  Catalogue::Plan plan;
  std::map<Revision, SharedBytes> bytes;  ///< The body of every block in plan.added.
  Constants constants;                    ///< Set anew; an empty value removes one.
};

/// The store's file: rows in SQLite. Used from one thread at a time; every call may wait for the disk.
class StoreFile {
 public:
  struct Options {
    bool is_read_only = false;  ///< Nothing is written; the file must be there.
    std::string vfs = {};       ///< SQLite's name of a file system, empty for the usual one.
  };

  /// Makes an empty store in a file that is empty or not there. Not whole when it fails.
  static StoreResult<void> make(const std::string& path, const std::string& vfs);
  /// Opens the file for itself alone, makes it where there is none (whole or not at all), reads all rows but the blocks' bytes
  /// and believes none that is not proven. Every way a file can be refused is in the message.
  static StoreResult<std::unique_ptr<StoreFile>> open(const std::string& path, const Options& options);

  /// The file is whole without its log after this.
  ~StoreFile();
  StoreFile(const StoreFile&) = delete;
  StoreFile& operator=(const StoreFile&) = delete;

  /// As it was when the file was opened. To be taken once.
  Catalogue take_catalogue() { return std::move(catalogue_); }
  Constants take_constants() { return std::move(constants_); }

  /// Whole and on the disk, or not at all.
  StoreResult<void> write(const Transaction& transaction);
  /// The body of a block; Damaged when it is not what was put.
  StoreResult<SharedBytes> read(const BlockFacts& facts);

  /// Moves what is in the log into the file. Until then the log grows.
  StoreResult<void> checkpoint();
  /// Gives some of the file's free pages back to the disk where there are many. False when there is no more to give.
  StoreResult<bool> give_back();
  /// Bytes of the log since the last checkpoint.
  std::uint64_t log_bytes() const;

  /// Looks at every page and every block's bytes. What is wrong, in sentences; empty: nothing. `progress` is told the share done.
  StoreResult<std::vector<std::string>> check(const Catalogue& catalogue, const std::function<void(double)>& progress);

 private:
  struct Statements {
    Statement add_change, drop_change, add_bytes, drop_bytes, set_constant, drop_constant, set_state;
  };

  StoreFile(std::string path, std::unique_ptr<Connection> connection, bool is_read_only)
      : path_(std::move(path)), connection_(std::move(connection)), is_read_only_(is_read_only) {}
  static StoreResult<void> create(const std::string& path, const std::string& vfs);
  StoreResult<void> recognise();
  StoreResult<void> load();
  StoreResult<void> prepare();
  /// Writes whether the file is in use, so that it is missed when its log gets lost.
  StoreResult<void> mark(bool is_open);
  StoreResult<void> write_rows(const Transaction& transaction, StoreState& next);
  StoreError damage(const std::string& what) const;

  std::string path_;
  std::unique_ptr<Connection> connection_;
  bool is_read_only_;
  std::uint64_t version_ = 0;
  std::unique_ptr<Statements> statements_;
  StoreState state_;
  std::map<Revision, Checksum> change_checksums_;
  std::map<std::string, std::pair<std::uint64_t, Checksum>, std::less<>> constant_rows_;  ///< Number and checksum.
  std::uint64_t next_constant_ = 1;
  Catalogue catalogue_;
  Constants constants_;
};

}  // namespace spectra::store
