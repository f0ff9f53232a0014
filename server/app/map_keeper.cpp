#include "server/app/map_keeper.hpp"

#include <spdlog/spdlog.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <future>
#include <set>
#include <utility>

#include "fusion/mesh/ply_reader.hpp"
#include "fusion/mesh/scene_survey.hpp"
#include "server/app/block_options.hpp"

namespace spectra::server {
namespace {

constexpr const char* kConstantsKey = "map";

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

fusion::Result<fusion::LoadedScene> loaded(const IncomingBlock& block) {
  const MemoryFile file(*block.ply);
  if (!file.is_open()) {
    return fusion::failure(fusion::ErrorCode::FileUnreadable, "there is no memory for the block", "body");
  }
  auto scene = fusion::read_ply(file.path(), block.read);
  if (scene) {
    fusion::survey(scene.value(), block.read);
    scene.value().mesh.name = block.id;
    return scene;
  }
  // The reader speaks of a file.
  const fusion::Error& error = scene.error();
  const std::string name = std::filesystem::path(file.path()).filename().string();
  const bool is_named = error.message.starts_with(name + ": ");
  return fusion::failure(error.code, is_named ? error.message.substr(name.size() + 2) : error.message,
                         error.field.empty() || error.field == name ? "body" : error.field);
}

store::BlockBounds bounds_of_mesh(const fusion::MultispectralMesh& mesh) {
  store::BlockBounds bounds;
  if (mesh.positions().empty()) return bounds;
  fusion::Vec3f low = mesh.positions()[0], high = low;
  for (const fusion::Vec3f& p : mesh.positions()) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  const auto absolute = [&](const fusion::Vec3f& p) {
    return fusion::Vec3d{mesh.origin.x + double{p.x}, mesh.origin.y + double{p.y}, mesh.origin.z + double{p.z}};
  };
  return {absolute(low), absolute(high)};
}

BlockRefusal refusal_of(const fusion::Error& error) {
  const bool is_conflict = error.code == fusion::ErrorCode::Unsupported && error.field == "map";
  return {is_conflict ? 409u : 422u, is_conflict ? "conflict" : "unreadable_block", is_conflict ? "body" : error.field,
          error.message, ""};
}

BlockRefusal refusal_of(const store::StoreError& error) {
  using store::StoreErrorCode;
  switch (error.code) {
    case StoreErrorCode::NotFound:
      return {404, "not_found", "id", error.message, ""};
    case StoreErrorCode::TooLarge:
      return {413, "too_large", "body", error.message, ""};
    case StoreErrorCode::InvalidRecord:
      return {400, "bad_request", "", error.message, ""};
    case StoreErrorCode::Busy:
      return {503, "busy", "", error.message, ""};
    default:
      return {507, "not_stored", "", error.message, ""};
  }
}

std::string text_of(const MapConstants& constants) {
  char text[256];
  const auto& corner = constants.grid.corner_m();
  std::snprintf(text, sizeof text, "%a %a %a %a %a %a %a %a", constants.origin.x, constants.origin.y,
                constants.origin.z, corner[0], corner[1], corner[2], constants.grid.edge_m(),
                double{constants.position_step_m});
  return text;
}

std::optional<MapConstants> constants_of(const std::string& text) {
  std::array<double, 8> v{};
  if (std::sscanf(text.c_str(), "%la %la %la %la %la %la %la %la", &v[0], &v[1], &v[2], &v[3], &v[4], &v[5], &v[6],
                  &v[7]) != 8) {
    return std::nullopt;
  }
  return MapConstants{.origin = {v[0], v[1], v[2]},
                      .grid = MapGrid({v[3], v[4], v[5]}, v[6]),
                      .position_step_m = static_cast<float>(v[7])};
}

}  // namespace

MapKeeper::MapKeeper(ServedScene& served, std::unique_ptr<store::BlockStore> store)
    : served_(served), store_(std::move(store)), writer_([this] { run(); }) {}

MapKeeper::~MapKeeper() {
  {
    const std::lock_guard lock(mutex_);
    is_ending_ = true;
  }
  has_work_.notify_all();
  writer_.join();
}

std::optional<std::string> MapKeeper::restore() {
  MapChange change;
  std::optional<std::string> problem;
  if (store_) {
    if (const auto text = store_->constant(kConstantsKey)) {
      const auto constants = constants_of(*text);
      if (!constants) return "the store's constants of the map cannot be read";
      served_.scenes.begin(*constants);
    }
    const auto done = store_->visit(std::nullopt, [&](store::StoredBlock stored) {
      const store::BlockDescription& told = stored.facts.description;
      auto block = incoming_block(told.id, told.read_options);
      if (!block) {
        problem = "block " + told.id + ": " + block.error().message;
        return false;
      }
      block.value().ply = stored.ply;
      auto scene = loaded(block.value());
      if (!scene) {
        problem = "block " + told.id + ": " + scene.error().message;
        return false;
      }
      entries_[told.id] = {told.id,
                           stored.facts.revision,
                           told.observed_at,
                           told.vertex_count,
                           told.triangle_count,
                           told.bounds,
                           store::to_hex(stored.facts.sha256)};
      change.put.push_back({told.id, std::move(scene).value(), told.observed_at});
      return true;
    });
    if (!problem && !done) problem = done.error().message;
    if (problem) return problem;
    last_revision_ = store_->status().last_revision;
  }
  const auto published = served_.scenes.change(std::move(change), served_.pool);
  if (!published) return published.error().message;
  return std::nullopt;
}

void MapKeeper::add_file_block(const SceneSnapshot& scene) {
  const auto& origin = scene.origin();
  const auto absolute = [&](const fusion::Vec3f& p) {
    return fusion::Vec3d{origin.x + double{p.x}, origin.y + double{p.y}, origin.z + double{p.z}};
  };
  const std::lock_guard lock(mutex_);
  const std::string id(SceneStore::kFileBlock);
  entries_[id] = {id,
                  0,
                  std::nullopt,
                  scene.vertex_count(),
                  scene.triangle_count(),
                  {absolute(scene.bounds().min), absolute(scene.bounds().max)},
                  ""};
}

void MapKeeper::put(IncomingBlock block, PutDone done) {
  {
    const std::lock_guard lock(mutex_);
    if (is_ending_ || waiting_bytes_ + block.ply->size() > kWaitingBytes) {
      return done(BlockRefusal{503, "busy", "", "too many bytes of blocks are waiting",
                               std::to_string(kWaitingBytes) + " bytes"});
    }
    waiting_bytes_ += block.ply->size();
  }
  PutDone counted = [this, size = block.ply->size(),
                     done = std::move(done)](std::variant<Taken, BlockRefusal> outcome) {
    {
      const std::lock_guard lock(mutex_);
      waiting_bytes_ -= size;
    }
    done(std::move(outcome));
  };
  served_.pool.post([this, block = std::move(block), counted = std::move(counted)]() mutable {
    read(std::move(block), std::move(counted));
  });
}

void MapKeeper::read(IncomingBlock block, PutDone done) {
  try {
    auto scene = loaded(block);
    if (!scene) return done(refusal_of(scene.error()));
    enqueue(Put{std::move(block), std::move(scene).value(), std::move(done)});
  } catch (const std::exception& error) {
    spdlog::error("a block could not be read: {}", error.what());
    done(BlockRefusal{503, "busy", "", "the block could not be read now", ""});
  }
}

void MapKeeper::remove(std::string id, RemoveDone done) {
  enqueue(Remove{std::move(id), std::move(done)});
}

void MapKeeper::enqueue(Change change) {
  {
    const std::lock_guard lock(mutex_);
    waiting_.push_back(std::move(change));
  }
  has_work_.notify_one();
}

void MapKeeper::run() {
  for (;;) {
    std::vector<Change> batch;
    {
      std::unique_lock lock(mutex_);
      has_work_.wait(lock, [this] { return is_ending_ || !waiting_.empty(); });
      if (is_ending_) return;
      // One change a block: the next waits for its own version.
      std::set<std::string> named;
      while (!waiting_.empty()) {
        const auto id_of = [](const auto& one) -> const std::string& {
          if constexpr (requires { one.block; }) {
            return one.block.id;
          } else {
            return one.id;
          }
        };
        if (!named.insert(std::visit(id_of, waiting_.front())).second) break;
        batch.push_back(std::move(waiting_.front()));
        waiting_.pop_front();
      }
    }
    take(std::move(batch));
  }
}

void MapKeeper::take(std::vector<Change> batch) {
  // What the map refuses must not be stored.
  MapChange probe = map_change_of(batch);
  const auto refused = served_.scenes.refusal_of(probe);
  for (BlockPut& put : probe.put) {
    for (Change& change : batch) {
      if (auto* one = std::get_if<Put>(&change); one != nullptr && one->block.id == put.id)
        one->scene = std::move(put.scene);
    }
  }
  if (refused && batch.size() > 1) {
    for (Change& change : batch) {
      std::vector<Change> alone;
      alone.push_back(std::move(change));
      take(std::move(alone));
    }
    return;
  }
  if (refused) {
    if (auto* put = std::get_if<Put>(&batch.front())) {
      put->done(refusal_of(fusion::Error{refused->code, refused->message, "map"}));
    }
    return;
  }

  // Durable first.
  std::vector<Change> taken;
  std::vector<std::pair<std::future<store::StoreResult<store::Revision>>, std::size_t>> stored;
  std::vector<store::BlockBounds> bounds(batch.size());
  for (std::size_t i = 0; i < batch.size(); ++i) {
    const auto promise = std::make_shared<std::promise<store::StoreResult<store::Revision>>>();
    stored.emplace_back(promise->get_future(), i);
    const auto on_done = [promise](store::StoreResult<store::Revision> revision) {
      promise->set_value(std::move(revision));
    };
    if (auto* put = std::get_if<Put>(&batch[i])) {
      bounds[i] = bounds_of_mesh(put->scene.mesh);
      if (!store_) {
        on_done(++last_revision_);
        continue;
      }
      store_->put({{put->block.id, put->block.observed_at, put->block.sensor, put->block.read_text,
                    put->scene.mesh.vertex_count(), put->scene.mesh.triangle_count(), bounds[i]},
                   put->block.ply},
                  on_done);
    } else {
      const std::string& id = std::get<Remove>(batch[i]).id;
      if (!has(id)) {
        on_done(store::failure(store::StoreErrorCode::NotFound, "there is no block \"" + id + "\""));
      } else if (!store_ || id == SceneStore::kFileBlock) {
        on_done(++last_revision_);
      } else {
        store_->remove(id, on_done);
      }
    }
  }
  std::vector<std::uint64_t> revisions;
  for (auto& [future, i] : stored) {
    auto revision = future.get();
    if (revision) {
      revisions.push_back(revision.value());
      taken.push_back(std::move(batch[i]));
      std::swap(bounds[taken.size() - 1], bounds[i]);
      continue;
    }
    const BlockRefusal refusal = refusal_of(revision.error());
    if (auto* put = std::get_if<Put>(&batch[i])) put->done(refusal);
    if (auto* gone = std::get_if<Remove>(&batch[i])) gone->done(refusal);
  }
  if (taken.empty()) return;

  std::vector<Taken> answers(taken.size());
  for (std::size_t i = 0; i < taken.size(); ++i) {
    const auto* put = std::get_if<Put>(&taken[i]);
    if (put == nullptr) continue;
    const auto& mesh = put->scene.mesh;
    answers[i] = {{put->block.id, revisions[i], put->block.observed_at, mesh.vertex_count(), mesh.triangle_count(),
                   bounds[i], store::to_hex(store::sha256(*put->block.ply))},
                  put->scene.notes};
  }
  const auto published = served_.scenes.change(map_change_of(taken), served_.pool);
  if (!published) spdlog::error("a block was stored and is not shown: {}", published.error().message);
  if (store_) {
    if (const auto constants = served_.scenes.constants()) {
      const std::string text = text_of(*constants);
      if (store_->constant(kConstantsKey) != text) store_->set_constant(kConstantsKey, text, [](const auto&) {});
    }
  }
  for (std::size_t i = 0; i < taken.size(); ++i) {
    if (auto* put = std::get_if<Put>(&taken[i])) {
      {
        const std::lock_guard lock(mutex_);
        entries_[put->block.id] = answers[i].entry;
      }
      put->done(std::move(answers[i]));
    } else {
      auto& gone = std::get<Remove>(taken[i]);
      {
        const std::lock_guard lock(mutex_);
        entries_.erase(gone.id);
      }
      gone.done(std::nullopt);
    }
  }
}

MapChange MapKeeper::map_change_of(std::vector<Change>& batch) {
  MapChange change;
  for (Change& one : batch) {
    if (auto* put = std::get_if<Put>(&one)) {
      change.put.push_back({put->block.id, std::move(put->scene), put->block.observed_at});
    } else {
      change.removed.push_back(std::get<Remove>(one).id);
    }
  }
  return change;
}

std::vector<BlockEntry> MapKeeper::page(std::string_view after, std::size_t limit) const {
  const std::lock_guard lock(mutex_);
  std::vector<BlockEntry> page;
  for (auto entry = entries_.upper_bound(after); entry != entries_.end() && page.size() < limit; ++entry) {
    page.push_back(entry->second);
  }
  return page;
}

bool MapKeeper::has(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  return entries_.contains(id);
}

}  // namespace spectra::server
