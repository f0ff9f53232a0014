#pragma once

#include <atomic>
#include <csignal>
#include <thread>

namespace spectra::app {

/// While it lives, SIGINT, SIGTERM and SIGHUP end the process as they do by default (a shell sees 130, 143, 129), but
/// files that are not finished are removed first; the ones that the process was started to ignore stay ignored. Make
/// it before any other thread, so that all of them leave the signals to it.
class Interruption {
 public:
  Interruption();
  ~Interruption();
  Interruption(const Interruption&) = delete;
  Interruption& operator=(const Interruption&) = delete;

 private:
  void wait();

  sigset_t signals_{};
  sigset_t mask_before_{};
  std::atomic<bool> is_over_{false};
  std::thread thread_;
};

}  // namespace spectra::app
