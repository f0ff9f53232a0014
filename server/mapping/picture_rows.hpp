#pragma once

#include <algorithm>
#include <cstddef>

#include "server/jobs/worker_pool.hpp"

namespace spectra::mapping {

/// Calls `work` with each row of a picture, some rows at a time, by all threads of a pool.
template <class Work>
void for_each_row(std::size_t height, jobs::WorkerPool& pool, const Work& work) {
  constexpr std::size_t kRows = 16;
  pool.for_each((height + kRows - 1) / kRows, [&](std::size_t band) {
    for (std::size_t y = band * kRows; y < std::min(height, (band + 1) * kRows); ++y) work(y);
  });
}

}  // namespace spectra::mapping
