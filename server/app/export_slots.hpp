#pragma once

#include <atomic>
#include <memory>

namespace spectra::server {

/// How many whole meshes may be written into memory, or wait there to be sent, at a time. Thread-safe.
class ExportSlots {
 public:
  /// Taken as long as somebody holds it.
  using Slot = std::shared_ptr<const void>;

  static constexpr int kMost = 2;

  /// Null when all are taken.
  Slot take() {
    if (count_->fetch_add(1) < kMost) {
      return Slot(this, [count = count_](const void*) { *count -= 1; });
    }
    *count_ -= 1;
    return nullptr;
  }

 private:
  std::shared_ptr<std::atomic<int>> count_ = std::make_shared<std::atomic<int>>(0);
};

}  // namespace spectra::server
