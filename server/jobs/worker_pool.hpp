#pragma once

#include <functional>
#include <memory>

namespace spectra::jobs {

/// Threads for everything that costs time: fusing, encoding, tiling. I/O threads never compute; jobs never block on I/O.
/// Of two waiting jobs the one with the lower `priority` number starts first, equals in order of arrival.
class WorkerPool {
 public:
  explicit WorkerPool(unsigned thread_count);
  ~WorkerPool();  ///< As stop().
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  /// From any thread. An exception that leaves a job is logged and swallowed at the top of the worker.
  void post(std::function<void()> job, int priority = 0);

  /// Lets running jobs end, drops waiting ones and those that are posted later. Not from a job.
  void stop();

  /// Runs job(0) .. job(count - 1) on the pool and the calling thread; returns when all are done. Must not be called
  /// from inside a job. An exception of a job is rethrown here.
  void for_each(std::size_t count, const std::function<void(std::size_t)>& job);

  unsigned thread_count() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace spectra::jobs
