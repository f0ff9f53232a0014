#include "server/app/interruption.hpp"

#include <pthread.h>
#include <unistd.h>

#include "fusion/files/output_file.hpp"
#include "server/app/progress_line.hpp"

namespace spectra::app {
namespace {

/// Wakes the waiting thread when there is nothing left to wait for. From anybody else it means nothing, as by default.
constexpr int kWakeUp = SIGURG;

/// Ends the process so that its parent sees which signal it was: a shell then ends its loop too.
[[noreturn]] void end_by(int signal) {
  std::signal(signal, SIG_DFL);
  sigset_t only;
  sigemptyset(&only);
  sigaddset(&only, signal);
  pthread_sigmask(SIG_UNBLOCK, &only, nullptr);
  std::raise(signal);
  ::_exit(128 + signal);
}

}  // namespace

Interruption::Interruption() {
  sigemptyset(&signals_);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction action {};
    if (::sigaction(signal, nullptr, &action) == 0 && action.sa_handler != SIG_IGN) sigaddset(&signals_, signal);
  }
  sigaddset(&signals_, kWakeUp);
  pthread_sigmask(SIG_BLOCK, &signals_, &mask_before_);
  thread_ = std::thread([this] { wait(); });
}

Interruption::~Interruption() {
  is_over_ = true;
  pthread_kill(thread_.native_handle(), kWakeUp);
  thread_.join();
  pthread_sigmask(SIG_SETMASK, &mask_before_, nullptr);
}

void Interruption::wait() {
  int signal = 0;
  while (!is_over_) {
    if (sigwait(&signals_, &signal) != 0 || signal == kWakeUp) continue;
    files::OutputFile::abandon_all();
    ProgressLine::make_way(true);
    end_by(signal);
  }
}

}  // namespace spectra::app
