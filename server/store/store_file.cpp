#include "server/store/store_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <system_error>

#include "server/store/page_rows.hpp"
#include "server/store/write_ahead_log.hpp"

namespace spectra::store {
namespace {

using BOOST_OUTCOME_V2_NAMESPACE::failure;

constexpr std::uint64_t kApplicationId = 0x53504354;  // "SPCT"
/// 2: blocks may have a baseline. What is of version 1 becomes 2 when something is written.
constexpr std::uint64_t kVersion = 2;
constexpr std::string_view kFirstBytes{"SQLite format 3\0", 16};
constexpr const char* kSalvage = "; spectra store salvage FILE NEW rescues what can be read";

// Deleted rows are overwritten (secure_delete), so that salvaging never finds what was deleted. It costs no writing where new rows
// take the pages of old ones in the same transaction.
constexpr const char* kSettings =
    "PRAGMA locking_mode=EXCLUSIVE; PRAGMA synchronous=FULL; PRAGMA fullfsync=ON; PRAGMA secure_delete=ON;"
    "PRAGMA cell_size_check=ON; PRAGMA journal_size_limit=67108864; PRAGMA temp_store=MEMORY; PRAGMA mmap_size=0;";
constexpr const char* kMaking =
    "BEGIN IMMEDIATE;"
    "CREATE TABLE state (number INTEGER PRIMARY KEY, facts BLOB NOT NULL, checksum BLOB NOT NULL);"
    "CREATE TABLE constant (number INTEGER PRIMARY KEY, facts BLOB NOT NULL, checksum BLOB NOT NULL);"
    "CREATE TABLE change (revision INTEGER PRIMARY KEY, facts BLOB NOT NULL, checksum BLOB NOT NULL);"
    "CREATE TABLE body (revision INTEGER PRIMARY KEY, bytes BLOB NOT NULL);"
    "PRAGMA application_id=1397769044; PRAGMA user_version=2;";
constexpr std::string_view kTables =
    "CREATE TABLE body (revision INTEGER PRIMARY KEY, bytes BLOB NOT NULL);"
    "CREATE TABLE change (revision INTEGER PRIMARY KEY, facts BLOB NOT NULL, checksum BLOB NOT NULL);"
    "CREATE TABLE constant (number INTEGER PRIMARY KEY, facts BLOB NOT NULL, checksum BLOB NOT NULL);"
    "CREATE TABLE state (number INTEGER PRIMARY KEY, facts BLOB NOT NULL, checksum BLOB NOT NULL);";
static_assert(kApplicationId == 1397769044);

std::string_view as_text(const Checksum& checksum) {
  return {reinterpret_cast<const char*>(checksum.data()), checksum.size()};
}

StoreError system_error(const std::string& path, const std::string& what, int number) {
  const auto code = number == ENOSPC || number == EDQUOT                     ? StoreErrorCode::DiskFull
                    : number == EROFS || number == EACCES || number == EPERM ? StoreErrorCode::ReadOnly
                                                                             : StoreErrorCode::IoError;
  return {code, path + " " + what + ": " + std::generic_category().message(number)};
}

/// What was written and renamed in a folder stays so through a power cut.
StoreResult<void> sync(const std::string& path, int flags) {
  const int descriptor = ::open(path.c_str(), flags | O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return failure(system_error(path, "cannot be synced", errno));
  const int result = ::fsync(descriptor);
  const int number = errno;
  ::close(descriptor);
  // Some file systems cannot sync a folder at all.
  if (result != 0 && number != EINVAL) return failure(system_error(path, "cannot be synced", number));
  return success();
}

StoreResult<void> write_state(Statement& set_state, const StoreState& state) {
  const std::string facts = encode(state);
  const Checksum checksum = row_checksum(RowKind::State, 0, facts);
  set_state.bind(1, std::uint64_t{0});
  set_state.bind(2, facts);
  set_state.bind(3, as_text(checksum));
  BOOST_OUTCOME_TRYV(set_state.step());
  return success();
}

constexpr const char* kSetState = "INSERT OR REPLACE INTO state VALUES (?, ?, ?)";

}  // namespace

StoreError StoreFile::damage(const std::string& what) const {
  return {StoreErrorCode::Damaged, path_ + " is damaged: " + what + kSalvage};
}

StoreResult<void> StoreFile::make(const std::string& path, const std::string& vfs) {
  BOOST_OUTCOME_TRY(auto connection, Connection::open(path, Connection::Access::ReadWrite, vfs));
  const std::string pages = "PRAGMA page_size=" + std::to_string(kPageBytes) + "; PRAGMA auto_vacuum=INCREMENTAL;";
  BOOST_OUTCOME_TRYV(connection->run(pages.c_str()));
  BOOST_OUTCOME_TRYV(connection->run(kSettings));
  BOOST_OUTCOME_TRYV(connection->run("PRAGMA journal_mode=WAL;"));
  BOOST_OUTCOME_TRYV(connection->run(kMaking));
  BOOST_OUTCOME_TRY(auto set_state, connection->prepare(kSetState));
  BOOST_OUTCOME_TRYV(write_state(set_state, StoreState{}));
  return connection->run("COMMIT");
}

StoreResult<void> StoreFile::create(const std::string& path, const std::string& vfs) {
  const std::string making = path + ".new-" + std::to_string(::getpid());
  const auto remove = [&making] {
    for (const char* suffix : {"", "-wal", "-journal", "-shm"}) ::unlink((making + suffix).c_str());
  };
  remove();
  auto made = make(making, vfs);
  if (made) made = sync(making, 0);
  if (made && ::link(making.c_str(), path.c_str()) != 0 && errno != EEXIST) {
    // A file system without links.
    if (::rename(making.c_str(), path.c_str()) != 0) made = failure(system_error(path, "cannot be created", errno));
  }
  remove();
  BOOST_OUTCOME_TRYV(std::move(made));
  return sync(std::filesystem::path(path).parent_path().string(), O_DIRECTORY);
}

StoreResult<std::unique_ptr<StoreFile>> StoreFile::open(const std::string& given, const Options& options) {
  const std::string path = std::filesystem::absolute(given).lexically_normal().string();
  std::error_code missing;
  const auto status = std::filesystem::status(path, missing);
  const bool exists = std::filesystem::exists(status);
  if (exists && !std::filesystem::is_regular_file(status)) {
    return store::failure(StoreErrorCode::Foreign, path + " is no file");
  }
  if (!exists) {
    if (options.is_read_only) return store::failure(StoreErrorCode::NotFound, "there is no store " + path);
    if (::access((path + "-wal").c_str(), F_OK) == 0) {
      return store::failure(StoreErrorCode::Damaged,
                            path + " is missing, but its log " + path +
                                "-wal is there; bring the file back, or remove the log to begin anew");
    }
    BOOST_OUTCOME_TRYV(create(path, options.vfs));
  }
  std::string first(kFirstBytes.size(), '\0');
  std::ifstream stream(path, std::ios::binary);
  if (!stream) return failure(system_error(path, "cannot be opened", errno));
  stream.read(first.data(), static_cast<std::streamsize>(first.size()));
  if (!stream || first != kFirstBytes) {
    return store::failure(StoreErrorCode::Foreign,
                          path + " is not a Spectra store" + (stream.gcount() == 0 ? " (it is empty)" : "") +
                              "; name another file, or, if it was one, use spectra store salvage FILE NEW");
  }
  stream.close();

  BOOST_OUTCOME_TRY(const auto log, read_log(path));
  const bool is_changeable =
      ::access(path.c_str(), W_OK) == 0 && ::access(std::filesystem::path(path).parent_path().c_str(), W_OK) == 0;
  if (!is_changeable && !options.is_read_only) {
    return store::failure(StoreErrorCode::ReadOnly,
                          path + " or its folder cannot be written; make them writable, or use another file");
  }
  if (!is_changeable && log.exists) {
    return store::failure(StoreErrorCode::ReadOnly,
                          path + " was not closed in order and its folder cannot be written; copy it, with " + path +
                              "-wal, to where it can");
  }
  const auto access = is_changeable ? Connection::Access::ReadWrite : Connection::Access::Unchangeable;
  BOOST_OUTCOME_TRY(auto connection, Connection::open(path, access, options.vfs));
  connection->keep_log();  // Until it is known that nothing is wrong.
  std::unique_ptr<StoreFile> file(new StoreFile(path, std::move(connection), options.is_read_only));
  if (log.exists && !log.has_right_header) {
    return failure(file->damage("the first bytes of its log " + path + "-wal are not right"));
  }
  BOOST_OUTCOME_TRYV(file->connection_->run(kSettings));
  BOOST_OUTCOME_TRYV(file->recognise());
  BOOST_OUTCOME_TRYV(file->load());
  if (log.newest_commit_beyond > file->state_.commit + 1) {
    return failure(
        file->damage("its log " + path + "-wal has a bad place, and changes that were acknowledged behind it"));
  }
  if (file->state_.is_open && !log.exists) {
    return store::failure(
        StoreErrorCode::Damaged,
        path + " was not closed in order, and its log " + path +
            "-wal is missing; bring the log back, or take what is in the file alone by spectra store salvage FILE NEW");
  }
  if (!options.is_read_only) {
    file->connection_->keep_log(false);
    BOOST_OUTCOME_TRYV(file->prepare());
    // A disk that is full now keeps nobody from looking at the map.
    (void)file->mark(true);
  } else {
    BOOST_OUTCOME_TRYV(file->connection_->run("PRAGMA query_only=ON"));
  }
  return file;
}

StoreFile::~StoreFile() {
  if (statements_) (void)mark(false);
}

StoreResult<void> StoreFile::mark(bool is_open) {
  StoreState next = state_;
  ++next.commit;
  next.is_open = is_open;
  BOOST_OUTCOME_TRYV(write_state(statements_->set_state, next));
  state_ = next;
  return is_open ? checkpoint() : success();
}

StoreResult<void> StoreFile::recognise() {
  BOOST_OUTCOME_TRY(const auto application, connection_->integer("PRAGMA application_id"));
  if (application != kApplicationId) {
    return store::failure(StoreErrorCode::Foreign,
                          path_ + " is a database of another program, not a Spectra store; name another file");
  }
  BOOST_OUTCOME_TRY(const auto version, connection_->integer("PRAGMA user_version"));
  if (version > kVersion) {
    return store::failure(StoreErrorCode::NewerVersion,
                          path_ + " was written by a newer Spectra (version " + std::to_string(version) +
                              " of the store, this program knows " + std::to_string(kVersion) +
                              "); use that program, or name another file");
  }
  BOOST_OUTCOME_TRY(const auto page_bytes, connection_->integer("PRAGMA page_size"));
  BOOST_OUTCOME_TRY(const auto tables, connection_->text("SELECT group_concat(sql || ';', '') FROM "
                                                         "(SELECT sql FROM sqlite_schema ORDER BY name)"));
  if (version < 1 || page_bytes != kPageBytes || tables != kTables) {
    return failure(damage("its tables are not those of a store"));
  }
  version_ = version;
  return success();
}

StoreResult<void> StoreFile::load() {
  BOOST_OUTCOME_TRY(const auto pages, connection_->text("PRAGMA quick_check(1)"));
  if (pages != "ok") return failure(damage(pages));

  BOOST_OUTCOME_TRY(auto select_state, connection_->prepare("SELECT number, facts, checksum FROM state"));
  BOOST_OUTCOME_TRY(const bool has_state, select_state.step());
  if (!has_state ||
      !is_right(RowKind::State, select_state.integer(0), {select_state.bytes(1), select_state.bytes(2)})) {
    return failure(damage("the row that says what is in it is missing or wrong"));
  }
  const auto state = decode_state(select_state.bytes(1));
  if (!state) return failure(damage("the row that says what is in it cannot be read"));
  state_ = *state;
  select_state.reset();

  StoreState found;
  BOOST_OUTCOME_TRY(auto sizes, connection_->prepare("SELECT length(bytes) FROM body WHERE revision = ?"));
  std::uint64_t block_rows = 0;
  std::vector<Change> changes;
  BOOST_OUTCOME_TRY(auto select_changes, connection_->prepare("SELECT revision, facts, checksum FROM change"));
  for (;;) {
    BOOST_OUTCOME_TRY(const bool is_row, select_changes.step());
    if (!is_row) break;
    const Revision revision = select_changes.integer(0);
    const ChecksummedBytes row{select_changes.bytes(1), select_changes.bytes(2)};
    auto change = is_right(RowKind::Change, revision, row) ? decode_change(revision, row.bytes) : std::nullopt;
    if (!change) return failure(damage("what it says of revision " + std::to_string(revision) + " is wrong"));
    Checksum checksum{};
    std::copy(row.checksum.begin(), row.checksum.end(), checksum.begin());
    toggle(found.rows, checksum);
    change_checksums_.emplace(revision, checksum);
    if (!change->is_removal) {
      ++block_rows;
      sizes.bind(1, revision);
      BOOST_OUTCOME_TRY(const bool is_there, sizes.step());
      if (!is_there || sizes.integer(0) != change->facts.body_bytes()) {
        return failure(damage("block " + change->facts.description.id + " of revision " + std::to_string(revision) +
                              " has lost its bytes"));
      }
      sizes.reset();
    }
    changes.push_back(std::move(*change));
  }
  BOOST_OUTCOME_TRY(const auto body_rows, connection_->integer("SELECT count(*) FROM body"));
  BOOST_OUTCOME_TRY(auto select_constants, connection_->prepare("SELECT number, facts, checksum FROM constant"));
  for (;;) {
    BOOST_OUTCOME_TRY(const bool is_row, select_constants.step());
    if (!is_row) break;
    const std::uint64_t number = select_constants.integer(0);
    const ChecksummedBytes row{select_constants.bytes(1), select_constants.bytes(2)};
    const auto constant = is_right(RowKind::Constant, number, row) ? decode_constant(row.bytes) : std::nullopt;
    if (!constant) return failure(damage("a constant of its map is wrong"));
    Checksum checksum{};
    std::copy(row.checksum.begin(), row.checksum.end(), checksum.begin());
    toggle(found.rows, checksum);
    constant_rows_[constant->key] = {number, checksum};
    constants_[constant->key] = constant->value;
    next_constant_ = std::max(next_constant_, number + 1);
  }
  found.row_count = changes.size() + constant_rows_.size();
  if (found.row_count != state_.row_count || found.rows != state_.rows || body_rows != block_rows) {
    return failure(damage("it holds " + std::to_string(found.row_count) + " rows of " +
                          std::to_string(state_.row_count) + ", or others than were written"));
  }
  catalogue_ = Catalogue(std::move(changes), state_.last_revision, state_.history_floor, state_.history_floor_at);
  return success();
}

StoreResult<void> StoreFile::prepare() {
  BOOST_OUTCOME_TRY(auto add_change, connection_->prepare("INSERT INTO change VALUES (?, ?, ?)"));
  BOOST_OUTCOME_TRY(auto drop_change, connection_->prepare("DELETE FROM change WHERE revision = ?"));
  BOOST_OUTCOME_TRY(auto add_bytes, connection_->prepare("INSERT INTO body VALUES (?, ?)"));
  BOOST_OUTCOME_TRY(auto drop_bytes, connection_->prepare("DELETE FROM body WHERE revision = ?"));
  BOOST_OUTCOME_TRY(auto set_constant, connection_->prepare("INSERT OR REPLACE INTO constant VALUES (?, ?, ?)"));
  BOOST_OUTCOME_TRY(auto drop_constant, connection_->prepare("DELETE FROM constant WHERE number = ?"));
  BOOST_OUTCOME_TRY(auto set_state, connection_->prepare(kSetState));
  statements_ = std::make_unique<Statements>(
      Statements{std::move(add_change), std::move(drop_change), std::move(add_bytes), std::move(drop_bytes),
                 std::move(set_constant), std::move(drop_constant), std::move(set_state)});
  return success();
}

StoreResult<void> StoreFile::write(const Transaction& transaction) {
  if (!statements_) return store::failure(StoreErrorCode::ReadOnly, path_ + " was opened for reading");
  const auto& plan = transaction.plan;
  StoreState next = state_;
  ++next.commit;
  next.last_revision = plan.last_revision;
  next.history_floor = plan.history_floor;
  next.history_floor_at = plan.history_floor_at;
  std::vector<std::pair<Revision, Checksum>> added;
  auto constant_rows = transaction.constants.empty() ? decltype(constant_rows_){} : constant_rows_;
  auto next_constant = next_constant_;

  const auto put = [&](Statement& statement, RowKind kind, std::uint64_t number,
                       const std::string& facts) -> StoreResult<Checksum> {
    const Checksum checksum = row_checksum(kind, number, facts);
    statement.bind(1, number);
    statement.bind(2, facts);
    statement.bind(3, as_text(checksum));
    BOOST_OUTCOME_TRYV(statement.step());
    toggle(next.rows, checksum);
    ++next.row_count;
    return checksum;
  };
  const auto write_all = [&]() -> StoreResult<void> {
    // One that an exception left open.
    if (connection_->is_in_transaction()) {
      BOOST_OUTCOME_TRYV(connection_->run("ROLLBACK"));
    }
    BOOST_OUTCOME_TRYV(connection_->run("BEGIN IMMEDIATE"));
    if (version_ < kVersion) {
      BOOST_OUTCOME_TRYV(connection_->run("PRAGMA user_version=2"));
    }
    // Rows go first, so that new ones take their pages.
    for (const Revision revision : plan.dropped) {
      for (Statement* statement : {&statements_->drop_bytes, &statements_->drop_change}) {
        statement->bind(1, revision);
        BOOST_OUTCOME_TRYV(statement->step());
      }
      toggle(next.rows, change_checksums_.at(revision));
      --next.row_count;
    }
    for (const Change& change : plan.added) {
      const Revision revision = change.facts.revision;
      if (!change.is_removal) {
        statements_->add_bytes.bind(1, revision);
        statements_->add_bytes.bind(2, std::string_view(*transaction.bytes.at(revision)));
        BOOST_OUTCOME_TRYV(statements_->add_bytes.step());
      }
      BOOST_OUTCOME_TRY(const auto checksum, put(statements_->add_change, RowKind::Change, revision, encode(change)));
      added.emplace_back(revision, checksum);
    }
    for (const auto& [key, value] : transaction.constants) {
      const auto before = constant_rows.find(key);
      if (before != constant_rows.end()) {
        statements_->drop_constant.bind(1, before->second.first);
        BOOST_OUTCOME_TRYV(statements_->drop_constant.step());
        toggle(next.rows, before->second.second);
        --next.row_count;
        constant_rows.erase(before);
      }
      if (value.empty()) continue;
      const std::uint64_t number = next_constant++;
      BOOST_OUTCOME_TRY(const auto checksum,
                        put(statements_->set_constant, RowKind::Constant, number, encode(Constant{key, value})));
      constant_rows[key] = {number, checksum};
    }
    BOOST_OUTCOME_TRYV(write_state(statements_->set_state, next));
    return connection_->commit();
  };
  auto written = write_all();
  if (!written) {
    // Some errors have rolled back by themselves.
    if (connection_->is_in_transaction()) (void)connection_->run("ROLLBACK");
    return written;
  }
  version_ = kVersion;
  for (const Revision revision : plan.dropped) change_checksums_.erase(revision);
  change_checksums_.insert(added.begin(), added.end());
  if (!transaction.constants.empty()) constant_rows_ = std::move(constant_rows);
  next_constant_ = next_constant;
  state_ = next;
  return success();
}

StoreResult<SharedBytes> StoreFile::read(const BlockFacts& facts) {
  BOOST_OUTCOME_TRY(auto select, connection_->prepare("SELECT bytes FROM body WHERE revision = ?"));
  select.bind(1, facts.revision);
  BOOST_OUTCOME_TRY(const bool is_there, select.step());
  auto bytes = std::make_shared<const std::string>(is_there ? select.bytes(0) : std::string_view());
  if (!is_there || !is_body_of(facts, *bytes)) {
    return failure(damage("block " + facts.description.id + " of revision " + std::to_string(facts.revision) +
                          " is not what was put"));
  }
  return SharedBytes(std::move(bytes));
}

std::uint64_t StoreFile::log_bytes() const {
  return connection_->log_pages() * kPageBytes;
}

StoreResult<void> StoreFile::checkpoint() {
  return connection_->checkpoint();
}

StoreResult<bool> StoreFile::give_back() {
  // A quarter of the file may be free: growing and shrinking by turns costs more than the room.
  constexpr std::uint64_t kLeastFree = 16 * 1024 * 1024 / kPageBytes;
  BOOST_OUTCOME_TRY(const auto free, connection_->integer("PRAGMA freelist_count"));
  BOOST_OUTCOME_TRY(const auto all, connection_->integer("PRAGMA page_count"));
  if (is_read_only_ || free <= std::max(kLeastFree, all / 4)) return false;
  BOOST_OUTCOME_TRYV(connection_->run("PRAGMA incremental_vacuum(1024)"));
  return true;
}

StoreResult<std::vector<std::string>> StoreFile::check(const Catalogue& catalogue,
                                                       const std::function<void(double)>& progress) {
  std::vector<std::string> wrong;
  BOOST_OUTCOME_TRY(auto select, connection_->prepare("PRAGMA integrity_check"));
  for (;;) {
    BOOST_OUTCOME_TRY(const bool is_row, select.step());
    if (!is_row) break;
    if (select.bytes(0) != "ok") wrong.emplace_back(select.bytes(0));
  }
  for (const auto& [revision, change] : catalogue.changes()) {
    progress(static_cast<double>(revision) / static_cast<double>(catalogue.last_revision()));
    if (change.is_removal) continue;
    const auto bytes = read(change.facts);
    if (!bytes) wrong.push_back(bytes.error().message);
  }
  return wrong;
}

}  // namespace spectra::store
