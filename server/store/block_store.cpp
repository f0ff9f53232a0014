#include "server/store/block_store.hpp"

#include <chrono>
#include <condition_variable>
#include <deque>
#include <future>
#include <map>
#include <mutex>
#include <new>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "server/store/store_file.hpp"

namespace spectra::store {
namespace {

using BOOST_OUTCOME_V2_NAMESPACE::failure;

struct Put {
  BlockRecord block;
  BlockStore::ChangeDone on_done;
};
struct Removal {
  std::string id;
  BlockStore::ChangeDone on_done;
};
struct Setting {
  std::string key, value;
  BlockStore::Done on_done;
};
using Order = std::variant<Put, Removal, Setting>;

struct Reading {
  Revision revision;
  BlockStore::ReadDone on_done;
};

std::uint64_t bytes_of(const Order& order) {
  const auto* put = std::get_if<Put>(&order);
  if (put == nullptr) return 0;
  return put->block.ply->size() + (put->block.baseline ? put->block.baseline->size() : 0);
}

void refuse(const Order& order, const StoreError& error) {
  std::visit([&error](const auto& what) { what.on_done(failure(error)); }, order);
}

StoreTime system_now() {
  return std::chrono::floor<std::chrono::microseconds>(std::chrono::system_clock::now());
}

const StoreError kClosed{StoreErrorCode::Closed, "the store is closed"};

}  // namespace

struct BlockStore::State {
  /// Written in one transaction at most.
  static constexpr std::uint64_t kMostBatchBytes = std::uint64_t{32} << 20U;
  /// So long a log is moved into the file between two transactions; a shorter one when nothing else is to be done.
  static constexpr std::uint64_t kMostLogBytes = std::uint64_t{16} << 20U;
  static constexpr auto kIdle = std::chrono::milliseconds(200);

  State(std::unique_ptr<StoreFile> opened, StoreOptions wanted)
      : file(std::move(opened)),
        options(std::move(wanted)),
        catalogue(file->take_catalogue()),
        constants(file->take_constants()) {
    if (!options.now) options.now = system_now;
  }

  // The thread's alone.
  std::unique_ptr<StoreFile> file;
  StoreOptions options;

  mutable std::mutex mutex;  // Held briefly, never while the disk is waited for.
  std::condition_variable wake;
  std::deque<Order> orders;
  std::deque<Reading> readings;
  std::uint64_t waiting_bytes = 0;  // With the batch that is being written.
  std::uint64_t waiting_count = 0;
  bool is_closing = false;
  Catalogue catalogue;  // Changed by the thread alone, which therefore reads it without the mutex.
  Constants constants;
  std::optional<StoreError> trouble;
  std::uint64_t log_bytes = 0;

  std::mutex closing;  // One at a time.
  std::thread thread;

  void hand_over(Order order);
  void work();
  void write(std::vector<Order> batch);
  void serve(const Reading& reading);
  void checkpoint();
  std::vector<Order> take_batch();
};

void BlockStore::State::hand_over(Order order) {
  const std::uint64_t bytes = bytes_of(order);
  std::unique_lock lock(mutex);
  std::optional<StoreError> reason;
  if (is_closing) {
    reason = kClosed;
  } else if (options.is_read_only) {
    reason = {StoreErrorCode::ReadOnly, "the store was opened for reading"};
  } else if (waiting_bytes > 0 && waiting_bytes + bytes > options.waiting_bytes) {
    reason = {StoreErrorCode::Busy,
              std::to_string(waiting_bytes) + " bytes of blocks wait to be written already; try again later"};
  }
  if (reason) {
    lock.unlock();
    return refuse(order, *reason);
  }
  waiting_bytes += bytes;
  ++waiting_count;
  orders.push_back(std::move(order));
  lock.unlock();
  wake.notify_one();
}

std::vector<Order> BlockStore::State::take_batch() {
  std::vector<Order> batch;
  for (std::uint64_t bytes = 0; !orders.empty(); orders.pop_front()) {
    bytes += bytes_of(orders.front());
    if (!batch.empty() && bytes > kMostBatchBytes) break;
    batch.push_back(std::move(orders.front()));
  }
  return batch;
}

void BlockStore::State::work() {
  std::unique_lock lock(mutex);
  bool is_tidy = false;
  for (;;) {
    const auto has_work = [this] { return is_closing || !orders.empty() || !readings.empty(); };
    if (is_tidy) {
      wake.wait(lock, has_work);
    } else if (!wake.wait_for(lock, kIdle, has_work)) {
      lock.unlock();
      checkpoint();
      const auto more = file->give_back();
      is_tidy = !more || !more.value();
      lock.lock();
      continue;
    }
    if (!orders.empty()) {
      auto batch = take_batch();
      lock.unlock();
      write(std::move(batch));
      if (file->log_bytes() > kMostLogBytes) checkpoint();
      is_tidy = false;
    } else if (!readings.empty()) {
      const Reading reading = std::move(readings.front());
      readings.pop_front();
      lock.unlock();
      serve(reading);
    } else {
      return;
    }
    lock.lock();
  }
}

void BlockStore::State::write(std::vector<Order> batch) {
  Transaction transaction;
  std::vector<Change> changes;
  std::vector<std::optional<StoreResult<Revision>>> outcomes(batch.size());
  std::map<std::string_view, bool> is_there;
  Revision revision = catalogue.last_revision();
  const StoreTime now = options.now();
  for (std::size_t i = 0; i < batch.size(); ++i) {
    if (const auto* put = std::get_if<Put>(&batch[i])) {
      const auto& ply = put->block.ply;
      BlockFacts facts{put->block.description, ++revision, now, ply->size(), sha256(*ply)};
      if (const auto& baseline = put->block.baseline; baseline && !baseline->empty()) {
        facts.baseline_bytes = baseline->size();
        facts.baseline_sha256 = sha256(*baseline);
      }
      changes.push_back({std::move(facts), false});
      transaction.bytes[revision] = body_of(put->block);
      is_there[put->block.description.id] = true;
      outcomes[i] = revision;
    } else if (const auto* removal = std::get_if<Removal>(&batch[i])) {
      const auto here = is_there.try_emplace(removal->id, catalogue.contains(removal->id)).first;
      if (!here->second) {
        outcomes[i] = store::failure(StoreErrorCode::NotFound, "there is no block " + removal->id);
        continue;
      }
      here->second = false;
      Change change;
      change.facts.description.id = removal->id;
      change.facts.revision = ++revision;
      change.facts.accepted_at = now;
      change.is_removal = true;
      changes.push_back(std::move(change));
      outcomes[i] = revision;
    } else if (const auto* setting = std::get_if<Setting>(&batch[i])) {
      transaction.constants[setting->key] = setting->value;
    }
  }
  const bool is_empty = changes.empty() && transaction.constants.empty();
  StoreResult<void> written = success();
  if (!is_empty) {
    try {
      transaction.plan = catalogue.plan(std::move(changes), options.history_bytes);
      written = file->write(transaction);
    } catch (const std::bad_alloc&) {
      written = store::failure(StoreErrorCode::IoError, "the store has no memory left for what was to be written");
    }
  }
  if (!written && batch.size() > 1 && written.error().code == StoreErrorCode::DiskFull) {
    // What is too much together may go in part.
    for (Order& order : batch) {
      std::vector<Order> single;
      single.push_back(std::move(order));
      write(std::move(single));
    }
    return;
  }
  {
    const std::lock_guard lock(mutex);
    log_bytes = file->log_bytes();
    if (written && !is_empty) {
      trouble.reset();
      catalogue.apply(transaction.plan);
      for (const auto& [key, value] : transaction.constants) {
        if (value.empty()) {
          constants.erase(key);
        } else {
          constants[key] = value;
        }
      }
    } else if (!written) {
      trouble = written.error();
    }
    for (const Order& order : batch) waiting_bytes -= bytes_of(order);
    waiting_count -= batch.size();
  }
  for (std::size_t i = 0; i < batch.size(); ++i) {
    if (!written && (!outcomes[i] || *outcomes[i])) {
      refuse(batch[i], written.error());
    } else if (const auto* put = std::get_if<Put>(&batch[i])) {
      put->on_done(*outcomes[i]);
    } else if (const auto* removal = std::get_if<Removal>(&batch[i])) {
      removal->on_done(*outcomes[i]);
    } else if (const auto* setting = std::get_if<Setting>(&batch[i])) {
      setting->on_done(success());
    }
  }
}

void BlockStore::State::serve(const Reading& reading) {
  const BlockFacts* facts = catalogue.find(reading.revision);
  if (facts == nullptr) {
    reading.on_done(store::failure(
        StoreErrorCode::NotFound,
        "there is no block of revision " + std::to_string(reading.revision) + ", or it is no longer kept"));
    return;
  }
  StoreResult<SharedBytes> bytes = store::failure(StoreErrorCode::IoError, "there is no memory for the block");
  try {
    bytes = file->read(*facts);
  } catch (const std::bad_alloc&) {
    // As said.
  }
  if (bytes) {
    SharedBytes ply = std::move(bytes).value(), baseline;
    if (facts->baseline_bytes > 0) {
      baseline = std::make_shared<const std::string>(*ply, facts->size_bytes);
      ply = std::make_shared<const std::string>(*ply, 0, facts->size_bytes);
    }
    reading.on_done(StoredBlock{*facts, std::move(ply), std::move(baseline)});
  } else {
    reading.on_done(failure(bytes.error()));
  }
}

void BlockStore::State::checkpoint() {
  const auto done = options.is_read_only ? StoreResult<void>(success()) : file->checkpoint();
  const std::lock_guard lock(mutex);
  log_bytes = file->log_bytes();
  if (!done) trouble = done.error();
}

StoreResult<std::unique_ptr<BlockStore>> BlockStore::open(const std::string& file, StoreOptions options) {
  BOOST_OUTCOME_TRY(auto opened, StoreFile::open(file, {options.is_read_only, options.vfs}));
  auto state = std::make_unique<State>(std::move(opened), std::move(options));
  return std::unique_ptr<BlockStore>(new BlockStore(std::move(state)));
}

BlockStore::BlockStore(std::unique_ptr<State> state) : state_(std::move(state)) {
  state_->thread = std::thread([this] { state_->work(); });
}

BlockStore::~BlockStore() {
  close();
}

void BlockStore::close() {
  const std::lock_guard closing(state_->closing);
  {
    const std::lock_guard lock(state_->mutex);
    state_->is_closing = true;
  }
  state_->wake.notify_one();
  if (state_->thread.joinable()) state_->thread.join();
  state_->file.reset();
}

void BlockStore::put(BlockRecord block, ChangeDone on_done) {
  if (auto checked = check_record(block); !checked) return on_done(failure(checked.error()));
  state_->hand_over(Put{std::move(block), std::move(on_done)});
}

void BlockStore::remove(std::string id, ChangeDone on_done) {
  state_->hand_over(Removal{std::move(id), std::move(on_done)});
}

void BlockStore::set_constant(std::string key, std::string value, Done on_done) {
  state_->hand_over(Setting{std::move(key), std::move(value), std::move(on_done)});
}

std::optional<std::string> BlockStore::constant(std::string_view key) const {
  const std::lock_guard lock(state_->mutex);
  const auto found = state_->constants.find(key);
  return found == state_->constants.end() ? std::nullopt : std::optional(found->second);
}

BlockPage BlockStore::page(std::string_view after, std::size_t limit) const {
  const std::lock_guard lock(state_->mutex);
  return state_->catalogue.page(state_->catalogue.last_revision(), after, limit);
}

StoreResult<BlockPage> BlockStore::page_at(StoreTime time, std::string_view after, std::size_t limit) const {
  const std::lock_guard lock(state_->mutex);
  BOOST_OUTCOME_TRY(const Revision revision, state_->catalogue.revision_at(time));
  return state_->catalogue.page(revision, after, limit);
}

std::optional<BlockFacts> BlockStore::find(std::string_view id) const {
  const std::lock_guard lock(state_->mutex);
  const BlockFacts* facts = state_->catalogue.find(id);
  return facts == nullptr ? std::nullopt : std::optional(*facts);
}

StoreResult<std::optional<BlockFacts>> BlockStore::find_at(StoreTime time, std::string_view id) const {
  const std::lock_guard lock(state_->mutex);
  BOOST_OUTCOME_TRY(const Revision revision, state_->catalogue.revision_at(time));
  const BlockFacts* facts = state_->catalogue.find(id, revision);
  return facts == nullptr ? std::nullopt : std::optional(*facts);
}

void BlockStore::read(Revision revision, ReadDone on_done) {
  {
    const std::lock_guard lock(state_->mutex);
    if (!state_->is_closing) {
      state_->readings.push_back({revision, std::move(on_done)});
      on_done = nullptr;
    }
  }
  if (on_done) return on_done(failure(kClosed));
  state_->wake.notify_one();
}

StoreResult<void> BlockStore::visit(std::optional<StoreTime> time, const std::function<bool(StoredBlock)>& on_block) {
  constexpr std::size_t kPage = 1000;
  Revision revision = 0;
  {
    const std::lock_guard lock(state_->mutex);
    revision = state_->catalogue.last_revision();
    if (time) {
      BOOST_OUTCOME_TRY(revision, state_->catalogue.revision_at(*time));
    }
  }
  std::optional<std::string> after = "";
  while (after) {
    BlockPage page;
    {
      const std::lock_guard lock(state_->mutex);
      page = state_->catalogue.page(revision, *after, kPage);
    }
    for (const BlockFacts& facts : page.blocks) {
      std::promise<StoreResult<StoredBlock>> promise;
      read(facts.revision, [&promise](StoreResult<StoredBlock> block) { promise.set_value(std::move(block)); });
      auto block = promise.get_future().get();
      if (!block && block.error().code == StoreErrorCode::NotFound) continue;
      if (!block) return failure(block.error());
      if (!on_block(std::move(block).value())) return success();
    }
    after = std::move(page.next);
  }
  return success();
}

StoreStatus BlockStore::status() const {
  const std::lock_guard lock(state_->mutex);
  const Catalogue& catalogue = state_->catalogue;
  return {catalogue.last_revision(), catalogue.history_floor(), catalogue.block_count(),
          catalogue.block_bytes(),   catalogue.history_bytes(), state_->log_bytes,
          state_->waiting_count,     state_->waiting_bytes,     state_->trouble};
}

}  // namespace spectra::store
