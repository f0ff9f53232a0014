#include "server/sources/map_keeper.hpp"

#include <spdlog/spdlog.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <future>
#include <set>
#include <utility>

#include "fusion/base/distance_text.hpp"
#include "fusion/files/ply_reader.hpp"
#include "fusion/files/scene_survey.hpp"
#include "server/jobs/priority.hpp"
#include "server/sources/block_options.hpp"
#include "server/sources/stored_baseline.hpp"
#include "server/sources/stored_constants.hpp"
#include "server/store/time_text.hpp"

namespace spectra::sources {
namespace {

/// Fusing and encoding for viewers get ten times as much of a processor as coarse tiles.
constexpr int kCoarseNiceness = 10;
/// After so long without any the memory for making them is given back.
constexpr std::chrono::seconds kCoarseRest{2};

/// Bytes as a file that only this process sees.
class MemoryFile {
 public:
  explicit MemoryFile(const std::string& bytes) : descriptor_(memfd_create("block", MFD_CLOEXEC)) {
    std::size_t written = 0;
    while (is_open() && written < bytes.size()) {
      const ssize_t count = ::write(descriptor_, bytes.data() + written, bytes.size() - written);
      if (count <= 0) {
        ::close(std::exchange(descriptor_, -1));
      } else {
        written += static_cast<std::size_t>(count);
      }
    }
  }
  ~MemoryFile() {
    if (is_open()) ::close(descriptor_);
  }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  bool is_open() const { return descriptor_ >= 0; }
  std::string path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

 private:
  int descriptor_;
};

base::Result<files::LoadedScene> loaded(const IncomingBlock& block, const std::optional<base::Vec3d>& origin) {
  const MemoryFile file(*block.ply);
  if (!file.is_open()) {
    return base::failure(base::ErrorCode::FileUnreadable, "there is no memory for the block", "body");
  }
  files::ReadOptions options = block.read;
  options.origin = origin;
  auto scene = files::read_ply(file.path(), options);
  if (scene) {
    files::survey(scene.value(), block.read);
    scene.value().mesh.name = block.id;
    return scene;
  }
  // The reader speaks of a file.
  const base::Error& error = scene.error();
  const std::string name = std::filesystem::path(file.path()).filename().string();
  const bool is_named = error.message.starts_with(name + ": ");
  return base::failure(error.code, is_named ? error.message.substr(name.size() + 2) : error.message,
                       error.field.empty() || error.field == name ? "body" : error.field);
}

/// A block of the store, as loaded().
base::Result<files::LoadedScene> read_stored(const store::StoredBlock& stored,
                                             const std::optional<base::Vec3d>& origin) {
  const store::BlockDescription& told = stored.facts.description;
  BOOST_OUTCOME_TRY(auto block, incoming_block(told.id, told.read_options));
  block.ply = stored.ply;
  return loaded(block, origin);
}

double unix_seconds(std::chrono::sys_time<std::chrono::system_clock::duration> time) {
  return std::chrono::duration<double>(time.time_since_epoch()).count();
}

BlockEntry entry_of(const store::BlockFacts& facts) {
  const store::BlockDescription& told = facts.description;
  return {told.id,
          facts.revision,
          told.observed_at,
          told.vertex_count,
          told.triangle_count,
          told.bounds,
          store::to_hex(facts.sha256)};
}

store::BlockBounds bounds_of_mesh(const mesh::MultispectralMesh& mesh) {
  store::BlockBounds bounds;
  if (mesh.positions().empty()) return bounds;
  base::Vec3f low = mesh.positions()[0], high = low;
  for (const base::Vec3f& p : mesh.positions()) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  const auto absolute = [&](const base::Vec3f& p) {
    return base::Vec3d{mesh.origin.x + double{p.x}, mesh.origin.y + double{p.y}, mesh.origin.z + double{p.z}};
  };
  return {absolute(low), absolute(high)};
}

net::BlockRefusal busy(std::string reason, std::string limits = "") {
  return {503, "busy", "", std::move(reason), std::move(limits)};
}

std::string place_text(const base::Vec3d& p) {
  char text[96];
  std::snprintf(text, sizeof text, "%.7g %.7g %.7g", p.x, p.y, p.z);
  return text;
}

/// Why a block cannot lie where its file says, strays aside. `known`: of the map, where it has any.
std::optional<net::BlockRefusal> refusal_of_place(const files::LoadedScene& scene,
                                                  const std::optional<map::MapConstants>& known) {
  constexpr double kMostCoordinate_m = 1e9;
  constexpr double kReach_m = 1e6;
  constexpr double kFloatSteps = 0x1p24;
  if (!scene.core_bounds || scene.mesh.vertex_count() == 0) return std::nullopt;
  const base::Vec3d& origin = scene.mesh.origin;
  const auto absolute = [&](const base::Vec3f& p) {
    return base::Vec3d{origin.x + double{p.x}, origin.y + double{p.y}, origin.z + double{p.z}};
  };
  const base::Vec3d low = absolute(scene.core_bounds->min), high = absolute(scene.core_bounds->max);
  const auto largest = [](const base::Vec3d& p) { return std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}); };
  const std::string where = "the block reaches from " + place_text(low) + " to " + place_text(high) + " m";
  if (!(std::max(largest(low), largest(high)) <= kMostCoordinate_m)) {
    return net::BlockRefusal{422, "absurd_extent", "body",
                             where + ", farther than anything on Earth; if its file counts in other units, say scale",
                             "coordinates from -1e9 to 1e9 m"};
  }
  if (!known) return std::nullopt;
  const double reach = std::max(kReach_m, kFloatSteps * double{known->position_step_m});
  const auto away = [&](const base::Vec3d& p) {
    return largest({p.x - known->origin.x, p.y - known->origin.y, p.z - known->origin.z});
  };
  const double farthest = std::max(away(low), away(high));
  if (farthest <= reach) return std::nullopt;
  return net::BlockRefusal{422, "too_far_away", "body",
                           where + ", " + base::distance_text(farthest) + " from where the map began (" +
                               place_text(known->origin) +
                               "): blocks of one map share one coordinate system; a map that is emptied begins anew",
                           base::distance_text(reach) + " along each axis"};
}

net::BlockRefusal no_history() {
  return {409, "no_history", "at", "the map's past is kept nowhere; serve it with --store FILE", ""};
}

net::BlockRefusal refusal_of(const store::StoreError& error) {
  using store::StoreErrorCode;
  switch (error.code) {
    case StoreErrorCode::NotFound:
      return {404, "not_found", "id", error.message, ""};
    case StoreErrorCode::TooLarge:
      return {413, "too_large", "body", error.message, ""};
    case StoreErrorCode::InvalidRecord:
      return {400, "bad_request", "", error.message, ""};
    case StoreErrorCode::Busy:
      return busy(error.message);
    case StoreErrorCode::HistoryGone:
      return {410, "history_gone", "at", error.message, ""};
    case StoreErrorCode::Damaged:
    case StoreErrorCode::IoError:
      return {500, "not_read", "", error.message, ""};
    default:
      return {507, "not_stored", "", error.message, ""};
  }
}

/// What a change is answered that the store did not take, whatever is wrong with the disk.
net::BlockRefusal refusal_to_store(const store::StoreError& error) {
  const auto refusal = refusal_of(error);
  return refusal.status == 500 ? net::BlockRefusal{507, "not_stored", "", error.message, ""} : refusal;
}

}  // namespace

MapKeeper::MapKeeper(map::SceneStore& scenes, jobs::WorkerPool& pool, std::unique_ptr<store::BlockStore> store,
                     const std::optional<store::StoreTime>& at, std::uint64_t most_bytes)
    : scenes_(scenes),
      pool_(pool),
      store_(std::move(store)),
      at_(at),
      most_bytes_(most_bytes),
      writer_([this] { run(); }),
      coarse_maker_([this] { make_coarse(); }) {}

MapKeeper::~MapKeeper() {
  end();
}

void MapKeeper::end() {
  Queue refused;
  {
    std::unique_lock lock(mutex_);
    is_ending_ = true;
    is_read_.wait(lock, [this] { return reading_count_ == 0; });
    refused.swap(waiting_);
  }
  has_work_.notify_all();
  has_coarse_work_.notify_all();
  if (writer_.joinable()) writer_.join();
  if (coarse_maker_.joinable()) coarse_maker_.join();
  for (Waiting& waiting : refused) refuse(waiting.change, busy("the server ends"));
}

std::optional<std::string> MapKeeper::restore() {
  map::MapChange change;
  std::optional<std::string> problem;
  std::map<std::string, BlockEntry, std::less<>> entries;
  if (store_) {
    std::optional<map::MapConstants> constants;
    if (const auto text = store_->constant(kConstantsKey)) {
      constants = constants_of(*text);
      if (!constants) return "the store's constants of the map cannot be read";
    }
    const auto first = at_ ? store_->page_at(*at_, "", 1) : store::StoreResult<store::BlockPage>(store_->page("", 1));
    if (!first) return first.error().message;
    const auto& any = first.value().blocks;
    // An empty map takes those that its next block asks for.
    constants = any.empty() ? std::nullopt : constants_at(any.front().revision);
    const auto origin = constants ? std::optional(constants->origin) : std::nullopt;
    StoredMark marked;
    if (const auto text = store_->constant(kBaselineKey)) {
      const auto found = mark_from(*text);
      if (!found) return "the store's mark of the baseline cannot be read";
      // A later one says nothing of the map as it was.
      if (!at_ || unix_seconds(*at_) >= *found->mark.marked_at) marked = *found;
    }
    scenes_.begin(constants, at_ ? std::optional("map of " + store::utc_text(*at_)) : std::nullopt, marked.mark);
    const auto visited = store_->visit(at_, [&](const store::StoredBlock& stored) {
      auto scene = read_stored(stored, origin);
      const BlockEntry entry = entry_of(stored.facts);
      if (!scene) {
        problem = "block " + entry.id + ": " + scene.error().message;
        return false;
      }
      const bool was_marked = entry.revision <= marked.revision;
      const std::string_view bytes = stored.baseline && !was_marked ? std::string_view(*stored.baseline) : "";
      auto baseline = baseline_from(bytes, scene.value().mesh.vertex_count());
      if (!baseline) {
        problem = "block " + entry.id + ": its baseline cannot be read";
        return false;
      }
      entries[entry.id] = entry;
      change.put.push_back({entry.id, std::move(scene).value(), entry.observed_at, std::move(baseline), was_marked});
      return true;
    });
    if (!problem && !visited) problem = visited.error().message;
    if (problem) return problem;
  }
  change_map(std::move(change));
  if (store_) last_revision_ = store_->status().last_revision;
  if (!at_) keep_constants(last_revision_);
  const std::lock_guard lock(mutex_);
  entries_ = std::move(entries);
  constants_ = scenes_.constants();
  is_open_ = true;
  return std::nullopt;
}

void MapKeeper::open_with_file() {
  const auto scene = scenes_.current();
  const base::Vec3d origin = scene->origin();
  const auto absolute = [&](const base::Vec3f& p) {
    return base::Vec3d{origin.x + double{p.x}, origin.y + double{p.y}, origin.z + double{p.z}};
  };
  const std::string id(map::SceneStore::kFileBlock);
  const std::lock_guard lock(mutex_);
  entries_[id] = {id,
                  0,
                  std::nullopt,
                  scene->vertex_count(),
                  scene->triangle_count(),
                  {absolute(scene->bounds().min), absolute(scene->bounds().max)},
                  ""};
  constants_ = scenes_.constants();
  is_open_ = true;
}

void MapKeeper::put(IncomingBlock block, PutDone done, WhenFull when_full) {
  const std::size_t size = block.ply->size();
  PutDone counted = [this, size, done = std::move(done)](std::variant<Taken, net::BlockRefusal> outcome) {
    {
      const std::lock_guard lock(mutex_);
      waiting_bytes_ -= size;
    }
    done(std::move(outcome));
  };
  enqueue(Put{std::move(block), {}, std::move(counted)}, size, when_full);
}

void MapKeeper::remove(std::string id, RemoveDone done, WhenFull when_full) {
  enqueue(Remove{std::move(id), std::move(done)}, 0, when_full);
}

void MapKeeper::mark_baseline(BaselineDone done) {
  enqueue(Mark{std::move(done)}, 0, WhenFull::Refuse);
}

void MapKeeper::enqueue(Change change, std::size_t bytes, WhenFull when_full) {
  std::optional<net::BlockRefusal> refusal;
  {
    const std::lock_guard lock(mutex_);
    waiting_bytes_ += bytes;
    if (at_) {
      refusal = {
          409, "as_it_was", "",
          "the map is shown as it was at " + store::utc_text(*at_) + "; it changes where it is served without --at",
          ""};
    } else if (!is_open_ || is_ending_) {
      refusal = busy("the map is not open yet, or not any more");
    } else if (when_full == WhenFull::Refuse && waiting_bytes_ > kWaitingBytes) {
      refusal = busy("too many bytes of blocks are waiting", std::to_string(kWaitingBytes) + " bytes");
    } else if (when_full == WhenFull::Refuse && waiting_.size() >= kWaitingChanges) {
      refusal = busy("too many changes are waiting", std::to_string(kWaitingChanges));
    } else {
      const bool is_ready = !std::holds_alternative<Put>(change);
      waiting_.push_back({.change = std::move(change), .is_ready = is_ready});
      if (is_ready) {
        has_work_.notify_one();
      } else {
        begin_reading(std::prev(waiting_.end()));
      }
    }
  }
  if (refusal) refuse(change, *refusal);
}

void MapKeeper::begin_reading(Queue::iterator waiting) {
  if (waiting->is_ready || waiting->is_reading || is_ending_ || (!constants_ && is_first_under_way_)) return;
  is_first_under_way_ = !constants_;
  waiting->is_reading = true;
  ++reading_count_;
  pool_.post([this, waiting] {
    read(waiting);
    // Under the lock: after it nothing here is touched any more.
    const std::lock_guard lock(mutex_);
    --reading_count_;
    is_read_.notify_all();
  });
}

void MapKeeper::read(Queue::iterator waiting) {
  std::optional<map::MapConstants> constants;
  {
    const std::lock_guard lock(mutex_);
    constants = constants_;
    if (is_ending_) return;  // refused there
  }
  auto& put = std::get<Put>(waiting->change);
  std::optional<net::BlockRefusal> refusal;
  try {
    auto scene = loaded(put.block, constants ? std::optional(constants->origin) : std::nullopt);
    if (scene) {
      put.scene = std::move(scene).value();
      refusal = refusal_of_place(put.scene, constants);
    } else {
      refusal = {422, "unreadable_block", scene.error().field, scene.error().message, ""};
    }
  } catch (const std::exception& error) {
    spdlog::error("a block could not be read: {}", error.what());
    refusal = busy("the block could not be read now");
  }
  Queue refused;
  {
    const std::lock_guard lock(mutex_);
    waiting->is_ready = true;
    if (refusal) refused.splice(refused.begin(), waiting_, waiting);
    if (refusal && !constants) read_next();
    has_work_.notify_one();
  }
  if (refusal) put.done(*refusal);
}

void MapKeeper::read_next() {
  is_first_under_way_ = false;
  for (auto waiting = waiting_.begin(); waiting != waiting_.end(); ++waiting) begin_reading(waiting);
}

void MapKeeper::refuse(Change& change, const net::BlockRefusal& refusal) {
  if (auto* put = std::get_if<Put>(&change)) put->done(refusal);
  if (auto* gone = std::get_if<Remove>(&change)) gone->done(refusal);
  if (auto* marking = std::get_if<Mark>(&change)) marking->done(refusal);
}

const std::string& MapKeeper::id_of(const Change& change) {
  const auto* put = std::get_if<Put>(&change);
  return put != nullptr ? put->block.id : std::get<Remove>(change).id;
}

void MapKeeper::run() {
  for (;;) {
    std::vector<Change> batch = next_batch();
    if (batch.empty()) return;
    const bool has_put =
        std::any_of(batch.begin(), batch.end(), [](const Change& c) { return std::holds_alternative<Put>(c); });
    if (const auto* marking = std::get_if<Mark>(&batch.front())) {
      mark(*marking);
    } else {
      take(std::move(batch));
    }
    const std::lock_guard lock(mutex_);
    if (has_put && is_first_under_way_) read_next();
  }
}

void MapKeeper::make_coarse() {
  // Of a thread alone, on Linux.
  if (setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kCoarseNiceness) != 0) {
    spdlog::debug("coarse tiles are made at the priority of everything else");
  }
  for (;;) {
    {
      std::unique_lock lock(mutex_);
      const auto is_called = [this] { return is_ending_ || is_behind_; };
      if (!has_coarse_work_.wait_for(lock, kCoarseRest, is_called)) {
        lock.unlock();
        scenes_.rest();
        lock.lock();
        has_coarse_work_.wait(lock, is_called);
      }
      if (is_ending_) return;
      is_behind_ = false;
    }
    const auto is_ending = [this] {
      const std::lock_guard lock(mutex_);
      return is_ending_;
    };
    try {
      while (!is_ending() && scenes_.make_coarse()) {
      }
    } catch (const std::exception& error) {
      spdlog::error("a coarse tile could not be made: {}", error.what());
    }
  }
}

std::vector<MapKeeper::Change> MapKeeper::next_batch() {
  std::unique_lock lock(mutex_);
  std::vector<Change> batch;
  while (!is_ending_) {
    // One change a block, the first that waits: the next waits for a version of its own.
    std::set<std::string> named;
    std::size_t bytes = 0;
    for (auto waiting = waiting_.begin(); waiting != waiting_.end();) {
      const auto next = std::next(waiting);
      if (std::holds_alternative<Mark>(waiting->change)) {
        // Alone, and before all that came later.
        if (batch.empty()) {
          batch.push_back(std::move(waiting->change));
          waiting_.erase(waiting);
        }
        break;
      }
      const auto* put = std::get_if<Put>(&waiting->change);
      const std::size_t size = put != nullptr ? put->block.ply->size() : 0;
      if (named.insert(id_of(waiting->change)).second && waiting->is_ready) {
        if (!batch.empty() && bytes + size > kBatchBytes) break;
        bytes += size;
        batch.push_back(std::move(waiting->change));
        waiting_.erase(waiting);
      }
      waiting = next;
    }
    if (!batch.empty()) return batch;
    has_work_.wait(lock);
  }
  return batch;
}

MapKeeper::Shapes MapKeeper::shapes_of(const std::vector<Change>& batch) {
  Shapes shapes;
  for (const Change& change : batch) {
    if (const auto* put = std::get_if<Put>(&change)) {
      const auto& mesh = put->scene.mesh;
      shapes.put.push_back({put->block.id, mesh.vertex_count(), !mesh.is_point_cloud()});
      shapes.put_bytes += bytes_of(mesh.vertex_count(), mesh.triangle_count());
    } else {
      shapes.removed.push_back(std::get<Remove>(change).id);
    }
  }
  return shapes;
}

std::optional<net::BlockRefusal> MapKeeper::why_not(const Shapes& shapes) const {
  if (const auto refused = scenes_.refusal_of(shapes.put, shapes.removed)) {
    return net::BlockRefusal{409, "conflict", "body", refused->message, ""};
  }
  if (shapes.put.empty()) return std::nullopt;
  std::set<std::string_view> gone(shapes.removed.begin(), shapes.removed.end());
  for (const map::BlockShape& shape : shapes.put) gone.insert(shape.id);
  std::uint64_t bytes = shapes.put_bytes;
  const std::lock_guard lock(mutex_);
  for (const auto& [id, entry] : entries_) {
    if (!gone.contains(id)) bytes += bytes_of(entry.vertex_count, entry.triangle_count);
  }
  if (bytes <= most_bytes_) return std::nullopt;
  return net::BlockRefusal{507, "map_full", "body",
                           "the map would take about " + std::to_string(bytes) +
                               " bytes of memory; delete blocks, or serve with another --limit scene-bytes",
                           std::to_string(most_bytes_) + " bytes"};
}

void MapKeeper::take(std::vector<Change> batch) {
  // What the map refuses must not be stored.
  const Shapes shapes = shapes_of(batch);
  if (const auto refused = why_not(shapes)) {
    if (batch.size() == 1) return refuse(batch.front(), *refused);
    for (Change& change : batch) {
      std::vector<Change> alone;
      alone.push_back(std::move(change));
      take(std::move(alone));
    }
    return;
  }
  for (Change& change : batch) {
    auto* put = std::get_if<Put>(&change);
    if (put == nullptr) continue;
    put->baseline = scenes_.handed_on(put->block.id, put->scene.mesh, put->block.observed_at);
  }
  const auto outcomes = stored(batch);
  if (store_) note_store(outcomes);
  std::vector<Change> taken;
  std::vector<store::Revision> revisions;
  for (std::size_t i = 0; i < batch.size(); ++i) {
    if (!outcomes[i]) {
      refuse(batch[i], refusal_to_store(outcomes[i].error()));
      continue;
    }
    taken.push_back(std::move(batch[i]));
    revisions.push_back(outcomes[i].value());
  }
  if (!taken.empty()) publish(std::move(taken), revisions);
}

void MapKeeper::note_store(const std::vector<store::StoreResult<store::Revision>>& outcomes) {
  const store::StoreError* failure = nullptr;
  bool is_any_stored = false;
  for (const auto& outcome : outcomes) {
    is_any_stored = is_any_stored || outcome;
    if (outcome || refusal_to_store(outcome.error()).status != 507) continue;
    ++store_failure_count_;
    failure = &outcome.error();
  }
  if ((failure != nullptr) == is_store_failing_ || (failure == nullptr && !is_any_stored)) return;
  is_store_failing_ = failure != nullptr;
  std::optional<std::string> trouble;
  if (failure != nullptr) {
    spdlog::error("the store takes nothing, and what mappers send is refused: {}", failure->message);
    trouble = "The map is not stored, and what mappers send is refused: " + failure->message +
              ". What was taken before is safe.";
  } else {
    spdlog::info("the store takes what is sent again");
  }
  if (on_store_trouble) on_store_trouble(std::move(trouble));
}

std::vector<store::StoreResult<store::Revision>> MapKeeper::stored(const std::vector<Change>& batch) {
  using Outcome = store::StoreResult<store::Revision>;
  std::vector<std::future<Outcome>> coming;
  for (const Change& change : batch) {
    const auto promise = std::make_shared<std::promise<Outcome>>();
    coming.push_back(promise->get_future());
    const auto on_done = [promise](Outcome outcome) { promise->set_value(std::move(outcome)); };
    const auto* put = std::get_if<Put>(&change);
    if (put == nullptr && !has(std::get<Remove>(change).id)) {
      on_done(
          store::failure(store::StoreErrorCode::NotFound, "there is no block \"" + std::get<Remove>(change).id + "\""));
    } else if (!store_) {
      on_done(++last_revision_);
    } else if (put == nullptr) {
      store_->remove(std::get<Remove>(change).id, on_done);
    } else {
      const auto& mesh = put->scene.mesh;
      store_->put({{put->block.id, put->block.observed_at, put->block.sensor, put->block.read_text, mesh.vertex_count(),
                    mesh.triangle_count(), bounds_of_mesh(mesh)},
                   put->block.ply,
                   std::make_shared<const std::string>(text_of(put->baseline))},
                  on_done);
    }
  }
  std::vector<Outcome> outcomes;
  for (auto& outcome : coming) outcomes.push_back(outcome.get());
  return outcomes;
}

void MapKeeper::publish(std::vector<Change> batch, const std::vector<store::Revision>& revisions) {
  std::vector<Taken> taken(batch.size());
  map::MapChange wanted;
  for (std::size_t i = 0; i < batch.size(); ++i) {
    auto* put = std::get_if<Put>(&batch[i]);
    if (put == nullptr) {
      wanted.removed.push_back(std::get<Remove>(batch[i]).id);
      continue;
    }
    const auto& mesh = put->scene.mesh;
    taken[i] = {{put->block.id, revisions[i], put->block.observed_at, mesh.vertex_count(), mesh.triangle_count(),
                 bounds_of_mesh(mesh), store::to_hex(store::sha256(*put->block.ply))},
                put->scene.notes};
    wanted.put.push_back({put->block.id, std::move(put->scene), put->block.observed_at, std::move(put->baseline)});
  }
  change_map(std::move(wanted));
  keep_constants(*std::max_element(revisions.begin(), revisions.end()));
  for (std::size_t i = 0; i < batch.size(); ++i) {
    {
      const std::lock_guard lock(mutex_);
      if (std::holds_alternative<Put>(batch[i])) {
        entries_[taken[i].entry.id] = taken[i].entry;
      } else {
        entries_.erase(std::get<Remove>(batch[i]).id);
      }
    }
    if (auto* put = std::get_if<Put>(&batch[i])) put->done(std::move(taken[i]));
    if (auto* gone = std::get_if<Remove>(&batch[i])) gone->done(revisions[i]);
  }
}

void MapKeeper::change_map(map::MapChange change) {
  scenes_.change(std::move(change), pool_);
  {
    const std::lock_guard lock(mutex_);
    is_behind_ = true;
  }
  has_coarse_work_.notify_one();
}

void MapKeeper::mark(const Mark& wanted) {
  const double now = unix_seconds(std::chrono::system_clock::now());
  if (store_) {
    const auto before = store_->constant(kBaselineKey);
    const auto marked = before ? mark_from(*before) : std::nullopt;
    const StoredMark next{{marked ? marked->mark.number + 1 : 1, now}, store_->status().last_revision};
    std::promise<store::StoreResult<void>> promise;
    auto outcome = promise.get_future();
    store_->set_constant(kBaselineKey, text_of(next),
                         [&promise](store::StoreResult<void> done) { promise.set_value(std::move(done)); });
    if (const auto done = outcome.get(); !done) return wanted.done(refusal_to_store(done.error()));
  }
  const auto marked = scenes_.mark_baseline(now);
  if (!marked) return wanted.done(busy("there is no map yet"));
  wanted.done(BaselineMarked{now, marked->revision()});
}

void MapKeeper::keep_constants(store::Revision revision) {
  const auto constants = scenes_.constants();
  {
    const std::lock_guard lock(mutex_);
    constants_ = constants;
  }
  if (!store_) return;
  const auto set = [this](const char* key, std::string text) {
    store_->set_constant(key, std::move(text), [](const store::StoreResult<void>& outcome) {
      if (!outcome) spdlog::error("the map's constants could not be stored: {}", outcome.error().message);
    });
  };
  const auto known = store_->constant(kConstantsKey);
  if (constants) {
    if (known != text_of(*constants)) set(kConstantsKey, text_of(*constants));
    return;
  }
  const auto gone = known ? constants_of(*known) : std::nullopt;
  if (!gone) return;
  auto earlier = earlier_constants_of(store_->constant(kEarlierConstantsKey).value_or(""));
  std::erase_if(earlier, [floor = store_->status().history_floor](const EarlierConstants& one) {
    return one.until_revision <= floor;
  });
  earlier.push_back({revision, *gone});
  set(kEarlierConstantsKey, text_of(earlier));
  set(kConstantsKey, "");
}

std::optional<map::MapConstants> MapKeeper::constants_at(store::Revision revision) const {
  for (const auto& [until, constants] : earlier_constants_of(store_->constant(kEarlierConstantsKey).value_or(""))) {
    if (revision < until) return constants;
  }
  const auto text = store_->constant(kConstantsKey);
  return text ? constants_of(*text) : std::nullopt;
}

MapKeeper::Page MapKeeper::page(std::string_view after, std::size_t limit) const {
  const std::lock_guard lock(mutex_);
  Page page;
  auto entry = entries_.upper_bound(after);
  for (; entry != entries_.end() && page.blocks.size() < limit; ++entry) page.blocks.push_back(entry->second);
  page.has_more = entry != entries_.end();
  return page;
}

std::variant<MapKeeper::Page, net::BlockRefusal> MapKeeper::page_at(store::StoreTime time, std::string_view after,
                                                                    std::size_t limit) const {
  if (!store_) return no_history();
  const auto page = store_->page_at(time, after, limit);
  if (!page) return refusal_of(page.error());
  Page past{{}, page.value().next.has_value()};
  for (const store::BlockFacts& facts : page.value().blocks) past.blocks.push_back(entry_of(facts));
  return past;
}

void MapKeeper::read_at(store::StoreTime time, const std::string& id, PastDone done) const {
  if (!store_) return done(no_history());
  const auto facts = store_->find_at(time, id);
  if (!facts) return done(refusal_of(facts.error()));
  if (!facts.value()) {
    return done(
        net::BlockRefusal{404, "not_found", "id", "there was no block \"" + id + "\" at " + store::utc_text(time), ""});
  }
  const auto constants = constants_at(facts.value()->revision);
  const auto origin = constants ? std::optional(constants->origin) : std::nullopt;
  store_->read(facts.value()->revision,
               [&pool = pool_, origin, done = std::move(done)](store::StoreResult<store::StoredBlock> outcome) {
                 if (!outcome) return done(refusal_of(outcome.error()));
                 // The store's thread waits for nobody.
                 pool.post(
                     [stored = std::move(outcome).value(), origin, done] {
                       auto scene = read_stored(stored, origin);
                       if (!scene) return done(net::BlockRefusal{500, "not_read", "", scene.error().message, ""});
                       done(std::move(scene).value());
                     },
                     jobs::kExportPriority);
               });
}

bool MapKeeper::is_open() const {
  const std::lock_guard lock(mutex_);
  return is_open_;
}

bool MapKeeper::has(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  return entries_.contains(id);
}

}  // namespace spectra::sources
