#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace spectra::base {

/// Calls `work(i)` once for each i of 0..count, in as many threads as there are processors, or as can be begun, and returns when all are done. What one throws
/// (the first) is thrown here; others that had not begun then are left out.
template <class Work>
void parallel_for(std::size_t count, const Work& work) {
  std::atomic<std::size_t> next = 0;
  std::mutex mutex;
  std::exception_ptr thrown;
  const auto run = [&]() noexcept {
    try {
      for (std::size_t i = next++; i < count; i = next++) work(i);
    } catch (...) {
      next = count;
      const std::lock_guard lock(mutex);
      if (!thrown) thrown = std::current_exception();
    }
  };
  {
    std::vector<std::jthread> threads;
    const std::size_t thread_count = std::min<std::size_t>(std::max(1U, std::thread::hardware_concurrency()), count);
    try {
      for (std::size_t i = 1; i < thread_count; ++i) threads.emplace_back(run);
    } catch (...) {
      // Fewer do.
    }
    run();
  }
  if (thrown) std::rethrow_exception(thrown);
}

}  // namespace spectra::base
