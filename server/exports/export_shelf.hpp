#pragma once

#include <atomic>
#include <cstddef>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

namespace spectra::exports {

/// Whole files on their way out: how many may be made at a time, and what those take that are being sent. A file that is being sent
/// to somebody is not made again for others. Thread-safe; what is handed out may outlive it.
class ExportShelf {
 public:
  /// Taken as long as somebody holds it: while a file is made.
  using Slot = std::shared_ptr<const void>;
  struct File {
    std::string bytes;
    std::string losses;  ///< On one line; empty for none.
  };
  using SharedFile = std::shared_ptr<const File>;

  /// How many may be made at a time, and how many bytes being sent beyond which no further one is made.
  ExportShelf(std::size_t most, std::size_t most_bytes) : most_(most), most_bytes_(most_bytes) {}

  std::size_t most() const { return most_; }

  /// Null when all are taken, or too much is being sent.
  Slot take() {
    if (counts_->making.fetch_add(1) < most_ && counts_->bytes < most_bytes_) {
      return {this, [counts = counts_](const void*) { counts->making -= 1; }};
    }
    counts_->making -= 1;
    return nullptr;
  }

  /// The file of a key (what was asked for, of which version of the scene), if it is being sent; else null.
  SharedFile find(const std::string& key) {
    const std::lock_guard lock(mutex_);
    const auto found = files_.find(key);
    return found == files_.end() ? nullptr : found->second.lock();
  }

  /// A file that was made; without a key it is not shared.
  SharedFile keep(const std::string& key, File file) {
    counts_->bytes += file.bytes.size();
    const SharedFile kept(new File(std::move(file)), [counts = counts_](const File* gone) {
      counts->bytes -= gone->bytes.size();
      delete gone;
    });
    const std::lock_guard lock(mutex_);
    std::erase_if(files_, [](const auto& entry) { return entry.second.expired(); });
    if (!key.empty()) files_[key] = kept;
    return kept;
  }

 private:
  struct Counts {
    std::atomic<std::size_t> making{0};
    std::atomic<std::size_t> bytes{0};
  };
  const std::size_t most_;
  const std::size_t most_bytes_;
  const std::shared_ptr<Counts> counts_ = std::make_shared<Counts>();
  std::mutex mutex_;
  std::map<std::string, std::weak_ptr<const File>> files_;
};

}  // namespace spectra::exports
