#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "server/store/store_error.hpp"

struct sqlite3;
struct sqlite3_stmt;

namespace spectra::store {

class Connection;

/// A prepared statement; ends before its connection does.
class Statement {
 public:
  void bind(int parameter, std::uint64_t value);
  /// The bytes must outlive the next step().
  void bind(int parameter, std::string_view bytes);
  /// True when there is a row to read. After false or an error the statement may be bound and stepped anew.
  StoreResult<bool> step();
  /// Of the current row, counted from 0.
  std::uint64_t integer(int column) const;
  /// Valid until the next step().
  std::string_view bytes(int column) const;
  /// Back to the start; for those who do not step to the end.
  void reset();

 private:
  friend class Connection;
  struct Finalizer {
    void operator()(sqlite3_stmt* statement) const;
  };
  Statement(const Connection& connection, sqlite3_stmt* statement) : connection_(&connection), statement_(statement) {}

  const Connection* connection_;
  std::unique_ptr<sqlite3_stmt, Finalizer> statement_;
};

/// One SQLite database, used from one thread at a time. Stays where it was made: statements point to it.
class Connection {
 public:
  enum class Access {
    ReadWrite,     ///< An existing file or a new one.
    Unchangeable,  ///< A file that nobody changes meanwhile and that has no log beside it; nothing is locked or written.
  };

  /// `vfs`: SQLite's name of a file system, empty for the usual one.
  static StoreResult<std::unique_ptr<Connection>> open(const std::string& path, Access access, const std::string& vfs);
  ~Connection();
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  StoreResult<void> run(const char* sql);
  /// Ends a transaction; what went wrong is asked of the log, because SQLite does not tell it of a COMMIT.
  StoreResult<void> commit();
  StoreResult<Statement> prepare(const char* sql);
  /// The first column of the only row.
  StoreResult<std::uint64_t> integer(const char* sql);
  StoreResult<std::string> text(const char* sql);

  bool is_read_only() const;
  /// Whether a transaction is open.
  bool is_in_transaction() const;
  /// Leaves the log beside the file as it is when the connection ends.
  void keep_log(bool is_kept = true);
  /// Writes the log's pages into the file.
  StoreResult<void> checkpoint();
  /// How many pages the log had after the last transaction.
  std::uint64_t log_pages() const { return log_pages_; }

  /// What SQLite said last, as the error it means here.
  StoreError error() const;

 private:
  Connection(std::string path, sqlite3* database);

  std::string path_;
  sqlite3* database_;
  std::uint64_t log_pages_ = 0;
};

}  // namespace spectra::store
