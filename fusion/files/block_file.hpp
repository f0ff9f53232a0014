#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "fusion/base/error.hpp"
#include "fusion/files/gzip_file.hpp"

namespace spectra::files {

/// Reads a regular file from front to back through one buffer of fixed size. A file that shrinks meanwhile only ends
/// early (a mapped one would end the process). A gzip file is read as what it unpacks to.
class BlockFile {
 public:
  /// The most that ready() can be asked for.
  static constexpr std::size_t kBufferBytes = std::size_t{512} * 1024;

  /// FileNotFound, or FileUnreadable (also for what is not a regular file: its size would not bound anything), or the errors
  /// of GzipFile::open().
  static base::Result<BlockFile> open(const std::filesystem::path& path);
  ~BlockFile();
  BlockFile(BlockFile&& other) noexcept;
  BlockFile& operator=(BlockFile&& other) noexcept;

  /// As it was when the file was opened; unpacked.
  std::uint64_t size_bytes() const { return size_bytes_; }
  /// What follows the end of gzip data in the file, and is not read.
  std::uint64_t packed_trailing_bytes() const { return gzip_ ? gzip_->trailing_bytes() : 0; }
  /// Of the next byte that was not consumed.
  std::uint64_t position() const { return buffer_position_ + begin_; }
  std::uint64_t remaining() const { return size_bytes_ > position() ? size_bytes_ - position() : 0; }

  /// The bytes from position() on that are in memory: at least `count` of them, or all there are to the end of the file
  /// (or up to a read error, see read_error()). Valid until the next call.
  std::span<const unsigned char> ready(std::size_t count) {
    if (end_ - begin_ < count) fill();
    return {buffer_.data() + begin_, end_ - begin_};
  }

  /// Moves on within what ready() gave.
  void consume(std::size_t count) { begin_ += count; }
  /// Moves on by any number of bytes, without reading them.
  void skip(std::uint64_t count);
  void seek(std::uint64_t position);

  using Watcher = std::function<void(double share)>;
  /// `watcher` is told, at every read of a block, the share of the file that lies before its end. Returns the one before.
  Watcher set_watcher(Watcher watcher) { return std::exchange(watcher_, std::move(watcher)); }

  /// errno of the read that failed, or 0.
  int read_error() const { return read_error_; }

 private:
  BlockFile(int descriptor, std::uint64_t size_bytes);
  void fill();
  std::ptrdiff_t read_at(std::uint64_t position, std::span<unsigned char> bytes);

  int descriptor_ = -1;  ///< Not open when the file is gzip's.
  std::optional<GzipFile> gzip_;
  std::uint64_t size_bytes_ = 0;
  std::uint64_t buffer_position_ = 0;  ///< Where in the file the buffer begins.
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  int read_error_ = 0;
  std::vector<unsigned char> buffer_;
  Watcher watcher_;
};

}  // namespace spectra::files
