#include "server/net/memory_reserve.hpp"

#include <gtest/gtest.h>

#include <new>
#include <stdexcept>

namespace spectra::net {
namespace {

class MemoryReserveTest : public testing::Test {
 protected:
  MemoryReserveTest() {
    keep_memory_reserve();
    run_out_ = std::get_new_handler();
  }
  ~MemoryReserveTest() override { std::set_new_handler(nullptr); }

  std::new_handler run_out_;
};

TEST_F(MemoryReserveTest, APartOfItGoesBackWithEachFailure) {
  const std::size_t whole = memory_reserve_bytes();
  // A destructor without any exception wants memory, too: the first half is for whoever comes.
  for (std::size_t left = whole; memory_reserve_bytes() > whole / 2; left = memory_reserve_bytes()) {
    EXPECT_NO_THROW(run_out_());
    ASSERT_LT(memory_reserve_bytes(), left);
  }
  EXPECT_THROW(run_out_(), std::bad_alloc);
  EXPECT_LT(memory_reserve_bytes(), whole / 2);
  while (memory_reserve_bytes() > 0) EXPECT_THROW(run_out_(), std::bad_alloc);
  EXPECT_THROW(run_out_(), std::bad_alloc);
  EXPECT_TRUE(refill_memory_reserve());
  EXPECT_EQ(memory_reserve_bytes(), whole);
}

TEST_F(MemoryReserveTest, WhoIsTakenApartByAnExceptionTriesAgain) {
  refill_memory_reserve();
  // The destructor is left by no exception: that would end the program.
  struct Allocating {
    std::new_handler run_out;
    ~Allocating() { run_out(); }
  };
  const std::size_t half = memory_reserve_bytes() / 2;
  while (memory_reserve_bytes() > half) run_out_();
  EXPECT_THROW(run_out_(), std::bad_alloc) << "without an exception on its way";
  const std::size_t left = memory_reserve_bytes();
  const auto fail = [this] {
    const Allocating allocating{run_out_};
    throw std::runtime_error("something else");
  };
  EXPECT_THROW(fail(), std::runtime_error);
  EXPECT_LT(memory_reserve_bytes(), left) << "with the memory of a part";
}

}  // namespace
}  // namespace spectra::net
