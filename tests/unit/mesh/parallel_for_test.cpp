#include "fusion/base/parallel_for.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <new>
#include <vector>

namespace spectra::base {
namespace {

TEST(ParallelFor, CallsOnceForEach) {
  for (const std::size_t count : {0U, 1U, 2U, 1000U}) {
    std::vector<std::atomic<int>> calls(count);
    parallel_for(count, [&](std::size_t i) { ++calls[i]; });
    for (const auto& count_of_one : calls) EXPECT_EQ(count_of_one, 1);
  }
}

TEST(ParallelFor, ThrowsWhatOneThrowsInWhateverThread) {
  std::atomic<int> thrown = 0;
  EXPECT_THROW(parallel_for(1000,
                            [&](std::size_t) {
                              ++thrown;
                              throw std::bad_alloc();
                            }),
               std::bad_alloc);
  EXPECT_GE(thrown, 1);
  EXPECT_LT(thrown, 1000);
}

}  // namespace
}  // namespace spectra::base
