#include "server/store/salvage.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>

#include "server/store/page_rows.hpp"
#include "server/store/store_file.hpp"
#include "server/store/time_text.hpp"
#include "server/store/write_ahead_log.hpp"

namespace spectra::store {
namespace {

/// The pages of a store as its file and its log leave them.
class Pages {
 public:
  static StoreResult<Pages> open(const std::string& file) {
    Pages pages;
    std::error_code error;
    const auto size = std::filesystem::file_size(file, error);
    pages.file_.open(file, std::ios::binary);
    if (error || !pages.file_) return failure(StoreErrorCode::NotFound, file + " cannot be read");
    pages.count_ = (size + kPageBytes - 1) / kPageBytes;
    BOOST_OUTCOME_TRY(pages.log_, read_log(file));
    if (pages.log_.exists) pages.log_file_.open(file + "-wal", std::ios::binary);
    pages.lay_over(pages.log_.committed);
    return pages;
  }

  /// Also what stands in the log behind a bad place.
  void believe_the_whole_log() { lay_over(log_.beyond); }
  const WriteAheadLog& log() const { return log_; }

  std::uint64_t count() const { return count_; }
  /// Counted from 1. What is not there is zeros.
  std::string page(std::uint64_t number) {
    std::string bytes(kPageBytes, '\0');
    const auto in_log = places_.find(number);
    std::ifstream& stream = in_log != places_.end() ? log_file_ : file_;
    stream.clear();
    stream.seekg(static_cast<std::streamoff>(in_log != places_.end() ? in_log->second : (number - 1) * kPageBytes));
    stream.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return bytes;
  }

  /// The whole record of a row, or nothing where its pages do not hold it.
  std::optional<std::string> record(const PageRow& row) {
    if (row.record_bytes > count_ * kPageBytes) return std::nullopt;
    std::string bytes(row.local);
    std::uint64_t next = row.overflow_page;
    while (bytes.size() < row.record_bytes) {
      if (next == 0 || next > count_) return std::nullopt;
      const std::string part = page(next);
      next = 0;
      for (std::size_t i = 0; i < 4; ++i) next = next << 8U | static_cast<unsigned char>(part[i]);
      bytes.append(part, 4, std::min<std::uint64_t>(kPageBytes - 4, row.record_bytes - bytes.size()));
    }
    return bytes;
  }

 private:
  void lay_over(const std::vector<WriteAheadLog::Frame>& frames) {
    // A page number beyond this is one that was damaged.
    const std::uint64_t most = count_ + log_.committed.size() + log_.beyond.size();
    for (const auto& frame : frames) {
      if (frame.page == 0 || frame.page > most) continue;
      places_[frame.page] = frame.offset;
      count_ = std::max<std::uint64_t>(count_, frame.page);
    }
  }

  std::ifstream file_, log_file_;
  WriteAheadLog log_;
  std::map<std::uint64_t, std::uint64_t> places_;  ///< Of pages that stand in the log: where.
  std::uint64_t count_ = 0;
};

/// Where a block's bytes may stand.
struct BodyPlace {
  std::uint64_t page = 0;
  std::size_t row = 0;
};

/// Every row that proves itself.
struct Found {
  std::map<Revision, Change> changes;
  std::map<std::string, std::pair<std::uint64_t, std::string>> constants;  ///< Number of the row, value.
  std::multimap<Revision, BodyPlace> bodies;
  std::optional<StoreState> state;
};

constexpr std::uint64_t kLargestSmallRow = kLongestReadOptions + 4096;

void take(Found& found, std::uint64_t number, const ChecksummedBytes& row) {
  if (is_right(RowKind::Change, number, row)) {
    if (auto change = decode_change(number, row.bytes)) found.changes.emplace(number, std::move(*change));
  } else if (is_right(RowKind::Constant, number, row)) {
    if (auto constant = decode_constant(row.bytes)) {
      auto& known = found.constants[constant->key];
      if (number >= known.first) known = {number, std::move(constant->value)};
    }
  } else if (is_right(RowKind::State, number, row)) {
    const auto state = decode_state(row.bytes);
    if (state && (!found.state || state->commit > found.state->commit)) found.state = state;
  }
}

Found search(Pages& pages, const std::function<void(double)>& progress) {
  Found found;
  for (std::uint64_t number = 1; number <= pages.count(); ++number) {
    constexpr double kShare = 0.3;  // The rest is writing.
    if (number % 1024 == 0) progress(kShare * static_cast<double>(number) / static_cast<double>(pages.count()));
    const std::string page = pages.page(number);
    const auto rows = rows_of(page, number == 1);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (only_blob(rows[i]).is_one) {
        found.bodies.emplace(rows[i].number, BodyPlace{number, i});
      } else if (rows[i].record_bytes <= kLargestSmallRow) {
        if (const auto record = pages.record(rows[i])) take(found, rows[i].number, checksummed_bytes(*record));
      }
    }
  }
  return found;
}

SharedBytes right_bytes(Pages& pages, const Found& found, const BlockFacts& facts) {
  const auto [begin, end] = found.bodies.equal_range(facts.revision);
  for (auto place = begin; place != end; ++place) {
    const std::string page = pages.page(place->second.page);
    const auto rows = rows_of(page, place->second.page == 1);
    const PageRow& row = rows[place->second.row];
    const BlobPlace blob = only_blob(row);
    if (blob.size != facts.body_bytes()) continue;
    auto record = pages.record(row);
    if (!record) continue;
    record->erase(0, blob.offset);
    if (is_body_of(facts, *record)) return std::make_shared<const std::string>(std::move(*record));
  }
  return nullptr;
}

/// Writes changes in order, in transactions of bounded size.
class Copy {
 public:
  Copy(StoreFile& into, const Found& found) : into_(into) {
    if (found.state) {
      last_revision_ = found.state->last_revision;
      floor_ = found.state->history_floor;
      floor_at_ = found.state->history_floor_at;
    }
    if (found.changes.empty()) return;
    const Change& newest = found.changes.rbegin()->second;
    last_revision_ = std::max(last_revision_, newest.facts.revision);
    if (!found.state) {
      // Nobody knows any more what the history had let go.
      floor_ = newest.facts.revision;
      floor_at_ = newest.facts.accepted_at;
    }
  }

  StoreResult<void> add(const Change& change, SharedBytes bytes) {
    constexpr std::uint64_t kMostBytes = std::uint64_t{32} << 20U;
    if (bytes) {
      waiting_bytes_ += bytes->size();
      transaction_.bytes[change.facts.revision] = std::move(bytes);
    }
    transaction_.plan.added.push_back(change);
    return waiting_bytes_ < kMostBytes ? StoreResult<void>(success()) : write();
  }

  StoreResult<void> write(Constants constants = {}) {
    transaction_.constants = std::move(constants);
    transaction_.plan.last_revision = last_revision_;
    transaction_.plan.history_floor = floor_;
    transaction_.plan.history_floor_at = floor_at_;
    BOOST_OUTCOME_TRYV(into_.write(transaction_));
    BOOST_OUTCOME_TRYV(into_.checkpoint());
    transaction_ = {};
    waiting_bytes_ = 0;
    return success();
  }

 private:
  StoreFile& into_;
  Transaction transaction_;
  std::uint64_t waiting_bytes_ = 0;
  Revision last_revision_ = 0, floor_ = 0;
  StoreTime floor_at_;
};

std::string revision_text(const BlockFacts& facts) {
  return "block " + facts.description.id + " of revision " + std::to_string(facts.revision) + " (" +
         utc_text(facts.accepted_at) + ")";
}

}  // namespace

StoreResult<SalvageReport> salvage(const std::string& file, const std::string& into,
                                   const std::function<void(double)>& progress) {
  BOOST_OUTCOME_TRY(auto pages, Pages::open(file));
  SalvageReport report;
  Found found = search(pages, progress);
  const auto& log = pages.log();
  const bool is_log_damaged =
      log.exists && (!log.has_right_header || log.newest_commit_beyond > (found.state ? found.state->commit : 0) + 1);
  if (is_log_damaged) {
    pages.believe_the_whole_log();
    found = search(pages, progress);
    report.lost.emplace_back("the log has a bad place; of what was written last, something may be missing");
  }
  if (found.state && found.state->is_open && !log.exists) {
    report.lost.push_back(
        "the store was not closed in order, and its log " + file +
        "-wal is missing: what was acknowledged last stood there, and nobody knows how much that was; "
        "bring the log back if it is anywhere");
  }
  if (found.changes.empty() && found.constants.empty() && !found.state) {
    return failure(StoreErrorCode::Damaged, "nothing of a Spectra store is to be found in " + file);
  }
  BOOST_OUTCOME_TRYV(StoreFile::make(into, {}));
  BOOST_OUTCOME_TRY(const auto out, StoreFile::open(into, {}));
  Copy copy(*out, found);

  std::set<std::string_view> here;  // Blocks of the map.
  std::map<std::string_view, const Change*> last_written, last_known;
  std::uint64_t written_count = 0;
  std::vector<const Change*> without_bytes;
  for (const auto& [revision, change] : found.changes) {
    const std::string_view id = change.facts.description.id;
    progress(0.3 + 0.7 * static_cast<double>(written_count + without_bytes.size()) /
                       static_cast<double>(found.changes.size()));
    last_known[id] = &change;
    SharedBytes bytes = change.is_removal ? nullptr : right_bytes(pages, found, change.facts);
    if (!change.is_removal && !bytes) {
      without_bytes.push_back(&change);
      continue;
    }
    BOOST_OUTCOME_TRYV(copy.add(change, std::move(bytes)));
    ++written_count;
    last_written[id] = &change;
    report.earlier_count += change.is_removal ? 0 : 1;
  }
  Constants constants;
  for (auto& [key, value] : found.constants) constants[key] = std::move(value.second);
  report.constant_count = constants.size();
  BOOST_OUTCOME_TRYV(copy.write(std::move(constants)));
  for (const auto& [id, change] : last_written) report.block_count += change->is_removal ? 0 : 1;
  report.earlier_count -= report.block_count;

  for (const Change* change : without_bytes) {
    const std::string_view id = change->facts.description.id;
    std::string text = "the bytes of " + revision_text(change->facts) + " are damaged";
    if (last_known.at(id) == change) {
      const auto instead = last_written.find(id);
      const bool is_there = instead != last_written.end() && !instead->second->is_removal;
      text += is_there ? "; its revision " + std::to_string(instead->second->facts.revision) + " stands in its place"
                       : "; the map is without it";
    } else {
      text += "; it was an earlier one";
    }
    report.lost.push_back(std::move(text));
  }
  const std::uint64_t row_count = found.changes.size() + found.constants.size();
  if (!found.state) {
    report.lost.emplace_back("what the store should hold is no longer known; more may be missing than is said here");
  } else if (found.state->row_count > row_count) {
    report.lost.push_back(
        std::to_string(found.state->row_count - row_count) +
        " changes or constants, of which nothing can be read; their blocks are missing, or stand as they were "
        "before");
  }
  return report;
}

}  // namespace spectra::store
