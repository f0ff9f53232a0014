#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>

namespace spectra::stream {

/// How long something took, how often: counts for rising bounds. Thread-safe.
class DurationHistogram {
 public:
  static constexpr std::array kBounds_s{0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0};

  struct Counts {
    std::array<std::uint64_t, kBounds_s.size() + 1>
        counts{};  ///< Up to each bound, and beyond the last; not cumulative.
    double sum_s = 0;
  };

  void add(double seconds) {
    std::size_t bound = 0;
    while (bound < kBounds_s.size() && seconds > kBounds_s[bound]) ++bound;
    ++counts_[bound];
    sum_ns_ += static_cast<std::uint64_t>(1e9 * seconds);
  }

  Counts counts() const {
    Counts all;
    for (std::size_t i = 0; i < counts_.size(); ++i) all.counts[i] = counts_[i];
    all.sum_s = 1e-9 * static_cast<double>(sum_ns_);
    return all;
  }

 private:
  std::array<std::atomic<std::uint64_t>, kBounds_s.size() + 1> counts_{};
  std::atomic<std::uint64_t> sum_ns_{0};
};

/// Adds its own life to a histogram.
class TimedWork {
 public:
  explicit TimedWork(DurationHistogram& histogram) : histogram_(histogram), begin_(std::chrono::steady_clock::now()) {}
  ~TimedWork() { histogram_.add(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count()); }
  TimedWork(const TimedWork&) = delete;
  TimedWork& operator=(const TimedWork&) = delete;

 private:
  DurationHistogram& histogram_;
  const std::chrono::steady_clock::time_point begin_;
};

/// What making frames takes, a tile each.
struct EncodingTimes {
  DurationHistogram geometry;  ///< Rounding and encoding.
  DurationHistogram fusing;
  DurationHistogram colours;  ///< Encoding what was fused.
  DurationHistogram raw_layer;
};

}  // namespace spectra::stream
