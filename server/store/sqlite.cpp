#include "server/store/sqlite.hpp"

#include <sqlite3.h>

#include <cerrno>
#include <system_error>
#include <utility>

namespace spectra::store {
namespace {

/// As the path of a file: URI.
std::string escaped(const std::string& path) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  for (const char c : path) {
    const auto byte = static_cast<unsigned char>(c);
    const bool is_plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '/' ||
                          c == '.' || c == '_' || c == '-';
    if (is_plain) {
      text += c;
    } else {
      text += '%';
      text += kDigits[byte >> 4U];
      text += kDigits[byte & 15U];
    }
  }
  return text;
}

StoreError error_of(const std::string& path, int code, int error_number, const std::string& said) {
  const std::string why = error_number != 0 ? std::generic_category().message(error_number) : said;
  const bool has_no_room = error_number == ENOSPC || error_number == EDQUOT || error_number == EFBIG;
  switch (code & 0xff) {
    case SQLITE_FULL:
      return {StoreErrorCode::DiskFull, path + " has no room to grow: the disk is full"};
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return {StoreErrorCode::Locked, path + " is in use by another process; stop that one first, or use another file"};
    case SQLITE_READONLY:
    case SQLITE_PERM:
      return {StoreErrorCode::ReadOnly, path + " cannot be written: " + said};
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      return {StoreErrorCode::Damaged,
              path + " is damaged (" + said + "); spectra store salvage FILE NEW rescues what can be read"};
    case SQLITE_TOOBIG:
      return {StoreErrorCode::TooLarge, "a row of " + path + " would be too large"};
    case SQLITE_CANTOPEN:
      if (error_number == EROFS || error_number == EACCES || error_number == EPERM) {
        return {StoreErrorCode::ReadOnly, path + " cannot be opened for writing: " + why};
      }
      if (has_no_room) break;
      return {StoreErrorCode::IoError, path + " cannot be opened: " + why};
    default:
      break;
  }
  if (has_no_room) return {StoreErrorCode::DiskFull, path + " has no room to grow: " + why};
  if (error_number == EROFS) return {StoreErrorCode::ReadOnly, path + " cannot be written: " + why};
  return {StoreErrorCode::IoError, path + " cannot be read or written: " + why};
}

}  // namespace

void Statement::Finalizer::operator()(sqlite3_stmt* statement) const {
  sqlite3_finalize(statement);
}

void Statement::bind(int parameter, std::uint64_t value) {
  sqlite3_bind_int64(statement_.get(), parameter, static_cast<sqlite3_int64>(value));
}

void Statement::bind(int parameter, std::string_view bytes) {
  // A null pointer would be NULL, not an empty blob.
  sqlite3_bind_blob64(statement_.get(), parameter, bytes.empty() ? "" : bytes.data(), bytes.size(), SQLITE_STATIC);
}

StoreResult<bool> Statement::step() {
  const int code = sqlite3_step(statement_.get());
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE) {
    sqlite3_reset(statement_.get());
    return false;
  }
  StoreError error = connection_->error();
  sqlite3_reset(statement_.get());
  return BOOST_OUTCOME_V2_NAMESPACE::failure(std::move(error));
}

std::uint64_t Statement::integer(int column) const {
  return static_cast<std::uint64_t>(sqlite3_column_int64(statement_.get(), column));
}

std::string_view Statement::bytes(int column) const {
  const void* data = sqlite3_column_blob(statement_.get(), column);
  const int size = sqlite3_column_bytes(statement_.get(), column);
  return data == nullptr ? std::string_view()
                         : std::string_view(static_cast<const char*>(data), static_cast<std::size_t>(size));
}

void Statement::reset() {
  sqlite3_reset(statement_.get());
}

StoreResult<std::unique_ptr<Connection>> Connection::open(const std::string& path, Access access,
                                                          const std::string& vfs) {
  sqlite3* database = nullptr;
  const bool is_unchangeable = access == Access::Unchangeable;
  // With a scheme in front, so that a file of any name is meant as it stands.
  const std::string uri = "file:" + escaped(path) + (is_unchangeable ? "?immutable=1" : "");
  const int flags = (is_unchangeable ? SQLITE_OPEN_READONLY : SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE) |
                    SQLITE_OPEN_URI | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_EXRESCODE;
  const int code = sqlite3_open_v2(uri.c_str(), &database, flags, vfs.empty() ? nullptr : vfs.c_str());
  if (database == nullptr) return failure(StoreErrorCode::IoError, path + " cannot be opened: out of memory");
  std::unique_ptr<Connection> connection(new Connection(path, database));
  if (code != SQLITE_OK) return BOOST_OUTCOME_V2_NAMESPACE::failure(connection->error());
  // What a damaged file may say of itself is not believed.
  sqlite3_db_config(database, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_db_config(database, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  return connection;
}

Connection::Connection(std::string path, sqlite3* database) : path_(std::move(path)), database_(database) {
  // In place of SQLite's own checkpoints, which would hold up whoever waits for a commit.
  const auto count = [](void* connection, sqlite3* /*database*/, const char* /*name*/, int pages) {
    static_cast<Connection*>(connection)->log_pages_ = static_cast<std::uint64_t>(pages);
    return SQLITE_OK;
  };
  if (database_ != nullptr) sqlite3_wal_hook(database_, count, this);
}

Connection::~Connection() {
  sqlite3_close_v2(database_);
}

StoreError Connection::error() const {
  const int code = sqlite3_extended_errcode(database_);
  const bool is_of_files = (code & 0xff) == SQLITE_IOERR || (code & 0xff) == SQLITE_CANTOPEN;
  return error_of(path_, code, is_of_files ? sqlite3_system_errno(database_) : 0, sqlite3_errmsg(database_));
}

StoreResult<void> Connection::run(const char* sql) {
  if (sqlite3_exec(database_, sql, nullptr, nullptr, nullptr) != SQLITE_OK) {
    return BOOST_OUTCOME_V2_NAMESPACE::failure(error());
  }
  return success();
}

StoreResult<void> Connection::commit() {
  if (sqlite3_exec(database_, "COMMIT", nullptr, nullptr, nullptr) == SQLITE_OK) return success();
  sqlite3_file* log = nullptr;
  int error_number = 0;
  sqlite3_file_control(database_, "main", SQLITE_FCNTL_JOURNAL_POINTER, &log);
  if (log != nullptr && log->pMethods != nullptr) {
    log->pMethods->xFileControl(log, SQLITE_FCNTL_LAST_ERRNO, &error_number);
  }
  return BOOST_OUTCOME_V2_NAMESPACE::failure(
      error_of(path_, sqlite3_extended_errcode(database_), error_number, sqlite3_errmsg(database_)));
}

StoreResult<Statement> Connection::prepare(const char* sql) {
  sqlite3_stmt* statement = nullptr;
  if (sqlite3_prepare_v3(database_, sql, -1, SQLITE_PREPARE_PERSISTENT, &statement, nullptr) != SQLITE_OK) {
    return BOOST_OUTCOME_V2_NAMESPACE::failure(error());
  }
  return Statement(*this, statement);
}

StoreResult<std::uint64_t> Connection::integer(const char* sql) {
  BOOST_OUTCOME_TRY(auto statement, prepare(sql));
  BOOST_OUTCOME_TRY(const bool is_row, statement.step());
  return is_row ? statement.integer(0) : 0;
}

StoreResult<std::string> Connection::text(const char* sql) {
  BOOST_OUTCOME_TRY(auto statement, prepare(sql));
  BOOST_OUTCOME_TRY(const bool is_row, statement.step());
  return is_row ? std::string(statement.bytes(0)) : std::string();
}

bool Connection::is_read_only() const {
  return sqlite3_db_readonly(database_, "main") != 0;
}

bool Connection::is_in_transaction() const {
  return sqlite3_get_autocommit(database_) == 0;
}

void Connection::keep_log(bool is_kept) {
  sqlite3_db_config(database_, SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, is_kept ? 1 : 0, nullptr);
}

StoreResult<void> Connection::checkpoint() {
  if (sqlite3_wal_checkpoint_v2(database_, nullptr, SQLITE_CHECKPOINT_PASSIVE, nullptr, nullptr) != SQLITE_OK) {
    return BOOST_OUTCOME_V2_NAMESPACE::failure(error());
  }
  log_pages_ = 0;
  return success();
}

}  // namespace spectra::store
