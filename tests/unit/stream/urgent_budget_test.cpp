#include "server/stream/urgent_budget.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <future>
#include <utility>

#include "server/stream/duration_histogram.hpp"
#include "stream_with_viewers.hpp"

namespace spectra::stream {
namespace {

using std::chrono::duration_cast;
using testing::TestViewer;

UrgentBudget::Clock::duration seconds(double s) {
  return duration_cast<UrgentBudget::Clock::duration>(std::chrono::duration<double>(s));
}

TEST(UrgentBudget, IsSpentAndComesBackSlowly) {
  UrgentBudget budget;
  const auto now = UrgentBudget::Clock::now() + seconds(1);
  EXPECT_TRUE(budget.is_left(now));
  budget.spend(seconds(UrgentBudget::kBurst_s - 0.01), now);
  EXPECT_TRUE(budget.is_left(now));
  budget.spend(seconds(0.02), now);
  EXPECT_FALSE(budget.is_left(now));
  EXPECT_TRUE(budget.is_left(now + seconds(0.02 / UrgentBudget::kShare)));
  for (int i = 0; i < 100; ++i) budget.spend(seconds(1), now);
  EXPECT_FALSE(budget.is_left(now + seconds(0.9 * UrgentBudget::kBurst_s / UrgentBudget::kShare)));
  EXPECT_TRUE(budget.is_left(now + seconds(1.1 * UrgentBudget::kBurst_s / UrgentBudget::kShare)));
}

class BusyStream : public testing::StreamWithViewers {
 protected:
  BusyStream() { scene_ = testing::scene_of(testing::quadtree_tiles(3, 80)); }
  jobs::WorkerPool one_{1};
};

TEST_F(BusyStream, AViewerWhoHasHadHisShareTakesTurnsWithOthers) {
  TestViewer restless(scene_, cache_, one_), calm(scene_, cache_, one_);
  restless.stream().subscribe({});
  show(restless, 0);
  restless.complete();
  // Until what is coarse for him no longer goes before what is fine for others, and for a while after that: he has been given
  // what encoding took, whatever else the machine had to do.
  UrgentBudget given;
  const auto begin = UrgentBudget::Clock::now();
  const auto will_be_left = [&given] { return UrgentBudget(given).is_left(UrgentBudget::Clock::now() + seconds(1.5)); };
  double counted_s = 0;
  for (int i = 0; will_be_left(); ++i) {
    ASSERT_LT(UrgentBudget::Clock::now() - begin, seconds(60));
    show(restless, 0.2 + (i % 10000) / 20000.0);
    testing::wait_until_idle(one_);
    const EncodingTimes& times = cache_.times();
    const double spent_s = times.fusing.counts().sum_s + times.colours.counts().sum_s;
    given.spend(seconds(spent_s - std::exchange(counted_s, spent_s)), UrgentBudget::Clock::now());
  }
  const auto misses_before = cache_.miss_count();
  const std::size_t tile_count = scene_->tiles().size();
  testing::HeldWorkers held(one_);
  show(restless, 0.9);
  calm.stream().subscribe({});
  show(calm, 0.1);
  // Runs behind everything that goes by its level.
  std::promise<std::uint64_t> misses_of_levels;
  one_.post([&] { misses_of_levels.set_value(cache_.miss_count()); }, 40);
  held.release();
  // Geometries are there already. What he asked for first, coarse tiles of it at that, has not begun.
  EXPECT_EQ(misses_of_levels.get_future().get() - misses_before, tile_count);
  calm.complete();
  EXPECT_EQ(restless.complete().generation, restless.last_generation());
}

}  // namespace
}  // namespace spectra::stream
