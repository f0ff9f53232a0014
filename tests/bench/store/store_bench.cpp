// The store against writing and syncing the same bytes to a plain file, in one run: blocks a second and the time until one is
// acknowledged, alone and with several waiting; the file's size while blocks come and go; the time to open it and to read all.
// store_bench [FOLDER] [BLOCKS] [BLOCK_BYTES]: the folder should be on the disk that is meant (default: build's, 600, 100000).
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <mutex>
#include <random>
#include <semaphore>
#include <string>
#include <vector>

#include "server/store/block_store.hpp"

namespace {

using spectra::store::BlockRecord;
using spectra::store::BlockStore;
using spectra::store::Revision;
using spectra::store::StoreResult;
using Clock = std::chrono::steady_clock;

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

spectra::store::SharedBytes random_bytes(std::size_t size) {
  static std::mt19937_64 random(1);
  std::string bytes(size, '\0');
  for (char& c : bytes) c = static_cast<char>(random());
  return std::make_shared<const std::string>(std::move(bytes));
}

void print(const char* what, std::vector<double> waits, double total_ms) {
  std::sort(waits.begin(), waits.end());
  std::printf("%-34s %8.0f blocks/s, acknowledged after %6.2f ms (median), %6.2f ms (99 %%)\n", what,
              1'000.0 * static_cast<double>(waits.size()) / total_ms, waits[waits.size() / 2],
              waits[waits.size() * 99 / 100]);
}

void plain_file(const std::string& path, std::size_t count, const spectra::store::SharedBytes& bytes) {
  const int descriptor = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  std::vector<double> waits;
  const auto start = Clock::now();
  for (std::size_t i = 0; i < count; ++i) {
    const auto begin = Clock::now();
    if (::write(descriptor, bytes->data(), bytes->size()) < 0 || ::fdatasync(descriptor) != 0) std::abort();
    waits.push_back(milliseconds_since(begin));
  }
  print("plain file, write and sync", waits, milliseconds_since(start));
  ::close(descriptor);
  std::filesystem::remove(path);
}

void put_all(BlockStore& store, const char* what, std::size_t count, int in_flight,
             const spectra::store::SharedBytes& bytes) {
  std::counting_semaphore<1024> room(in_flight);
  std::mutex mutex;
  std::vector<double> waits;
  const auto start = Clock::now();
  for (std::size_t i = 0; i < count; ++i) {
    room.acquire();
    BlockRecord block;
    block.description.id = "block-" + std::to_string(i % 100);
    block.ply = bytes;
    store.put(std::move(block), [&, begin = Clock::now()](const StoreResult<Revision>& result) {
      if (!result) std::abort();
      const std::lock_guard lock(mutex);
      waits.push_back(milliseconds_since(begin));
      room.release();
    });
  }
  for (int i = 0; i < in_flight; ++i) room.acquire();
  print(what, waits, milliseconds_since(start));
}

}  // namespace

int main(int argc, char** argv) {
  const std::filesystem::path parent = argc > 1 ? argv[1] : ".";
  const std::size_t count = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 600;
  const std::size_t size = argc > 3 ? std::strtoull(argv[3], nullptr, 10) : 100'000;
  std::string pattern = (parent / "store-bench-XXXXXX").string();
  const std::filesystem::path folder = ::mkdtemp(pattern.data());
  const std::string file = (folder / "map").string();
  const auto bytes = random_bytes(size);
  plain_file((folder / "plain").string(), count, bytes);
  spectra::store::StoreOptions options;
  options.history_bytes = 100 * (size + 1024);
  {
    auto store = BlockStore::open(file, options).value();
    put_all(*store, "store, one at a time", count, 1, bytes);
    put_all(*store, "store, 8 waiting", count, 8, bytes);
    put_all(*store, "store, 64 waiting", count, 64, bytes);
    const auto held = store->status().block_bytes + store->status().history_bytes;
    std::printf("file and log %.1f MB after %.1f MB were put; %.1f MB are kept\n",
                static_cast<double>(std::filesystem::file_size(file) + std::filesystem::file_size(file + "-wal")) / 1e6,
                3e-6 * static_cast<double>(count * size), 1e-6 * static_cast<double>(held));
  }
  auto start = Clock::now();
  auto store = BlockStore::open(file, options).value();
  const double opened_ms = milliseconds_since(start);
  start = Clock::now();
  std::uint64_t read = 0;
  const auto visited = store->visit(std::nullopt, [&read](const spectra::store::StoredBlock& block) {
    read += block.ply->size();
    return true;
  });
  if (!visited) std::abort();
  std::printf("opened in %.1f ms (file of %.1f MB), all %.1f MB of the map read in %.1f ms\n", opened_ms,
              static_cast<double>(std::filesystem::file_size(file)) / 1e6, static_cast<double>(read) / 1e6,
              milliseconds_since(start));
  store.reset();
  std::filesystem::remove_all(folder);
  return 0;
}
