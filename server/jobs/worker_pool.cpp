#include "server/jobs/worker_pool.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <map>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace spectra::jobs {

struct WorkerPool::State {
  std::mutex mutex;
  std::condition_variable wake;
  std::map<int, std::deque<std::function<void()>>> waiting;  // by priority, never holds an empty queue
  bool closing = false;
  std::vector<std::thread> threads;

  void post(std::function<void()> job, int priority) {
    {
      const std::lock_guard lock(mutex);
      if (closing) return;
      waiting[priority].push_back(std::move(job));
    }
    wake.notify_one();
  }

  void work() {
    std::unique_lock lock(mutex);
    for (;;) {
      wake.wait(lock, [this] { return closing || !waiting.empty(); });
      if (closing) return;
      const auto first = waiting.begin();
      std::function<void()> job = std::move(first->second.front());
      first->second.pop_front();
      if (first->second.empty()) waiting.erase(first);
      lock.unlock();
      try {
        job();
      } catch (const std::exception& error) {
        spdlog::error("a worker's job failed: {}", error.what());
      } catch (...) {
        spdlog::error("a worker's job failed with something that is no exception object");
      }
      job = nullptr;  // what it holds is released without the lock
      // Those who wait for what the job has made, often an I/O thread, go before the next job: a scheduler with time slices would
      // let a busy worker keep the processor for milliseconds.
      std::this_thread::yield();
      lock.lock();
    }
  }
};

namespace {

/// One call of for_each, shared with the workers that help it. They may look at it after the call has returned, but touch
/// `job` only while they hold an index below `count`, and the call does not return before all those are done.
struct Loop {
  const std::function<void(std::size_t)>* job = nullptr;
  std::size_t count = 0;
  std::atomic<std::size_t> next{0};
  std::atomic<bool> failed{false};
  std::mutex mutex;
  std::condition_variable all_done;
  std::size_t done_count = 0;
  std::exception_ptr error;

  /// Runs one index; false when none is left.
  bool step() {
    const std::size_t index = next.fetch_add(1);
    if (index >= count) return false;
    std::exception_ptr thrown;
    if (!failed) {
      try {
        (*job)(index);
      } catch (...) {
        thrown = std::current_exception();
        failed = true;
      }
    }
    const std::lock_guard lock(mutex);
    if (thrown && !error) error = thrown;
    if (++done_count == count) all_done.notify_all();
    return true;
  }
};

}  // namespace

WorkerPool::WorkerPool(unsigned thread_count) : state_(std::make_unique<State>()) {
  thread_count = std::max(1u, thread_count);
  state_->threads.reserve(thread_count);
  for (unsigned i = 0; i < thread_count; ++i) state_->threads.emplace_back([state = state_.get()] { state->work(); });
}

WorkerPool::~WorkerPool() {
  stop();
}

void WorkerPool::stop() {
  std::map<int, std::deque<std::function<void()>>> dropped;
  {
    const std::lock_guard lock(state_->mutex);
    state_->closing = true;
    dropped.swap(state_->waiting);
  }
  dropped.clear();
  state_->wake.notify_all();
  for (std::thread& thread : state_->threads) {
    if (thread.joinable()) thread.join();
  }
}

void WorkerPool::post(std::function<void()> job, int priority) {
  state_->post(std::move(job), priority);
}

void WorkerPool::for_each(std::size_t count, const std::function<void(std::size_t)>& job) {
  if (count == 0) return;
  const auto loop = std::make_shared<Loop>();
  loop->job = &job;
  loop->count = count;
  // A helper goes back to the end of the queue after each index, so that a long loop does not hold up other jobs.
  struct Helper {
    std::shared_ptr<Loop> loop;
    State* state;
    void operator()() const {
      if (loop->step() && loop->next.load() < loop->count) state->post(*this, 0);
    }
  };
  const std::size_t helper_count = std::min<std::size_t>(thread_count(), count - 1);
  for (std::size_t i = 0; i < helper_count; ++i) state_->post(Helper{loop, state_.get()}, 0);
  while (loop->step()) {
  }
  std::unique_lock lock(loop->mutex);
  loop->all_done.wait(lock, [&] { return loop->done_count == loop->count; });
  if (loop->error) std::rethrow_exception(loop->error);
}

unsigned WorkerPool::thread_count() const {
  return static_cast<unsigned>(state_->threads.size());
}

}  // namespace spectra::jobs
