#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <future>
#include <memory>
#include <string>
#include <system_error>
#include <utility>

#include "server/store/block_store.hpp"

namespace spectra::store {

/// A folder of its own, removed at the end; in memory where there is such a place, because these tests are about kills and failing
/// calls, not about the speed of a disk.
class StoreFixture {
 public:
  StoreFixture()
      : StoreFixture(::access("/dev/shm", W_OK) == 0 ? std::filesystem::path("/dev/shm")
                                                     : std::filesystem::temp_directory_path()) {}
  explicit StoreFixture(const std::filesystem::path& parent) {
    std::string pattern = (parent / "spectra-store-XXXXXX").string();
    folder_ = ::mkdtemp(pattern.data());
  }
  ~StoreFixture() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  StoreFixture(const StoreFixture&) = delete;
  StoreFixture& operator=(const StoreFixture&) = delete;

  const std::filesystem::path& folder() const { return folder_; }
  std::string file() const { return (folder_ / "map.spectra").string(); }

 private:
  std::filesystem::path folder_;
};

/// Bytes that follow from the seed alone.
inline std::string made_bytes(std::uint64_t seed, std::size_t size) {
  std::string bytes(size, '\0');
  std::uint64_t state = seed * 0x9e3779b97f4a7c15U + 1;
  for (char& c : bytes) {
    state ^= state << 13U;
    state ^= state >> 7U;
    state ^= state << 17U;
    c = static_cast<char>(state >> 56U);
  }
  return bytes;
}

inline BlockRecord made_block(const std::string& id, std::uint64_t seed, std::size_t size) {
  BlockRecord block;
  block.description.id = id;
  block.description.vertex_count = seed;
  block.ply = std::make_shared<const std::string>(made_bytes(seed, size));
  return block;
}

inline StoreResult<Revision> put(BlockStore& store, BlockRecord block) {
  std::promise<StoreResult<Revision>> done;
  store.put(std::move(block), [&done](StoreResult<Revision> result) { done.set_value(std::move(result)); });
  return done.get_future().get();
}

inline StoreResult<Revision> remove(BlockStore& store, const std::string& id) {
  std::promise<StoreResult<Revision>> done;
  store.remove(id, [&done](StoreResult<Revision> result) { done.set_value(std::move(result)); });
  return done.get_future().get();
}

inline StoreResult<void> set_constant(BlockStore& store, const std::string& key, const std::string& value) {
  std::promise<StoreResult<void>> done;
  store.set_constant(key, value, [&done](StoreResult<void> result) { done.set_value(std::move(result)); });
  return done.get_future().get();
}

inline StoreResult<StoredBlock> read(BlockStore& store, Revision revision) {
  std::promise<StoreResult<StoredBlock>> done;
  store.read(revision, [&done](StoreResult<StoredBlock> result) { done.set_value(std::move(result)); });
  return done.get_future().get();
}

/// The store, or a failed test with its reason.
inline std::unique_ptr<BlockStore> opened(const std::string& file, StoreOptions options = {}) {
  auto store = BlockStore::open(file, std::move(options));
  if (!store) {
    ADD_FAILURE() << store.error().message;
    return nullptr;
  }
  return std::move(store).value();
}

}  // namespace spectra::store
