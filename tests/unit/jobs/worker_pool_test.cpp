#include "server/jobs/worker_pool.hpp"

#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <atomic>
#include <future>
#include <memory>
#include <mutex>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace spectra::jobs {
namespace {

TEST(WorkerPool, RunsPostedJobs) {
  WorkerPool pool(2);
  std::promise<int> answer;
  pool.post([&] { answer.set_value(42); });
  EXPECT_EQ(answer.get_future().get(), 42);
}

TEST(WorkerPool, HasAtLeastOneThread) {
  WorkerPool pool(0);
  EXPECT_EQ(pool.thread_count(), 1u);
}

TEST(WorkerPool, StartsLowerPriorityNumbersFirstAndEqualsInOrder) {
  WorkerPool pool(1);
  std::promise<void> gate;
  std::promise<void> last;
  std::vector<int> order;
  pool.post([opened = gate.get_future().share()] { opened.wait(); });
  for (const int id : {10, 11}) pool.post([&order, id] { order.push_back(id); }, 5);
  for (const int id : {0, 1}) pool.post([&order, id] { order.push_back(id); }, -5);
  pool.post([&] { last.set_value(); }, 9);
  gate.set_value();
  last.get_future().wait();
  EXPECT_EQ(order, (std::vector<int>{0, 1, 10, 11}));
}

/// What is logged while it lives.
class CapturedLog {
 public:
  CapturedLog() { spdlog::set_default_logger(std::make_shared<spdlog::logger>("captured", sink_)); }
  ~CapturedLog() { spdlog::set_default_logger(before_); }
  CapturedLog(const CapturedLog&) = delete;
  CapturedLog& operator=(const CapturedLog&) = delete;

  std::string text() const { return text_.str(); }

 private:
  std::ostringstream text_;
  std::shared_ptr<spdlog::logger> before_ = spdlog::default_logger();
  spdlog::sink_ptr sink_ = std::make_shared<spdlog::sinks::ostream_sink_mt>(text_, true);
};

TEST(WorkerPool, SurvivesJobsThatThrowAndLogsThem) {
  const CapturedLog log;
  std::promise<std::thread::id> before, after;
  {
    WorkerPool pool(1);
    pool.post([&] { before.set_value(std::this_thread::get_id()); });
    pool.post([] { throw std::runtime_error("expected by a test"); });
    pool.post([] { throw 42; });
    pool.post([&] { after.set_value(std::this_thread::get_id()); });
    EXPECT_EQ(after.get_future().get(), before.get_future().get()) << "the worker itself lives on";
  }
  EXPECT_NE(log.text().find("a worker's job failed: expected by a test"), std::string::npos) << log.text();
  EXPECT_NE(log.text().find("a worker's job failed with something"), std::string::npos) << log.text();
}

TEST(WorkerPool, ForEachRunsEveryIndexOnce) {
  WorkerPool pool(3);
  std::vector<std::atomic<int>> runs(1000);
  pool.for_each(runs.size(), [&](std::size_t i) { ++runs[i]; });
  for (const auto& count : runs) EXPECT_EQ(count, 1);
  pool.for_each(0, [](std::size_t) { FAIL(); });
}

TEST(WorkerPool, ForEachNeedsNoFreeWorker) {
  WorkerPool pool(1);
  std::promise<void> gate;
  pool.post([opened = gate.get_future().share()] { opened.wait(); });
  int sum = 0;
  pool.for_each(10, [&](std::size_t i) { sum += static_cast<int>(i); });
  EXPECT_EQ(sum, 45);
  gate.set_value();
}

TEST(WorkerPool, ForEachFromSeveralThreads) {
  WorkerPool pool(2);
  std::vector<std::future<std::size_t>> sums;
  for (int caller = 0; caller < 4; ++caller) {
    sums.push_back(std::async(std::launch::async, [&pool] {
      std::atomic<std::size_t> sum{0};
      for (int round = 0; round < 50; ++round) pool.for_each(20, [&](std::size_t i) { sum += i; });
      return sum.load();
    }));
  }
  for (auto& sum : sums) EXPECT_EQ(sum.get(), 50u * 190u);
}

TEST(WorkerPool, ForEachRethrows) {
  WorkerPool pool(2);
  EXPECT_THROW(pool.for_each(100,
                             [](std::size_t i) {
                               if (i == 37) throw std::runtime_error("expected by a test");
                             }),
               std::runtime_error);
}

TEST(WorkerPool, LongForEachLetsOtherJobsIn) {
  WorkerPool pool(1);
  const auto caller = std::this_thread::get_id();
  std::atomic<bool> is_posted{false};
  std::atomic<int> worker_runs{0};
  std::atomic<int> seen{-1};
  // The caller is held at its first index, so that the only worker has to run all others.
  pool.for_each(100, [&](std::size_t) {
    if (std::this_thread::get_id() == caller) {
      if (is_posted) return;
      pool.post([&] { seen = worker_runs.load(); });
      is_posted = true;
      while (seen < 0) std::this_thread::yield();
    } else {
      while (!is_posted) std::this_thread::yield();
      ++worker_runs;
    }
  });
  EXPECT_LT(seen, 99);
}

TEST(WorkerPool, DoesNothingMoreAfterItsStop) {
  WorkerPool pool(2);
  std::atomic<int> count{0};
  pool.for_each(10, [&](std::size_t) { ++count; });
  pool.stop();
  pool.post([&] { ++count; });
  pool.stop();
  EXPECT_EQ(count, 10);
  pool.for_each(3, [&](std::size_t) { ++count; });
  EXPECT_EQ(count, 13) << "a loop runs on the thread that asks for it";
}

TEST(WorkerPool, DropsWaitingJobsWhenDestroyed) {
  const auto token = std::make_shared<int>(1);
  std::atomic<bool> has_run{false};
  std::promise<void> started;
  std::promise<void> gate;
  std::future<void> opening;
  {
    WorkerPool pool(1);
    pool.post([&started, opened = gate.get_future().share()] {
      started.set_value();
      opened.wait();
    });
    pool.post([token, &has_run] { has_run = true; });
    started.get_future().wait();
    // The running job ends only after the destructor has emptied the queue: then `token` is the only owner left.
    opening = std::async(std::launch::async, [&] {
      while (token.use_count() > 1) std::this_thread::yield();
      gate.set_value();
    });
  }
  opening.wait();
  EXPECT_FALSE(has_run);
}

}  // namespace
}  // namespace spectra::jobs
